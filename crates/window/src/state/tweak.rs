//! Small changes of a look, made by a key or the wheel.

use bokehcam::bokeh::Rank;
use bokehcam::depth::focus::FocusRule;
use bokehcam::look::{COC_AT_INFINITY_PER_HEIGHT, Effect, Look, MAX_COC_PER_HEIGHT, Strength};
use bokehcam::optics::Lens;

/// The lens to start from where none was chosen: a portrait lens on full frame.
pub const LENS: Lens = Lens { focal_length_mm: 50.0, f_number: 1.8, sensor_width_mm: 36.0 };
/// The f-numbers that can be chosen.
pub const F_NUMBERS: std::ops::RangeInclusive<f32> = 0.7..=22.0;
/// The focal ranges that can be chosen, in metres.
pub const FOCUS_RANGES_M: std::ops::RangeInclusive<f32> = 0.0..=3.0;
/// The distances that can be focused at, in metres.
pub const DISTANCES_M: std::ops::RangeInclusive<f32> = 0.2..=20.0;

/// CoC radius at infinity as a share of the picture's height; `None` where the strength is given as a lens.
pub fn amount(look: &Look, height_px: u32) -> Option<f32> {
    match look.strength {
        Strength::Default => Some(COC_AT_INFINITY_PER_HEIGHT),
        Strength::AtInfinity(radius_px) => Some(radius_px / height_px.max(1) as f32),
        Strength::Percent(percent) => Some(percent / 100.0),
        Strength::Lens(_) => None,
    }
}

/// Makes the blur `factor` times as strong, by its f-number where the strength is given as a lens.
pub fn blur_by(look: &mut Look, factor: f32, height_px: u32) {
    // As a share of the height: below that no blur is visible, so a step down ends at 0, and one up starts from half.
    let least = 0.002;
    match (look.strength, amount(look, height_px)) {
        (_, Some(share)) => {
            let share = if share < least && factor < 1.0 { 0.0 } else { share.max(least / 2.0) * factor };
            // A radius beyond the usual limit may stay.
            let most = amount(look, height_px).unwrap_or_default().max(MAX_COC_PER_HEIGHT);
            look.strength = Strength::Percent(short(share.min(most) * 100.0));
        }
        (Strength::Lens(lens), None) if look.effect.follows_depth() => {
            look.strength = Strength::Lens(stopped(lens, 1.0 / factor));
        }
        _ => {}
    }
}

/// The f-number at which [`LENS`], focused at `focus_m`, blurs by a share of the height of pictures of this size; infinite
/// where that is none.
pub fn f_number_of(share: f32, focus_m: f32, (width, height): (u32, u32)) -> f32 {
    let wide_open = Lens { f_number: 1.0, ..LENS };
    wide_open.coc_at_infinity_px(focus_m, width) / (share * height.max(1) as f32)
}

/// The share of the height by which a lens, focused at `focus_m`, blurs pictures of this size.
pub fn amount_of(lens: Lens, focus_m: f32, (width, height): (u32, u32)) -> f32 {
    lens.coc_at_infinity_px(focus_m, width) / height.max(1) as f32
}

/// How strong the blur of a look is, as a share of the height, whichever way it is given.
pub fn share_of(look: &Look, focus_m: f32, size: (u32, u32)) -> f32 {
    match look.strength {
        Strength::Lens(lens) => amount_of(lens, focus_m, size),
        _ => amount(look, size.1).unwrap_or_default(),
    }
}

/// Makes the blur of a look so strong, a share of the height, the way it is given: a lens is stopped up or down.
pub fn set_share(look: &mut Look, share: f32, focus_m: f32, size: (u32, u32)) {
    look.strength = match look.strength {
        Strength::Lens(lens) => {
            let factor = amount_of(lens, focus_m, size) / share.max(1e-4);
            Strength::Lens(stopped(lens, if factor.is_finite() { factor } else { 1.0 }))
        }
        _ => Strength::Percent(percent(share)),
    };
}

/// A share as a percentage, to a hundredth: finer nobody sees.
fn percent(share: f32) -> f32 {
    (share * 1e4).round() / 1e2
}

