//! Depth slicing by histogram: bin borders lie where few pixels are, so that a surface stays in one bin and two
//! surfaces do not share one. A flat background then costs one bin, however wide the possible range.

use pulp::{Arch, Simd, WithSimd};

use super::quality_level::{FOCUS_BORDER_PX, QualityLevel};
use crate::frame::DepthMap;
use crate::optics::DepthCoc;

/// Buckets per octave of `|c|`.
const BUCKETS_PER_OCTAVE: usize = 16;
/// Buckets on one side of the focal plane: `|c|` from 1 px to 256 px; the last bucket holds everything beyond.
const BUCKETS: usize = 8 * BUCKETS_PER_OCTAVE;
/// Right shift that turns the bits of a float into its bucket: exponent and top bits of the mantissa remain.
const BUCKET_SHIFT: u32 = f32::MANTISSA_DIGITS - 1 - BUCKETS_PER_OCTAVE.ilog2();
/// Shifted bits of the radius at which bucket 0 begins.
const FIRST: u32 = FOCUS_BORDER_PX.to_bits() >> BUCKET_SHIFT;
/// Minimum of samples across a frame with enough columns; there are less than twice this number.
const SAMPLES_ACROSS: usize = 320;
/// Cost of one more bin: it must lower the sum over all bins of (variance of `ln |c|` in the bin) x (fraction of the
/// picture) by this.
const BIN_COST: f64 = 0.002;
/// Fraction of a bin's pixels that may have a smaller radius than its scale is made for.
const STRAY_FRACTION: f32 = 0.02;

/// Half the width of the cross-fade between two bins, as a fraction of the border's CoC.
pub const CROSS_FADE: f32 = 0.15;

/// Filters of a smaller radius have one tap, in pixels.
pub const SHARP_PX: f32 = 0.4;

/// A range of `|c|` on one side of the focal plane that contains pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CocRange {
    /// Border towards the focal plane, in pixels.
    pub border_px: f32,
    /// Smallest radius, in pixels, ignoring strays.
    pub low_px: f32,
    /// Largest radius, in pixels.
    pub high_px: f32,
}

/// Histogram of a frame's CoC.
#[derive(Clone, Debug)]
pub struct CocHistogram {
    /// Samples per bucket of `|c|`, behind and in front of the focal plane, and of those in focus: up to a radius of
    /// [`SHARP_PX`], and from there to the first bucket.
    counts: [u32; PLACES],
}

/// Number of counts of a histogram.
const PLACES: usize = 2 * BUCKETS + 2;

impl Default for CocHistogram {
    fn default() -> Self {
        Self { counts: [0; PLACES] }
    }
}

impl CocHistogram {
    /// Counts the pixels of a frame on a subsampled grid.
    pub fn count_depth(&mut self, depth: &DepthMap, lens: &DepthCoc) {
        let coc_px_of = |metres| lens.coc_px(metres);
        self.counts = Arch::new().dispatch(Count { values: &depth.metres, width: depth.width as usize, coc_px_of });
    }

    /// Same as [`CocHistogram::count_depth`] for radii, `width` per row.
    pub fn count_radii(&mut self, coc_px: &[f32], width: usize) {
        self.counts = Arch::new().dispatch(Count { values: coc_px, width, coc_px_of: |coc_px| coc_px });
    }

    /// Returns the samples per bucket behind the focal plane, or in front of it.
    fn side(&self, near: bool) -> &[u32] {
        &self.counts[usize::from(near) * BUCKETS..][..BUCKETS]
    }

