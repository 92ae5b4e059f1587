//! Remote control shared by `stream` and `preview`: names, presets, and errors as answers.

use std::path::{Path, PathBuf};

use crate::error::CliError;
use crate::settings::file::SettingsFile;
use crate::settings::unused::{self, FrameOrigin, RunFacts};
use bokehcam::look::{Patch, presets};
use bokehcam_live::control::{self, Answer, Claim, ControlError, Name};
use bokehcam_live::controller::CommandLine;

/// Claims a name for a run. Without a folder for sockets the run continues, and the inner error is the line to log
/// later.
///
/// # Errors
/// Fails if the name is taken.
pub fn claim_name(name: Option<&Name>, command: &'static str) -> Result<Result<Claim, String>, CliError> {
    match control::claim_name(name, command) {
        Ok(claim) => Ok(Ok(claim)),
        Err(ControlError::NoFolder(why)) => Ok(Err(format!("`bokehcam ctl` cannot reach this {command}: {why}"))),
        Err(error) => Err(CliError::Usage(error.to_string())),
    }
}

/// Converts an error to an answer.
pub fn to_answer(error: &CliError) -> Answer {
    match error {
        CliError::Exists(path) => Answer::failed(format!("{} exists: choose another name", path.display())),
        error if error.is_wrong_argument() => Answer::invalid_request(error.to_string()),
        error => Answer::failed(error.to_string()),
    }
}

/// Returns what the command line adds to the rules of looks: the presets of the settings file chosen by `config`, if any,
/// and settings without effect in this `run`.
pub fn command_line(config: Option<PathBuf>, run: RunFacts) -> CommandLine {
    CommandLine {
        load_preset: Box::new(move |name| load_preset(config.as_deref(), name).map_err(|error| to_answer(&error))),
        describe_unused: Box::new(move |patch, changed| {
            let (kind, depth) = changed.source?;
            unused::describe_unused(&patch.values(), &run.for_look(FrameOrigin::Source(kind), depth, &changed.look))
        }),
    }
}

/// Returns the patch of a preset, built in or from the current settings file, which is read only for one of its own.
fn load_preset(config: Option<&Path>, name: &str) -> Result<Patch, CliError> {
    let is_built_in = presets::built_in_presets().any(|preset| preset.name == name);
    let file = if is_built_in { SettingsFile::default() } else { SettingsFile::load(config)? };
    let values = file.preset(name).ok_or_else(|| CliError::Usage(file.unknown_preset(name)))?;
    let patch = Patch::parse(values.iter().map(|(name, value)| (name.as_str(), value.as_str())));
    let mut patch = patch.map_err(|(name, what)| CliError::Usage(format!("{name}: {what}")))?;
    patch.load_pictures()?;
    Ok(patch)
}
