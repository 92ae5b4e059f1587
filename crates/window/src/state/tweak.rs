//! Incremental changes of a look by keys or the wheel.

use bokehcam::depth::focus::FocusRule;
use bokehcam::look::{COC_AT_INFINITY_PER_HEIGHT, Effect, Look, MAX_COC_PER_HEIGHT, Strength};
use bokehcam::optics::Lens;

/// The initial lens: a portrait lens on full frame.
pub const DEFAULT_LENS: Lens = Lens { focal_length_mm: 50.0, f_number: 1.8, sensor_width_mm: 36.0 };
/// Valid f-numbers.
pub const F_NUMBER_RANGE: std::ops::RangeInclusive<f32> = 0.7..=22.0;
/// Valid focus ranges, in metres.
pub const FOCUS_RANGE_LIMITS_M: std::ops::RangeInclusive<f32> = 0.0..=3.0;
/// Valid focus distances, in metres.
pub const FOCUS_DISTANCE_RANGE_M: std::ops::RangeInclusive<f32> = 0.2..=20.0;

/// Returns the CoC radius at infinity as a fraction of the picture's height; `None` if the strength is given as a lens.
pub fn coc_fraction(look: &Look, height_px: u32) -> Option<f32> {
    match look.strength {
        Strength::Default => Some(COC_AT_INFINITY_PER_HEIGHT),
        Strength::AtInfinity(radius_px) => Some(radius_px / height_px.max(1) as f32),
        Strength::Percent(percent) => Some(percent / 100.0),
        Strength::Lens(_) => None,
    }
}

/// Scales the blur by `factor`, through the f-number if the strength is given as a lens.
pub fn scale_blur(look: &mut Look, factor: f32, height_px: u32) {
    // Fraction of the height below which blur is invisible: a step down ends at 0, and a step up from 0 starts at half
    // of it.
    let min = 0.002;
    match (look.strength, coc_fraction(look, height_px)) {
        (_, Some(fraction)) => {
            let fraction = if fraction < min && factor < 1.0 { 0.0 } else { fraction.max(min / 2.0) * factor };
            // A radius already above the usual limit is kept.
            let max = coc_fraction(look, height_px).unwrap_or_default().max(MAX_COC_PER_HEIGHT);
            look.strength = Strength::Percent(round_significant(fraction.min(max) * 100.0));
        }
        (Strength::Lens(lens), None) if look.effect.follows_depth() => {
            look.strength = Strength::Lens(scale_lens_f_number(lens, 1.0 / factor));
        }
        _ => {}
    }
}

/// Returns the f-number at which [`DEFAULT_LENS`], focused at `focus_m`, has a CoC radius of `fraction` of the picture's
/// height; infinite if `fraction` is 0.
pub fn f_number_for_coc(fraction: f32, focus_m: f32, (width, height): (u32, u32)) -> f32 {
    let wide_open = Lens { f_number: 1.0, ..DEFAULT_LENS };
    wide_open.coc_at_infinity_px(focus_m, width) / (fraction * height.max(1) as f32)
}

/// Returns the CoC radius at infinity of a lens focused at `focus_m`, as a fraction of the picture's height.
pub fn lens_coc_fraction(lens: Lens, focus_m: f32, (width, height): (u32, u32)) -> f32 {
    lens.coc_at_infinity_px(focus_m, width) / height.max(1) as f32
}

/// Returns the blur strength of a look as a fraction of the height, for either kind of strength.
pub fn blur_fraction(look: &Look, focus_m: f32, size: (u32, u32)) -> f32 {
    match look.strength {
        Strength::Lens(lens) => lens_coc_fraction(lens, focus_m, size),
        _ => coc_fraction(look, size.1).unwrap_or_default(),
    }
}

/// Sets the blur strength as a fraction of the height; for a lens, by its f-number.
pub fn set_blur_fraction(look: &mut Look, fraction: f32, focus_m: f32, size: (u32, u32)) {
    look.strength = match look.strength {
        Strength::Lens(lens) => {
            let factor = lens_coc_fraction(lens, focus_m, size) / fraction.max(1e-4);
            Strength::Lens(scale_lens_f_number(lens, if factor.is_finite() { factor } else { 1.0 }))
        }
        _ => Strength::Percent(to_percent(fraction)),
    };
}

/// Converts a fraction to a percentage, rounded to a hundredth: finer steps are invisible.
fn to_percent(fraction: f32) -> f32 {
    (fraction * 1e4).round() / 1e2
}

