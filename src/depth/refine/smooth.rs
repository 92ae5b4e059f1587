//! Edge-preserving spatial denoising of surfaces.
//!
//! The sigma filter (Lee, *Digital image smoothing and the sigma filter*, 1983) along rows and then along columns, with
//! taps in symmetric pairs: `v = v_0 + sum(v_-k + v_k - 2 v_0) / (2 PAIRS + 1)`, where a pair counts only if both its
//! ends belong to the surface. So slanted planes are preserved up to their very rim, and the two sides of an edge never
//! mix.
//!
//! twin: shaders/refine/smooth.wgsl

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::noise::NO_NOISE;
use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;

/// Offsets of the averaged pairs in pixels: sparse, because the noise of depth sensors is correlated over some pixels.
/// A denser set with the same radius gains nothing.
pub const PAIRS_PX: [usize; 4] = [2, 4, 6, 8];
/// Depths within this many standard deviations belong to one surface.
pub const SAME_SURFACE: f32 = 3.5;

/// Denoises maps of inverse depth; owns its buffers.
#[derive(Debug, Default)]
pub struct Smoother {
    /// One per thread.
    lines: Vec<Lines>,
}

/// A ring buffer of rows after the horizontal pass, and one row before it.
#[derive(Debug, Default)]
struct Lines {
    along_rows: Vec<f32>,
    row: Vec<f32>,
}

/// Radius of the filter in pixels, and the number of rows of the vertical pass.
const RADIUS_PX: usize = PAIRS_PX[PAIRS_PX.len() - 1];
const ROWS: usize = 2 * RADIUS_PX + 1;

impl Lines {
    fn resize(&mut self, width: usize) {
        self.along_rows.resize(ROWS * width, 0.0);
        self.row.resize(width, 0.0);
    }
}

impl Smoother {
    /// Computes inverse depth, `focus_m` over `metres`, and denoises it; `noise` is the standard deviation of its
    /// noise.
    pub fn smooth(
        &mut self,
        (arch, workers): (Arch, &mut ThreadPool),
        (metres, focus_m): (&[f32], f32),
        inverse: &mut Vec<f32>,
        width: usize,
        noise: f32,
    ) {
        inverse.resize(metres.len(), 0.0);
        let bands = Bands::new(metres.len().checked_div(width).unwrap_or(0), 1, workers);
        let limit = if noise < NO_NOISE { None } else { Some(SAME_SURFACE * noise) };
        // Sized here for every thread: one without a part of this frame would allocate in a later one.
        self.lines.resize_with(workers.thread_count(), Lines::default);
        if limit.is_some() {
            self.lines.iter_mut().for_each(|lines| lines.resize(width));
        }
        let parts = bands.rows().zip(bands.split(inverse, width));
        workers.run_each_with(&mut self.lines, parts, &|Lines { along_rows, row }, (rows, out)| {
            let Some(limit) = limit else {
                let values = &metres[rows.start * width..rows.end * width];
                return arch.dispatch(Invert { focus_m, values, out });
            };
            arch.dispatch(Smooth { metres, focus_m, rows, out, width, limit, along_rows, row });
        });
    }
}

/// Computes `focus_m / from` in parallel, like [`Invert`]; rows have `width` values.
pub fn invert((arch, workers): (Arch, &mut ThreadPool), focus_m: f32, (from, out): (&[f32], &mut [f32]), width: usize) {
    let bands = Bands::new(out.len() / width, 1, workers);
    let parts = bands.rows().zip(bands.split(out, width));
    workers.run_each(parts, &|(rows, out)| {
        arch.dispatch(Invert { focus_m, values: &from[rows.start * width..], out });
    });
}

/// Computes `focus_m / values`: converts depth in metres to inverse depth and back.
pub struct Invert<'a> {
    pub focus_m: f32,
    pub values: &'a [f32],
    pub out: &'a mut [f32],
}

impl WithSimd for Invert<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { focus_m, values, out } = self;
        for (out, &value) in out.iter_mut().zip(values) {
            *out = focus_m / value;
        }
    }
}

/// The sigma filter along rows, and along columns as soon as a row has all its inputs, so that they are still in the
/// cache. Ends of a pair within `limit` of its centre lie on the centre's surface.
struct Smooth<'a> {
    metres: &'a [f32],
    focus_m: f32,
    /// Range of output rows.
    rows: Range<usize>,
    out: &'a mut [f32],
    width: usize,
    limit: f32,
    along_rows: &'a mut [f32],
    row: &'a mut [f32],
}

