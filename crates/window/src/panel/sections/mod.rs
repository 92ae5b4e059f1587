//! The panel's sections, top to bottom.

mod aperture;
mod backdrop;
mod blur;
mod effect;
pub mod first;
mod focus;
mod framing;
mod looks;
mod output;
mod quality;
mod source;
mod view;

pub use aperture::Thumbnails;
pub use looks::PresetEditor;

use egui::{Key, Ui};

use super::state::{Action, State};
use super::widgets::{Number, add_button, add_choice, add_foldable_section, add_number, add_switch};
use bokehcam::look::{Effect, Look};

/// Data that the sections read and change while they are drawn.
pub struct PanelForm<'a> {
    /// The current state.
    pub state: &'a State,
    /// A copy of the look, which the controls change.
    pub look: Look,
    /// The control that changed it, if any.
    pub stroke: Option<&'static str>,
    /// Width and height of the picture, in pixels.
    pub size: (u32, u32),
    /// Collects actions other than look changes.
    pub actions: &'a mut Vec<Action>,
}

impl PanelForm<'_> {
    fn push_action(&mut self, action: Action) {
        self.actions.push(action);
    }

    /// Adds a number of the look, which `set` writes; its label is the undo stroke.
    fn add_number(&mut self, ui: &mut Ui, how: &Number<'static>, mut value: f32, set: impl FnOnce(&mut Look, f32)) {
        if add_number(ui, how, &mut value) {
            set(&mut self.look, value);
            self.stroke = Some(how.label);
        }
    }

    /// Adds radio buttons for a setting of the look, which `set` writes.
    fn add_choice<T: PartialEq + Copy>(
        &mut self,
        ui: &mut Ui,
        what: &'static str,
        options: &[(&str, &str, T)],
        chosen: T,
        set: impl FnOnce(&mut Look, T),
    ) {
        if let Some(option) = add_choice(ui, what, options, chosen, |_| true).filter(|option| *option != chosen) {
            set(&mut self.look, option);
            self.stroke = Some(what);
        }
    }

    /// Adds a switch; a click triggers `act` with the new state.
    fn add_switch(&mut self, ui: &mut Ui, label: &str, hint: &str, on: bool, act: impl FnOnce(bool) -> Action) {
        if add_switch(ui, label, hint, on) {
            self.push_action(act(!on));
        }
    }

    /// Adds a button that triggers `action`.
    fn add_button(&mut self, ui: &mut Ui, text: &str, hint: &str, action: Action) {
        if add_button(ui, text, hint) {
            self.push_action(action);
        }
    }

    /// Whether Esc cancels a dialog of the panel: no modal is open over it.
    fn is_cancelled(&self, ui: &Ui) -> bool {
        !self.state.help && !self.state.closing && ui.input(|input| input.key_pressed(Key::Escape))
    }

    fn has_depth(&self) -> bool {
        self.state.may_have_depth()
    }

    fn follows_depth(&self) -> bool {
        self.look.effect.follows_depth()
    }
}

/// Draws the sections that apply to the look and the source, in the order look, input and output, window.
pub fn show(ui: &mut Ui, form: &mut PanelForm, editing: &mut PresetEditor, thumbnails: &mut Thumbnails) {
    ui.add_space(4.0);
    looks::show(ui, form, editing);
    ui.add_space(2.0);
    effect::show(ui, form);
    if form.follows_depth() {
        add_section(ui, form, "Focus", true, focus::show);
    }
    // Sections without effect on the current look are omitted.
    let blurs = form.look.effect != Effect::None;
    if blurs {
        add_section(ui, form, "Blur", true, blur::show);
        add_section(ui, form, "Aperture", true, |ui, form| aperture::show(ui, form, thumbnails));
    }
    if form.follows_depth() {
        add_section(ui, form, "Background", false, backdrop::show);
    }
    add_section(ui, form, "Source", true, source::show);
    add_section(ui, form, "Record and call", true, output::show);
    add_section(ui, form, "View", true, |ui, form| {
        // It follows the subject by depth.
        if form.follows_depth() {
            framing::show(ui, form);
        }
        view::show(ui, form);
    });
    if !form.state.controls.is_empty() {
        add_section(ui, form, "Controls of the camera", false, source::add_controls);
    }
    add_section(ui, form, "For experts", false, |ui, form| {
        if blurs {
            quality::show(ui, form);
        }
        source::add_executor(ui, form);
    });
}

/// Draws a section, folded as the user left it; `open` is the default.
fn add_section(
    ui: &mut Ui,
    form: &mut PanelForm,
    name: &'static str,
    open: bool,
    body: impl FnOnce(&mut Ui, &mut PanelForm),
) {
    let open = form.state.preferences.sections.get(name).copied().unwrap_or(open);
    if add_foldable_section(ui, name, open, |ui| body(ui, form)) {
        form.push_action(Action::Section(name, !open));
    }
}
