//! `completions`: shell completions, generated from the clap command.

use std::any::TypeId;
use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;
use clap::{Arg, Command, ValueHint};

use crate::log;
use crate::settings::file::SettingsFile;
use bokehcam_live::sink::Target;
use bokehcam_live::source::SourceName;

/// Suggestions for options whose values are more than a list of names.
const VALUES: [(&str, &[&str]); 4] = [
    ("depth", &["auto", "recorded", "stereo", "none", "matte", "mono", "plate", "matte,mono", "defocus"]),
    ("aperture", &["disc", "ring:", "polygon:", "heart", "star:", "image:"]),
    ("behind", &["blur", "color:", "image:"]),
    ("focus", &["auto"]),
];

/// Adds suggested values to the command's options; options that take no file get no file completion.
pub fn add_completions(command: Command, presets: &[String]) -> Command {
    let command = command.mut_args(|arg| {
        let option = arg.get_long().unwrap_or(arg.get_id().as_str()).to_owned();
        let values = VALUES.iter().find(|(name, _)| *name == option).map(|(_, values)| *values);
        match values {
            _ if option == "preset" || option == "look" => {
                arg.value_parser(PossibleValuesParser::new(presets.to_vec()))
            }
            Some(values) => arg.value_parser(PossibleValuesParser::new(values.iter().copied())),
            None if takes_file(&arg) || !arg.get_action().takes_values() => arg,
            None => arg.value_hint(ValueHint::Other),
        }
    });
    command.mut_subcommands(|subcommand| add_completions(subcommand, presets))
}

/// Returns the names of all presets. Those of a settings file with a fault are left out, with a warning.
pub fn preset_names(chosen: Option<&Path>) -> Vec<String> {
    let file = SettingsFile::load(chosen).unwrap_or_else(|fault| {
        log::warn(&format!("{fault}; the presets of this file are left out"));
        SettingsFile::default()
    });
    file.preset_names()
}

/// Whether the option takes a file or folder, or already has suggestions.
fn takes_file(arg: &Arg) -> bool {
    let kind = arg.get_value_parser().type_id();
    let has_names = !arg.get_possible_values().is_empty();
    let files = [TypeId::of::<PathBuf>(), TypeId::of::<Target>(), TypeId::of::<SourceName>()];
    has_names || files.iter().any(|file| kind == *file) || arg.get_id() == "source" || arg.get_id() == "language"
}
