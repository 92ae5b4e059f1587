//! What the window asks for by name; who starts the preview knows how to get it.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::bokeh::{self, Bokeh};
use crate::capture::Camera;
use crate::depth::DepthSource;
use crate::look::{Look, presets::Preset};
use crate::sink::Sink;

/// Something to choose, by the name that the command line has for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// What the command line calls it.
    pub name: String,
    /// What a person calls it.
    pub label: String,
}

/// An option of the command line that is none of the look: its name and its value.
pub type Switch = (String, String);

/// A camera's control that can be changed while it streams.
#[derive(Clone, Debug, PartialEq)]
pub struct Control {
    /// Its name on the command line (`--control NAME=VALUE`).
    pub name: String,
    /// Its value.
    pub value: i64,
    /// Least and largest value, and the step between.
    pub range: (i64, i64, i64),
    /// Names of the values of a menu, by value; empty otherwise.
    pub menu: Vec<(i64, String)>,
    /// Whether it is on or off.
    pub switch: bool,
    /// Whether it can be changed now.
    pub active: bool,
}

/// A source that was opened.
pub struct Opened {
    /// What the command line calls it.
    pub name: String,
    /// Gives the frames.
    pub camera: Box<dyn Camera>,
    /// Gives their depth, where the camera does not.
    pub depth: Option<Box<dyn DepthSource>>,
    /// Whether frames have depth, from wherever.
    pub has_depth: bool,
    /// Whether that was measured, so that refining it makes it better.
    pub measured: bool,
    /// Lines for the person: what was assumed, what is missing and where to get it.
    pub notes: Vec<String>,
    /// The camera's controls, where it has any.
    pub controls: Vec<Control>,
}

/// What the window cannot do itself. Errors are one line for the person.
pub trait Backstage: Send {
    /// What could be opened, now.
    fn sources(&mut self) -> Vec<Choice>;

    /// Virtual cameras that could be written to, now.
    fn virtual_cameras(&mut self) -> Vec<Choice>;

    /// Opens a source; an empty name is the first camera there is, else the synthetic scene.
    ///
    /// # Errors
    /// It cannot be opened.
    fn open(&mut self, name: &str) -> Result<Opened, String>;

    /// Sets a control of the camera that was opened last; gives back all of them.
    ///
    /// # Errors
    /// The camera refuses.
    fn set_control(&mut self, name: &str, value: i64) -> Result<Vec<Control>, String>;

    /// An executor for pictures of `size` pixels.
    ///
    /// # Errors
    /// There is no such GPU.
    fn executor(&mut self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, String>;

    /// Opens an output: a virtual camera or a file, for pictures of `size` pixels every `period_ns`, which end once `stop`
    /// is set.
    ///
    /// # Errors
    /// It cannot be opened.
    fn output(
        &mut self,
        name: &str,
        size: (u32, u32),
        period_ns: u64,
        stop: &Arc<AtomicBool>,
    ) -> Result<Box<dyn Sink>, String>;

    /// The command that shows `source` in this look: `bokehcam preview ...` with the window's `switches`, or
    /// `bokehcam stream ...` into `outputs`.
    fn command(&self, look: &Look, source: &str, outputs: &[String], switches: &[Switch]) -> String;

    /// The presets, the person's own last.
    fn presets(&mut self) -> Vec<Preset>;

    /// Saves a look under a name of the person's.
    ///
    /// # Errors
    /// The settings file cannot be written, or the name cannot be one.
    fn save_preset(&mut self, name: &str, look: &Look) -> Result<(), String>;
}
