//! What an action makes of the state.

use super::{Action, Output, Request, Shown, Source, State, TEXT_SCALES};
use crate::look::{Effect, Look, Strength};

/// What is missing where a look or a view needs depth; also what to do.
pub const NO_DEPTH: &str =
    "This source has no depth. A second camera beside it, a depth camera or a recording with depth gives it.";
/// Why depth is not shown: nobody makes it.
pub const NOT_FOLLOWED: &str = "Depth is made only while the blur follows it: choose Depth as the effect first.";
/// What is missing where there is no virtual camera.
pub const NO_VIRTUAL_CAMERA: &str = "There is no virtual camera yet: `bokehcam doctor` says how to make one.";

impl State {
    /// Does what the person did; gives back what only others can bring about.
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
                name => return vec![Request::SavePreset(name.to_owned(), Box::new(self.look.clone()))],
            },
            Action::Show(Shown::Depth) if !self.may_have_depth() => self.note(NO_DEPTH),
            Action::Show(Shown::Depth) if !self.look.effect.follows_depth() => self.note(NOT_FOLLOWED),
            Action::Show(shown) => self.shown = shown,
            Action::Split(at) => self.split = at.filter(|at| at.is_finite()).map(|at| at.clamp(0.0, 1.0)),
            Action::Mirror(on) => self.mirror = on,
            Action::Freeze(on) => self.frozen = on,
            Action::Panel(on) => self.panel = on,
            Action::Instruments(on) => self.instruments = on,
            Action::Bare(on) => self.bare = on,
            Action::Help(on) => self.help = on,
            Action::TextScale(scale) if scale.is_finite() => {
                self.text_scale = scale.clamp(*TEXT_SCALES.start(), *TEXT_SCALES.end());
            }
            Action::TextScale(_) => {}
            Action::FullScreen(on) => {
                self.full_screen = on;
                return vec![Request::FullScreen(on)];
            }
            Action::Snapshot => return vec![Request::Snapshot],
            Action::Record(on) => return self.record(on),
            Action::VirtualCamera(name) => return self.write_to(name),
            Action::Open(name) => return self.open(name),
            Action::Retry => return self.open(self.source_name.clone()),
            Action::Control(name, value) => return self.set_control(name, value),
            Action::Refresh => return vec![Request::Refresh],
            Action::CopyCommand => return vec![Request::CopyCommand],
            Action::Close => return vec![Request::Close],
            Action::Dismiss => self.trouble = None,
        }
        Vec::new()
    }

    fn set_look(&mut self, look: Look, stroke: Option<&'static str>) -> Vec<Request> {
        let look = self.fitting(look);
        if look == self.look {
            return Vec::new();
        }
        self.history.keep(&self.look, stroke);
        self.go_to(Some(look))
    }

    fn go_to(&mut self, look: Option<Look>) -> Vec<Request> {
        let Some(look) = look else { return Vec::new() };
        let mut look = self.fitting(look);
        if self.look.effect.follows_depth() && !look.effect.follows_depth() {
            // Without depth a lens would need a distance, and there is no depth to be seen.
            if matches!(look.strength, Strength::Lens(_)) {
                look.strength = Strength::Default;
            }
            if self.shown == Shown::Depth {
                self.shown = Shown::Picture;
            }
        }
        self.look = look;
        vec![Request::Look(Box::new(self.look.clone()))]
    }

    fn set_preset(&mut self, name: &str) -> Vec<Request> {
        let Some(preset) = self.presets.iter().find(|preset| preset.name == name) else {
            self.note(format!("There is no preset '{name}'."));
            return Vec::new();
        };
        if preset.patch.effect.is_some_and(Effect::follows_depth) && !self.may_have_depth() {
            self.note(NO_DEPTH);
            return Vec::new();
        }
        match preset.patch.on(&self.look) {
            Ok(look) => self.set_look(look, None),
            Err(error) => {
                let line = format!("preset {name}: {error}");
                self.note(line);
                Vec::new()
            }
        }
    }

    fn record(&mut self, on: bool) -> Vec<Request> {
        match (on, self.recording().cloned()) {
            (true, None) => self.begin(Output { name: String::new(), is_camera: false }),
            (false, Some(output)) => self.end(output),
            (true, Some(_)) | (false, None) => Vec::new(),
        }
    }

    fn write_to(&mut self, name: Option<String>) -> Vec<Request> {
        let current = self.virtual_camera().cloned();
        if current.as_ref().map(|output| &output.name) == name.as_ref() {
            if name.is_none() {
                self.note(NO_VIRTUAL_CAMERA);
            }
            return Vec::new();
        }
        let mut effects: Vec<_> = current.into_iter().flat_map(|output| self.end(output)).collect();
        effects.extend(name.into_iter().flat_map(|name| self.begin(Output { name, is_camera: true })));
        effects
    }

    /// It counts as written to from now on, so that nothing begins it twice; what becomes of it, others tell.
    fn begin(&mut self, output: Output) -> Vec<Request> {
        self.outputs.push(output.clone());
        vec![Request::Begin(output)]
    }

    fn end(&mut self, output: Output) -> Vec<Request> {
        self.outputs.retain(|other| *other != output);
        vec![Request::End(output)]
    }

    fn open(&mut self, name: String) -> Vec<Request> {
        if name != self.source_name {
            self.controls.clear();
            self.source_name.clone_from(&name);
        }
        self.source = Source::Opening;
        self.frozen = false;
        self.focus_m = None;
        vec![Request::Open(name)]
    }

    fn set_control(&mut self, name: String, value: i64) -> Vec<Request> {
        let Some(control) = self.controls.iter_mut().find(|control| control.name == name && control.active) else {
            return Vec::new();
        };
        let (least, most, _) = control.range;
        let value = value.min(most).max(least);
        if std::mem::replace(&mut control.value, value) == value {
            return Vec::new();
        }
        vec![Request::Control(name, value)]
    }
}
