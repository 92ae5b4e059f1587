//! What of a frame is shown.

use egui::Ui;

use super::Sheet;
use crate::preview::panel::parts::{Number, choose, number, switch};
use crate::preview::state::{Action, Shown};

const VIEWS: [(&str, &str, Shown); 4] = [
    ("Picture", "The blurred picture", Shown::Picture),
    ("Depth", "Distance in colours: light is near", Shown::Depth),
    ("CoC", "Circle of confusion: white is sharp, hatched is in front", Shown::Coc),
    ("Bins", "The layers that are blurred on their own", Shown::Bins),
];

/// The view, how it is shown, and the instruments.
pub fn show(ui: &mut Ui, sheet: &mut Sheet) {
    let state = sheet.state;
    let chosen = VIEWS.iter().position(|view| view.2 == state.shown).unwrap_or_default();
    let has_depth = sheet.has_depth();
    let options = VIEWS.map(|(name, hint, _)| (name, hint));
    if let Some(index) = choose(ui, "Show", &options, chosen, |index| index != 1 || has_depth) {
        sheet.act(Action::Show(VIEWS[index].2));
    }
    if switch(ui, "Mirror", "Like a mirror; what is recorded or sent on is not (M)", state.mirror) {
        sheet.act(Action::Mirror(!state.mirror));
    }
    if switch(ui, "Freeze", "Keep this picture; the source goes on (Z)", state.frozen) {
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
    if switch(ui, "Instruments", "Times, rates and drops (I)", state.instruments) {
        sheet.act(Action::Instruments(!state.instruments));
    }
    if switch(ui, "Full screen", "F or F11", state.full_screen) {
        sheet.act(Action::FullScreen(!state.full_screen));
    }
}
