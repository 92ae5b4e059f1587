//! How actions change the state.

use super::{Action, Output, Request, Shown, Source, State, Way};
use bokehcam::depth::focus::FocusRule;
use bokehcam::look::{Effect, Look, Patch, Strength};

/// Shown when a look or a view needs depth and there is none: what to do.
pub const NO_DEPTH: &str = "Who is near is not known here: a small network or a picture of the empty room tells.";
/// The same for a photo.
pub const NO_DEPTH_OF_PHOTO: &str =
    "This photo has no depth. A network gives it (`bokehcam models get`), or a depth map beside it: NAME-depth.png.";
/// The same where it was declined on the command line.
pub const DECLINED: &str = "This source has depth that `--depth none` declines. “Depth from” under More uses it.";
/// Shown when depth is to be viewed while it is not computed.
pub const NOT_FOLLOWED: &str = "Depth is made only while the blur follows it: switch Portrait on first.";
/// Shown when what the blur is made of is to be viewed while there is none.
pub const NOT_BLURRED: &str = "Nothing is blurred: there is nothing to show of it.";
/// Shown when a plate is to be taken of what is no camera.
pub const NO_PLATE: &str = "Open a camera first: a plate needs one that stands still.";
/// Shown when a look needs metres that relative depth has not.
pub const NO_METRES: &str = "Nothing is known in metres here: the subject is in focus, and blur is given as an amount.";
/// Shown when the picture is frozen while something is written.
pub const GOES_ON: &str =
    "Only this window is frozen. What is recorded or sent goes on live, and in every look that you choose here.";
/// Shown when there is no virtual camera.
pub const NO_VIRTUAL_CAMERA: &str = "No camera for calls is set up yet: `bokehcam doctor` says how.";

impl State {
    /// Applies an action; gives back what the window or the session has to do for it.
    pub fn apply(&mut self, action: Action) -> Vec<Request> {
        match action {
            Action::Look { look, stroke } => return self.set_look(*look, stroke),
            Action::Settle => self.history.settle(),
            Action::Undo => {
                let before = self.history.undo(&self.look);
                return self.go_to(before);
            }
            Action::Redo => {
                let after = self.history.redo(&self.look);
                return self.go_to(after);
            }
            Action::Reset => return self.set_look(self.first_look.clone(), None),
            Action::Preset(name) => return self.set_preset(&name),
            Action::SavePreset(name) => match name.trim() {
                "" => self.note("A preset needs a name."),
                name => {
                    self.chosen_preset = Some(name.to_owned());
                    return vec![Request::SavePreset(name.to_owned(), Box::new(self.look.clone()))];
                }
            },
            Action::RenamePreset(name, new) => return vec![Request::RenamePreset(name, new)],
            Action::DeletePreset(name) => return vec![Request::DeletePreset(name)],
            Action::Show(Shown::Depth) if !self.may_have_depth() => self.note(self.no_depth()),
            Action::Show(Shown::Depth) if !self.look.effect.follows_depth() => self.note(NOT_FOLLOWED),
            Action::Show(Shown::Coc | Shown::Bins) if self.look.effect == Effect::None => self.note(NOT_BLURRED),
            Action::Show(shown) => self.shown = shown,
            Action::Split(at) => self.split = at.filter(|at| at.is_finite()).map(|at| at.clamp(0.0, 1.0)),
            Action::Mirror(on) => (self.mirror, self.mirror_chosen) = (on, true),
            Action::Freeze(on) => self.freeze(on),
            Action::Off(off) => {
                self.off = off;
                return vec![Request::Off(off)];
            }
            Action::Zoom(factor, at) => self.set_zoom(factor, at),
            Action::Pan(center) => self.zoom.center = center,
            Action::Seek(place) => return self.seek(place),
            Action::Step(by) => return self.step(by),
            Action::Panel(on) => self.panel = on,
            Action::Instruments(on) => self.instruments = on,
            Action::Bare(on) => self.bare = on,
            Action::Help(on) => self.help = on,
            Action::TextScale(scale) => self.habits.set_text_scale(scale),
            Action::SingleKeys(on) => self.habits.single_keys = on,
            Action::AskBeforeClosing(on) => self.habits.ask_before_closing = on,
            Action::Section(name, open) => drop(self.habits.sections.insert(name.to_owned(), open)),
            Action::Note(line) => self.note(line),
            Action::FullScreen(on) => {
                self.full_screen = on;
                return vec![Request::FullScreen(on)];
            }
            Action::Snapshot => return vec![Request::Snapshot],
            Action::SelfTimer(on) => self.self_timer = on,
            Action::OpenFolder => return self.kept_in.clone().map(Request::OpenFolder).into_iter().collect(),
            Action::Record(on) => return self.record(on),
            Action::VirtualCamera(name) => return self.set_virtual_camera(name),
            Action::Open(name) => return self.open(name),
            Action::Browse(what) => return vec![Request::Browse(what)],
            Action::Mode(size, fps) => return self.set_mode(size, fps),
            Action::Retry => return self.open(self.source_name.clone()),
            Action::Control(name, value) => return self.set_control(name, value),
            Action::TakePlate if self.takes_plates() => {
                self.declined_plate = false;
                return vec![Request::TakePlate];
            }
            Action::TakePlate => self.note(NO_PLATE),
            Action::DeclinePlate => self.declined_plate = true,
            Action::FindMe => return vec![Request::DepthBy(Way::Person)],
            Action::DepthBy(way) => return vec![Request::DepthBy(way)],
            Action::Portrait(on) => return self.set_portrait(on),
            Action::Refresh => return vec![Request::Refresh],
            Action::CopyCommand => return vec![Request::CopyCommand],
            Action::Close => return self.close(),
            Action::StayOpen => self.closing = false,
            Action::Dismiss => self.trouble = None,
            Action::KnowDemonstration => self.knows_demonstration = true,
            Action::KeepSources(on) => self.habits.keep_sources = on,
        }
        Vec::new()
    }

