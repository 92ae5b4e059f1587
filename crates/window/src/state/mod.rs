//! Model of the window: its state, and the actions that change it.
//!
//! Nothing here draws, blocks, or calls the system: [`State::apply`] and [`State::apply_update`] depend on the state
//! alone.

mod action;
mod adapt_look;
mod apply;
mod camera;
mod cli_options;
mod depth_method;
mod dropped;
mod history;
mod notes;
mod preferences;
#[cfg(test)]
pub mod sample;
#[cfg(test)]
mod tests;
mod transport;
pub mod tweak;
mod updates;
mod zoom;

use std::path::PathBuf;

pub use action::{Action, Request, Update};
pub use apply::NO_VIRTUAL_CAMERA;
pub use camera::Camera;
pub use depth_method::DepthMethod;
pub use dropped::DroppedFile;
pub use history::History;
pub use notes::Note;
pub use preferences::{Preferences, TEXT_SCALE_RANGE};
pub use transport::Transport;
pub use zoom::Zoom;

pub use super::views::ViewMode;
use bokehcam::depth::plate::Step;
use bokehcam::frame::crop::Crop;
use bokehcam::look::Look;
use bokehcam::look::presets::Preset;
use bokehcam_live::camera_control::CameraControl;
use bokehcam_live::capture::demo;

use bokehcam_live::source::devices::Choice;
use bokehcam_live::source::{DepthOrigin, Kind};

/// Status of the source.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Source {
    #[default]
    Opening,
    Running(Running),
    /// No frames, for this reason. The last picture stays.
    Lost(String),
    /// The end of the recording was reached. The last picture stays.
    Ended,
}

/// A source that delivers frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Running {
    /// Name on the command line.
    pub name: String,
    /// Display name.
    pub label: String,
    /// Width and height of its frames, in pixels.
    pub size: (u32, u32),
    /// Frame period.
    pub period_ns: u64,
    /// Whether its frames have depth.
    pub has_depth: bool,
    /// Kind of source; a photo is a single still frame.
    pub kind: Kind,
    /// Origin of its depth.
    pub depth_from: DepthOrigin,
    /// Depth methods the source supports, and the active one.
    pub depth_methods: Vec<DepthMethod>,
    pub depth_method: Option<DepthMethod>,
    pub executor: String,
}

/// An active output.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// Name on the command line.
    pub name: String,
    /// True for a virtual camera, false for a recording.
    pub is_camera: bool,
}

