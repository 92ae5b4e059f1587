//! Applies actions to the state.

use super::{Action, Output, Request, Source, State, ViewMode};
use bokehcam::look::{Change, Effect, Look, LookError, Strength};

/// Shown when a look or a view needs depth and the source has none.
pub const NO_DEPTH: &str = "Nothing is known about depth here: use a small network or a picture of the empty room.";
/// Shown instead for a photo.
pub const NO_DEPTH_OF_PHOTO: &str =
    "This photo has no depth. Install a network (`bokehcam models get`), or put a depth map beside it: NAME-depth.png.";
/// Shown instead if the command line declined the source's depth.
const DEPTH_DECLINED: &str = "The depth of this source is off by `--depth none`. “Depth from” under More uses it.";
/// Shown when the depth view is requested while depth is not computed.
const DEPTH_NOT_COMPUTED: &str = "Depth is only computed while the blur uses it: switch Portrait on first.";
/// Shown when a background plate is requested but the source is not a camera.
pub const NO_PLATE: &str = "Open a camera first: a plate needs a camera that does not move.";
/// Shown when a look needs metric depth but the depth is relative.
pub const NO_METRES: &str = "Distances in metres are unknown here: the subject is in focus, and the blur is set as an \
                             amount.";
/// Shown when the window is frozen while an output is active.
pub const OUTPUTS_CONTINUE: &str =
    "Only this window is frozen. Recordings and calls go on live, in every look that you choose here.";
/// Shown when there is no virtual camera.
pub const NO_VIRTUAL_CAMERA: &str = "No camera for calls is set up yet: `bokehcam doctor` says how.";

impl State {
    /// Applies an action. Returns the requests that the window or the session must carry out.
    pub fn apply(&mut self, action: Action) -> Vec<Request> {
        match action {
            Action::Look { look, stroke } => return self.set_look(*look, stroke),
            Action::EndStroke => self.history.end_stroke(),
            Action::Undo => {
                let before = self.history.undo(&self.look);
                return self.replace_look(before);
            }
            Action::Redo => {
                let after = self.history.redo(&self.look);
                return self.replace_look(after);
            }
            Action::Reset => return self.set_look(self.first_look.clone(), None),
            Action::Preset(name) => return self.apply_preset(&name),
            Action::SavePreset(name) => match name.trim() {
                "" => self.note("A preset needs a name."),
                name => {
                    self.chosen_preset = Some(name.to_owned());
                    return vec![Request::SavePreset(name.to_owned(), Box::new(self.look.clone()))];
                }
            },
            Action::RenamePreset(name, new) => return vec![Request::RenamePreset(name, new)],
            Action::DeletePreset(name) => return vec![Request::DeletePreset(name)],
            // Views without data are refused, with a note that explains why.
            Action::Show(ViewMode::Depth) if !self.may_have_depth() => self.note(self.no_depth_advice()),
            Action::Show(ViewMode::Depth) if !self.look.effect.follows_depth() => self.note(DEPTH_NOT_COMPUTED),
            Action::Show(shown) => self.shown = shown,
            Action::Split(at) => self.split = at.filter(|at| at.is_finite()).map(|at| at.clamp(0.0, 1.0)),
            Action::Mirror(on) => (self.mirror, self.mirror_chosen) = (on, true),
            Action::Freeze(on) => self.set_frozen(on),
            Action::Off(off) => {
                self.off = off;
                return vec![Request::Off(off)];
            }
            Action::Zoom(factor, at) => self.set_zoom(factor, at),
            Action::Pan(center) => self.zoom.center = center,
            Action::Seek(frame) => return self.seek(frame),
            Action::Step(by) => return self.step_frames(by),
            Action::Panel(on) => self.panel = on,
            Action::HideControls(on) => self.controls_hidden = on,
            Action::Help(on) => self.help = on,
            Action::TextScale(scale) => self.preferences.set_text_scale(scale),
            Action::SingleKeys(on) => self.preferences.single_keys = on,
            Action::AskBeforeClosing(on) => self.preferences.ask_before_closing = on,
            Action::Section(name, open) => drop(self.preferences.sections.insert(name.to_owned(), open)),
            Action::Note(line) => self.note(line),
            Action::FullScreen(on) => {
                self.full_screen = on;
                return vec![Request::FullScreen(on)];
            }
            Action::Snapshot => return vec![Request::Snapshot],
            Action::SelfTimer(on) => self.self_timer = on,
            Action::OpenFolder => return self.saved_in.clone().map(Request::OpenFolder).into_iter().collect(),
            Action::Record(on) => return self.set_recording(on),
            Action::VirtualCamera(name) => return self.set_virtual_camera(name),
            Action::Open(name) => return self.choose_source(name),
            Action::Drop(name) => return self.drop_file(name),
            Action::OpenDropped => {
                return self.take_dropped().map_or_else(Vec::new, |name| self.choose_source(name));
            }
            Action::UseDroppedAsBackground => {
                return self.take_dropped().map(Request::LoadBackground).into_iter().collect();
            }
            Action::DismissDropped => self.dropped = None,
            Action::Browse(what) => return vec![Request::Browse(what)],
            Action::Mode(size, fps) => return self.set_camera_mode(size, fps),
            Action::Retry => return self.open_source(self.source_name.clone()),
            Action::Control(name, value) => return self.set_camera_control(name, value),
            Action::CapturePlate if self.can_capture_plate() => {
                self.depth_offer_declined = false;
                return vec![Request::CapturePlate];
            }
            Action::CapturePlate => self.note(NO_PLATE),
            Action::CapturePlateAnyway => return vec![Request::CapturePlateAnyway],
            Action::DeclineDepthOffer => self.depth_offer_declined = true,
            Action::SetDepthMethod(depth_method) => return vec![Request::SetDepthMethod(depth_method)],
            Action::Portrait(on) => return self.set_portrait(on),
            Action::Refresh => return vec![Request::Refresh],
            Action::CopyCommand => return vec![Request::CopyCommand],
            Action::Close => return self.request_close(),
            Action::CancelClose => self.closing = false,
            Action::DismissFailure => self.output_failure = None,
            Action::DismissDemonstration => self.demonstration_dismissed = true,
            Action::KeepSources(on) => self.preferences.keep_sources = on,
        }
        Vec::new()
    }

