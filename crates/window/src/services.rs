//! System services of a session: sources, outputs, executors, and the settings file. Errors are one line of text.

use super::state::{Camera, DepthMethod};
use bokehcam::bokeh::{self, Bokeh};
use bokehcam::look::{Look, presets::Preset};
use bokehcam_live::camera_control::CameraControl;
use bokehcam_live::sink::{self, Sink};
use bokehcam_live::source::{Source, devices::Choice};

/// A command-line option that is not part of the look: name and value.
pub type CliOption = (String, String);

/// Kinds of paths that the user can choose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathKind {
    /// The folder of a recording.
    Folder,
    /// The file of a photo.
    Photo,
    /// The file of a background, a picture or a video.
    Background,
}

/// Opens a file chooser and blocks: returns the name of a source or a file, or `None` if cancelled. Errors are one
/// line.
pub type FileChooser = Box<dyn FnOnce() -> Result<Option<String>, String> + Send>;

/// An opened source.
pub struct OpenedSource {
    /// Name on the command line.
    pub name: String,
    /// Its frames and their depth.
    pub source: Source,
    /// Whether its depth is used: it has depth, and the user did not decline it.
    pub has_depth: bool,
    /// Depth methods it supports, and the active one.
    pub depth_methods: Vec<DepthMethod>,
    pub depth_method: Option<DepthMethod>,
    /// Messages to the user: assumptions, and missing parts with where to get them.
    pub notes: Vec<String>,
    /// The camera's driver controls, such as exposure.
    pub controls: Vec<CameraControl>,
    /// Other properties of the camera; default for other sources.
    pub camera: Camera,
}

/// System services that a session needs.
pub trait Services: Send {
    /// Returns the available sources.
    fn list_sources(&mut self) -> Vec<Choice>;

    /// Returns the available virtual cameras.
    fn list_virtual_cameras(&mut self) -> Vec<Choice>;

    /// Opens a source; an empty name is the first camera, or without a camera the demonstration. `depth_method` is the depth
    /// method, `None` for the default; a background plate is captured at the start.
    ///
    /// # Errors
    /// Fails if it cannot be opened.
    fn open(&mut self, name: &str, depth_method: Option<DepthMethod>) -> Result<OpenedSource, String>;

    /// Checks that the source supports this depth method now.
    ///
    /// # Errors
    /// Returns a one-line message with advice if it does not.
    fn check_depth_method(&mut self, name: &str, depth_method: DepthMethod) -> Result<(), String> {
        let _ = (name, depth_method);
        Ok(())
    }

    /// Whether devices appeared or disappeared since the last call.
    fn have_devices_changed(&mut self) -> bool {
        false
    }

    /// Returns a camera that has come while the source is the demonstration for want of one.
    fn awaited_camera(&mut self) -> Option<String> {
        None
    }

    /// Checks that `name` is a valid source.
    ///
    /// # Errors
    /// Returns a one-line message if it is not.
    fn check_source_name(&self, name: &str) -> Result<(), String> {
        let _ = name;
        Ok(())
    }

    /// Returns a function that opens a file chooser.
    fn create_file_chooser(&self, kind: PathKind) -> FileChooser {
        let _ = kind;
        Box::new(|| Err("there is no file dialog".to_owned()))
    }

    /// Selects the frame size (width, height) and rate with which this source is opened from now on.
    fn set_mode(&mut self, name: &str, size: (u32, u32), fps: f64) {
        let _ = (name, size, fps);
    }

    /// Sets a driver control of the camera opened last. Returns all of its controls.
    ///
    /// # Errors
    /// Fails if the camera rejects the value.
    fn set_control(&mut self, control: &str, value: i64) -> Result<Vec<CameraControl>, String>;

    /// Creates an executor for pictures of `size` pixels.
    ///
    /// # Errors
    /// Fails if the requested GPU does not exist.
    fn create_executor(&mut self, settings: &bokeh::Settings, size: (u32, u32)) -> Result<Box<dyn Bokeh>, String>;

    /// Opens an output, a virtual camera or a file, with these options, which the services complete.
    ///
    /// # Errors
    /// Fails if it cannot be opened.
    fn open_output(&mut self, name: &str, options: sink::Options) -> Result<Box<dyn Sink>, String>;

    /// Returns the command that shows `source` with this look: `bokehcam preview ...` with the window's `switches`, or
    /// `bokehcam stream ...` into `outputs`.
    fn format_command(&self, look: &Look, source: &str, outputs: &[String], switches: &[CliOption]) -> String;

    /// Returns the settings store, which has the presets.
    fn settings(&mut self) -> &mut dyn SettingsStore;
}

/// Persistent settings.
pub trait SettingsStore: Send {
    /// Returns the current presets, the user's own last.
    fn presets(&mut self) -> Vec<Preset>;

    /// Saves a look as a user preset.
    ///
    /// # Errors
    /// Fails if the settings file cannot be written or the name is invalid.
    fn save_preset(&mut self, name: &str, look: &Look) -> Result<(), String>;

    /// Renames a user preset.
    ///
    /// # Errors
    /// Fails as for saving, if there is no such preset, or if the new name is taken.
    fn rename_preset(&mut self, name: &str, new: &str) -> Result<(), String>;

    /// Deletes a user preset.
    ///
    /// # Errors
    /// Fails if the settings file cannot be written or lacks the preset.
    fn delete_preset(&mut self, name: &str) -> Result<(), String>;

    /// Returns the command line of [`Services::format_command`].
    fn format_command(&self, look: &Look, source: &str, outputs: &[String], switches: &[CliOption]) -> String;
}
