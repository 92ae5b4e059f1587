//! The command line: parses arguments and settings; one module per command.

#![allow(missing_docs)]
// What only a feature needs is no reason for attributes of its own.
#![cfg_attr(not(feature = "packaged"), allow(dead_code, unused_imports, unused_variables))]

mod browsers;
mod commands;
mod controlled;
mod error;
mod files;
mod focus;
mod help;
mod log;
mod options;
mod parse;
#[doc(hidden)]
pub mod parsers;
mod report;
mod screen;
mod settings;
mod sinks;
mod terminal;

use std::ffi::OsString;
use std::process::ExitCode;

pub use error::CliError;
use parse::{ParseError, Parsed};
use settings::file::SettingsFile;
use settings::layers::Layers;
use settings::{arguments, environment};

/// Runs the program. An error becomes one line on stderr and an exit code: 1 for failures, 2 for wrong arguments.
pub fn run(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args = arguments::join_negative_numbers(args);
    #[cfg(feature = "lab")]
    bokehcam_lab::synthetic::register();
    bokehcam_live::source::register_look_files();
    log::install_panic_hook();
    log::set_format(arguments::log_format(&args));
    finish(|| run_command(&args))
}

/// Runs a command, and waits until all is printed, also after a panic.
fn finish(command: impl FnOnce() -> ExitCode) -> ExitCode {
    let code = CliError::catch_panic(|| Ok(command())).unwrap_or_else(|error| {
        log::error(&error.to_string());
        error.exit_code()
    });
    log::flush();
    code
}

/// Parses the arguments and runs the command; log lines may still be queued afterwards.
fn run_command(args: &[OsString]) -> ExitCode {
    let fail = |error: &CliError, from: Option<(&SettingsFile, &Layers)>| {
        log::error(&environment::append_origins(&error.to_string(), args, error.is_wrong_argument(), from));
        error.exit_code()
    };
    let Parsed { cli, matches, file, layers } = match parse::parse(args) {
        Ok(parsed) => parsed,
        Err(ParseError::Settings(error)) => return fail(&error, None),
        Err(ParseError::Arguments(error)) => return arguments::refuse(&error, args),
    };
    log::start(&cli.global);
    if commands::reads_settings(&matches) {
        environment::warn_of_unknown();
    }
    match commands::run(cli, &matches, &file, &layers) {
        Ok(()) => ExitCode::SUCCESS,
        // The reader of our output closed it: no failure.
        Err(error) if error.is_broken_pipe() => ExitCode::SUCCESS,
        Err(error) => fail(&error, Some((&file, &layers))),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    /// Panics in a child process, the test program itself: only there is nothing printed after `finish`.
    #[test]
    fn a_panic_of_the_main_thread_is_printed() {
        const IS_CHILD: &str = "TEST_OF_A_PANIC";
        if std::env::var_os(IS_CHILD).is_some() {
            log::install_panic_hook();
            finish(|| panic!("of this test"));
            std::process::exit(0);
        }
        let mut child = std::process::Command::new(std::env::current_exe().unwrap());
        child.args(["--exact", "tests::a_panic_of_the_main_thread_is_printed", "--nocapture"]).env(IS_CHILD, "");
        let printed = String::from_utf8(child.output().unwrap().stderr).unwrap();
        assert!(printed.contains("lib.rs") && printed.contains("\nof this test\n"), "{printed}");
        assert!(printed.ends_with("error: a fault in bokehcam: of this test; please report this\n"), "{printed}");
    }

    #[test]
    fn the_definition_is_consistent() {
        settings::table::with_environment(commands::Cli::command()).debug_assert();
    }
}
