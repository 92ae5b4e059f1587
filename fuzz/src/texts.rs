//! Settings files with presets, and command lines.

use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;

use bokehcam_cli::parsers;

use super::input::assert_one_line;

/// A settings file.
pub fn settings(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Err(error) = parsers::settings("config.toml".as_ref(), text) {
        assert_one_line(error);
    }
}

/// Most arguments of a command line that are tried.
const MOST_ARGUMENTS: usize = 12;

/// Arguments of `config dump`, one a line. What it prints is a settings file.
pub fn command_line(data: &[u8]) {
    let given = data.split(|byte| *byte == b'\n').take(MOST_ARGUMENTS);
    let given = given.map(|argument| OsString::from_vec(argument.iter().copied().filter(|byte| *byte != 0).collect()));
    let all: Vec<OsString> = ["bokehcam", "config", "dump"].map(OsString::from).into_iter().chain(given).collect();
    match parsers::arguments(&all) {
        Ok(dump) => {
            if let Err(error) = parsers::settings("dump.toml".as_ref(), &dump) {
                panic!("what is dumped is no settings file: {error}");
            }
        }
        // Help and version are no refusals.
        Err(_)
            if all.iter().any(|argument| ["-h", "--help", "-V", "--version", "help"].iter().any(|h| argument == h)) => {
        }
        Err(message) => assert_one_line(message),
    }
}