    /// Closes the window. The first call only opens the confirmation dialog if an output is active.
    fn request_close(&mut self) -> Vec<Request> {
        let asks = self.preferences.ask_before_closing && !self.outputs.is_empty() && !self.closing;
        self.closing = asks;
        if asks { Vec::new() } else { vec![Request::Close] }
    }

    /// Freezes or unfreezes the picture, with a note that active outputs continue.
    fn set_frozen(&mut self, on: bool) {
        if on && !self.frozen && !self.outputs.is_empty() {
            self.note(OUTPUTS_CONTINUE);
        }
        if !on {
            self.withdraw_note(OUTPUTS_CONTINUE);
        }
        self.frozen = on;
    }

    /// Returns advice for a source without depth.
    pub fn no_depth_advice(&self) -> &'static str {
        match (self.is_photo(), self.has_declined_depth()) {
            (_, true) => DEPTH_DECLINED,
            (true, false) => NO_DEPTH_OF_PHOTO,
            (false, false) => NO_DEPTH,
        }
    }

    /// Switches blur by depth on or off. If there is no depth, offers the methods to get it.
    fn set_portrait(&mut self, on: bool) -> Vec<Request> {
        if on && !self.may_have_depth() {
            self.depth_offer_declined = false;
            self.note(self.no_depth_advice());
            return Vec::new();
        }
        let effect = if on { Effect::Auto } else { Effect::None };
        self.set_look(Look { effect, ..self.look.clone() }, None)
    }

    /// Changes the look as far as the source supports it, with an undo step.
    pub(super) fn set_look(&mut self, look: Look, stroke: Option<&'static str>) -> Vec<Request> {
        let look = self.adapt_look(look);
        if look == self.look {
            return Vec::new();
        }
        self.history.push(&self.look, stroke);
        self.replace_look(Some(look))
    }

    /// Changes the look without an undo step. An effect without depth also drops lens parameters and the depth view.
    fn replace_look(&mut self, look: Option<Look>) -> Vec<Request> {
        let Some(look) = look else { return Vec::new() };
        let mut look = self.adapt_look(look);
        if self.look.effect.follows_depth() && !look.effect.follows_depth() {
            // A lens needs distances, and the depth view needs depth.
            if matches!(look.strength, Strength::Lens(_)) {
                look.strength = Strength::Default;
            }
            if self.shown == ViewMode::Depth {
                self.shown = ViewMode::Picture;
            }
        }
        self.look = look;
        vec![Request::Look(Box::new(self.look.clone()))]
    }

    fn apply_preset(&mut self, name: &str) -> Vec<Request> {
        let Some(preset) = self.presets.iter().find(|preset| preset.name == name) else {
            self.note(format!("There is no preset '{name}'."));
            return Vec::new();
        };
        match self.look.change(&Change::to_preset(preset.patch.clone()), &self.look_facts()) {
            Ok((look, left_out)) => {
                self.chosen_preset = Some(name.to_owned());
                if left_out.is_some() {
                    self.note(NO_METRES);
                }
                self.set_look(look, None)
            }
            Err(LookError::NoDepth { .. }) => {
                self.note(self.no_depth_advice());
                Vec::new()
            }
            Err(error) => {
                self.note(format!("preset {name}: {error}"));
                Vec::new()
            }
        }
    }

    fn set_recording(&mut self, on: bool) -> Vec<Request> {
        match (on, self.recording().cloned()) {
            (true, None) => self.start_output(Output { name: String::new(), is_camera: false }),
            (false, Some(output)) => self.stop_output(output),
            (true, Some(_)) | (false, None) => Vec::new(),
        }
    }

    /// Switches to another virtual camera, or stops the active one with `None`.
    fn set_virtual_camera(&mut self, name: Option<String>) -> Vec<Request> {
        let current = self.virtual_camera().cloned();
        if current.as_ref().map(|output| &output.name) == name.as_ref() {
            // No camera was active, so the request was to start one although none exists.
            if name.is_none() {
                self.note(NO_VIRTUAL_CAMERA);
            }
            return Vec::new();
        }
        let mut requests: Vec<_> = current.into_iter().flat_map(|output| self.stop_output(output)).collect();
        requests.extend(name.into_iter().flat_map(|name| self.start_output(Output { name, is_camera: true })));
        requests
    }

    /// Requests an output. It is listed immediately, so that it cannot start twice; the session reports the outcome.
    fn start_output(&mut self, output: Output) -> Vec<Request> {
        self.outputs.push(output.clone());
        vec![Request::StartOutput(output)]
    }

    fn stop_output(&mut self, output: Output) -> Vec<Request> {
        self.outputs.retain(|other| *other != output);
        vec![Request::StopOutput(output)]
    }

    /// Requests a source, and clears the state of the previous one.
    pub(super) fn open_source(&mut self, name: String) -> Vec<Request> {
        if name != self.source_name {
            self.controls.clear();
            self.source_name.clone_from(&name);
        }
        self.source = Source::Opening;
        self.dropped = None;
        (self.frozen, self.shows_final_photo, self.transport) = (false, false, None);
        self.focus_m = None;
        vec![Request::Open(name)]
    }

    fn set_camera_control(&mut self, name: String, value: i64) -> Vec<Request> {
        let Some(control) = self.controls.iter_mut().find(|control| control.name == name && control.is_active) else {
            return Vec::new();
        };
        let (min, max, _) = control.range;
        // Not `clamp`, which panics if a driver reports an inverted range.
        let value = value.min(max).max(min);
        if std::mem::replace(&mut control.value, value) == value {
            return Vec::new();
        }
        vec![Request::Control(name, value)]
    }
}
