//! Spatial denoising (edge-preserving): noise of smooth surfaces, how much there is, and less of it.
//!
//! The sigma filter (Lee, *Digital image smoothing and the sigma filter*, 1983) along rows and then along columns, with
//! taps in symmetric pairs: a pair counts only if both its ends belong to the surface. A slanted plane then stays
//! where it is, up to its very rim, and the two sides of an edge are never mixed.

use pulp::{Arch, WithSimd};

/// Distances in pixels of the pairs that are averaged: sparse, because the noise of depth sensors is correlated over
/// some pixels. A denser set of the same reach gains nothing.
const PAIRS_PX: [usize; 4] = [2, 4, 6, 8];
/// Depths within this many standard deviations belong to one surface.
const SAME_SURFACE: f32 = 3.5;
/// Distance in pixels between the three depths that tell noise from slope, above the length over which it correlates.
const LAG_PX: usize = 6;
/// Rows and columns sampled for the noise, at most.
const LOOKS: usize = 96;
/// Share of the differences that lie on smooth surfaces, whatever else the picture holds, and the quantile of `|x|`
/// there of a normal distribution in standard deviations.
const SMOOTH_SHARE: f32 = 0.35;
const SMOOTH_QUANTILE: f32 = 0.4538;
/// Noise below this is none: it is 1/20 px of CoC with a strong blur.
const NO_NOISE: f32 = 5e-4;

/// Reduces the noise of maps of inverse depth; owns the memory for it.
#[derive(Debug, Default)]
pub struct Smoother {
    differences: Vec<f32>,
    /// The map after the pass along the rows.
    along_rows: Vec<f32>,
}

impl Smoother {
    /// The noise of a map, as a standard deviation: a low quantile of second differences, which slanted planes
    /// do not raise, and edges only where they are everywhere. Unknown depths are left out.
    pub fn noise(&mut self, inverse: &[f32], unknown: &[bool], width: usize) -> f32 {
        self.differences.clear();
        let height = inverse.len().checked_div(width).unwrap_or(0);
        for y in (0..height).step_by(height.div_ceil(LOOKS).max(1)) {
            let row = y * width..(y + 1) * width;
            let (row, unknown) = (&inverse[row.clone()], &unknown[row]);
            for x in (LAG_PX..width.saturating_sub(LAG_PX)).step_by(width.div_ceil(LOOKS).max(1)) {
                let three = [x - LAG_PX, x, x + LAG_PX];
                if three.iter().all(|&x| !unknown[x]) {
                    let [before, here, after] = three.map(|x| row[x]);
                    self.differences.push((before - 2.0 * here + after).abs());
                }
            }
        }
        if self.differences.is_empty() {
            return 0.0;
        }
        let at = (self.differences.len() as f32 * SMOOTH_SHARE) as usize;
        let quantile = *self.differences.select_nth_unstable_by(at, f32::total_cmp).1;
        // The difference has 1 + 4 + 1 times the variance of a depth.
        quantile / SMOOTH_QUANTILE / 6.0_f32.sqrt()
    }

    /// Averages `inverse`, whose noise has the standard deviation `noise`, within its surfaces.
    pub fn smooth(&mut self, arch: Arch, inverse: &mut Vec<f32>, width: usize, noise: f32) {
        if noise < NO_NOISE || width == 0 {
            return;
        }
        self.along_rows.resize(inverse.len(), 0.0);
        let limit = SAME_SURFACE * noise;
        arch.dispatch(Rows { from: inverse, to: &mut self.along_rows, width, limit });
        arch.dispatch(Columns { from: &self.along_rows, to: inverse, width, limit });
    }
}

/// The sigma filter along rows. Ends of a pair within `limit` of its middle lie on the middle's surface.
struct Rows<'a> {
    from: &'a [f32],
    to: &'a mut [f32],
    width: usize,
    limit: f32,
}

impl WithSimd for Rows<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { from, to, width, limit } = self;
        for (row, out) in from.chunks_exact(width).zip(to.chunks_exact_mut(width)) {
            out.fill(0.0);
            for px in PAIRS_PX.into_iter().filter(|px| 2 * px < width) {
                add_pair(&row[..width - 2 * px], &row[px..width - px], &row[2 * px..], &mut out[px..width - px], limit);
            }
            finish_mean(row, out);
        }
    }
}

/// As [`Rows`], along columns.
struct Columns<'a> {
    from: &'a [f32],
    to: &'a mut [f32],
    width: usize,
    limit: f32,
}

impl WithSimd for Columns<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { from, to, width, limit } = self;
        let height = from.len() / width;
        let row = |y: usize| &from[y * width..(y + 1) * width];
        for (y, out) in to.chunks_exact_mut(width).enumerate() {
            out.fill(0.0);
            for px in PAIRS_PX.into_iter().filter(|&px| px <= y && y + px < height) {
                add_pair(row(y - px), row(y), row(y + px), out, limit);
            }
            finish_mean(row(y), out);
        }
    }
}

/// Adds the differences of both ends of a pair from its middle to `out`, where both lie on the middle's surface.
#[inline(always)]
fn add_pair(before: &[f32], here: &[f32], after: &[f32], out: &mut [f32], limit: f32) {
    for (((&before, &here), &after), out) in before.iter().zip(here).zip(after).zip(out) {
        let (before, after) = (before - here, after - here);
        let same = (before.abs() < limit) & (after.abs() < limit);
        *out += if same { before + after } else { 0.0 };
    }
}

/// Turns the summed differences in `out` into the mean over all taps. A pair that was left out counts as two taps equal
/// to the middle.
#[inline(always)]
fn finish_mean(row: &[f32], out: &mut [f32]) {
    const SHARE: f32 = 1.0 / (2 * PAIRS_PX.len() + 1) as f32;
    for (&here, out) in row.iter().zip(out) {
        *out = here + *out * SHARE;
    }
}
