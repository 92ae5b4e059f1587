//! Messages of the state machine: user actions, requests to the session, and its updates.

use std::path::PathBuf;

use super::{Camera, DepthMethod, Output, Source, ViewMode};
use crate::services::PathKind;
use bokehcam::depth::backdrop::Background;
use bokehcam::look::Look;
use bokehcam::look::presets::Preset;
use bokehcam_live::camera_control::CameraControl;
use bokehcam_live::source::devices::Choice;

/// A user action. Every control and key produces one of these.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Changes the look. Changes with the same `stroke` (one drag of one control) share one undo step.
    Look {
        look: Box<Look>,
        /// The control in use, or `None` for a single change.
        stroke: Option<&'static str>,
    },
    /// Ends the stroke: the control was released, and the next change starts a new undo step.
    EndStroke,
    /// Restores the previous look.
    Undo,
    Redo,
    /// Restores the initial look.
    Reset,
    /// Applies a preset.
    Preset(String),
    /// Saves the look as a preset.
    SavePreset(String),
    /// Renames a user preset from the first name to the second.
    RenamePreset(String, String),
    /// Deletes a user preset.
    DeletePreset(String),
    /// Changes the displayed view.
    Show(ViewMode),
    /// Shows the unblurred picture left of this fraction of the width; `None` turns that off.
    Split(Option<f32>),
    /// Switches mirroring of the window.
    Mirror(bool),
    /// Freezes or unfreezes the picture.
    Freeze(bool),
    /// Replaces the picture by a still card in the window and the outputs, and pauses the camera; or ends that.
    Off(bool),
    /// Sets the zoom factor (0: fit to the window) around a point of the picture, or its current centre.
    Zoom(u32, Option<[f32; 2]>),
    /// Centres this point of the zoomed picture.
    Pan([f32; 2]),
    /// Seeks to this frame of the recording.
    Seek(usize),
    /// Pauses and moves by this number of frames.
    Step(i32),
    /// Opens or closes the panel.
    Panel(bool),
    /// Shows only the picture, or everything again.
    HideControls(bool),
    /// Shows or hides the help.
    Help(bool),
    /// Switches full screen.
    FullScreen(bool),
    /// Sets the scale of text and controls; 1 is the default.
    TextScale(f32),
    /// Enables or disables key bindings without Ctrl.
    SingleKeys(bool),
    /// Switches the confirmation before closing while an output is active.
    AskBeforeClosing(bool),
    /// Unfolds or folds a section of the panel.
    Section(&'static str, bool),
    /// Shows a message.
    Note(String),
    /// Saves the displayed picture, with its inputs if [`Self::KeepSources`] is on.
    Snapshot,
    /// Starts or cancels a snapshot with self-timer.
    SelfTimer(bool),
    /// Opens the folder of the last saved file.
    OpenFolder,
    /// Starts or stops a recording.
    Record(bool),
    /// Switches to this virtual camera, or to none.
    VirtualCamera(Option<String>),
    Open(String),
    /// A file or folder was dropped on the window.
    Drop(String),
    /// Opens the dropped file that was asked about.
    OpenDropped,
    /// Puts the dropped file behind the subject.
    UseDroppedAsBackground,
    /// Forgets the dropped file.
    DismissDropped,
    /// Opens a file chooser for a source or a background.
    Browse(PathKind),
    /// Switches the camera's frame size (width, height) and rate (fps).
    Mode((u32, u32), f64),
    /// Reopens the source.
    Retry,
    /// Sets a driver control of the camera.
    Control(String, i64),
    /// Captures a background plate: the user is told when to step out of the picture.
    CapturePlate,
    /// Captures it although a person seems to be there.
    CapturePlateAnyway,
    /// Declines the offered depth methods.
    DeclineDepthOffer,
    /// Switches blur by depth on or off.
    Portrait(bool),
    /// Switches the depth method.
    SetDepthMethod(DepthMethod),
    /// Refreshes the lists of sources and virtual cameras.
    Refresh,
    /// Copies the equivalent command to the clipboard.
    CopyCommand,
    /// Closes the window, or opens the confirmation dialog.
    Close,
    /// Cancels closing.
    CancelClose,
    /// Dismisses the failure of an output.
    DismissFailure,
    /// Dismisses the notice about the demonstration.
    DismissDemonstration,
    /// Switches whether snapshots include their inputs.
    KeepSources(bool),
}

/// Side effects of an action, for the window or the session to carry out.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    Look(Box<Look>),
    /// Saves a preset under this name.
    SavePreset(String, Box<Look>),
    RenamePreset(String, String),
    DeletePreset(String),
    /// Saves the displayed picture.
    Snapshot,
    /// Opens a folder in the file manager.
    OpenFolder(PathBuf),
    /// Starts an output. A recording without a name gets one.
    StartOutput(Output),
    StopOutput(Output),
    Open(String),
    /// Opens this source if it is valid.
    Offer(String),
    Browse(PathKind),
    /// Reads this picture or video as the background.
    LoadBackground(String),
    /// Reopens the camera with this frame size (width, height) and rate (fps).
    Mode((u32, u32), f64),
    Control(String, i64),
    /// Captures a background plate, and uses it for depth.
    CapturePlate,
    /// Captures it although a person seems to be there.
    CapturePlateAnyway,
    /// Switches the depth method.
    SetDepthMethod(DepthMethod),
    /// Seeks to this frame of the recording.
    Seek(usize),
    /// Refreshes the lists of sources and virtual cameras.
    Refresh,
    /// Copies the equivalent command to the clipboard.
    CopyCommand,
    /// Switches full screen.
    FullScreen(bool),
    /// Withholds the picture from the outputs, or passes it again.
    Off(bool),
    Close,
}

/// Updates from the session to the window.
#[derive(Clone, Debug, PartialEq)]
pub enum Update {
    /// The source or its status changed.
    Source(Source),
    /// Available sources and virtual cameras.
    Choices {
        sources: Vec<Choice>,
        virtual_cameras: Vec<Choice>,
    },
    Presets(Vec<Preset>),
    Controls(Vec<CameraControl>),
    /// Properties of the camera, sent before it runs.
    Camera(Camera),
    /// An offered source is valid, and is to be opened.
    Offered(String),
    /// A camera came while the demonstration is shown for want of one.
    CameraFound(String),
    /// The user chose another background.
    Background(Background),
    /// Active outputs: sent after each start or stop, including failed ones.
    Outputs(Vec<Output>),
    /// Whether a program reads the virtual camera.
    Watched(bool),
    /// Bytes of the recording so far.
    RecordedBytes(u64),
    /// A file was saved in this folder.
    SavedIn(PathBuf),
    /// A message to the user.
    Note(String),
    /// Failure of an output: a message that stays until it is dismissed.
    OutputFailure(String),
}