/// Everything that the window shows except the picture itself.
#[derive(Clone, Debug, Default)]
pub struct State {
    /// The chosen look.
    pub look: Look,
    /// The look that `reset` restores.
    pub first_look: Look,
    /// The source's name on the command line.
    pub source_name: String,
    /// The source that the user chose in the window, for the next start. What the command line names and what is shown
    /// for want of a camera is no choice.
    pub chosen_source: Option<String>,
    /// The file dropped last, until it is opened.
    pub dropped: Option<DroppedFile>,
    pub source: Source,
    /// The available sources.
    pub sources: Vec<Choice>,
    /// The available virtual cameras.
    pub virtual_cameras: Vec<Choice>,
    pub controls: Vec<CameraControl>,
    /// Other properties of the camera.
    pub camera: Camera,
    pub presets: Vec<Preset>,
    /// The preset that was chosen or saved last.
    chosen_preset: Option<String>,
    /// Active outputs besides the window.
    pub outputs: Vec<Output>,
    /// Whether a program reads the virtual camera.
    pub is_watched: bool,
    /// Whether the self-timer is counting down to a snapshot.
    pub self_timer: bool,
    /// Location of the last saved file.
    pub saved_in: Option<PathBuf>,
    /// The displayed view of a frame.
    pub shown: ViewMode,
    /// Whether the window mirrors the picture.
    pub mirror: bool,
    /// Whether frames still use other kernels while those of the chosen look are being built.
    pub is_transitional: bool,
    /// The crop that outputs get; `None` for the whole picture.
    pub crop: Option<Crop>,
    /// Whether the user set `mirror`; otherwise it depends on the camera.
    pub mirror_chosen: bool,
    /// Whether the displayed picture is frozen.
    pub frozen: bool,
    /// Whether the final picture of a photo is displayed: later ones would be identical.
    pub shows_final_photo: bool,
    /// Whether outputs get the still card instead of the picture, and the camera is paused.
    pub off: bool,
    /// Playback position, if the source is a recording.
    pub transport: Option<Transport>,
    pub zoom: Zoom,
    /// Split position as a fraction of the width: left of it, the picture is shown before the blur.
    pub split: Option<f32>,
    /// Whether the panel is open.
    pub panel: bool,
    /// Whether all controls and overlays are hidden.
    pub controls_hidden: bool,
    /// Whether the help is shown.
    pub help: bool,
    /// Whether the window fills the screen.
    pub full_screen: bool,
    /// Seconds since the last frame, if a running source has been silent for too long.
    pub silent_s: Option<u64>,
    /// Distance of the focal plane in the last frame, in metres.
    pub focus_m: Option<f32>,
    /// Messages to the user, newest last, at most `MAX_NOTES`.
    pub notes: Vec<Note>,
    /// Progress of the background plate, if depth comes from it.
    pub plate: Option<Step>,
    /// Whether the user declined other depth methods.
    pub depth_offer_declined: bool,
    /// Whether the user dismissed the notice that this is a demonstration.
    pub demonstration_dismissed: bool,
    /// Whether the dialog that confirms closing is open.
    pub closing: bool,
    /// Settings that persist between runs.
    pub preferences: Preferences,
    /// Bytes of the recording so far, if known.
    pub recorded_bytes: Option<u64>,
    /// Failure of an output, until the user dismisses it.
    pub output_failure: Option<String>,
    /// Undo and redo history of the look.
    pub history: History,
    /// Whether the effect differs from the chosen one because the source has no depth.
    effect_replaced: bool,
    /// Number of the last note.
    last_note_number: u64,
}

/// Shown once the background plate is captured.
const PLATE_CAPTURED: &str = "Come back: the room behind you is known now. Keep the camera where it is.";

impl State {
    /// Creates the state of a window that opens `source_name` with `look`, with the panel open.
    pub fn new(look: Look, source_name: String) -> Self {
        Self { first_look: look.clone(), look, source_name, panel: true, ..Self::default() }
    }

    /// Updates the progress of the background plate. Returns whether it changed.
    pub fn set_plate_step(&mut self, step: Option<Step>) -> bool {
        let before = std::mem::replace(&mut self.plate, step);
        if step == Some(Step::Ready) && before.is_some_and(|before| before != Step::Ready) {
            self.note(PLATE_CAPTURED);
        }
        before != step
    }

    /// Whether the source is the demonstration.
    pub fn is_demonstration(&self) -> bool {
        matches!(&self.source, Source::Running(running) if running.name == demo::NAME)
    }

    /// Returns the depth methods that the source supports.
    pub fn depth_methods(&self) -> &[DepthMethod] {
        match &self.source {
            Source::Running(running) => &running.depth_methods,
            Source::Opening | Source::Lost(_) | Source::Ended => &[],
        }
    }

    /// Returns the active depth method.
    pub fn depth_method(&self) -> Option<DepthMethod> {
        if let Source::Running(running) = &self.source { running.depth_method } else { None }
    }

    /// Whether a background plate can be captured.
    pub fn can_capture_plate(&self) -> bool {
        self.depth_methods().contains(&DepthMethod::Plate)
    }

    /// Returns person segmentation as a fallback while the plate is missing or does not match the picture.
    pub fn method_without_plate(&self) -> Option<DepthMethod> {
        let lacks_plate = self.plate.is_some_and(|step| step != Step::Ready);
        Some(DepthMethod::Person).filter(|depth_method| lacks_plate && self.depth_methods().contains(depth_method))
    }

