//! The quality level of the blur.

use egui::Ui;

use super::PanelForm;
use crate::panel::widgets::add_dropdown;
use crate::texts::tr;
use bokehcam::budget::Quality;

/// Adds the list of quality levels; automatic selection follows the time budget.
pub fn show(ui: &mut Ui, form: &mut PanelForm) {
    let name = |quality: Option<Quality>| match quality {
        None => tr("Auto: as the time allows").to_owned(),
        Some(quality) => quality.to_string(),
    };
    ui.label(tr("Quality"));
    let quality = form.look.quality;
    let levels = [None].into_iter().chain(Quality::ALL.map(Some)).map(|level| (name(level), "", level));
    if let Some(quality) = add_dropdown(ui, "Quality", &name(quality), levels, &quality) {
        form.look.quality = quality;
        form.stroke = Some("quality");
    }
}
