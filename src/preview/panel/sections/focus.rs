//! The focus: distance of the focal plane, and depth of the focal range.

use egui::Ui;

use super::Sheet;
use crate::depth::focus::FocusRule;
use crate::preview::panel::parts::{Number, choose, number, remark};
use crate::preview::state::tweak::{DISTANCES_M, FOCUS_RANGES_M};

const RULES: [(&str, &str); 3] = [
    ("Subject", "Follows the nearest large subject. Double-click on the picture does the same"),
    ("Point", "What is at a point of the picture. Click on the picture to choose it"),
    ("Distance", "A distance in metres"),
];

/// The rule of focus, its distance, and the focal range.
pub fn show(ui: &mut Ui, sheet: &mut Sheet) {
    let chosen = match sheet.look.focus {
        FocusRule::Auto => 0,
        FocusRule::Point { .. } => 1,
        FocusRule::Metres(_) => 2,
    };
    // Without depth in the frame yet, something to start from.
    let now_m = sheet.state.distance_m();
    if let Some(index) = choose(ui, "Focus on", &RULES, chosen, |_| true).filter(|&index| index != chosen) {
        sheet.look.focus = match index {
            0 => FocusRule::Auto,
            1 => FocusRule::Point { x: 0.5, y: 0.5 },
            _ => FocusRule::Metres((now_m * 100.0).round() / 100.0),
        };
        sheet.changed(true, "focus rule");
    }
    let mut metres = match sheet.look.focus {
        FocusRule::Metres(metres) => metres,
        FocusRule::Auto | FocusRule::Point { .. } => now_m,
    };
    let how = Number {
        label: "Focused at",
        hint: "Distance of what is sharpest. Move it to focus at a distance of your own",
        range: DISTANCES_M,
        ratios: true,
        digits: 2,
        around: ["", " m"],
    };
    if number(ui, how, &mut metres) {
        sheet.look.focus = FocusRule::Metres(metres);
        sheet.changed(true, "focus distance");
    }
    // Shown as half of it on either side of the focal plane.
    let how = Number {
        label: "Focal range",
        hint: "Depth that stays sharp in front of and behind the focal plane",
        range: *FOCUS_RANGES_M.start() / 2.0..=*FOCUS_RANGES_M.end() / 2.0,
        ratios: false,
        digits: 2,
        around: ["±", " m"],
    };
    let mut half_m = sheet.look.focus_range_m / 2.0;
    if number(ui, how, &mut half_m) {
        sheet.look.focus_range_m = half_m * 2.0;
        sheet.changed(true, "focal range");
    }
    if chosen == 1 {
        remark(ui, "Click on the picture to focus elsewhere; double-click to follow the subject.");
    }
}
