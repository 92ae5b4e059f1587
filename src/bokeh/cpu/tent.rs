//! Weighted pixels of a row, and the tent filter that downscales them: twice as wide as a bin pixel, which preserves
//! the centroid.
//!
//! twin: shaders/blur/tent.wgsl

#![allow(clippy::needless_range_loop)] // Planes index several arrays at once.

use pulp::Simd;

use super::tiles::BLOCK;
use super::unpack::{PixelRun, Surfaces};
use crate::bokeh::plan::{BinWeight, HIDING_WEIGHT};
use crate::compute::aligned::CacheAligned;
use crate::compute::simd::{abs, fma, load, store};

/// Columns on both sides of a block that its averages include.
pub const MARGIN: usize = 8;
/// Columns of a block and its margins.
pub const PADDED_BLOCK: usize = BLOCK + 2 * MARGIN;
/// Length of a plane of a block: one cache line more than needed, because planes at multiples of 4096 bytes conflict.
pub const PLANE_LEN: usize = BLOCK + 16;
/// Planes of a sum: premultiplied colour, coverage, coverage times |CoC|.
pub const SUM_PLANES: usize = 5;

/// A row of a block of the bin: the planes of a sum.
pub type Means = CacheAligned<[[f32; PLANE_LEN]; SUM_PLANES]>;

/// Adds a weighted row to two rows of sums, or starts them if they are `fresh`. Vertically, the tent falls for one row
/// of the bin while it rises for the next, so a row of the picture is read once and never stored, at any scale.
#[inline(always)]
pub fn accumulate_row<S: Simd>(
    simd: S,
    weight: &VectorWeight<S>,
    surfaces: &Surfaces<PADDED_BLOCK>,
    columns: usize,
    weights: [f32; 2],
    rows: [&mut [[f32; PADDED_BLOCK]; SUM_PLANES]; 2],
    fresh: [bool; 2],
) {
    let zero = simd.splat_f32s(0.0);
    let weights = [simd.splat_f32s(weights[0]), simd.splat_f32s(weights[1])];
    let [above, below] = rows;
    for x in (0..columns + 2 * MARGIN).step_by(S::F32_LANES) {
        let taken = weight.surface_weights(simd, surfaces, x);
        if is_zero(simd, taken) {
            for p in 0..SUM_PLANES {
                if fresh[0] {
                    store::<S>(&mut above[p], x, zero);
                }
                if fresh[1] {
                    store::<S>(&mut below[p], x, zero);
                }
            }
            continue;
        }
        let values = weight.apply(simd, taken, surfaces, x);
        for p in 0..SUM_PLANES {
            let falling = if fresh[0] { zero } else { load::<S>(&above[p], x) };
            let rising = if fresh[1] { zero } else { load::<S>(&below[p], x) };
            store::<S>(&mut above[p], x, fma(simd, values[p], weights[0], falling));
            store::<S>(&mut below[p], x, fma(simd, values[p], weights[1], rising));
        }
    }
}

/// Adds a row of one plane that counts as a whole, in the same way.
#[inline(always)]
pub fn accumulate_whole_row<S: Simd>(
    simd: S,
    values: &[f32; PADDED_BLOCK],
    columns: usize,
    weights: [f32; 2],
    [above, below]: [&mut [f32; PADDED_BLOCK]; 2],
    fresh: [bool; 2],
) {
    let weights = [simd.splat_f32s(weights[0]), simd.splat_f32s(weights[1])];
    for (row, is_fresh) in [(&mut *above, fresh[0]), (&mut *below, fresh[1])] {
        if is_fresh {
            row[..columns + 2 * MARGIN].fill(0.0);
        }
    }
    for x in (0..columns + 2 * MARGIN).step_by(S::F32_LANES) {
        let value = load::<S>(values, x);
        for (row, weight) in [(&mut *above, weights[0]), (&mut *below, weights[1])] {
            let weighted = fma(simd, value, weight, load::<S>(row, x));
            store::<S>(row, x, weighted);
        }
    }
}

