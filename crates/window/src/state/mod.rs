//! What the window shows and lets one change: a state, and the actions that change it.
//!
//! Nothing here draws, waits or asks the system: [`State::apply`] and [`State::hear`] are functions of the state alone.

mod action;
mod apply;
mod camera;
mod fitting;
mod habits;
mod hear;
mod history;
#[cfg(test)]
pub mod sample;
mod switches;
#[cfg(test)]
mod tests;
mod transport;
pub mod tweak;
mod way;
mod zoom;

use std::path::PathBuf;

pub use action::{Action, Request, Update};
pub use apply::NO_VIRTUAL_CAMERA;
pub use camera::Camera;
pub use habits::{Habits, TEXT_SCALES};
pub use history::History;
pub use transport::Transport;
pub use way::Way;
pub use zoom::Zoom;

use super::meters::Meters;
use super::texts::translated;
pub use super::views::Shown;
use super::views::{Legend, Probe};
use bokehcam::capture::demo;
use bokehcam::depth::plate::Step;
use bokehcam::frame::crop::Crop;
use bokehcam::knob::Knob;
use bokehcam::look::Look;
use bokehcam::look::presets::Preset;

use bokehcam::source::devices::Choice;
use bokehcam::source::{DepthFrom, Kind};

/// The source as it is now.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Source {
    /// It is being opened.
    #[default]
    Opening,
    Running(Running),
    /// Why there are no frames any more, or never were. The last picture stays.
    Lost(String),
    /// It came to its end. The last picture stays.
    Ended,
}

/// A source whose frames come.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Running {
    /// What the command line calls it.
    pub name: String,
    /// What it calls itself.
    pub label: String,
    /// Width and height of its pictures.
    pub size: (u32, u32),
    /// Time from frame to frame.
    pub period_ns: u64,
    /// Whether its frames have depth.
    pub has_depth: bool,
    /// Whether its frames come at their own pace, as a camera's do. Others can stand still.
    pub is_live: bool,
    /// What it is; a photo is one picture that stands still.
    pub kind: Kind,
    /// What its depth comes from.
    pub depth_from: DepthFrom,
    /// The ways to depth that it has, and the one that is used.
    pub ways: Vec<Way>,
    pub way: Option<Way>,
    pub executor: String,
    /// Time that a frame's blur may take.
    pub budget_ns: u64,
}

/// An output that is written to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// What the command line calls it.
    pub name: String,
    /// Whether it is a virtual camera; otherwise a recording.
    pub is_camera: bool,
}

/// A line for the person. It is shown for a while.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Counts from 1, different for each line.
    pub number: u64,
    pub text: String,
}

