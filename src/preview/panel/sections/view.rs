//! What of a frame is shown.

use egui::Ui;

use super::Sheet;
use crate::preview::panel::parts::{Number, choose, number, remark, switch};
use crate::preview::state::{Action, Shown, ZOOM_FACTORS};

type Views = [(&'static str, &'static str, Shown); 2];

const VIEWS: Views = [
    ("Picture", "The blurred picture", Shown::Picture),
    ("Depth", "Distance in colours: light is near (D)", Shown::Depth),
];
const INTERNALS: Views = [
    ("CoC", "Circle of confusion: white is sharp, hatched is in front (C)", Shown::Coc),
    ("Bins", "The layers that are blurred on their own (N)", Shown::Bins),
];

/// Draws views to choose from; one that is shown already is left for the picture.
fn choose_view(ui: &mut Ui, sheet: &mut Sheet, what: &str, views: Views) {
    let chosen = views.iter().position(|view| view.2 == sheet.state.shown);
    let has_depth = sheet.has_depth();
    let options = views.map(|(name, hint, _)| (name, hint));
    let can = |index: usize| has_depth || views[index].2 != Shown::Depth;
    if let Some(index) = choose(ui, what, &options, chosen.unwrap_or(usize::MAX), can) {
        let shown = if chosen == Some(index) { Shown::Picture } else { views[index].2 };
        sheet.act(Action::Show(shown));
    }
}

/// What the blur is made of, and the instruments.
pub fn internals(ui: &mut Ui, sheet: &mut Sheet) {
    choose_view(ui, sheet, "Show of the blur", INTERNALS);
    let on = sheet.state.instruments;
    if switch(ui, "Instruments", "Times, rates and drops (I)", on) {
        sheet.act(Action::Instruments(!on));
    }
}

/// The view, and how it is shown.
pub fn show(ui: &mut Ui, sheet: &mut Sheet) {
    let state = sheet.state;
    choose_view(ui, sheet, "Show", VIEWS);
    let zooms = ["Fit", "100 %", "200 %", "400 %", "800 %"]
        .map(|name| (name, "Pixels of the window for one of the picture (X, +, -)"));
    let chosen = ZOOM_FACTORS.iter().position(|factor| *factor == state.zoom.factor).unwrap_or_default();
    if let Some(index) = choose(ui, "Size", &zooms, chosen, |_| true) {
        sheet.act(Action::Zoom(ZOOM_FACTORS[index], None));
    }
    if switch(ui, "Mirror", "Like a mirror; what is recorded or sent on is not (M)", state.mirror) {
        sheet.act(Action::Mirror(!state.mirror));
    }
    if state.mirror {
        remark(ui, "In this window alone: what goes out is not mirrored.");
    }
    let (freeze, hint) = match state.can_pause() {
        true => ("Pause", "The recording stands still, and looks can be tried on its picture (Z)"),
        false => ("Freeze", "Keep this picture, and try looks on it (Z)"),
    };
    if switch(ui, freeze, hint, state.frozen) {
        sheet.act(Action::Freeze(!state.frozen));
    }
    if switch(ui, "Before and after", "The picture before the blur, left of a line to drag (B)", state.split.is_some())
    {
        sheet.act(Action::Split(if state.split.is_some() { None } else { Some(0.5) }));
    }
    if let Some(at) = state.split {
        let mut percent = at * 100.0;
        let how = Number {
            label: "Line at",
            hint: "From the left; it can also be dragged on the picture",
            range: 0.0..=100.0,
            ratios: false,
            digits: 0,
            around: ["", " %"],
        };
        if number(ui, how, &mut percent) {
            sheet.act(Action::Split(Some(percent / 100.0)));
        }
    }
    if switch(ui, "Full screen", "F or F11", state.full_screen) {
        sheet.act(Action::FullScreen(!state.full_screen));
    }
}