    /// Splits one side into `ranges`, outwards from the focal plane, at most one per bin of the quality level, by
    /// dynamic programming over the bucket borders. Returns the largest radius that is left to the bin in focus, in
    /// pixels; in front it keeps everything up to `near_from_px`.
    pub fn split_side(&self, near: bool, level: &QualityLevel, near_from_px: f32, ranges: &mut Vec<CocRange>) -> f32 {
        ranges.clear();
        let side = self.side(near);
        let bins = (level.bins_per_side as usize).min(MAX_RANGES);
        let Some(last) = side.iter().rposition(|&n| n > 0) else { return FOCUS_BORDER_PX };
        // Slightly defocused pixels in front belong to the subject, not to a layer of their own.
        let first = if near { near_from_px.log2() * BUCKETS_PER_OCTAVE as f32 } else { 0.0 } as usize;
        if last < first {
            return bucket_edge_px(last + 1);
        }
        let sums = self.sum_buckets(near);
        let variance = |from: usize, to: usize| variance_between(&sums, from, to);
        // best[j][to]: smallest cost of buckets first..to in j + 1 ranges, and the start of the last range.
        let mut best = [[(f64::INFINITY, 0usize); BUCKETS + 1]; MAX_RANGES];
        for (to, best) in best[0].iter_mut().enumerate().take(last + 2).skip(first + 1) {
            *best = (variance(first, to), first);
        }
        for j in 1..bins {
            for to in first + j + 1..=last + 1 {
                for from in first + j..to {
                    // A range begins with pixels. Only the first ranges may need full scale, which is expensive.
                    if side[from] == 0 || j >= level.fine_bins && bucket_edge_px(from) < level.scale_from_px[1] {
                        continue;
                    }
                    let cost = best[j - 1][from].0 + variance(from, to) + BIN_COST;
                    if cost < best[j][to].0 {
                        best[j][to] = (cost, from);
                    }
                }
            }
        }
        let last_range = (0..bins).min_by(|&a, &b| best[a][last + 1].0.total_cmp(&best[b][last + 1].0)).unwrap_or(0);
        let mut to = last + 1;
        for j in (0..=last_range).rev() {
            let from = best[j][to].1;
            ranges.push(self.range_of_buckets(side, from, to));
            to = from;
        }
        ranges.reverse();
        ranges.first().map_or(FOCUS_BORDER_PX, |range| range.border_px)
    }

    /// Returns the fraction of the picture with a CoC between two borders around the focal plane that is not sharp.
    pub fn defocused_fraction(&self, low_px: f32, high_px: f32) -> f32 {
        let within =
            |near: bool, border_px: f32| -> u32 { self.side(near)[..bucket_of(border_px.min(f32::MAX))].iter().sum() };
        let soft = self.counts[PLACES - 1];
        (soft + within(false, high_px) + within(true, -low_px)) as f32 / self.samples().max(1) as f32
    }

    /// Returns the number of samples, including those in focus.
    fn samples(&self) -> u32 {
        self.counts.iter().sum()
    }

    /// Returns prefix sums over the buckets of w, w ln |c| and w (ln |c|)^2, where w is the fraction of the picture.
    fn sum_buckets(&self, near: bool) -> [[f64; 3]; BUCKETS + 1] {
        let (mut sums, samples) = ([[0.0f64; 3]; BUCKETS + 1], f64::from(self.samples()));
        for (k, &n) in self.side(near).iter().enumerate() {
            // A constant factor on |c| (1.04: within the bucket) changes no variance.
            let (fraction, log) = (f64::from(n) / samples, (f64::from(bucket_edge_px(k)) * 1.04).ln());
            sums[k + 1] = [sums[k][0] + fraction, sums[k][1] + fraction * log, sums[k][2] + fraction * log * log];
        }
        sums
    }

    /// Returns the range of buckets `from..to`, with its border in the empty buckets before it.
    fn range_of_buckets(&self, side: &[u32], from: usize, to: usize) -> CocRange {
        let total: u32 = side[from..to].iter().sum();
        let first = (from..to).find(|&k| side[k] > 0).unwrap_or(from);
        let mut strays = (STRAY_FRACTION * total as f32) as u32;
        // First bucket that does not consist of strays alone.
        let low = (from..to).find(|&k| {
            let is_stray = side[k] <= strays;
            strays = strays.saturating_sub(side[k]);
            !is_stray
        });
        let high = (from..to).rposition(|k| side[k] > 0).map_or(from, |k| from + k);
        // The border is the geometric mean of the gap's ends, but not far out if the gap is wide.
        let gap = (0..first).rev().find(|&k| side[k] > 0).map_or(0, |k| k + 1);
        CocRange {
            border_px: (bucket_edge_px(gap) * bucket_edge_px(first)).sqrt().min(2.5 * bucket_edge_px(gap)),
            low_px: bucket_edge_px(low.unwrap_or(first)),
            high_px: bucket_edge_px(high + 1),
        }
    }
}