/// All that the window shows, but the picture itself.
#[derive(Clone, Debug, Default)]
pub struct State {
    /// The look as it was chosen.
    pub look: Look,
    /// What `reset` goes back to.
    pub first_look: Look,
    /// What the source is called on the command line.
    pub source_name: String,
    pub source: Source,
    /// The sources that can be chosen.
    pub sources: Vec<Choice>,
    /// The virtual cameras that can be chosen.
    pub virtual_cameras: Vec<Choice>,
    pub controls: Vec<Knob>,
    /// What else is known of the camera.
    pub camera: Camera,
    pub presets: Vec<Preset>,
    /// The name of the one that was chosen or saved last.
    chosen_preset: Option<String>,
    /// Where pictures go besides the window.
    pub outputs: Vec<Output>,
    /// Whether a snapshot is due in a few seconds.
    pub self_timer: bool,
    /// Where something was saved last.
    pub kept_in: Option<PathBuf>,
    /// What of a frame is shown.
    pub shown: Shown,
    /// Whether the window shows pictures as a mirror does.
    pub mirror: bool,
    /// Whether frames are still blurred for the look before, as their own kernels are being made.
    pub between: bool,
    /// What of the picture goes out; `None` is all.
    pub part: Option<Crop>,
    /// Whether somebody said so; otherwise it depends on the camera.
    pub mirror_chosen: bool,
    /// Whether the window keeps the picture it has.
    pub frozen: bool,
    /// Whether the picture of a photo is there: all that follow would be the same.
    pub settled: bool,
    /// Whether outputs have the still card in place of pictures, and the camera rests.
    pub off: bool,
    /// Where the recording is, if the source is one.
    pub transport: Option<Transport>,
    pub zoom: Zoom,
    /// What is under the pointer, where that is shown.
    pub probe: Option<Probe>,
    /// Left of this fraction of its width, the picture is shown as before the blur.
    pub split: Option<f32>,
    /// Whether the panel is open.
    pub panel: bool,
    /// Whether the instruments are shown.
    pub instruments: bool,
    /// Whether nothing but the picture is shown.
    pub bare: bool,
    /// Whether the help on keys is shown.
    pub help: bool,
    /// Whether the window fills the screen.
    pub full_screen: bool,
    /// Seconds without a frame, where the source runs but has been silent for too long.
    pub silent_s: Option<u64>,
    /// Distance of the focal plane in the last frame, in metres.
    pub focus_m: Option<f32>,
    /// What the colours of a view other than the picture mean.
    pub legend: Option<Legend>,
    /// Lines for the person, the newest last, and no more than a few.
    pub notes: Vec<Note>,
    /// How far the plate is, where that makes the depth.
    pub plate: Option<Step>,
    /// Whether the person wants no other way to depth.
    pub declined_plate: bool,
    /// Whether the person knows that this is a demonstration.
    pub knows_demonstration: bool,
    /// Whether the person is asked if the window shall close although something is recorded.
    pub closing: bool,
    /// What of the window goes on from run to run.
    pub habits: Habits,
    /// Bytes of the recording so far, where they are known.
    pub recorded_bytes: Option<u64>,
    /// What went wrong with an output, until the person knows.
    pub trouble: Option<String>,
    pub meters: Meters,
    /// The looks before, and those that were undone.
    pub history: History,
    /// Whether the effect differs from what was chosen, because the source has no depth.
    fitted: bool,
    /// Number of the last note.
    noted: u64,
}

/// Shown once a plate is taken.
const PLATE_TAKEN: &str = "Come back: what is behind you is known now. Keep the camera where it is.";
/// The most notes that are kept.
const NOTES: usize = 6;

impl State {
    /// A window that opens `source_name` and shows it in `look`, with the panel open.
    pub fn new(look: Look, source_name: String) -> Self {
        Self { first_look: look.clone(), look, source_name, panel: true, ..Self::default() }
    }

    /// Adds a line for the person, in the language that is spoken.
    pub fn note(&mut self, text: impl Into<String>) {
        let text = translated(&text.into());
        // Said once more, it is shown anew, and once.
        self.notes.retain(|note| note.text != text);
        self.noted += 1;
        self.notes.push(Note { number: self.noted, text });
        if self.notes.len() > NOTES {
            self.notes.remove(0);
        }
    }

    /// Takes note of how far the plate is. Whether that is new.
    pub fn guide(&mut self, step: Option<Step>) -> bool {
        let before = std::mem::replace(&mut self.plate, step);
        if step == Some(Step::Ready) && before.is_some_and(|before| before != Step::Ready) {
            self.note(PLATE_TAKEN);
        }
        before != step
    }

    /// Whether the source is the demonstration.
    pub fn is_demonstration(&self) -> bool {
        matches!(&self.source, Source::Running(running) if running.name == demo::NAME)
    }

    /// The ways to depth that the source has.
    pub fn ways(&self) -> &[Way] {
        match &self.source {
            Source::Running(running) => &running.ways,
            Source::Opening | Source::Lost(_) | Source::Ended => &[],
        }
    }

    /// The one by which it has its depth.
    pub fn way(&self) -> Option<Way> {
        if let Source::Running(running) = &self.source { running.way } else { None }
    }