/// Weight of a bin, prepared for vectors.
pub struct VectorWeight<S: Simd> {
    steps: Option<[[S::f32s; 2]; 2]>,
}

impl<S: Simd> VectorWeight<S> {
    #[inline(always)]
    pub fn new(simd: S, weight: &Option<BinWeight>) -> Self {
        // A step at `at` with a slope: slope c + (1/2 - slope at).
        let step = |(at, slope): (f32, f32)| [simd.splat_f32s(slope), simd.splat_f32s(0.5 - slope * at)];
        Self { steps: weight.as_ref().map(|weight| [step(weight.front), step(weight.behind)]) }
    }

    /// Returns the weights of a vector of pixels: of their only or farther surface, and of the nearer one where some
    /// have two.
    #[inline(always)]
    pub fn surface_weights<const W: usize>(&self, simd: S, surfaces: &Surfaces<W>, x: usize) -> [S::f32s; 2] {
        let back = self.at(simd, &surfaces.back, x);
        [back, if surfaces.mixed { self.at(simd, &surfaces.front, x) } else { back }]
    }

    /// Returns premultiplied colour, coverage, and coverage times |CoC| of a vector of pixels with weights `taken`, for
    /// one or two surfaces.
    #[inline(always)]
    pub fn apply<const W: usize>(
        &self,
        simd: S,
        taken: [S::f32s; 2],
        surfaces: &Surfaces<W>,
        x: usize,
    ) -> [S::f32s; SUM_PLANES] {
        let back = scale_surface(simd, taken[0], &surfaces.back, x);
        if !surfaces.mixed {
            return back;
        }
        let (alpha, behind) = (load::<S>(&surfaces.alpha.0, x), load::<S>(&surfaces.behind.0, x));
        let one = simd.splat_f32s(1.0);
        if simd.first_true_m32s(simd.less_than_f32s(simd.sub_f32s(behind, alpha), one)) == S::F32_LANES {
            return back;
        }
        let front = scale_surface(simd, taken[1], &surfaces.front, x);
        // Parts of the farther surface that are known but not visible count only in bins without the nearer one.
        let unseen = simd.sub_f32s(simd.add_f32s(behind, alpha), one);
        let hidden = simd.min_f32s(simd.mul_f32s(simd.splat_f32s(1.0 / HIDING_WEIGHT), front[3]), one);
        let behind = simd.sub_f32s(behind, simd.mul_f32s(unseen, hidden));
        let mut both = back;
        for p in 0..SUM_PLANES {
            both[p] = fma(simd, alpha, front[p], simd.mul_f32s(behind, back[p]));
        }
        both
    }

    /// Returns the weights of a vector of pixels of one surface.
    #[inline(always)]
    fn at<const W: usize>(&self, simd: S, pixels: &PixelRun<W>, x: usize) -> S::f32s {
        let [zero, one] = [simd.splat_f32s(0.0), simd.splat_f32s(1.0)];
        let Some([up, down]) = &self.steps else { return one };
        let coc = load::<S>(&pixels.0[3], x);
        let up = simd.min_f32s(simd.max_f32s(fma(simd, coc, up[0], up[1]), zero), one);
        let down = simd.min_f32s(simd.max_f32s(fma(simd, coc, down[0], down[1]), zero), one);
        simd.sub_f32s(up, down)
    }
}

/// Whether the weights of a whole vector are 0.
#[inline(always)]
pub fn is_zero<S: Simd>(simd: S, taken: [S::f32s; 2]) -> bool {
    let any = simd.greater_than_f32s(simd.max_f32s(taken[0], taken[1]), simd.splat_f32s(0.0));
    simd.first_true_m32s(any) == S::F32_LANES
}

