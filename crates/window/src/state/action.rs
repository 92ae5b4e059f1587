//! What a person can do, what others have to do then, and what they tell.

use std::path::PathBuf;

use super::{Camera, Output, Shown, Source, Way};
use crate::services::Browse;
use bokehcam::depth::backdrop::Behind;
use bokehcam::knob::Knob;
use bokehcam::look::Look;
use bokehcam::look::presets::Preset;
use bokehcam::source::devices::Choice;

/// What a person can do. Every control and key is one of these.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Another look. Looks of the same `stroke` (one drag of one control) are undone together.
    Look {
        look: Box<Look>,
        /// The control in hand, or `None` for a single change.
        stroke: Option<&'static str>,
    },
    /// The control in hand was let go: what comes next is undone on its own.
    Settle,
    /// Back to the look before.
    Undo,
    Redo,
    /// Back to the look at the start.
    Reset,
    /// The look of a preset.
    Preset(String),
    /// Saves the look as a preset.
    SavePreset(String),
    /// Gives a preset of the person's another name.
    RenamePreset(String, String),
    /// Deletes a preset of the person's.
    DeletePreset(String),
    /// Shows something else of the frames.
    Show(Shown),
    /// Shows what was before the blur left of this fraction, or nowhere.
    Split(Option<f32>),
    /// Mirrors the window, or not.
    Mirror(bool),
    /// Keeps the picture, or lets the next ones come.
    Freeze(bool),
    /// Shows a still card in place of pictures, here and outside, and lets the camera rest; or shows them again.
    Off(bool),
    /// Shows the picture so many times as large (0: as large as fits), around a point of it or what was in the middle.
    Zoom(u32, Option<[f32; 2]>),
    /// This point of an enlarged picture comes to the window's middle.
    Pan([f32; 2]),
    /// Goes to the frame at this place of the recording.
    Seek(usize),
    /// Stops so many frames after the one that is shown.
    Step(i32),
    /// Opens or closes the panel.
    Panel(bool),
    /// Shows or hides the instruments.
    Instruments(bool),
    /// Hides all but the picture, or not.
    Bare(bool),
    /// Shows or hides the help on keys.
    Help(bool),
    /// Fills the screen, or not.
    FullScreen(bool),
    /// Text and controls of this size, 1 as usual.
    TextScale(f32),
    /// Keys without Ctrl do something, or nothing.
    SingleKeys(bool),
    /// Closing asks first while something is recorded, or never.
    AskBeforeClosing(bool),
    /// Opens or folds a section of the panel.
    Section(&'static str, bool),
    /// Tells the person something.
    Note(String),
    /// Saves what is shown, and what is needed to make it again.
    Snapshot,
    /// Saves what is shown in a few seconds, or not after all.
    SelfTimer(bool),
    /// Shows the folder that something was saved in last.
    OpenFolder,
    /// Begins a recording (video), or ends it.
    Record(bool),
    /// Writes to this virtual camera, or to none.
    VirtualCamera(Option<String>),
    Open(String),
    /// Asks for a source, or a picture, by a dialog.
    Browse(Browse),
    /// Other pictures of the camera: their columns and rows, and frames per second.
    Mode((u32, u32), f64),
    /// Opens the source again.
    Retry,
    /// Sets a control of the camera.
    Control(String, i64),
    /// Takes a plate: a picture of what is behind the person, who is told when to step aside.
    TakePlate,
    /// Finds the person by a network.
    FindMe,
    /// Takes no way to depth now.
    DeclinePlate,
    /// Blurs what is not in focus, or nothing.
    Portrait(bool),
    /// Makes depth another way.
    DepthBy(Way),
    /// Looks again which sources and virtual cameras there are.
    Refresh,
    /// Puts the equivalent command on the clipboard.
    CopyCommand,
    /// Closes the window, or asks first.
    Close,
    /// Does not close it after all.
    StayOpen,
    /// What went wrong is known.
    Dismiss,
    /// That this is a demonstration is known.
    KnowDemonstration,
    /// Snapshots are saved with what is needed to make them again, or alone.
    KeepSources(bool),
}

/// What others have to do after an action.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    Look(Box<Look>),
    /// Save it under this name.
    SavePreset(String, Box<Look>),
    RenamePreset(String, String),
    DeletePreset(String),
    /// Save the frame that is shown, with all that is needed to make it again or alone.
    Snapshot,
    /// Show a folder.
    OpenFolder(PathBuf),
    /// Begin to write to an output. A recording without a name is to be given one.
    Begin(Output),
    End(Output),
    Open(String),
    /// Open it, if it can be a source.
    Offer(String),
    Browse(Browse),
    /// Open the camera again with pictures of this size and rate.
    Mode((u32, u32), f64),
    Control(String, i64),
    /// Take a plate, and use it.
    TakePlate,
    /// Make depth this way from now on.
    DepthBy(Way),
    /// Show the frame at this place of the recording.
    Seek(usize),
    /// Look which sources and virtual cameras there are.
    Refresh,
    /// Put the equivalent command on the clipboard.
    CopyCommand,
    /// Fill the screen, or not.
    FullScreen(bool),
    /// Let no picture pass, or let them again.
    Off(bool),
    Close,
}

/// What the session tells the window.
#[derive(Clone, Debug, PartialEq)]
pub enum Update {
    /// The source is another one now.
    Source(Source),
    /// What can be chosen.
    Choices {
        sources: Vec<Choice>,
        virtual_cameras: Vec<Choice>,
    },
    Presets(Vec<Preset>),
    Controls(Vec<Knob>),
    /// What else is known of the camera, before it runs.
    Camera(Camera),
    /// What somebody offered can be a source.
    Offered(String),
    /// Somebody chose what is to stand behind the subject.
    Behind(Behind),
    /// The outputs that are written to now: after each that was begun or ended, also where that failed.
    Outputs(Vec<Output>),
    /// Bytes of the recording so far.
    Recorded(u64),
    /// Something was saved in this folder.
    Kept(PathBuf),
    /// A line for the person.
    Note(String),
    /// A line that stays until it was read: an output failed.
    Trouble(String),
}
