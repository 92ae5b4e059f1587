//! The controls, as egui draws them.

use super::present::Area;
use super::state::{Action, State};

/// What the controls remember from frame to frame besides egui's own memory.
#[derive(Debug, Default)]
pub struct Panel {}

/// Where the picture is, for the gestures on it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Canvas {
    /// The picture's area, in pixels of the window.
    pub area: Area,
    /// Its own columns and rows.
    pub size: (u32, u32),
}

impl Panel {
    /// Draws the controls, reads keys and gestures, and says what the person did.
    pub fn show(&mut self, ui: &mut egui::Ui, state: &State, canvas: Canvas, actions: &mut Vec<Action>) {
        let _ = (ui, state, canvas, actions);
    }
}
