//! The focus: distance or place of the focal plane, and focus range.

use egui::Ui;

use super::PanelForm;
use crate::panel::widgets::{Number, add_remark};
use crate::state::tweak::{FOCUS_DISTANCE_RANGE_M, FOCUS_RANGE_LIMITS_M};
use crate::texts::{format_number, tr_with};
use bokehcam::depth::focus::FocusRule;
use bokehcam::frame::DepthMap;

/// Adds the focus rule, its distance, and the focus range.
pub fn show(ui: &mut Ui, form: &mut PanelForm) {
    let focus = form.look.focus;
    // A default if no frame with depth has arrived yet.
    let now_m = form.state.focus_distance_m();
    let (is_point, metres) = match focus {
        FocusRule::Metres(metres) => (false, metres),
        FocusRule::Point { .. } | FocusRule::Track { .. } => (true, now_m),
        FocusRule::Auto | FocusRule::Relative(_) => (false, now_m),
    };
    let point = if is_point { focus } else { FocusRule::Point { x: 0.5, y: 0.5 } };
    let in_metres = !form.state.lacks_metres();
    let by_number = match focus {
        FocusRule::Metres(_) | FocusRule::Relative(_) => focus,
        _ if in_metres => FocusRule::Metres((now_m * 100.0).round() / 100.0),
        _ => FocusRule::at_relative(now_m, DepthMap::FAR_M),
    };
    let rules = [
        ("Subject", "Follows a person, or the nearest large subject", FocusRule::Auto),
        ("Point", "A point of the picture: click there. Double-click on a thing to follow it", point),
        match in_metres {
            true => ("Distance", "A distance in metres", by_number),
            false => ("Place", "A place between the nearest and the farthest", by_number),
        },
    ];
    form.add_choice(ui, "Focus on", &rules, focus, |look, rule| look.focus = rule);
    if let (false, FocusRule::Relative(place)) = (in_metres, by_number) {
        let hint = "Place of the focal plane: 0 is the nearest, 1 the farthest. Move the slider to set it";
        let how = Number::new("Place", hint, 0.0..=1.0, 2);
        form.add_number(ui, &how, place, |look, place| look.focus = FocusRule::Relative(place));
    }
    if in_metres {
        let hint = "Distance of the focal plane. Move the slider to set it";
        let how = Number::new("Distance", hint, FOCUS_DISTANCE_RANGE_M, 2).with_affixes("", " m").logarithmic();
        form.add_number(ui, &how, metres, |look, metres| look.focus = FocusRule::Metres(metres));
        // Displayed as half the range on either side of the focal plane.
        let half_m = *FOCUS_RANGE_LIMITS_M.start() / 2.0..=*FOCUS_RANGE_LIMITS_M.end() / 2.0;
        let hint = "Range that stays as sharp as the focal plane, in front of it and behind";
        let how = Number::new("Depth of the sharp range", hint, half_m, 2).with_affixes("±", " m");
        form.add_number(ui, &how, form.look.focus_range_m / 2.0, |look, half_m| look.focus_range_m = half_m * 2.0);
        let half_m = form.look.focus_range_m / 2.0;
        if half_m > 0.0 {
            let [from, to] = [(metres - half_m).max(0.0), metres + half_m].map(|metres| format_number(metres, 2));
            add_remark(ui, &tr_with("Sharp from {} m to {} m", &[&from, &to]));
        }
    }
    if is_point {
        add_remark(ui, "Click on the picture to focus elsewhere; double-click on something to follow it.");
    }
}
