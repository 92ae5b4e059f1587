//! Temporal recursive filter of what a bin is made of ([`Settings::reuse`](crate::bokeh::Settings::reuse)): a pixel of a
//! bin moves only slowly towards the newest frame while it differs by no more than noise does, and is replaced at once
//! where it differs by more. The blur of a still wall is then still, and a virtual camera's encoder has less to send.

#![allow(clippy::needless_range_loop)] // Planes index several arrays at once.

use pulp::Simd;

use crate::compute::simd::{abs, fma, load, store};

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

/// Moves a vector of pixels of the last frame towards the new ones: premultiplied colour and coverage of both, in planes
/// of which `last` begins at index `at` of each `stride` values and `new` at index `x`.
#[inline(always)]
pub fn steady<S: Simd, const W: usize>(
    simd: S,
    (last, at, stride): (&[f32], usize, usize),
    new: &mut [[f32; W]],
    x: usize,
) {
    let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
    // Premultiplied light counts by the coverage that it has, so that nothing is left of what was empty before.
    let (old, value) = (load::<S>(last, 3 * stride + at), load::<S>(&new[3], x));
    let coverage = simd.max_f32s(simd.max_f32s(old, value), simd.splat_f32s(1e-6));
    let apart = abs(simd, simd.sub_f32s(value, old));
    let mut change = simd.div_f32s(apart, simd.mul_f32s(coverage, simd.splat_f32s(CHANGED_COVERAGE)));
    for p in 0..3 {
        let (old, value) = (load::<S>(last, p * stride + at), load::<S>(&new[p], x));
        let light = simd.max_f32s(simd.max_f32s(old, value), zero);
        let root = simd.sqrt_f32s(simd.mul_f32s(light, coverage));
        let dark = simd.mul_f32s(coverage, simd.splat_f32s(DARK_ROOT));
        let limit = simd.mul_f32s(simd.add_f32s(root, dark), simd.splat_f32s(CODE_STEP * CHANGED_CODES));
        change = simd.max_f32s(change, simd.div_f32s(abs(simd, simd.sub_f32s(value, old)), limit));
    }
    // From noise to change, the weight rises linearly.
    let weight = fma(simd, change, simd.splat_f32s(2.0), simd.splat_f32s(-1.0));
    let weight = simd.min_f32s(simd.max_f32s(weight, simd.splat_f32s(NEW_WEIGHT)), one);
    for p in 0..4 {
        let (old, value) = (load::<S>(last, p * stride + at), load::<S>(&new[p], x));
        store::<S>(&mut new[p], x, fma(simd, simd.sub_f32s(value, old), weight, old));
    }
}
