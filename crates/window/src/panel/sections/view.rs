//! The displayed view of a frame.

use egui::Ui;

use super::PanelForm;
use crate::panel::widgets::{Number, add_choice, add_number, add_remark};
use crate::state::{Action, ViewMode};

type Views = [(&'static str, &'static str, ViewMode); 2];

const VIEWS: Views = [
    ("Picture", "The blurred picture", ViewMode::Picture),
    ("Depth", "Distance in colours: light is near (D)", ViewMode::Depth),
];
const INTERNALS: Views = [
    ("Blur radius", "Circle of confusion: white is sharp, hatched is in front (C)", ViewMode::Coc),
    ("Layers", "The layers, each blurred separately (N)", ViewMode::Bins),
];

/// Adds radio buttons for views; clicking the active one returns to the picture.
fn add_view_choice(ui: &mut Ui, form: &mut PanelForm, what: &str, views: Views) {
    let (now, has_depth) = (form.state.shown, form.has_depth());
    if let Some(shown) = add_choice(ui, what, &views, now, |shown| has_depth || shown != ViewMode::Depth) {
        form.push_action(Action::Show(if shown == now { ViewMode::Picture } else { shown }));
    }
}

/// Adds the views of the blur's internals, and the instruments.
pub fn add_internals(ui: &mut Ui, form: &mut PanelForm) {
    add_view_choice(ui, form, "Views of the blur", INTERNALS);
    form.add_switch(ui, "Instruments", "Times, rates and drops (I)", form.state.instruments, Action::Instruments);
}

/// Adds the view, and options for its display.
pub fn show(ui: &mut Ui, form: &mut PanelForm) {
    let state = form.state;
    add_view_choice(ui, form, "Show", VIEWS);
    let hint = "Like a mirror; recordings and calls are not mirrored (M)";
    form.add_switch(ui, "Mirror", hint, state.mirror, Action::Mirror);
    if state.mirror {
        add_remark(ui, "Only this window is mirrored, not recordings and calls.");
    }
    let (freeze, hint) = match state.can_pause() {
        true => ("Pause", "Pause the recording, and try looks on its picture (Z)"),
        false => ("Freeze", "Keep this picture, and try looks on it (Z)"),
    };
    form.add_switch(ui, freeze, hint, state.frozen, Action::Freeze);
    let hint = "Show the picture before the blur, left of a movable line (B)";
    form.add_switch(ui, "Before and after", hint, state.split.is_some(), |on| Action::Split(on.then_some(0.5)));
    if let Some(at) = state.split {
        let hint = "From the left; you can also drag the line on the picture";
        let mut percent = at * 100.0;
        if add_number(ui, &Number::new("Line at", hint, 0.0..=100.0, 0).with_affixes("", " %"), &mut percent) {
            form.push_action(Action::Split(Some(percent / 100.0)));
        }
    }
    form.add_switch(ui, "Full screen", "F or F11", state.full_screen, Action::FullScreen);
}
