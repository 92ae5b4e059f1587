//! The quality of the blur.

use egui::Ui;

use super::Sheet;
use crate::bokeh::{Method, Rank};
use crate::budget::Quality;
use crate::look::{BackgroundMemory, Refine};
use crate::preview::panel::parts::{Hinted, list, switch};
use crate::preview::state::tweak::rank_label;
use crate::preview::texts::tr;

const METHODS: [(&str, &str, Method); 2] = [
    ("Layered", "Depth bins, blurred and put together front to back", Method::Layered),
    ("Gather", "Every pixel gathers with its own radius: the plain form, for comparison", Method::Gather),
];
const REFINES: [(&str, &str, Refine); 3] = [
    ("Auto", "Where depth was measured", Refine::Auto),
    ("On", "Always fit depth to the picture's edges", Refine::On),
    ("Off", "Only fill holes", Refine::Off),
];

/// Quality, terms, method and refining.
pub fn show(ui: &mut Ui, sheet: &mut Sheet) {
    let name = |quality: Option<Quality>| match quality {
        None => tr("Auto: as the time allows").to_owned(),
        Some(quality) => quality.to_string(),
    };
    ui.label(tr("Level"));
    let (quality, rank) = (sheet.look.quality, sheet.look.rank);
    let levels = [None].into_iter().chain(Quality::ALL.map(Some)).map(|level| (name(level), "", level));
    if let Some(quality) = list(ui, "Level", &name(quality), levels, &quality) {
        sheet.look.quality = quality;
        sheet.changed(true, "quality");
    }
    ui.label(tr("Terms of the aperture")).hint("Separable terms: more keep its shape better and cost more");
    let ranks = [None].into_iter().chain((1..=16).map(|terms| Some(Rank::Terms(terms)))).chain([Some(Rank::Full)]);
    let ranks = ranks.map(|rank| (rank_label(rank), "", rank));
    if let Some(rank) = list(ui, "Terms of the aperture", &rank_label(rank), ranks, &rank) {
        sheet.look.rank = rank;
        sheet.changed(true, "rank");
    }
    if sheet.follows_depth() {
        ui.label(tr("Method"));
        sheet.choose(ui, "Method", &METHODS, sheet.look.method, |look, method| look.method = method);
        ui.label(tr("Refine depth"));
        sheet.choose(ui, "Refine depth", &REFINES, sheet.look.refine, |look, refine| look.refine = refine);
        let remembers = sheet.look.background_memory == BackgroundMemory::On;
        let hint = "What was seen before of what things hide now is shown where blur lets it through";
        if switch(ui, "Remember the background", hint, remembers) {
            sheet.look.background_memory = if remembers { BackgroundMemory::Off } else { BackgroundMemory::On };
            sheet.changed(true, "background-memory");
        }
    }
}
