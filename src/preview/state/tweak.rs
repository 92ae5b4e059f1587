//! Small changes of a look, as a key or a turn of the wheel makes them.

use crate::bokeh::Rank;
use crate::depth::focus::FocusRule;
use crate::look::{COC_AT_INFINITY_PER_HEIGHT, Effect, Look, MAX_COC_PER_HEIGHT, Strength};
use crate::optics::Lens;

/// The lens that is meant where none was chosen: a portrait lens on full frame.
pub const LENS: Lens = Lens { focal_length_mm: 50.0, f_number: 1.8, sensor_width_mm: 36.0 };
/// The f-numbers that can be chosen.
pub const F_NUMBERS: std::ops::RangeInclusive<f32> = 0.7..=22.0;
/// The focal ranges that can be chosen, in metres.
pub const FOCUS_RANGES_M: std::ops::RangeInclusive<f32> = 0.0..=3.0;
/// The distances that can be focused at, in metres.
pub const DISTANCES_M: std::ops::RangeInclusive<f32> = 0.2..=20.0;

/// Radius at infinity as a share of the picture's height, where it is not a lens's.
pub fn amount(look: &Look, height_px: u32) -> Option<f32> {
    match look.strength {
        Strength::Default => Some(COC_AT_INFINITY_PER_HEIGHT),
        Strength::AtInfinity(radius_px) => Some(radius_px / height_px.max(1) as f32),
        Strength::Percent(percent) => Some(percent / 100.0),
        Strength::Lens(_) => None,
    }
}

/// Blurs `factor` times as much: a lens by its f-number.
pub fn blur_by(look: &mut Look, factor: f32, height_px: u32) {
    let least = 0.002;
    match amount(look, height_px) {
        // Below, blur is none to be seen; from there one gets back by a first step.
        Some(share) => {
            let share = if share < least && factor < 1.0 { 0.0 } else { share.max(least / 2.0) * factor };
            let most = amount(look, height_px).unwrap_or_default().max(MAX_COC_PER_HEIGHT);
            look.strength = Strength::Percent(share.min(most) * 100.0);
        }
        None => f_number_by(look, 1.0 / factor),
    }
}

/// Makes the f-number `factor` times as large; the first time, a lens is put on. Only where the blur follows depth has a
/// lens a distance.
pub fn f_number_by(look: &mut Look, factor: f32) {
    if !look.effect.follows_depth() {
        return;
    }
    let lens = match look.strength {
        Strength::Lens(lens) => Lens { f_number: lens.f_number * factor, ..lens },
        Strength::Default | Strength::AtInfinity(_) | Strength::Percent(_) => LENS,
    };
    let f_number = lens.f_number.clamp(*F_NUMBERS.start(), *F_NUMBERS.end());
    look.strength = Strength::Lens(Lens { f_number, ..lens });
}

/// Makes the focal range larger or smaller by some metres.
pub fn focus_range_by(look: &mut Look, by_m: f32) {
    let range_m = ((look.focus_range_m + by_m) * 100.0).round() / 100.0;
    look.focus_range_m = range_m.clamp(*FOCUS_RANGES_M.start(), *FOCUS_RANGES_M.end());
}

/// Moves what is sharp by fractions of the picture's width and height: the band of tilt-shift, the distance of focus
/// where one was chosen (up is farther), else the point of focus.
pub fn move_focus(look: &mut Look, dx: f32, dy: f32) {
    if look.effect == Effect::TiltShift {
        look.tilt.center_y = (look.tilt.center_y + dy).clamp(0.0, 1.0);
        look.tilt.angle_deg = turned(look.tilt.angle_deg, dx * 100.0);
        return;
    }
    look.focus = match look.focus {
        FocusRule::Metres(metres) => {
            let metres = metres * (1.0 + 2.0 * (dx - dy));
            FocusRule::Metres(metres.clamp(*DISTANCES_M.start(), *DISTANCES_M.end()))
        }
        FocusRule::Auto => FocusRule::Point { x: (0.5 + dx).clamp(0.0, 1.0), y: (0.5 + dy).clamp(0.0, 1.0) },
        FocusRule::Point { x, y } => FocusRule::Point { x: (x + dx).clamp(0.0, 1.0), y: (y + dy).clamp(0.0, 1.0) },
    };
}

/// An angle turned on, between -90 and 90 degrees: a band has no direction.
pub fn turned(angle_deg: f32, by_deg: f32) -> f32 {
    (angle_deg + by_deg + 90.0).rem_euclid(180.0) - 90.0
}

/// How many separable terms a look has; `None` is the quality's own choice.
pub fn rank_label(rank: Option<Rank>) -> String {
    match rank {
        None => "auto".into(),
        Some(Rank::Terms(terms)) => terms.to_string(),
        Some(Rank::Full) => "full".into(),
    }
}