    /// Whether the source has no depth and the user is offered methods to get it.
    pub fn offers_depth_methods(&self) -> bool {
        let is_plain = matches!(&self.source, Source::Running(running) if !running.has_depth);
        is_plain && !self.has_declined_depth() && !self.depth_offer_declined && self.plate.is_none()
    }

    /// Whether the source could measure its own depth, but the user turned that off.
    fn has_declined_depth(&self) -> bool {
        !self.may_have_depth()
            && self
                .depth_methods()
                .iter()
                .any(|depth_method| matches!(depth_method, DepthMethod::Measured | DepthMethod::Stereo))
    }

    /// Returns a short display name of the source; empty if unknown.
    pub fn title(&self) -> &str {
        let listed = self.sources.iter().find(|choice| choice.name == self.source_name);
        let name = match (listed, &self.source) {
            (Some(choice), _) => choice.label.as_str(),
            // A camera's label has its mode after the name.
            (None, Source::Running(running)) => running.label.split(", ").next().unwrap_or_default(),
            (None, _) => self.source_name.as_str(),
        };
        let name = name.split(" (/dev/").next().unwrap_or(name);
        name.trim_end_matches('/').rsplit('/').next().unwrap_or(name)
    }

    /// Whether the panel is expanded.
    pub fn is_expanded(&self) -> bool {
        self.preferences.sections.get("More").copied().unwrap_or(false)
    }

    /// Whether the source is a photo.
    pub fn is_photo(&self) -> bool {
        matches!(&self.source, Source::Running(running) if running.kind == Kind::Photo)
    }

    /// Whether the displayed picture stays: it is frozen, a photo's final one, or the source has stopped.
    pub fn is_picture_static(&self) -> bool {
        self.frozen || self.shows_final_photo || matches!(self.source, Source::Lost(_) | Source::Ended)
    }

    /// Whether the pipeline can pause once the displayed picture is held: the window needs no other.
    pub fn can_pause_pipeline(&self) -> bool {
        let is_plate_due = self.plate.is_some_and(|step| step != Step::Ready);
        (self.frozen || self.shows_final_photo) && !is_plate_due && matches!(self.source, Source::Running(_))
    }

    /// Whether frames have depth; assumed true while no source is running.
    pub fn may_have_depth(&self) -> bool {
        match &self.source {
            Source::Running(running) => running.has_depth,
            Source::Opening | Source::Lost(_) | Source::Ended => true,
        }
    }

    /// Returns the distance of the focal plane in the last frame in metres, or 1 if unknown.
    pub fn focus_distance_m(&self) -> f32 {
        self.focus_m.filter(|metres| metres.is_finite()).unwrap_or(1.0)
    }

    /// Returns the active recording.
    pub fn recording(&self) -> Option<&Output> {
        self.outputs.iter().find(|output| !output.is_camera)
    }

    /// Returns the active virtual camera.
    pub fn virtual_camera(&self) -> Option<&Output> {
        self.outputs.iter().find(|output| output.is_camera)
    }

    /// Returns the index of the preset that matches the look, ignoring the focus. If several match, prefers the one
    /// that was chosen or saved last, else the first.
    pub fn preset_in_use(&self) -> Option<usize> {
        let is_in_use = |preset: &Preset| {
            let used = preset.patch.apply_to(&self.look);
            used.is_ok_and(|look| Look { focus: self.look.focus, ..look } == self.look)
        };
        let all = self.presets.iter().enumerate().filter(|(_, preset)| is_in_use(preset));
        let is_other = |preset: &Preset| self.chosen_preset.as_ref() != Some(&preset.name);
        all.min_by_key(|(index, preset)| (is_other(preset), *index)).map(|(index, _)| index)
    }
}
