//! Entry points for the fuzz targets: parse what users write, without running a command.

use std::ffi::OsString;
use std::path::Path;

use super::CliError;
use super::commands::{Command, ConfigCommand};
use super::log::{escape_controls, one_line};
use super::parse::{ParseError, parse};
use super::settings::arguments::join_negative_numbers;
use super::settings::dump;
use super::settings::file::SettingsFile;

/// Parses a command line. Returns the output of `config dump`, and an empty text for other commands.
///
/// # Errors
/// Returns the message for a command line that cannot be parsed.
pub fn parse_arguments(args: &[OsString]) -> Result<String, String> {
    let parsed = parse(&join_negative_numbers(args.iter().cloned())).map_err(|refusal| {
        let message = match refusal {
            ParseError::Arguments(error) => one_line(&error),
            ParseError::Settings(error) => error.to_string(),
        };
        escape_controls(&message, &[]).into_owned()
    })?;
    Ok(match parsed.cli.command {
        Command::Config(ConfigCommand::Dump { .. }) => {
            dump::to_toml(&parsed.layers.resolve_settings(&parsed.matches), &parsed.file.presets)
        }
        _ => String::new(),
    })
}

/// Parses the text of a settings file, and looks up each preset in it.
///
/// # Errors
/// Fails if the text is not a settings file.
pub fn parse_settings(path: &Path, text: &str) -> Result<(), CliError> {
    let file = SettingsFile::parse(path, text)?;
    for name in file.presets.keys() {
        assert!(file.preset(name).is_some(), "the preset {name:?} is there and is not found");
    }
    Ok(())
}

pub use bokehcam_live::source::registration::parse_calibration as depth_calibration;