    /// Closes the window; asks first, but only once, where something is recorded or calls may have the picture.
    fn close(&mut self) -> Vec<Request> {
        let asks = self.habits.ask_before_closing && !self.outputs.is_empty() && !self.closing;
        self.closing = asks;
        if asks { Vec::new() } else { vec![Request::Close] }
    }

    /// Keeps the picture, and says what goes out meanwhile.
    fn freeze(&mut self, on: bool) {
        if on && !self.frozen && !self.outputs.is_empty() {
            self.note(GOES_ON);
        }
        self.frozen = on;
    }

    /// What to do where depth is needed and there is none.
    pub fn no_depth(&self) -> &'static str {
        match (self.is_photo(), self.declines_own()) {
            (_, true) => DECLINED,
            (true, false) => NO_DEPTH_OF_PHOTO,
            (false, false) => NO_DEPTH,
        }
    }

    /// Blurs what is not in focus, or nothing. Without depth, the ways to it are offered.
    fn set_portrait(&mut self, on: bool) -> Vec<Request> {
        if on && !self.may_have_depth() {
            self.declined_plate = false;
            self.note(self.no_depth());
            return Vec::new();
        }
        let effect = if on { Effect::Auto } else { Effect::None };
        self.set_look(Look { effect, ..self.look.clone() }, None)
    }

    /// Changes the look as far as the source allows it; the one before can be undone.
    pub(super) fn set_look(&mut self, look: Look, stroke: Option<&'static str>) -> Vec<Request> {
        let look = self.fitting(look);
        if look == self.look {
            return Vec::new();
        }
        self.history.keep(&self.look, stroke);
        self.go_to(Some(look))
    }

    /// Changes the look without remembering the one before. With an effect that needs no depth, a lens and the depth
    /// view are given up.
    fn go_to(&mut self, look: Option<Look>) -> Vec<Request> {
        let Some(look) = look else { return Vec::new() };
        let mut look = self.fitting(look);
        if self.look.effect.follows_depth() && !look.effect.follows_depth() {
            // Without depth there are no distances that a lens needs, and no depth to view.
            if matches!(look.strength, Strength::Lens(_)) {
                look.strength = Strength::Default;
            }
            if self.shown == Shown::Depth {
                self.shown = Shown::Picture;
            }
        }
        if look.effect == Effect::None && matches!(self.shown, Shown::Coc | Shown::Bins) {
            self.shown = Shown::Picture;
        }
        self.look = look;
        vec![Request::Look(Box::new(self.look.clone()))]
    }

    fn set_preset(&mut self, name: &str) -> Vec<Request> {
        let Some(preset) = self.presets.iter().find(|preset| preset.name == name) else {
            self.note(format!("There is no preset '{name}'."));
            return Vec::new();
        };
        match self.patched(&preset.patch) {
            Ok(look) => {
                self.chosen_preset = Some(name.to_owned());
                self.set_look(look, None)
            }
            Err(line) => {
                let line = if line == self.no_depth() { line } else { format!("preset {name}: {line}") };
                self.note(line);
                Vec::new()
            }
        }
    }

    /// The look after a change.
    ///
    /// # Errors
    /// It needs depth that there is not, or settings that do not go together: one line.
    pub fn patched(&self, patch: &Patch) -> Result<Look, String> {
        if patch.effect.is_some_and(Effect::follows_depth) && !self.may_have_depth() {
            return Err(self.no_depth().to_owned());
        }
        let look = patch.on(&self.look).map_err(|error| error.to_string())?;
        let is_lens = |look: &Look| matches!(look.strength, Strength::Lens(_));
        let asks = matches!(patch.focus, Some(FocusRule::Metres(_)))
            || patch.focus_range_m.is_some_and(|range_m| range_m > 0.0)
            || is_lens(&look) && !is_lens(&self.look);
        // Of a whole look, such as a preset, what needs metres is left out.
        let is_one_change = patch.effect.is_none();
        match self.known().is_relative && look.effect.follows_depth() && is_one_change && asks {
            true => Err(NO_METRES.to_owned()),
            false => Ok(look),
        }
    }

    fn record(&mut self, on: bool) -> Vec<Request> {
        match (on, self.recording().cloned()) {
            (true, None) => self.begin(Output { name: String::new(), is_camera: false }),
            (false, Some(output)) => self.end(output),
            (true, Some(_)) | (false, None) => Vec::new(),
        }
    }

    /// Changes the virtual camera that is written to, or ends it with `None`.
    fn set_virtual_camera(&mut self, name: Option<String>) -> Vec<Request> {
        let current = self.virtual_camera().cloned();
        if current.as_ref().map(|output| &output.name) == name.as_ref() {
            // With nothing to end, this came of a wish to start the first camera of none.
            if name.is_none() {
                self.note(NO_VIRTUAL_CAMERA);
            }
            return Vec::new();
        }
        let mut requests: Vec<_> = current.into_iter().flat_map(|output| self.end(output)).collect();
        requests.extend(name.into_iter().flat_map(|name| self.begin(Output { name, is_camera: true })));
        requests
    }

    /// Asks for an output. It is listed at once, so that it is not begun twice; the session reports what became of it.
    fn begin(&mut self, output: Output) -> Vec<Request> {
        self.outputs.push(output.clone());
        vec![Request::Begin(output)]
    }

    fn end(&mut self, output: Output) -> Vec<Request> {
        self.outputs.retain(|other| *other != output);
        vec![Request::End(output)]
    }

    /// Asks for a source, and forgets what was known of the one before.
    pub(super) fn open(&mut self, name: String) -> Vec<Request> {
        if name != self.source_name {
            self.controls.clear();
            self.source_name.clone_from(&name);
        }
        self.source = Source::Opening;
        (self.frozen, self.settled, self.transport) = (false, false, None);
        self.focus_m = None;
        vec![Request::Open(name)]
    }

    fn set_control(&mut self, name: String, value: i64) -> Vec<Request> {
        let Some(control) = self.controls.iter_mut().find(|control| control.name == name && control.active) else {
            return Vec::new();
        };
        let (least, most, _) = control.range;
        // Not `clamp`, which panics if a driver gives a range upside down.
        let value = value.min(most).max(least);
        if std::mem::replace(&mut control.value, value) == value {
            return Vec::new();
        }
        vec![Request::Control(name, value)]
    }
}