/// The lens of a look, or the one that blurs as much while focused at `focus_m`, as far as there is one.
pub fn lens_of(look: &Look, focus_m: f32, size: (u32, u32)) -> Lens {
    match (look.strength, amount(look, size.1)) {
        (Strength::Lens(lens), _) => lens,
        (_, share) => {
            let f_number = f_number_of(share.unwrap_or_default(), focus_m, size);
            // It may be one that no lens has: nothing is lost on the way back.
            Lens { f_number: short(f_number.clamp(0.01, 10_000.0)), ..LENS }
        }
    }
}

/// Makes the f-number `factor` times as large, from that of [`lens_of`]. Does nothing unless the blur follows depth: a lens
/// needs distances.
pub fn f_number_by(look: &mut Look, factor: f32, focus_m: f32, size: (u32, u32)) {
    if !look.effect.follows_depth() {
        return;
    }
    look.strength = Strength::Lens(stopped(lens_of(look, focus_m, size), factor));
}

/// A lens whose f-number is `factor` times as large, within what can be chosen.
fn stopped(lens: Lens, factor: f32) -> Lens {
    let (least, most) = (F_NUMBERS.start().min(lens.f_number), F_NUMBERS.end().max(lens.f_number));
    let f_number = (lens.f_number * factor).clamp(least, most);
    Lens { f_number: short(f_number), ..lens }
}

/// Widens the focal range by some metres, in steps of a centimetre.
pub fn focus_range_by(look: &mut Look, by_m: f32) {
    let range_m = ((look.focus_range_m + by_m) * 100.0).round() / 100.0;
    look.focus_range_m = range_m.clamp(*FOCUS_RANGES_M.start(), *FOCUS_RANGES_M.end());
}

/// Moves what is sharp by fractions of the picture's width and height: the band of tilt-shift (sideways turns it), the
/// distance of focus where one was chosen (up and right is farther), else the point of focus.
pub fn move_focus(look: &mut Look, dx: f32, dy: f32) {
    if look.effect == Effect::TiltShift {
        look.tilt.center_y = (look.tilt.center_y + dy).clamp(0.0, 1.0);
        // A key's step of 0.02 turns by 2 degrees.
        look.tilt.angle_deg = turned(look.tilt.angle_deg, dx * 100.0);
        return;
    }
    look.focus = match look.focus {
        FocusRule::Metres(metres) => {
            // The same step is a share of the distance: 4 %.
            let metres = metres * (1.0 + 2.0 * (dx - dy));
            FocusRule::Metres(short(metres.clamp(*DISTANCES_M.start(), *DISTANCES_M.end())))
        }
        FocusRule::Auto => point(0.5 + dx, 0.5 + dy),
        FocusRule::Point { x, y } | FocusRule::Track { x, y } => point(x + dx, y + dy),
    };
}

/// The focus at a place of the picture, or the nearest one in it.
pub fn point(x: f32, y: f32) -> FocusRule {
    FocusRule::Point { x: short(x.clamp(0.0, 1.0)), y: short(y.clamp(0.0, 1.0)) }
}

/// The focus on what is at a place of the picture, or the nearest one in it, wherever it goes.
pub fn track(x: f32, y: f32) -> FocusRule {
    FocusRule::Track { x: short(x.clamp(0.0, 1.0)), y: short(y.clamp(0.0, 1.0)) }
}

/// A number with four digits that count, as one would write it: finer nobody sees, and commands stay short.
pub fn short(value: f32) -> f32 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// An angle plus `by_deg`, wrapped to -90 to 90 degrees: a band turned by 180 degrees is the same.
pub fn turned(angle_deg: f32, by_deg: f32) -> f32 {
    (angle_deg + by_deg + 90.0).rem_euclid(180.0) - 90.0
}

/// The label for a number of separable terms; `None` leaves it to the quality.
pub fn rank_label(rank: Option<Rank>) -> String {
    match rank {
        None => "auto".into(),
        Some(Rank::Terms(terms)) => terms.to_string(),
        Some(Rank::Full) => "full".into(),
    }
}