impl WithSimd for Smooth<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { metres, focus_m, rows, out, width, limit, along_rows, row } = self;
        let height = metres.len() / width;
        for y in rows.start.saturating_sub(RADIUS_PX)..rows.end + RADIUS_PX {
            if y < height {
                Invert { focus_m, values: &metres[y * width..][..width], out: row }.with_simd(simd);
                smooth_row(row, &mut along_rows[y % ROWS * width..][..width], limit);
            }
            let Some(y) = y.checked_sub(RADIUS_PX).filter(|&y| y >= rows.start) else { continue };
            let row = |y: usize| &along_rows[y % ROWS * width..][..width];
            let (here, out) = (row(y), &mut out[(y - rows.start) * width..][..width]);
            if y >= RADIUS_PX && y + RADIUS_PX < height {
                average_pairs(PAIRS_PX.map(|px| [row(y - px), row(y + px)]), here, out, limit);
            } else {
                out.fill(0.0);
                for px in PAIRS_PX.into_iter().filter(|&px| px <= y && y + px < height) {
                    add_pair_differences(row(y - px), here, row(y + px), out, limit);
                }
                finish_mean(here, out);
            }
        }
    }
}

/// Filters along a row.
#[inline(always)]
fn smooth_row(row: &[f32], out: &mut [f32], limit: f32) {
    let width = row.len();
    let inside = width.saturating_sub(2 * RADIUS_PX);
    // Pixels near the borders, where some pairs lack an end; whole rows if they are too short.
    let ends = if inside == 0 { [0..width, width..width] } else { [0..RADIUS_PX, width - RADIUS_PX..width] };
    for x in ends.into_iter().flatten() {
        let here = row[x];
        let mut sum = 0.0;
        for px in PAIRS_PX.into_iter().filter(|&px| px <= x && x + px < width) {
            sum += pair_difference(row[x - px], here, row[x + px], limit);
        }
        out[x] = mean_of_taps(here, sum);
    }
    if inside > 0 {
        let part = |from: usize| &row[from..][..inside];
        let pairs = PAIRS_PX.map(|px| [part(RADIUS_PX - px), part(RADIUS_PX + px)]);
        average_pairs(pairs, part(RADIUS_PX), &mut out[RADIUS_PX..][..inside], limit);
    }
}

/// Filters pixels of which all pairs are complete.
#[inline(always)]
fn average_pairs(pairs: [[&[f32]; 2]; PAIRS_PX.len()], here: &[f32], out: &mut [f32], limit: f32) {
    let count = out.len();
    let (pairs, here) = (pairs.map(|ends| ends.map(|end| &end[..count])), &here[..count]);
    for (x, out) in out.iter_mut().enumerate() {
        let sum =
            pairs.iter().fold(0.0, |sum, [before, after]| sum + pair_difference(before[x], here[x], after[x], limit));
        *out = mean_of_taps(here[x], sum);
    }
}

/// Returns the sum of the differences of both ends of a pair from its centre, or 0 unless both lie on the centre's
/// surface.
#[inline(always)]
fn pair_difference(before: f32, here: f32, after: f32, limit: f32) -> f32 {
    let (before, after) = (before - here, after - here);
    let same = (before.abs() < limit) & (after.abs() < limit);
    if same { before + after } else { 0.0 }
}

/// Returns the mean over all taps from the sum of differences. A rejected pair counts as two taps equal to the centre.
#[inline(always)]
fn mean_of_taps(here: f32, sum: f32) -> f32 {
    const WEIGHT: f32 = 1.0 / (2 * PAIRS_PX.len() + 1) as f32;
    here + sum * WEIGHT
}

/// Adds the differences of pairs to `out`.
#[inline(always)]
fn add_pair_differences(before: &[f32], here: &[f32], after: &[f32], out: &mut [f32], limit: f32) {
    for (((&before, &here), &after), out) in before.iter().zip(here).zip(after).zip(out) {
        *out += pair_difference(before, here, after, limit);
    }
}

/// Converts the summed differences in `out` to the mean.
#[inline(always)]
fn finish_mean(row: &[f32], out: &mut [f32]) {
    for (&here, out) in row.iter().zip(out) {
        *out = mean_of_taps(here, *out);
    }
}
