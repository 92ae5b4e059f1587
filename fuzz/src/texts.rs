//! Targets for settings files and command lines.

use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;

use bokehcam_cli::parsers;

use super::input::assert_one_line;

/// Parses a settings file.
pub fn settings(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Err(error) = parsers::parse_settings("config.toml".as_ref(), text) {
        assert_one_line(error);
    }
}

/// Maximum number of arguments per command line.
const MAX_ARGUMENTS: usize = 12;

/// Parses arguments of `config dump`, one per line. The output must be a valid settings file.
pub fn command_line(data: &[u8]) {
    let given = data.split(|byte| *byte == b'\n').take(MAX_ARGUMENTS);
    let given = given.map(|argument| OsString::from_vec(argument.iter().copied().filter(|byte| *byte != 0).collect()));
    let all: Vec<OsString> = ["bokehcam", "config", "dump"].map(OsString::from).into_iter().chain(given).collect();
    match parsers::parse_arguments(&all) {
        Ok(dump) => {
            if let Err(error) = parsers::parse_settings("dump.toml".as_ref(), &dump) {
                panic!("what is dumped is no settings file: {error}");
            }
        }
        // Help and version are reported like errors, but have several lines.
        Err(_)
            if all.iter().any(|argument| ["-h", "--help", "-V", "--version", "help"].iter().any(|h| argument == h)) => {
        }
        Err(message) => assert_one_line(message),
    }
}
