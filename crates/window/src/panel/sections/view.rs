//! The displayed view of a frame.

use egui::Ui;

use super::PanelForm;
use crate::panel::widgets::{Number, add_choice, add_number, add_remark};
use crate::state::{Action, ViewMode};

const VIEWS: [(&str, &str, ViewMode); 2] = [
    ("Picture", "The blurred picture", ViewMode::Picture),
    ("Depth", "Distance in colours: light is near (D)", ViewMode::Depth),
];

/// Adds the view, and options for its display.
pub fn show(ui: &mut Ui, form: &mut PanelForm) {
    let state = form.state;
    let has_depth = form.has_depth();
    // A click on the active view returns to the picture.
    if let Some(shown) = add_choice(ui, "Show", &VIEWS, state.shown, |shown| has_depth || shown != ViewMode::Depth) {
        form.push_action(Action::Show(if shown == state.shown { ViewMode::Picture } else { shown }));
    }
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
