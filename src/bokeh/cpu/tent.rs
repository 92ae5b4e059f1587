//! Shares of a row of pixels, and the tent that averages them down: twice as wide as a pixel of the bin, so that
//! reducing a picture keeps its centroid.

use pulp::Simd;

use super::tiles::BLOCK;
use super::unpack::{Piece, Surfaces};
use crate::bokeh::plan::{HIDING_SHARE, Share};
use crate::compute::aligned::Line;
use crate::compute::simd::{fma, load, store};

/// Columns beyond a block on both sides that its averages reach.
pub const MARGIN: usize = 16;
/// Columns of a block and its margins.
pub const WIDE: usize = BLOCK + 2 * MARGIN;
/// Values of a plane of a block: a line more than needed, as planes at multiples of 4096 bytes hinder each other.
pub const PLANE: usize = BLOCK + 16;
/// Planes of a sum: premultiplied colour, coverage, coverage times |CoC|.
pub const SUMS: usize = 5;

/// A row of a block of the bin: the planes of a sum.
pub type Means = Line<[[f32; PLANE]; SUMS]>;

/// Adds a row's shares to two rows of sums. Down the picture the tent falls for one row of the bin while it rises for
/// the next, so a row of the picture is read once and never kept: one pass makes any scale.
#[inline(always)]
pub fn sum_row<S: Simd>(
    simd: S,
    share: &ShareAt<S>,
    surfaces: &Surfaces<WIDE>,
    columns: usize,
    weights: [f32; 2],
    above: &mut [[f32; WIDE]; SUMS],
    below: &mut [[f32; WIDE]; SUMS],
) {
    let weights = weights.map(|weight| simd.splat_f32s(weight));
    for x in (0..columns + 2 * MARGIN).step_by(S::F32_LANES) {
        let values = share.of(simd, surfaces, x);
        for p in 0..SUMS {
            let sums = [&above[p], &below[p]].map(|sums| load::<S>(sums, x));
            store::<S>(&mut above[p], x, fma(simd, values[p], weights[0], sums[0]));
            store::<S>(&mut below[p], x, fma(simd, values[p], weights[1], sums[1]));
        }
    }
}

/// A share, ready for vectors.
pub struct ShareAt<S: Simd> {
    steps: Option<[[S::f32s; 2]; 2]>,
}

impl<S: Simd> ShareAt<S> {
    #[inline(always)]
    pub fn new(simd: S, share: &Option<Share>) -> Self {
        // A step at `at` of a slope: slope c + (1/2 - slope at).
        let step = |(at, slope): (f32, f32)| [simd.splat_f32s(slope), simd.splat_f32s(0.5 - slope * at)];
        Self { steps: share.as_ref().map(|share| [step(share.front), step(share.behind)]) }
    }

    /// Premultiplied colour, coverage, and coverage times |CoC| of a vector of pixels, whatever surfaces they show.
    #[inline(always)]
    pub fn of(&self, simd: S, surfaces: &Surfaces<WIDE>, x: usize) -> [S::f32s; SUMS] {
        let back = self.of_one(simd, &surfaces.back, x);
        if !surfaces.mixed {
            return back;
        }
        let front = self.of_one(simd, &surfaces.front, x);
        let [share, behind] = [&surfaces.share, &surfaces.behind].map(|plane| load::<S>(&plane.0, x));
        // What is known of the farther surface without being seen, and the bins that take none of the nearer one.
        let one = simd.splat_f32s(1.0);
        let unseen = simd.sub_f32s(simd.add_f32s(behind, share), one);
        let hidden = simd.min_f32s(simd.mul_f32s(simd.splat_f32s(1.0 / HIDING_SHARE), front[3]), one);
        let behind = simd.sub_f32s(behind, simd.mul_f32s(unseen, hidden));
        std::array::from_fn(|p| fma(simd, share, front[p], simd.mul_f32s(behind, back[p])))
    }

    /// The same, of pixels of one surface.
    #[inline(always)]
    fn of_one(&self, simd: S, piece: &Piece<WIDE>, x: usize) -> [S::f32s; SUMS] {
        let [r, g, b, coc] = piece.0.each_ref().map(|plane| load::<S>(plane, x));
        let [zero, one] = [0.0, 1.0].map(|value| simd.splat_f32s(value));
        let share = match &self.steps {
            None => one,
            Some(steps) => {
                let at = |[slope, offset]: [S::f32s; 2]| {
                    simd.min_f32s(simd.max_f32s(fma(simd, coc, slope, offset), zero), one)
                };
                simd.sub_f32s(at(steps[0]), at(steps[1]))
            }
        };
        let by = |value| simd.mul_f32s(share, value);
        [by(r), by(g), by(b), share, by(simd.abs_f32s(coc))]
    }
}

/// The tent across: a row of sums at the bin's scale. Weights repeat every `S` columns, so rise and fall fit in one vector
/// each, and what is left to add up are runs of `S` values.
#[inline(always)]
pub fn reduce<V: Simd, const S: usize>(simd: V, sums: &[[f32; WIDE]; SUMS], columns: usize, means: &mut Means) {
    // The ascending half of the tent, and the descending one, as often as they fit.
    let ramp: [f32; BLOCK] = const {
        let mut ramp = [0.0; BLOCK];
        let mut k = 0;
        while k < BLOCK {
            ramp[k] = ((k % S) as f32 + 0.5) / (S * S) as f32;
            k += 1;
        }
        ramp
    };
    let (rise, fall) = (load::<V>(&ramp, 0), {
        let mut fall = [0.0; BLOCK];
        for k in 0..V::F32_LANES {
            fall[k] = 1.0 / S as f32 - ramp[k];
        }
        load::<V>(&fall, 0)
    });
    let mut weighed = Line([0.0f32; BLOCK]);
    for (mean, sum) in means.0.iter_mut().zip(sums) {
        let start = MARGIN - S / 2;
        for x in (0..columns).step_by(V::F32_LANES) {
            let (before, after) = (load::<V>(sum, start + x), load::<V>(sum, start + S + x));
            store::<V>(&mut weighed.0, x, fma(simd, after, fall, simd.mul_f32s(before, rise)));
        }
        for (mean, group) in mean[..columns / S].iter_mut().zip(weighed.0.as_chunks::<S>().0) {
            *mean = group.iter().sum();
        }
    }
}