/// Returns the lens of a look, or [`DEFAULT_LENS`] stopped to blur equally when focused at `focus_m`.
pub fn lens_for_look(look: &Look, focus_m: f32, size: (u32, u32)) -> Lens {
    match (look.strength, coc_fraction(look, size.1)) {
        (Strength::Lens(lens), _) => lens,
        (_, fraction) => {
            let f_number = f_number_for_coc(fraction.unwrap_or_default(), focus_m, size);
            // Possibly beyond real lenses, so that the conversion back is lossless.
            Lens { f_number: round_significant(f_number.clamp(0.01, 10_000.0)), ..DEFAULT_LENS }
        }
    }
}

/// Scales the f-number by `factor`, starting from [`lens_for_look`]. No effect unless the blur follows depth, because a lens
/// needs distances.
pub fn scale_f_number(look: &mut Look, factor: f32, focus_m: f32, size: (u32, u32)) {
    if !look.effect.follows_depth() {
        return;
    }
    look.strength = Strength::Lens(scale_lens_f_number(lens_for_look(look, focus_m, size), factor));
}

/// Returns a lens with its f-number scaled by `factor`, within [`F_NUMBER_RANGE`].
fn scale_lens_f_number(lens: Lens, factor: f32) -> Lens {
    let (min, max) = (F_NUMBER_RANGE.start().min(lens.f_number), F_NUMBER_RANGE.end().max(lens.f_number));
    let f_number = (lens.f_number * factor).clamp(min, max);
    Lens { f_number: round_significant(f_number), ..lens }
}

/// Widens the focus range, in steps of a centimetre.
pub fn widen_focus_range(look: &mut Look, by_m: f32) {
    let range_m = ((look.focus_range_m + by_m) * 100.0).round() / 100.0;
    look.focus_range_m = range_m.clamp(*FOCUS_RANGE_LIMITS_M.start(), *FOCUS_RANGE_LIMITS_M.end());
}

/// Moves the focus by fractions of the picture's width and height: the tilt-shift band (dx rotates it), a focus
/// distance (up and right increase it), else the focus point.
pub fn move_focus(look: &mut Look, dx: f32, dy: f32) {
    if look.effect == Effect::TiltShift {
        look.tilt.center_y = (look.tilt.center_y + dy).clamp(0.0, 1.0);
        // A key's step of 0.02 rotates by 2 degrees.
        look.tilt.angle_deg = rotate_band(look.tilt.angle_deg, dx * 100.0);
        return;
    }
    look.focus = match look.focus {
        FocusRule::Metres(metres) => {
            // Steps are proportional to the distance: 4 %.
            let metres = metres * (1.0 + 2.0 * (dx - dy));
            FocusRule::Metres(round_significant(
                metres.clamp(*FOCUS_DISTANCE_RANGE_M.start(), *FOCUS_DISTANCE_RANGE_M.end()),
            ))
        }
        // A key's step of 0.02 moves it by as much of the range, away from the camera.
        FocusRule::Relative(place) => FocusRule::Relative(round_significant((place + dx - dy).clamp(0.0, 1.0))),
        FocusRule::Auto => focus_on_point(0.5 + dx, 0.5 + dy),
        FocusRule::Point { x, y } | FocusRule::Track { x, y } => focus_on_point(x + dx, y + dy),
    };
}

/// Returns a focus on a point of the picture, clamped to it.
pub fn focus_on_point(x: f32, y: f32) -> FocusRule {
    FocusRule::Point { x: round_significant(x.clamp(0.0, 1.0)), y: round_significant(y.clamp(0.0, 1.0)) }
}

/// Returns a focus that tracks the object at a point of the picture, clamped to it.
pub fn focus_on_tracked(x: f32, y: f32) -> FocusRule {
    FocusRule::Track { x: round_significant(x.clamp(0.0, 1.0)), y: round_significant(y.clamp(0.0, 1.0)) }
}

/// Rounds to four significant digits: finer steps are invisible, and commands stay short.
fn round_significant(value: f32) -> f32 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// Returns an angle plus `by_deg`, wrapped to -90 to 90 degrees: rotating a band by 180 degrees changes nothing.
pub fn rotate_band(angle_deg: f32, by_deg: f32) -> f32 {
    (angle_deg + by_deg + 90.0).rem_euclid(180.0) - 90.0
}
