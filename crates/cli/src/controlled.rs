//! Remote control shared by `stream` and `preview`: names, rules, and errors as answers.

use std::path::PathBuf;

use crate::error::CliError;
use crate::settings::{changes, unused};
use bokehcam::control::{self, Answer, Claim, ControlError, Name};
use bokehcam::controller::{Rules, SourceFacts};
use bokehcam::depth::backdrop::Background;
use bokehcam::look::{Look, Patch, SourceDepth, Strength};
use bokehcam::source::{self, DepthOrigin};

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

/// Applies requests by the rules of the command line.
pub struct CommandLineRules {
    /// The settings file chosen by `--config`, if any.
    pub config: Option<PathBuf>,
    /// Facts for warnings about settings without effect, except those that follow from source and look.
    pub unused: unused::RunFacts,
}

impl Rules for CommandLineRules {
    fn parse_settings(&self, settings: &[String]) -> Result<Patch, Answer> {
        changes::parse_patch(settings).map_err(|error| to_answer(&error))
    }

    fn load_preset(&self, name: &str) -> Result<Patch, Answer> {
        changes::load_preset(self.config.as_deref(), name).map_err(|error| to_answer(&error))
    }

    fn apply_patch(&self, patch: &Patch, look: &Look, facts: &SourceFacts) -> Result<(Look, Option<String>), Answer> {
        apply_checked_patch(patch, look, facts, self.unused).map_err(|error| to_answer(&error))
    }
}

/// Returns the look of a run after a change, and a note on the parts of the change without effect.
///
/// # Errors
/// Fails if the run cannot have this look.
fn apply_checked_patch(
    patch: &Patch,
    look: &Look,
    facts: &SourceFacts,
    command: unused::RunFacts,
) -> Result<(Look, Option<String>), CliError> {
    if let Some(effect) = patch.effect.filter(|effect| effect.follows_depth() && !facts.has_depth) {
        return Err(CliError::Usage(format!(
            "--effect {effect} needs depth, and this run has none: use --effect blur or tilt-shift"
        )));
    }
    let was_transparent = look.background == Background::Transparent;
    let look = patch.apply_to(look)?;
    if look.background == Background::Transparent && !was_transparent {
        return Err(CliError::Usage(
            "--behind transparent cannot be set while it runs, as outputs are opened for it: start a `stream` with it"
                .to_owned(),
        ));
    }
    match facts.depth_from {
        _ if !(facts.has_depth && look.effect.follows_depth()) => {}
        DepthOrigin::Networks | DepthOrigin::Plate => source::reject_metric_look(&look, "one camera gives")?,
        DepthOrigin::Relative => source::reject_metric_look(&look, source::INVERSE_DEPTH_GIVES)?,
        _ => {}
    }
    let (has_depth, is_relative) = (facts.has_depth, facts.depth_from.is_relative());
    let known = SourceDepth { has_depth, is_relative, size: facts.size };
    let look = source::adapt_look(&look, &facts.depth_choice, known)?;
    let uses_depth = look.effect.follows_depth();
    let run = unused::RunFacts {
        source: unused::FrameOrigin::Source(facts.kind),
        depth: if facts.has_depth { facts.depth_from } else { DepthOrigin::Nothing },
        uses_depth,
        effect: look.effect,
        lens: matches!(look.strength, Strength::Lens(_)),
        ..command
    };
    let note = unused::describe_unused(&patch.values(), &run);
    look.blur_settings(facts.size, command.realtime).map_or(Ok(()), |settings| settings.check(facts.size))?;
    Ok((look, note))
}
