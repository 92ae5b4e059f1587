//! PipeWire's cameras in a build without the feature `pipewire`: there are none.

use super::devices::Choice;
use super::{Frames, SourceError, SourceName};
use crate::capture::Camera;

pub fn parse(name: &str) -> Result<SourceName, SourceError> {
    SourceError::usage_error(format!(
        "this build leaves PipeWire's cameras out (features `camera` and `pipewire`): {name} cannot be read"
    ))
}

pub fn open(name: &str, _: bool, _: &Frames) -> Result<Box<dyn Camera>, SourceError> {
    parse(name).and_then(|_| SourceError::usage_error(""))
}

/// Returns none.
pub fn list_pipewire_cameras() -> Vec<Choice> {
    Vec::new()
}

pub fn find_output() -> Option<Choice> {
    None
}

#[derive(Debug)]
pub enum SourceWatch {}

impl SourceWatch {
    pub fn take_change(&self) -> bool {
        match *self {}
    }
}

pub fn watch() -> Option<SourceWatch> {
    None
}
