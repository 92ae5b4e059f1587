//! Temporal recursive filter of what a bin is made of ([`Settings::reuse`](crate::bokeh::Settings::reuse)): a pixel of a
//! bin moves only slowly towards the newest frame while it differs by no more than noise does, and is replaced at once
//! where it differs by more. The blur of a still wall is then still, and a virtual camera's encoder has less to send.

#![allow(clippy::needless_range_loop)] // Planes index several arrays at once.

use pulp::Simd;

use super::rows::STRIP;
use super::tent::SUM_PLANES;
use crate::compute::simd::{abs, fma, load};

/// Weight of the newest frame in a pixel that does not change.
const NEW_WEIGHT: f32 = 1.0 / 24.0;
/// Difference of an sRGB code from which a pixel is replaced, and below half of which it is noise.
const CHANGED_CODES: f32 = 5.0;
/// Difference of the coverage, as a fraction of the larger one, from which a pixel is replaced.
const CHANGED_COVERAGE: f32 = 0.05;
/// Linear light of a code's step at white, and what is added to the square root of light, so that the step at darker
/// light is about their product.
const CODE_STEP: f32 = 0.0086;
const DARK_ROOT: f32 = 0.05;

/// Moves a vector of pixels of the last frame towards the new ones: premultiplied colour and coverage of both, of which
/// `last` is a row of a strip, and the pixels are at column `x` of it.
#[inline(always)]
pub fn steady<S: Simd>(simd: S, last: &[f32], x: usize, new: &mut [S::f32s; SUM_PLANES]) {
    let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
    let mut old = [zero; 4];
    for p in 0..4 {
        old[p] = load::<S>(last, p * STRIP + x);
    }
    // Premultiplied light counts by the coverage that it has, so that nothing is left of what was empty before.
    let coverage = simd.max_f32s(simd.max_f32s(old[3], new[3]), simd.splat_f32s(1e-6));
    let (mut apart, mut light) = (old, old);
    for p in 0..4 {
        apart[p] = simd.sub_f32s(new[p], old[p]);
        light[p] = simd.mul_f32s(simd.max_f32s(simd.max_f32s(old[p], new[p]), zero), coverage);
    }
    let dark = simd.mul_f32s(coverage, simd.splat_f32s(DARK_ROOT));
    // Most pixels hold noise only. Squares show that, with a smaller limit: that of the sum of two roots squared.
    let [color_limit, coverage_limit] = const {
        let [color, coverage] = [CODE_STEP * CHANGED_CODES, CHANGED_COVERAGE];
        let square = -(0.5 + 0.5 * NEW_WEIGHT) * (0.5 + 0.5 * NEW_WEIGHT);
        [square * color * color, square * coverage * coverage]
    };
    let (color_limit, coverage_limit) = (simd.splat_f32s(color_limit), simd.splat_f32s(coverage_limit));
    let mut excess = fma(simd, apart[3], apart[3], simd.mul_f32s(simd.mul_f32s(coverage, coverage), coverage_limit));
    for p in 0..3 {
        let least = simd.mul_f32s(fma(simd, dark, dark, light[p]), color_limit);
        excess = simd.max_f32s(excess, fma(simd, apart[p], apart[p], least));
    }
    let mut weight = simd.splat_f32s(NEW_WEIGHT);
    if simd.first_true_m32s(simd.greater_than_f32s(excess, zero)) < S::F32_LANES {
        let mut change = simd.div_f32s(abs(simd, apart[3]), simd.mul_f32s(coverage, simd.splat_f32s(CHANGED_COVERAGE)));
        for p in 0..3 {
            let root = simd.add_f32s(simd.sqrt_f32s(light[p]), dark);
            let limit = simd.mul_f32s(root, simd.splat_f32s(CODE_STEP * CHANGED_CODES));
            change = simd.max_f32s(change, simd.div_f32s(abs(simd, apart[p]), limit));
        }
        // From noise to change, the weight rises linearly.
        let rising = fma(simd, change, simd.splat_f32s(2.0), simd.splat_f32s(-1.0));
        weight = simd.min_f32s(simd.max_f32s(rising, weight), one);
    }
    for p in 0..4 {
        new[p] = fma(simd, apart[p], weight, old[p]);
    }
}
