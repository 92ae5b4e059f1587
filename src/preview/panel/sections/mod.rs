//! The panel's sections, top to bottom.

mod aperture;
mod blur;
mod effect;
mod focus;
mod looks;
mod output;
mod quality;
mod source;
mod view;

pub use aperture::Thumbs;
pub use looks::Saving;

use egui::Ui;

use super::parts::section;
use super::state::{Action, State};
use crate::look::Look;

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

    fn has_depth(&self) -> bool {
        self.state.may_have_depth()
    }

    fn follows_depth(&self) -> bool {
        self.look.effect.follows_depth()
    }
}

/// Draws the sections that the look and the source call for.
pub fn show(ui: &mut Ui, sheet: &mut Sheet, saving: &mut Saving, thumbs: &mut Thumbs) {
    looks::show(ui, sheet, saving);
    ui.add_space(2.0);
    effect::show(ui, sheet);
    if sheet.follows_depth() {
        section(ui, "Focus", true, |ui| focus::show(ui, sheet));
    }
    if sheet.look.effect != crate::look::Effect::None {
        section(ui, "Blur", true, |ui| blur::show(ui, sheet));
        section(ui, "Aperture", true, |ui| aperture::show(ui, sheet, thumbs));
        section(ui, "Quality", false, |ui| quality::show(ui, sheet));
    }
    section(ui, "View", true, |ui| view::show(ui, sheet));
    section(ui, "Source", true, |ui| source::show(ui, sheet));
    if !sheet.state.controls.is_empty() {
        section(ui, "Camera", false, |ui| source::controls(ui, sheet));
    }
    section(ui, "Keep", true, |ui| output::show(ui, sheet));
}
