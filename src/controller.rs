//! What is asked of a run is answered here, whatever kind of run it is and whoever asks ([`crate::control`] is how).

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use crate::control::{Answer, Handler, Name, Request, Status};
use crate::look::{Look, Patch};
use crate::sink::Release;
use crate::source::{DepthChoice, DepthFrom, Kind};

/// What requests mean, and which looks a run can have: as its command line has it. What is refused is the answer.
#[allow(clippy::missing_errors_doc)]
pub trait Rules: Send + Sync {
    /// The changes that settings make, each written `NAME=VALUE`.
    fn settings(&self, settings: &[String]) -> Result<Patch, Answer>;

    /// The changes that a preset makes, as it is now.
    fn preset(&self, name: &str) -> Result<Patch, Answer>;

    /// The look of a run after a change, and one line on what of the change has no effect.
    fn changed(&self, patch: &Patch, look: &Look, facts: &Facts) -> Result<(Look, Option<String>), Answer>;
}

/// What of a source decides which looks a run of it can have.
#[derive(Clone, Debug, PartialEq)]
pub struct Facts {
    pub kind: Kind,
    /// Columns and rows of its pictures.
    pub size: (u32, u32),
    /// Whether its frames have depth, and where that comes from.
    pub has_depth: bool,
    pub depth_from: DepthFrom,
    pub depth_choice: DepthChoice,
}

/// A run that can be controlled. It is asked on several threads at once; what it refuses is the answer.
#[allow(clippy::missing_errors_doc)]
pub trait Controlled: Send + Sync {
    /// How it is, but for its name, process, command and age.
    fn status(&self) -> Result<Status, Answer>;

    /// Shows pictures, or the still card in their place; `None` is the other of both. Returns whether there are pictures now.
    fn switch(&self, on: Option<bool>) -> Result<bool, Answer>;

    /// What keeps pictures from its outputs, while it has some.
    fn release(&self) -> Option<Release>;

    /// Changes the look, as far as the rules allow it; returns their line.
    fn change(&self, patch: Patch, rules: &Arc<dyn Rules>) -> Result<Option<String>, Answer>;

    /// Makes depth another way.
    fn make_depth_by(&self, way: &str) -> Result<(), Answer>;

    /// Saves the next picture in this file, which is not there yet, or by date; returns the file.
    fn save(&self, to: Option<&Path>) -> Result<PathBuf, Answer>;
}

/// Answers for a run.
pub struct Controller<R> {
    name: Name,
    command: &'static str,
    began: Instant,
    rules: Arc<dyn Rules>,
    run: R,
}

impl<R: Controlled + 'static> Controller<R> {
    /// What answers for a run of this name that begins now.
    pub fn begin(name: Name, command: &'static str, rules: Arc<dyn Rules>, run: R) -> Arc<Handler> {
        let controller = Self { name, command, began: Instant::now(), rules, run };
        Arc::new(move |request| controller.answer(request).unwrap_or_else(|refused| refused))
    }

    fn answer(&self, request: Request) -> Result<Answer, Answer> {
        let change = |patch| self.run.change(patch, &self.rules);
        let note = match request {
            Request::Status => None,
            Request::On => self.switch(Some(true))?,
            Request::Off => self.switch(Some(false))?,
            Request::Toggle => self.switch(None)?,
            Request::Preset { name } => change(self.rules.preset(&name)?)?,
            Request::Set { settings } => change(self.rules.settings(&settings)?)?,
            Request::Depth { from } => self.run.make_depth_by(&from).map(|()| None)?,
            Request::Snapshot { to } => return self.save(to.as_deref()),
        };
        Ok(Answer::Done { status: Box::new(self.status()?), note })
    }

    /// Off, every output that somebody may watch has the card once this returns.
    fn switch(&self, on: Option<bool>) -> Result<Option<String>, Answer> {
        match (self.run.switch(on)?, self.run.release()) {
            (false, Some(release)) => release.wait_covered().map_err(|error| Answer::failed(error.to_string())),
            _ => Ok(None),
        }
    }

    fn save(&self, to: Option<&Path>) -> Result<Answer, Answer> {
        if let Some(path) = to.filter(|path| !path.is_absolute()) {
            return Err(Answer::usage(format!("{}: say the whole path", path.display())));
        }
        if !self.run.status()?.on {
            return Err(Answer::failed("it is off: there is no picture"));
        }
        self.run.save(to).map(|saved| Answer::Saved { saved })
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
