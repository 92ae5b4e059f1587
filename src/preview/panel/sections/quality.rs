//! The quality of the blur.

use egui::{ComboBox, Role, Ui};

use super::Sheet;
use crate::bokeh::{Method, Rank};
use crate::budget::Quality;
use crate::look::{BackgroundMemory, Refine};
use crate::preview::panel::parts::{called, choose, switch};
use crate::preview::state::tweak::rank_label;
use crate::preview::texts::tr;

/// Quality, terms, method and refining.
pub fn show(ui: &mut Ui, sheet: &mut Sheet) {
    let name = |quality: Option<Quality>| match quality {
        None => tr("Auto: as the time allows").to_owned(),
        Some(quality) => quality.to_string(),
    };
    ui.label(tr("Level"));
    let levels = ComboBox::from_id_salt("quality").selected_text(name(sheet.look.quality)).show_ui(ui, |ui| {
        for quality in [None].into_iter().chain(Quality::ALL.map(Some)) {
            if ui.selectable_label(sheet.look.quality == quality, name(quality)).clicked() {
                sheet.look.quality = quality;
                sheet.changed(true, "quality");
            }
        }
    });
    called(&levels.response, "Level", Role::ComboBox);
    ui.label(tr("Terms of the aperture"))
        .on_hover_text(tr("Separable terms: more keep its shape better and cost more"));
    let ranks = [None].into_iter().chain((1..=16).map(|terms| Some(Rank::Terms(terms)))).chain([Some(Rank::Full)]);
    let terms = ComboBox::from_id_salt("rank").selected_text(rank_label(sheet.look.rank)).show_ui(ui, |ui| {
        for rank in ranks {
            if ui.selectable_label(sheet.look.rank == rank, rank_label(rank)).clicked() {
                sheet.look.rank = rank;
                sheet.changed(true, "rank");
            }
        }
    });
    called(&terms.response, "Terms of the aperture", Role::ComboBox);
    if sheet.look.effect.follows_depth() {
        let methods = [
            ("Layered", "Depth bins, blurred and put together front to back"),
            ("Gather", "Every pixel gathers with its own radius: the plain form, for comparison"),
        ];
        let chosen = usize::from(sheet.look.method == Method::Gather);
        ui.label(tr("Method"));
        if let Some(index) = choose(ui, "Method", &methods, chosen, |_| true) {
            sheet.look.method = if index == 0 { Method::Layered } else { Method::Gather };
            sheet.changed(true, "method");
        }
        let refines = [
            ("Auto", "Where depth was measured"),
            ("On", "Always fit depth to the picture's edges"),
            ("Off", "Only fill holes"),
        ];
        const REFINES: [Refine; 3] = [Refine::Auto, Refine::On, Refine::Off];
        ui.label(tr("Refine depth"));
        let chosen = REFINES.iter().position(|&refine| refine == sheet.look.refine).unwrap_or_default();
        if let Some(index) = choose(ui, "Refine depth", &refines, chosen, |_| true) {
            sheet.look.refine = REFINES[index];
            sheet.changed(true, "refine");
        }
        let remembers = sheet.look.background_memory == BackgroundMemory::On;
        let hint = "What was seen before of what things hide now is shown where blur lets it through";
        if switch(ui, "Remember the background", hint, remembers) {
            sheet.look.background_memory = if remembers { BackgroundMemory::Off } else { BackgroundMemory::On };
            sheet.changed(true, "background-memory");
        }
    }
}
