//! Answers requests to a run of any kind, from any client; [`crate::control`] transports them.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use crate::control::{Answer, Handler, Name, Request, Status};
use crate::look::{Look, Patch};
use crate::sink::ShutterControl;
use crate::source::{DepthChoice, DepthOrigin, Kind};

/// Interprets requests according to the run's command line. A refusal is returned as the answer.
#[allow(clippy::missing_errors_doc)]
pub trait Rules: Send + Sync {
    /// Parses settings, each written `NAME=VALUE`, into changes.
    fn parse_settings(&self, settings: &[String]) -> Result<Patch, Answer>;

    /// Returns the current changes of a preset.
    fn load_preset(&self, name: &str) -> Result<Patch, Answer>;

    /// Returns the look after a change, and one line on the parts of the change without effect.
    fn apply_patch(&self, patch: &Patch, look: &Look, facts: &SourceFacts) -> Result<(Look, Option<String>), Answer>;
}

/// The facts of a source that decide which looks are possible.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceFacts {
    pub kind: Kind,
    /// Width and height of its pictures, in pixels.
    pub size: (u32, u32),
    /// Whether its frames have depth; `depth_from` says from where.
    pub has_depth: bool,
    pub depth_from: DepthOrigin,
    pub depth_choice: DepthChoice,
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

    /// Changes the look as far as the rules allow; returns their note.
    fn change_look(&self, patch: Patch, rules: &Arc<dyn Rules>) -> Result<Option<String>, Answer>;

    /// Switches to another source of depth.
    fn set_depth_source(&self, way: &str) -> Result<(), Answer>;

    /// Saves the next picture in `to`, which must not exist, or in a file named by date; returns the file.
    fn save_snapshot(&self, to: Option<&Path>) -> Result<PathBuf, Answer>;
}

/// Answers requests to a run.
pub struct Controller<R> {
    name: Name,
    command: &'static str,
    began: Instant,
    rules: Arc<dyn Rules>,
    run: R,
}

impl<R: ControllableRun + 'static> Controller<R> {
    /// Creates the handler for a run with this name that starts now.
    pub fn create_handler(name: Name, command: &'static str, rules: Arc<dyn Rules>, run: R) -> Arc<Handler> {
        let controller = Self { name, command, began: Instant::now(), rules, run };
        Arc::new(move |request| controller.handle_request(request).unwrap_or_else(|refused| refused))
    }

    fn handle_request(&self, request: Request) -> Result<Answer, Answer> {
        let change = |patch| self.run.change_look(patch, &self.rules);
        let note = match request {
            Request::Status => None,
            Request::On => self.switch_and_wait(Some(true))?,
            Request::Off => self.switch_and_wait(Some(false))?,
            Request::Toggle => self.switch_and_wait(None)?,
            Request::Preset { name } => change(self.rules.load_preset(&name)?)?,
            Request::Set { settings } => change(self.rules.parse_settings(&settings)?)?,
            Request::Depth { from } => self.run.set_depth_source(&from).map(|()| None)?,
            Request::Snapshot { to } => return self.handle_snapshot(to.as_deref()),
        };
        Ok(Answer::Done { status: Box::new(self.status()?), note })
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