/// Multiplies a vector of pixels of one surface by their weights, in the layout of [`VectorWeight::apply`].
#[inline(always)]
fn scale_surface<S: Simd, const W: usize>(
    simd: S,
    weight: S::f32s,
    pixels: &PixelRun<W>,
    x: usize,
) -> [S::f32s; SUM_PLANES] {
    let mut values = [weight; SUM_PLANES];
    for p in 0..3 {
        values[p] = simd.mul_f32s(weight, load::<S>(&pixels.0[p], x));
    }
    values[4] = simd.mul_f32s(weight, abs(simd, load::<S>(&pixels.0[3], x)));
    values
}

/// Applies the tent horizontally to a plane: a row of sums at the bin's scale. Where the tent rises for one pixel of the bin it
/// falls for the one before, so the remaining sums are over runs of `S` values.
#[inline(always)]
pub fn downscale_row<V: Simd, const S: usize>(
    simd: V,
    sum: &[f32; PADDED_BLOCK],
    columns: usize,
    mean: &mut [f32; PLANE_LEN],
) {
    // The rising and the falling half of the tent, repeated.
    let [rise, fall] = const {
        let mut halves = [[0.0; BLOCK]; 2];
        let mut k = 0;
        while k < BLOCK {
            halves[0][k] = ((k % S) as f32 + 0.5) / (S * S) as f32;
            halves[1][k] = 1.0 / S as f32 - halves[0][k];
            k += 1;
        }
        halves
    };
    // The weights repeat every `S` columns, so that one vector has all of them if it is not narrower.
    let phase = |x: usize| if V::F32_LANES >= S { 0 } else { x };
    let mut weighed = CacheAligned([0.0f32; BLOCK]);
    let start = MARGIN - S / 2;
    for x in (0..columns).step_by(V::F32_LANES) {
        let (rise, fall) = (load::<V>(&rise, phase(x)), load::<V>(&fall, phase(x)));
        let (before, after) = (load::<V>(sum, start + x), load::<V>(sum, start + S + x));
        store::<V>(&mut weighed.0, x, fma(simd, after, fall, simd.mul_f32s(before, rise)));
    }
    for (mean, group) in mean[..columns / S].iter_mut().zip(weighed.0.as_chunks::<S>().0) {
        let mut total = 0.0;
        for value in group {
            total += value;
        }
        *mean = total;
    }
}

#[cfg(test)]
mod tests {
    use pulp::{Arch, WithSimd};

    use super::*;

    /// Averages a row at this scale.
    struct Downscale<const S: usize>(f32);

    impl<const S: usize> WithSimd for Downscale<S> {
        type Output = Vec<f32>;
        fn with_simd<V: Simd>(self, simd: V) -> Vec<f32> {
            let row = std::array::from_fn(|x| if x == MARGIN + 2 * S { 1.0 } else { self.0 });
            let mut mean = [0.0; PLANE_LEN];
            downscale_row::<V, S>(simd, &row, BLOCK, &mut mean);
            mean[..BLOCK / S].to_vec()
        }
    }

    fn check<const S: usize>() {
        for arch in [Arch::new(), Arch::Scalar] {
            let constant = arch.dispatch(Downscale::<S>(1.0));
            assert!(constant.iter().all(|mean| (mean - 1.0).abs() < 1e-6), "{S}: {constant:?}");
            // A point in the first column of pixel 2 of the bin: the tents of its pixels 1 and 2 meet there.
            let (rising, falling) = ((S as f32 + 1.0) / 2.0, (S as f32 - 1.0) / 2.0);
            let point = arch.dispatch(Downscale::<S>(0.0));
            let mut expected = vec![0.0; BLOCK / S];
            (expected[2], expected[1]) = (rising / (S * S) as f32, falling / (S * S) as f32);
            assert!(point.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6), "{S}: {point:?}");
        }
    }

    #[test]
    fn vectors_of_any_width_average_by_the_tent() {
        check::<2>();
        check::<4>();
        check::<8>();
    }
}
