//! What `stream` and `preview` have in common for those who control them.

use crate::error::CliError;
use crate::settings::unused;
use bokehcam::control::{self, Answer, Claim, ControlError, Name};
use bokehcam::look::{Look, Patch, Strength};
use bokehcam::source::{self, DepthChoice, DepthFrom};

/// Takes a name for a run. Without a folder for sockets the run goes on, and the inner error is the line that says so,
/// once nothing else is in its way.
///
/// # Errors
/// The name that it was given is taken.
pub fn claim(name: Option<&Name>, command: &'static str) -> Result<Result<Claim, String>, CliError> {
    match control::claim(name, command) {
        Ok(claim) => Ok(Ok(claim)),
        Err(ControlError::NoFolder(why)) => Ok(Err(format!("`bokehcam ctl` cannot reach this {command}: {why}"))),
        Err(error) => Err(CliError::Usage(error.to_string())),
    }
}

/// The answer to what cannot be done.
pub fn refused(error: &CliError) -> Answer {
    match error {
        CliError::Exists(path) => Answer::failed(format!("{} exists: choose another name", path.display())),
        error if error.is_wrong_argument() => Answer::usage(error.to_string()),
        error => Answer::failed(error.to_string()),
    }
}

/// What of a run decides which looks it can have.
pub struct Standing<'a> {
    /// Columns and rows of its pictures.
    pub size: (u32, u32),
    pub depth_choice: &'a DepthChoice,
    /// Whether its frames have depth.
    pub has_depth: bool,
    /// Whether the quality may follow the time there is.
    pub adaptive: bool,
    /// What the warnings about settings to no effect go by, but for what the look itself decides.
    pub unused: unused::Run,
}

/// The look of a run after a change, and what of the change has no effect.
///
/// # Errors
/// The run cannot have such a look.
pub fn changed(patch: &Patch, look: &Look, run: &Standing) -> Result<(Look, Option<String>), CliError> {
    if let Some(effect) = patch.effect.filter(|effect| effect.follows_depth() && !run.has_depth) {
        return Err(CliError::Usage(format!(
            "--effect {effect} follows depth, and this run has none: use --effect blur or tilt-shift"
        )));
    }
    let look = source::fitting_look(&patch.on(look)?, run.depth_choice, run.has_depth)?;
    let uses_depth = look.effect.follows_depth();
    match run.unused.depth {
        DepthFrom::Networks | DepthFrom::Plate if uses_depth => source::refuse_metres(&look, "one camera knows")?,
        DepthFrom::Relative if uses_depth => source::refuse_metres(&look, source::INVERSE_TELLS)?,
        _ => {}
    }
    let lens = matches!(look.strength, Strength::Lens(_));
    let note = unused::note(&patch.values(), &unused::Run { effect: look.effect, uses_depth, lens, ..run.unused });
    look.settings(run.size, run.adaptive).map_or(Ok(()), |settings| settings.check(run.size))?;
    Ok((look, note))
}