/// Counts values on a subsampled grid by their CoC, `width` per row.
struct Count<'a, F> {
    values: &'a [f32],
    width: usize,
    coc_px_of: F,
}

impl<F: Fn(f32) -> f32> WithSimd for Count<'_, F> {
    type Output = [u32; PLACES];
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [u32; PLACES] {
        // Several sets of counts, because a count waits for the last addition to it.
        let mut counts = [[0u32; PLACES]; 4];
        let step = (self.width / SAMPLES_ACROSS).max(1);
        let mut samples = [0.0; 2 * SAMPLES_ACROSS];
        for row in self.values.chunks_exact(self.width.max(1)).step_by(step) {
            let taken = samples.iter_mut().zip(row.iter().step_by(step)).map(|(to, &value)| *to = value).count();
            let (chunks, rest) = samples[..taken].as_chunks::<16>();
            for chunk in chunks {
                let mut places = [0; 16];
                for (place, &value) in places.iter_mut().zip(chunk) {
                    *place = place_of((self.coc_px_of)(value));
                }
                match places.iter().fold(0, |apart, place| apart | (place ^ places[0])) {
                    0 => counts[0][places[0] as usize] += 16,
                    _ => places.iter().enumerate().for_each(|(k, &place)| counts[k % 4][place as usize] += 1),
                }
            }
            rest.iter().for_each(|&value| counts[0][place_of((self.coc_px_of)(value)) as usize] += 1);
        }
        std::array::from_fn(|place| counts.iter().map(|counts| counts[place]).sum())
    }
}

/// Returns where a CoC is counted.
#[inline(always)]
fn place_of(coc_px: f32) -> u32 {
    let bucket = (coc_px.abs().to_bits() >> BUCKET_SHIFT) as i32 - FIRST as i32;
    let outermost = BUCKETS as i32 - 1;
    let bucket = if bucket < outermost { bucket } else { outermost };
    let defocused = bucket + if coc_px < 0.0 { BUCKETS as i32 } else { 0 };
    let in_focus = 2 * BUCKETS as i32 + i32::from(coc_px.abs() > SHARP_PX);
    (if bucket < 0 { in_focus } else { defocused }) as u32
}

/// Largest number of ranges per side.
pub const MAX_RANGES: usize = 5;

/// Returns the variance of ln |c| over the buckets `from..to`, times their fraction of the picture.
fn variance_between(sums: &[[f64; 3]; BUCKETS + 1], from: usize, to: usize) -> f64 {
    let [fraction, sum, squares] = std::array::from_fn(|p| sums[to][p] - sums[from][p]);
    if fraction > 0.0 { (squares - sum * sum / fraction).max(0.0) } else { 0.0 }
}

/// Splits the radii of a ramp into ranges of equal ratio, because the look of a blur depends on the ratio. Returns none
/// if the largest radius is hardly above that of the bin in focus.
pub fn geometric_ranges(max_px: f32, bins: u32) -> impl Iterator<Item = CocRange> {
    let ratio = max_px / FOCUS_BORDER_PX;
    let border_px = move |k: u32| FOCUS_BORDER_PX * ratio.powf(k as f32 / bins as f32);
    (0..if ratio > 1.3 { bins } else { 0 }).map(move |k| CocRange {
        border_px: border_px(k),
        low_px: border_px(k),
        high_px: border_px(k + 1),
    })
}

/// Returns the first bucket that does not begin below a radius, in pixels.
fn bucket_of(radius_px: f32) -> usize {
    let bucket = (radius_px.to_bits() >> BUCKET_SHIFT).saturating_sub(FIRST) as usize;
    (bucket + usize::from(bucket_edge_px(bucket) < radius_px)).min(BUCKETS)
}

/// Returns the lower edge of a bucket, in pixels.
fn bucket_edge_px(bucket: usize) -> f32 {
    f32::from_bits((FIRST + bucket as u32) << BUCKET_SHIFT)
}
