//! Answers requests to a run of any kind, from any client; [`crate::control`] transports them.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use crate::control::{Answer, Handler, Name, Request, Status};
use crate::sink::ShutterControl;
use crate::source::{DepthOrigin, Kind};
use bokehcam::look::{Change, Look, LookError, Patch};

/// Returns the current settings of a preset.
pub type LoadPreset = dyn Fn(&str) -> Result<Patch, Answer> + Send + Sync;
/// Returns one line on the settings of a change that have no effect in the run.
pub type DescribeUnused = dyn Fn(&Patch, &Changed) -> Option<String> + Send + Sync;

/// What the command line of a run adds to the rules of looks. A refusal is returned as the answer.
pub struct CommandLine {
    /// Finds presets.
    pub load_preset: Box<LoadPreset>,
    /// Judges changes.
    pub describe_unused: Box<DescribeUnused>,
}

/// The result of a change of the look.
pub struct Changed {
    /// The look after it.
    pub look: Look,
    /// What of the change is left out.
    pub note: Option<String>,
    /// The kind of the source and the origin of its depth, while one is open.
    pub source: Option<(Kind, DepthOrigin)>,
}

/// A run that can be controlled, from several threads at once. A refusal is returned as the answer.
#[allow(clippy::missing_errors_doc)]
pub trait ControllableRun: Send + Sync {
    /// Returns the status, except for name, process, command and age.
    fn status(&self) -> Result<Status, Answer>;

    /// Shows pictures, or the still card in their place; `None` toggles. Returns whether pictures are shown now.
    fn switch_pictures(&self, on: Option<bool>) -> Result<bool, Answer>;

    /// Returns the control of the shutter before the outputs, while there are outputs.
    fn shutter(&self) -> Option<ShutterControl>;

    /// Changes the look as far as [`Look::change`] allows.
    fn change_look(&self, change: Change) -> Result<Changed, Answer>;

    /// Switches to another source of depth.
    fn set_depth_source(&self, way: &str) -> Result<(), Answer>;

    /// Saves the next picture in `to`, which must not exist, or in a file named by date; returns the file.
    fn save_snapshot(&self, to: Option<&Path>) -> Result<PathBuf, Answer>;
}

/// Returns the answer to a look that cannot be.
pub fn refuse_look(error: &LookError) -> Answer {
    match error.is_wrong_argument() {
        true => Answer::invalid_request(error.to_string()),
        false => Answer::failed(error.to_string()),
    }
}

/// Answers requests to a run.
pub struct Controller<R> {
    name: Name,
    command: &'static str,
    began: Instant,
    command_line: CommandLine,
    run: R,
}

impl<R: ControllableRun + 'static> Controller<R> {
    /// Creates the handler for a run with this name that starts now.
    pub fn create_handler(name: Name, command: &'static str, command_line: CommandLine, run: R) -> Arc<Handler> {
        let controller = Self { name, command, began: Instant::now(), command_line, run };
        Arc::new(move |request| controller.handle_request(request).unwrap_or_else(|refused| refused))
    }

    fn handle_request(&self, request: Request) -> Result<Answer, Answer> {
        let note = match request {
            Request::Status => None,
            Request::On => self.switch_and_wait(Some(true))?,
            Request::Off => self.switch_and_wait(Some(false))?,
            Request::Toggle => self.switch_and_wait(None)?,
            Request::Preset { name } => self.change_look(Change::to_preset((self.command_line.load_preset)(&name)?))?,
            Request::Set { settings } => {
                let mut patch = Patch::parse_assignments(&settings).map_err(Answer::invalid_request)?;
                patch.load_pictures().map_err(|error| refuse_look(&error))?;
                self.change_look(Change::to_settings(patch))?
            }
            Request::Depth { from } => self.run.set_depth_source(&from).map(|()| None)?,
            Request::Snapshot { to } => return self.handle_snapshot(to.as_deref()),
        };
        Ok(Answer::Done { status: Box::new(self.status()?), note })
    }

    /// Changes the look. Returns one line on what of the change is left out, or has no effect, and on a blur that is too
    /// small for privacy.
    fn change_look(&self, change: Change) -> Result<Option<String>, Answer> {
        let patch = change.patch.clone();
        let changed = self.run.change_look(change)?;
        let unused = (self.command_line.describe_unused)(&patch, &changed);
        let size = self.run.status()?.size.unwrap_or_default();
        let small_blur = changed.look.small_blur(size).map(|small| small.to_string());
        let lines: Vec<String> = changed.note.into_iter().chain(unused).chain(small_blur).collect();
        Ok(Some(lines.join("; ")).filter(|line| !line.is_empty()))
    }

    /// Switches pictures on or off. After switching off, returns only once every output that may have viewers shows the
    /// card.
    fn switch_and_wait(&self, on: Option<bool>) -> Result<Option<String>, Answer> {
        match (self.run.switch_pictures(on)?, self.run.shutter()) {
            (false, Some(shutter)) => shutter.wait_for_card().map_err(|error| Answer::failed(error.to_string())),
            _ => Ok(None),
        }
    }

    fn handle_snapshot(&self, to: Option<&Path>) -> Result<Answer, Answer> {
        if let Some(path) = to.filter(|path| !path.is_absolute()) {
            return Err(Answer::invalid_request(format!("{}: give the absolute path", path.display())));
        }
        if !self.run.status()?.on {
            return Err(Answer::failed("it is off: there is no picture"));
        }
        self.run.save_snapshot(to).map(|saved| Answer::Saved { saved })
    }

    fn status(&self) -> Result<Status, Answer> {
        let round = |value: f64| (value * 10.0).round() / 10.0;
        let status = self.run.status()?;
        Ok(Status {
            name: self.name.to_string(),
            pid: std::process::id(),
            command: self.command.to_owned(),
            fps: round(status.fps),
            uptime_s: round(self.began.elapsed().as_secs_f64()),
            ..status
        })
    }
}
