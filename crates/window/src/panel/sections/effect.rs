//! The effect, which determines where the blur is applied.

use egui::Ui;

use super::PanelForm;
use crate::panel::widgets::{Number, add_choice, add_remark};
use crate::state::Source;
use bokehcam::look::{Effect, Tilt};

const EFFECTS: [(&str, &str, Effect); 4] = [
    ("Portrait", "More blur, the farther from the subject in focus", Effect::Auto),
    ("Sharp band", "A sharp band, and blur that grows away from it", Effect::TiltShift),
    ("Whole picture", "The same blur everywhere", Effect::Blur),
    ("No blur", "The picture as it is", Effect::None),
];

/// Adds the effect, and the parameters of the tilt-shift band.
pub fn show(ui: &mut Ui, form: &mut PanelForm) {
    let chosen = EFFECTS.iter().find(|effect| effect.2 == form.look.effect).map_or(Effect::Auto, |effect| effect.2);
    let has_depth = form.has_depth();
    if let Some(effect) = add_choice(ui, "Effect", &EFFECTS, chosen, |effect| has_depth || effect != Effect::Auto) {
        form.look.effect = effect;
        form.stroke = Some("effect");
    }
    if !has_depth && matches!(form.state.source, Source::Running(_)) {
        add_remark(ui, form.state.no_depth_advice());
    }
    if form.look.effect == Effect::TiltShift {
        let Tilt { center_y, band, angle_deg } = form.look.tilt;
        let share = |label, hint| Number::new(label, hint, 0.0..=100.0, 0).with_affixes("", " %");
        let how = share("Middle of the band", "Its middle, from the top of the picture");
        form.add_number(ui, &how, center_y * 100.0, |look, percent| look.tilt.center_y = percent / 100.0);
        let how = share("Width of the band", "As a share of the height");
        form.add_number(ui, &how, band * 100.0, |look, percent| look.tilt.band = percent / 100.0);
        let how = Number::new("Angle", "Rotation of the band, clockwise", -90.0..=90.0, 0).with_affixes("", "°");
        form.add_number(ui, &how, angle_deg, |look, angle_deg| look.tilt.angle_deg = angle_deg);
    }
}
