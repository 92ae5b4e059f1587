//! Parsing of arguments to a command with its settings.

use std::ffi::OsString;
use std::path::Path;

use clap::{ArgMatches, CommandFactory, FromArgMatches};

use super::commands::{Cli, reads_settings};
use super::error::CliError;
use super::help;
use super::settings::file::SettingsFile;
use super::settings::layers::Layers;
use super::settings::{save, table};

/// Error of parsing, by its origin.
pub enum ParseError {
    Arguments(clap::Error),
    Settings(CliError),
}

impl From<clap::Error> for ParseError {
    fn from(error: clap::Error) -> Self {
        ParseError::Arguments(error)
    }
}

/// A parsed command line, and the settings from other layers.
pub struct Parsed {
    pub cli: Cli,
    pub matches: ArgMatches,
    pub file: SettingsFile,
    pub layers: Layers,
}

/// Parses arguments together with the environment, preset, snapshot and settings file that apply.
pub fn parse(args: &[OsString]) -> Result<Parsed, ParseError> {
    let command = table::with_environment(Cli::command())
        .mut_arg("config", |arg| table::with_variable(arg, table::environment_variable("config")));
    let command = help::full_help(command);
    let wants_all = args.iter().take_while(|arg| *arg != "--").any(|arg| arg == help::ALL);
    let command = if wants_all { command } else { help::short_help(command) };
    // The first pass finds the settings file and the preset; the second one uses their values as defaults.
    let given = command.clone().try_get_matches_from(args)?;
    if !reads_settings(&given) {
        let cli = Cli::from_arg_matches(&given)?;
        return Ok(Parsed { cli, matches: given, file: SettingsFile::default(), layers: Layers::default() });
    }
    let chosen = Cli::from_arg_matches(&given)?.global.config;
    let file = load_settings(&given, chosen.as_deref()).map_err(ParseError::Settings)?;
    let layers = Layers::resolve(&file, &given).map_err(ParseError::Settings)?;
    let matches = layers.apply_defaults(command).try_get_matches_from(args)?;
    Ok(Parsed { cli: Cli::from_arg_matches(&matches)?, matches, file, layers })
}

/// Loads the settings file, unless `config dump` is printed into it.
fn load_settings(given: &ArgMatches, chosen: Option<&Path>) -> Result<SettingsFile, CliError> {
    if given.subcommand_matches("config").is_some() {
        save::refuse_redirect(chosen)?;
    }
    SettingsFile::load(chosen)
}