    /// Whether a plate can be taken.
    pub fn takes_plates(&self) -> bool {
        self.ways().contains(&Way::Plate)
    }

    /// What finds the person while there is no plate yet, or it is of another picture.
    pub fn way_without_plate(&self) -> Option<Way> {
        let lacks_plate = self.plate.is_some_and(|step| step != Step::Ready);
        Some(Way::Person).filter(|way| lacks_plate && self.ways().contains(way))
    }

    /// Whether nothing is known of depth, and the person is offered ways to it.
    pub fn offers_depth(&self) -> bool {
        let is_plain = matches!(&self.source, Source::Running(running) if !running.has_depth);
        is_plain && !self.declines_own() && !self.declined_plate && self.plate.is_none()
    }

    /// Whether the source has depth of its own that was declined.
    fn declines_own(&self) -> bool {
        !self.may_have_depth() && self.ways().iter().any(|way| matches!(way, Way::Measured | Way::Stereo))
    }

    /// What the source is called, in short; empty where that is not known.
    pub fn title(&self) -> &str {
        let listed = self.sources.iter().find(|choice| choice.name == self.source_name);
        let name = match (listed, &self.source) {
            (Some(choice), _) => choice.label.as_str(),
            // After its name, a camera tells its mode.
            (None, Source::Running(running)) => running.label.split(", ").next().unwrap_or_default(),
            (None, _) => self.source_name.as_str(),
        };
        let name = name.split(" (/dev/").next().unwrap_or(name);
        name.trim_end_matches('/').rsplit('/').next().unwrap_or(name)
    }

    /// Whether the panel shows all there is.
    pub fn shows_more(&self) -> bool {
        self.habits.sections.get("More").copied().unwrap_or(false)
    }

    /// Whether the source is a photo.
    pub fn is_photo(&self) -> bool {
        matches!(&self.source, Source::Running(running) if running.kind == Kind::Photo)
    }

    /// Whether the picture that is shown stays: it was frozen, is a photo's, or no others come.
    pub fn keeps_picture(&self) -> bool {
        self.frozen || self.settled || matches!(self.source, Source::Lost(_) | Source::Ended)
    }

    /// Whether the window needs no frames: it keeps its picture, and the source can stand still.
    pub fn stands_still(&self) -> bool {
        (self.frozen || self.settled) && matches!(&self.source, Source::Running(running) if !running.is_live)
    }

    /// Whether frames have depth, as far as is known: without a running source they may.
    pub fn may_have_depth(&self) -> bool {
        match &self.source {
            Source::Running(running) => running.has_depth,
            Source::Opening | Source::Lost(_) | Source::Ended => true,
        }
    }

    /// Distance of the focal plane in the last frame, in metres; one where there is none to start from.
    pub fn distance_m(&self) -> f32 {
        self.focus_m.filter(|metres| metres.is_finite()).unwrap_or(1.0)
    }

    /// The recording that is being written, if any.
    pub fn recording(&self) -> Option<&Output> {
        self.outputs.iter().find(|output| !output.is_camera)
    }

    /// The virtual camera that is written to, if any.
    pub fn virtual_camera(&self) -> Option<&Output> {
        self.outputs.iter().find(|output| output.is_camera)
    }

    /// The index of the preset that the look is of, wherever it is focused: of several that look the same, the one that was
    /// chosen or saved last, else the first.
    pub fn preset_in_use(&self) -> Option<usize> {
        let is_in_use = |preset: &Preset| {
            let used = preset.patch.on(&self.look);
            used.is_ok_and(|look| Look { focus: self.look.focus, ..look } == self.look)
        };
        let all = self.presets.iter().enumerate().filter(|(_, preset)| is_in_use(preset));
        let is_other = |preset: &Preset| self.chosen_preset.as_ref() != Some(&preset.name);
        all.min_by_key(|(index, preset)| (is_other(preset), *index)).map(|(index, _)| index)
    }
}
