//! Taps for bins at a reduced scale.
//!
//! Such a bin is downscaled by a tent before its filter, and enlarged by another one after it. Both together are a cubic
//! B-spline, which blurs. The taps are those with which tents and filter together are nearest to the aperture, in least
//! squares over all positions of a point: the aperture sampled by the spline, and the spline's own correlation undone
//! (Unser, Aldroubi and Eden, *B-Spline Signal Processing*, 1993). As all of that is separable, it holds for each singular
//! function alone.

/// How far the correlation of the spline is undone: 2 is nearest to the aperture, but rings beside lights; with less, what
/// is left of the spline's blur is made up by a smaller radius ([`compensated_radius_px`]).
const UNDONE: f64 = 1.65;
/// Three times what the variance of the part that is left subtracts from a squared radius, in squared pixels of a bin.
pub const SPLINE_LEFT: f32 = 4.0 * (2.0 - UNDONE as f32);
/// Taps beyond the aperture that undo the correlation.
pub const EXTRA_TAPS: usize = 2;
/// Taps on either side of the filter that undoes the correlation: it decays by a factor of 0.27 from tap to tap.
const UNDOING_TAPS: usize = 6;
/// Samples of a profile per bin pixel.
const SAMPLES: usize = 4;

/// Returns the radius, in pixels of a picture reduced by `scale`, whose filter blurs as much as `coc_px` does at full
/// size: a disc of radius R has a variance of R^2 / 4, in which the part of the spline's correlation that is not undone
/// adds a third each, and the tents, of whole pixels, 1 / (6 s^2) more than continuous ones.
#[inline(always)]
pub fn compensated_radius_px(coc_px: f32, scale: usize) -> f32 {
    if scale == 1 {
        return coc_px;
    }
    let s = scale as f32;
    (coc_px * coc_px - (SPLINE_LEFT * s * s + 1.0) / 3.0).max(0.0).sqrt() / s
}

/// Samples profiles for reduced scales.
pub(super) struct ReducedTaps {
    /// The cubic B-spline at the centres of samples, over four pixels.
    spline: [f64; 4 * SAMPLES],
    /// The filter that undoes the spline's correlation at whole pixels.
    undoing: [f64; 2 * UNDOING_TAPS + 1],
}

impl ReducedTaps {
    pub(super) fn new() -> Self {
        let spline = std::array::from_fn(|k| {
            let x = ((k as f64 + 0.5) / SAMPLES as f64 - 2.0).abs();
            if x < 1.0 { (4.0 - 6.0 * x * x + 3.0 * x * x * x) / 6.0 } else { (2.0 - x).powi(3) / 6.0 }
        });
        // A power of the inverse of the correlation's transfer function, (4 + 2 cos w) / 6, transformed back.
        const STEPS: usize = 64;
        let undoing = std::array::from_fn(|k| {
            let wave = |step: usize| step as f64 * std::f64::consts::TAU / STEPS as f64;
            let term = |step| ((4.0 + 2.0 * f64::cos(wave(step))) / 6.0).powf(-UNDONE);
            let shift = k as f64 - UNDOING_TAPS as f64;
            (0..STEPS).map(|step| term(step) * (wave(step) * shift).cos()).sum::<f64>() / STEPS as f64
        });
        Self { spline, undoing }
    }

    /// Fills `taps`, centred on 0, from the `integral` of a profile between two places, in pixels.
    pub(super) fn sample(&self, integral: impl Fn(f64, f64) -> f64, taps: &mut [f64]) {
        let first = -(taps.len() as f64 - 1.0) / 2.0 - UNDOING_TAPS as f64;
        let sampled: Vec<f64> = (0..taps.len() + 2 * UNDOING_TAPS)
            .map(|j| {
                let from = first + j as f64 - 2.0;
                let edge = |k: usize| from + k as f64 / SAMPLES as f64;
                self.spline.iter().enumerate().map(|(k, weight)| weight * integral(edge(k), edge(k + 1))).sum()
            })
            .collect();
        for (tap, sampled) in taps.iter_mut().zip(sampled.windows(self.undoing.len())) {
            *tap = sampled.iter().zip(&self.undoing).map(|(value, weight)| value * weight).sum();
        }
    }
}
