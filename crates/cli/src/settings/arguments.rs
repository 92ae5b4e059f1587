//! Preprocessing of the command line, and the message if it cannot be parsed.

use std::error::Error as _;
use std::ffi::{OsStr, OsString};
use std::io;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::process::ExitCode;

use clap::error::ErrorKind;

use super::{environment, unknown};
use crate::error::CliError;
use crate::log;
use crate::options::LogFormat;
use bokehcam_live::source::SourceError;

/// Joins a negative number to the option before it: `--focus -1` becomes `--focus=-1` instead of an option `-1`, so
/// that the option can report its accepted values.
pub fn join_negative_numbers(args: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let mut joined: Vec<OsString> = Vec::new();
    // After `--`, no argument is an option.
    let mut are_options = true;
    for arg in args {
        let is_number = matches!(arg.as_bytes(), [b'-', b'0'..=b'9' | b'.', ..]);
        match joined.last_mut() {
            Some(last) if are_options && is_number && is_open_option(last) => {
                last.push("=");
                last.push(arg);
            }
            _ => {
                are_options &= arg != "--";
                joined.push(arg);
            }
        }
    }
    joined
}

/// Whether the argument is `--name` without a value.
fn is_open_option(arg: &OsStr) -> bool {
    let bytes = arg.as_bytes();
    bytes.len() > 2 && bytes.starts_with(b"--") && !bytes.contains(&b'=')
}

/// Returns the log format, as far as it can be read from arguments that may be invalid.
pub fn log_format(args: &[OsString]) -> LogFormat {
    let after = |pair: &[OsString]| pair[0] == "--log-format" && pair[1] == "json";
    match args.iter().any(|arg| arg == "--log-format=json") || args.windows(2).any(after) {
        true => LogFormat::Json,
        false => LogFormat::Text,
    }
}

/// Prints the error of the arguments, or the requested help. If they name a missing device or file, the exit code is 1:
/// the same arguments may be right later.
pub fn refuse(error: &clap::Error, args: &[OsString]) -> ExitCode {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            return match error.print() {
                Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
                    log::error(&CliError::io("standard output".as_ref())(error).to_string());
                    ExitCode::FAILURE
                }
                // A closed standard output is no failure.
                _ => ExitCode::SUCCESS,
            };
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let _ = error.print();
        }
        ErrorKind::InvalidUtf8 => log::error(&non_utf8_message(args)),
        _ => {
            let what = unknown::explain_unknown(error, args).unwrap_or_else(|| log::one_line(error));
            log::error(&environment::append_origins(&what, args, true, None));
        }
    }
    let names_a_source = error.source().and_then(|cause| cause.downcast_ref::<SourceError>());
    if names_a_source.is_some_and(|error| !error.is_wrong_argument()) { ExitCode::FAILURE } else { ExitCode::from(2) }
}

fn non_utf8_message(args: &[OsString]) -> String {
    let escaped = |arg: &OsString| arg.clone().into_vec().escape_ascii().to_string();
    let which = args.iter().find(|arg| arg.to_str().is_none()).map(escaped);
    format!("'{}' is not UTF-8 text: rename it, or give a link to it", which.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(words: &[&str]) -> Vec<OsString> {
        words.iter().map(OsString::from).collect()
    }

    #[test]
    fn numbers_below_zero_belong_to_the_option_before_them() {
        for (given, expected) in [
            (&["--focus", "-1"][..], &["--focus=-1"][..]),
            (&["--focus", "-.5,0.2", "x"], &["--focus=-.5,0.2", "x"]),
            (&["--focus=1", "-1"], &["--focus=1", "-1"]),
            (&["a", "-1", "-v"], &["a", "-1", "-v"]),
            (&["--", "-1"], &["--", "-1"]),
            (&["--out", "--", "--x", "-1"], &["--out", "--", "--x", "-1"]),
        ] {
            assert_eq!(join_negative_numbers(args(given)), args(expected));
        }
    }
}
