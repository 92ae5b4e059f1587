//! What a session needs of the system: sources, outputs, executors, and the settings file. Errors are one line of text.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::state::{Camera, Way};
use bokehcam::bokeh::{self, Bokeh};
use bokehcam::knob::Knob;
use bokehcam::look::{Look, presets::Preset};
use bokehcam::sink::Sink;
use bokehcam::source::{Source, devices::Choice};

/// An option of the command line that is not part of the look: its name and its value.
pub type Switch = (String, String);

/// What a person is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Browse {
    /// The folder of a recording.
    Folder,
    /// The file of a photo.
    Photo,
    /// The file of a picture to stand behind the subject.
    Behind,
}

/// Asks the person and waits for the answer: the name of a source, or of a file; or nothing. An error is one line.
pub type Pick = Box<dyn FnOnce() -> Result<Option<String>, String> + Send>;

/// A source that was opened.
pub struct Opened {
    /// What the command line calls it.
    pub name: String,
    /// Its frames and their depth.
    pub source: Source,
    /// Whether its depth is used: it has some, and that was not declined.
    pub has_depth: bool,
    /// The ways to depth that it has, and the one that is used.
    pub ways: Vec<Way>,
    pub way: Option<Way>,
    /// Lines for the person: what was assumed, what is missing and where to get it.
    pub notes: Vec<String>,
    /// The camera's controls, such as exposure, if it has any.
    pub controls: Vec<Knob>,
    /// What else is known of the camera; nothing of other sources.
    pub camera: Camera,
}

/// What a session needs of the system.
pub trait Services: Send {
    /// The sources that can be opened now.
    fn sources(&mut self) -> Vec<Choice>;

    /// The virtual cameras that can be written to now.
    fn virtual_cameras(&mut self) -> Vec<Choice>;

    /// Opens a source; an empty name is the first camera there is, else the demonstration. Its depth is made this `way`, `None`
    /// for the usual one; a plate is taken at the start.
    ///
    /// # Errors
    /// It cannot be opened.
    fn open(&mut self, name: &str, way: Option<Way>) -> Result<Opened, String>;

    /// Whether the source of this name can have depth this way now.
    ///
    /// # Errors
    /// It cannot: one line, what to do.
    fn can(&mut self, name: &str, way: Way) -> Result<(), String> {
        let _ = (name, way);
        Ok(())
    }

    /// Whether other devices came, or some went, since this was asked last.
    fn devices_changed(&mut self) -> bool {
        false
    }

    /// Whether what somebody offers can be a source.
    ///
    /// # Errors
    /// It cannot: one line.
    fn check(&self, name: &str) -> Result<(), String> {
        let _ = name;
        Ok(())
    }

    /// A way to ask the person for a source, or a file.
    fn browse(&self, what: Browse) -> Pick {
        let _ = what;
        Box::new(|| Err("there is no file dialog".to_owned()))
    }

    /// Opens the source of this name with pictures of another size (columns, rows) and rate from now on.
    fn choose_mode(&mut self, name: &str, size: (u32, u32), fps: f64) {
        let _ = (name, size, fps);
    }

    /// Sets a control of the camera that was opened last; gives back all of its controls.
    ///
    /// # Errors
    /// The camera refuses.
    fn turn(&mut self, knob: &str, value: i64) -> Result<Vec<Knob>, String>;

    /// An executor for pictures of `size` pixels.
    ///
    /// # Errors
    /// There is no such GPU.
    fn executor(&mut self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, String>;

    /// Opens an output: a virtual camera or a file, for pictures of `size` pixels every `period_ns`, which end once
    /// `stop` is set.
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

    /// The settings: presets are there.
    fn settings(&mut self) -> &mut dyn SettingsStore;
}

/// The settings, wherever they are kept.
pub trait SettingsStore: Send {
    /// The presets, the person's own last, as they are now.
    fn presets(&mut self) -> Vec<Preset>;

    /// Saves a look under a name of the person's.
    ///
    /// # Errors
    /// The settings file cannot be written, or the name cannot be one.
    fn save_preset(&mut self, name: &str, look: &Look) -> Result<(), String>;

    /// Gives a preset of the person's another name.
    ///
    /// # Errors
    /// As for saving; or there is none, or one of the new name.
    fn rename_preset(&mut self, name: &str, new: &str) -> Result<(), String>;

    /// Deletes a preset of the person's.
    ///
    /// # Errors
    /// The settings file cannot be written, or has no such preset.
    fn delete_preset(&mut self, name: &str) -> Result<(), String>;

    /// As [`Services::command`].
    fn command(&self, look: &Look, source: &str, outputs: &[String], switches: &[Switch]) -> String;
}
