//! What the window shows and lets one change: a state, and the actions that change it.

use super::backstage::{Choice, Control, Preset};
use super::meters::Meters;
use crate::look::Look;

/// What of a frame is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shown {
    /// The picture.
    #[default]
    Picture,
    /// Its depth, in colours, with a legend in metres.
    Depth,
    /// Its circle of confusion.
    Coc,
    /// The bins that it is split into.
    Bins,
}

/// The source as it is now.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Source {
    /// It is being opened.
    #[default]
    Opening,
    /// Frames come.
    Running(Running),
    /// There are no frames any more, or never were: why. The last picture stays.
    Lost(String),
    /// It came to its end. The last picture stays.
    Ended,
}

/// A source whose frames come.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Running {
    /// What it calls itself.
    pub label: String,
    /// Width and height of its pictures.
    pub size: (u32, u32),
    /// Time from frame to frame.
    pub period_ns: u64,
    /// Whether its frames have depth.
    pub has_depth: bool,
    /// What blurs them.
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

/// All that the window shows, but the picture itself.
#[derive(Clone, Debug)]
pub struct State {
    /// The look as it was chosen.
    pub look: Look,
    /// What `reset` goes back to.
    pub first_look: Look,
    /// What the source is called on the command line.
    pub source_name: String,
    /// The source.
    pub source: Source,
    /// The sources that can be chosen.
    pub sources: Vec<Choice>,
    /// The virtual cameras that can be chosen.
    pub virtual_cameras: Vec<Choice>,
    /// The camera's controls.
    pub controls: Vec<Control>,
    /// The presets.
    pub presets: Vec<Preset>,
    /// Where pictures go besides the window.
    pub outputs: Vec<Output>,
    /// What of a frame is shown.
    pub shown: Shown,
    /// Whether the window shows pictures as a mirror does.
    pub mirror: bool,
    /// Whether the window keeps the picture it has.
    pub frozen: bool,
    /// Left of this fraction of the picture's width, it is shown as it was before the blur.
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
    /// Distance of the focal plane in the last frame, in metres.
    pub focus_m: Option<f32>,
    /// Lines for the person, the newest last.
    pub notes: Vec<String>,
    /// What was measured.
    pub meters: Meters,
}

/// What a person can do. Every control and key is one of these.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Another look. Looks of the same `stroke` (one drag of one control) are undone together.
    Look {
        /// The look.
        look: Box<Look>,
        /// The control in hand, or `None` for a single change.
        stroke: Option<&'static str>,
    },
    /// Back to the look before.
    Undo,
    /// And forth again.
    Redo,
    /// Back to the look at the start.
    Reset,
    /// The look of a preset.
    Preset(String),
    /// Saves the look as a preset.
    SavePreset(String),
    /// Shows something else of the frames.
    Show(Shown),
    /// Shows what was before the blur left of this fraction, or nowhere.
    Split(Option<f32>),
    /// Mirrors the window, or not.
    Mirror(bool),
    /// Keeps the picture, or lets the next ones come.
    Freeze(bool),
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
    /// Saves what is shown, and what is needed to make it again.
    Snapshot,
    /// Begins a recording (video), or ends it.
    Record(bool),
    /// Writes to this virtual camera, or to none.
    VirtualCamera(Option<String>),
    /// Opens another source.
    Open(String),
    /// Opens the source again.
    Retry,
    /// Sets a control of the camera.
    Control(String, i64),
    /// Looks again which sources and virtual cameras there are.
    Refresh,
    /// Puts the equivalent command on the clipboard.
    CopyCommand,
    /// Closes the window.
    Close,
}

/// What others have to do after an action.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// The look changed.
    Look(Box<Look>),
    /// Save it under this name.
    SavePreset(String, Box<Look>),
    /// Save the frame that is shown.
    Snapshot,
    /// Begin to write to an output.
    Begin(Output),
    /// Complete an output.
    End(Output),
    /// Open a source.
    Open(String),
    /// Set a control.
    Control(String, i64),
    /// Look which sources and virtual cameras there are.
    Refresh,
    /// Put the equivalent command on the clipboard.
    CopyCommand,
    /// Fill the screen, or not.
    FullScreen(bool),
    /// Close the window.
    Close,
}

/// What the session tells the window.
#[derive(Clone, Debug, PartialEq)]
pub enum Told {
    /// The source is another one now.
    Source(Source),
    /// What can be chosen.
    Choices {
        /// Sources.
        sources: Vec<Choice>,
        /// Virtual cameras.
        virtual_cameras: Vec<Choice>,
    },
    /// The presets.
    Presets(Vec<Preset>),
    /// The camera's controls.
    Controls(Vec<Control>),
    /// The outputs that are written to now.
    Outputs(Vec<Output>),
    /// A line for the person.
    Note(String),
}
