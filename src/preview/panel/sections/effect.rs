//! The effect: what the blur follows.

use egui::Ui;

use super::Sheet;
use crate::look::Effect;
use crate::preview::panel::parts::{Number, choose, number, remark};
use crate::preview::state::Source;

const EFFECTS: [(&str, &str, Effect); 4] = [
    ("Depth", "The farther from the focal plane, the more blur", Effect::Auto),
    ("Tilt-shift", "A sharp band, and blur that grows away from it", Effect::TiltShift),
    ("Even", "The same blur everywhere", Effect::Blur),
    ("Off", "The picture as it is", Effect::None),
];

/// The effect, and the band of tilt-shift.
pub fn show(ui: &mut Ui, sheet: &mut Sheet) {
    let chosen = EFFECTS.iter().position(|effect| effect.2 == sheet.look.effect).unwrap_or_default();
    let options = EFFECTS.map(|(name, hint, _)| (name, hint));
    let has_depth = sheet.has_depth();
    if let Some(index) = choose(ui, "Effect", &options, chosen, |index| index != 0 || has_depth) {
        sheet.look.effect = EFFECTS[index].2;
        sheet.changed(true, "effect");
    }
    if !has_depth && matches!(sheet.state.source, Source::Running(_)) {
        remark(
            ui,
            "This source has no depth: tilt-shift needs none. For blur by depth, add a second camera beside it, \
                    or use a depth camera or a recording with depth.",
        );
    }
    if sheet.look.effect == Effect::TiltShift {
        tilt(ui, sheet);
    }
}

/// The band of tilt-shift: place, width and angle.
fn tilt(ui: &mut Ui, sheet: &mut Sheet) {
    let mut tilt = sheet.look.tilt;
    let percent = |ui: &mut Ui, label: &str, hint: &str, share: &mut f32, most: f32| {
        let mut value = *share * 100.0;
        let how = Number { label, hint, range: 0.0..=most, ratios: false, digits: 0, around: ["", " %"] };
        let changed = number(ui, how, &mut value);
        if changed {
            *share = value / 100.0;
        }
        changed
    };
    let place = percent(ui, "Sharp band", "Its middle, from the top of the picture", &mut tilt.center_y, 100.0);
    let width = percent(ui, "Width of the band", "As a share of the height", &mut tilt.band, 100.0);
    let how = Number {
        label: "Angle",
        hint: "The turn of the band, clockwise",
        range: -90.0..=90.0,
        ratios: false,
        digits: 0,
        around: ["", "°"],
    };
    let turned = number(ui, how, &mut tilt.angle_deg);
    sheet.changed(place, "tilt place");
    sheet.changed(width, "tilt width");
    sheet.changed(turned, "tilt angle");
    sheet.look.tilt = tilt;
}
