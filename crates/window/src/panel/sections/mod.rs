//! The panel's sections, top to bottom.

mod aperture;
mod backdrop;
mod blur;
mod effect;
pub mod first;
mod focus;
mod looks;
mod output;
mod quality;
mod source;
mod view;

pub use aperture::Thumbs;
pub use looks::Editing;

use egui::{Key, Ui};

use super::parts::{Number, button, choose, number, section, switch};
use super::state::{Action, State};
use bokehcam::look::{Effect, Look};

/// What the sections read and change while they are drawn.
pub struct Sheet<'a> {
    /// The state as it is.
    pub state: &'a State,
    /// A copy of the look, which the controls change.
    pub look: Look,
    /// The control that changed it, if any.
    pub stroke: Option<&'static str>,
    /// Columns and rows of the picture.
    pub size: (u32, u32),
    /// What the person did other than change the look.
    pub actions: &'a mut Vec<Action>,
}

impl Sheet<'_> {
    /// Remembers that the control `stroke` changed the look, if it did.
    fn changed(&mut self, is: bool, stroke: &'static str) {
        if is {
            self.stroke = Some(stroke);
        }
    }

    fn act(&mut self, action: Action) {
        self.actions.push(action);
    }

    /// Draws a number of the look, which `set` changes; the number's name is the stroke.
    fn number(&mut self, ui: &mut Ui, how: &Number<'static>, mut value: f32, set: impl FnOnce(&mut Look, f32)) {
        if number(ui, how, &mut value) {
            set(&mut self.look, value);
            self.stroke = Some(how.label());
        }
    }

    /// Draws options of the look side by side; `set` takes the one that is chosen.
    fn choose<T: PartialEq + Copy>(
        &mut self,
        ui: &mut Ui,
        what: &'static str,
        options: &[(&str, &str, T)],
        chosen: T,
        set: impl FnOnce(&mut Look, T),
    ) {
        if let Some(option) = choose(ui, what, options, chosen, |_| true).filter(|option| *option != chosen) {
            set(&mut self.look, option);
            self.stroke = Some(what);
        }
    }

    /// Draws a switch, which the action of its new state changes.
    fn switch(&mut self, ui: &mut Ui, label: &str, hint: &str, on: bool, act: impl FnOnce(bool) -> Action) {
        if switch(ui, label, hint, on) {
            self.act(act(!on));
        }
    }

    /// Draws a button that does this.
    fn button(&mut self, ui: &mut Ui, text: &str, hint: &str, action: Action) {
        if button(ui, text, hint) {
            self.act(action);
        }
    }

    /// Whether Esc gives up what is asked here: nothing else is open over it.
    fn gives_up(&self, ui: &Ui) -> bool {
        !self.state.help && !self.state.closing && ui.input(|input| input.key_pressed(Key::Escape))
    }

    fn has_depth(&self) -> bool {
        self.state.may_have_depth()
    }

    /// Whether nothing of depth is known in metres.
    fn is_relative(&self) -> bool {
        self.state.known().is_relative
    }

    fn follows_depth(&self) -> bool {
        self.look.effect.follows_depth()
    }
}

/// Draws the sections that the look and the source call for: the look, what pictures come from and go to, the window.
pub fn show(ui: &mut Ui, sheet: &mut Sheet, editing: &mut Editing, thumbs: &mut Thumbs) {
    ui.add_space(4.0);
    looks::show(ui, sheet, editing);
    ui.add_space(2.0);
    effect::show(ui, sheet);
    if sheet.follows_depth() {
        part(ui, sheet, "Focus", true, focus::show);
    }
    let blurs = sheet.look.effect != Effect::None;
    if blurs {
        part(ui, sheet, "Blur", true, blur::show);
        part(ui, sheet, "Aperture", true, |ui, sheet| aperture::show(ui, sheet, thumbs));
    }
    if sheet.follows_depth() {
        part(ui, sheet, "Background", false, backdrop::show);
    }
    part(ui, sheet, "Source", true, source::show);
    part(ui, sheet, "Record and call", true, output::show);
    part(ui, sheet, "View", true, view::show);
    if !sheet.state.controls.is_empty() {
        part(ui, sheet, "Controls of the camera", false, source::controls);
    }
    part(ui, sheet, "For experts", false, |ui, sheet| {
        view::internals(ui, sheet);
        if blurs {
            quality::show(ui, sheet);
        }
        source::executor(ui, sheet);
    });
}

/// Draws a section: open or folded as the person left it, at first as `open` says.
fn part(ui: &mut Ui, sheet: &mut Sheet, name: &'static str, open: bool, body: impl FnOnce(&mut Ui, &mut Sheet)) {
    let open = sheet.state.habits.sections.get(name).copied().unwrap_or(open);
    if section(ui, name, open, |ui| body(ui, sheet)) {
        sheet.act(Action::Section(name, !open));
    }
}
