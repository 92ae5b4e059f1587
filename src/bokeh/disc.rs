//! Discs as runs of columns: the kernel of a disc with a soft rim, for every radius.
//!
//! All pixels of a disc count alike, so its sum is, for each column, a difference of two cumulative sums down that
//! column: `2 (2 r + 1)` additions a pixel at radius `r`, where a decomposition takes a multiplication for each tap of
//! each term. A radius between those of two discs of whole pixels is a weighted mean of both, and a small kernel
//! smooths their rim: as near to the disc as three terms are, without their overshoot.

use super::bank::STEPS_PER_PX;

/// Smallest radius, in bin pixels, at which discs of whole pixels are round enough.
pub const MIN_RADIUS_PX: f32 = 7.0;
/// Largest half-width of a kernel.
pub const MAX_HALF_WIDTH: usize = 64;
/// Widest rim, in bin pixels, that one smoothed disc shows.
const MAX_STEP_PX: f64 = 2.8;
/// Half the difference of the radii of the two discs that stand for one between them, in pixels: at least.
const HALF_STEP_PX: f64 = 0.1;
/// Variance per axis of the smoothing of a hard rim, and of any rim at most: those at which the kernels from 7 to 14
/// pixels are nearest to their discs.
const SMOOTHING_VARIANCE: (f64, f64) = (0.2, 0.35);
/// Variance of a pixel's own square, per axis.
const PIXEL_VARIANCE: f64 = 1.0 / 12.0;

/// A run of pixels of equal weight down one column of a disc, `-half_height..=half_height`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColumnRun {
    pub offset: i16,
    pub half_height: i16,
}

/// The kernels of an aperture that is a disc, for radii from 0 to a maximum in steps of 1 / [`STEPS_PER_PX`].
#[derive(Clone, Debug)]
pub struct DiscBank {
    runs: Vec<ColumnRun>,
    /// Discs of all kernels: where their runs end, and the weight of each of their pixels.
    discs: Vec<(usize, f32)>,
    /// Per radius, where its discs end, and the weight of each of a pixel's two neighbours in the smoothing.
    nodes: Vec<(usize, f32)>,
}

impl DiscBank {
    /// Creates the kernels of a disc whose rim falls linearly over `rim` (0 to 1) of its radius, half inside and half
    /// outside, for radii up to `max_radius_px`; `None` if they are wider than [`MAX_HALF_WIDTH`].
    pub fn new(rim: f32, max_radius_px: f32) -> Option<Self> {
        let (rim, max_px) = (f64::from(rim.clamp(0.0, 1.0)), f64::from(max_radius_px.max(MIN_RADIUS_PX)));
        // Checked first: the kernels of hundreds of pixels would take seconds and gigabytes.
        if max_px * (1.0 + rim / 2.0) > MAX_HALF_WIDTH as f64 {
            return None;
        }
        let lattice = LatticeDiscs::new((max_px * (1.0 + rim / 2.0)).ceil() as i32 + 2);
        let mut bank = Self { runs: Vec::new(), discs: Vec::new(), nodes: Vec::new() };
        for node in 0..=(max_px * f64::from(STEPS_PER_PX)).ceil() as usize {
            let radius_px = node as f64 / f64::from(STEPS_PER_PX);
            let steps = (rim * radius_px / MAX_STEP_PX).ceil().max(1.0);
            let (hard, most) = SMOOTHING_VARIANCE;
            let smoothing = (hard + (rim * radius_px / steps).powi(2) / 12.0).min(most);
            let edge = |k: usize| radius_px * (1.0 + rim * (k as f64 / steps - 0.5));
            let first = bank.discs.len();
            for step in 0..steps as usize {
                let variance = ring_variance(edge(step), edge(step + 1)) + PIXEL_VARIANCE - smoothing;
                for (square, weight) in lattice.between(variance, radius_px * HALF_STEP_PX) {
                    let width = square.isqrt();
                    let half_height = |x: i32| (square - x * x).isqrt() as i16;
                    let run = |x: i32| ColumnRun { offset: x as i16, half_height: half_height(x) };
                    bank.runs.extend((-width..=width).map(run));
                    bank.discs.push((bank.runs.len(), weight as f32));
                }
            }
            // The taps of all discs sum to 1.
            let total: f64 =
                (first..bank.discs.len()).map(|disc| f64::from(bank.discs[disc].1) * pixels(bank.runs_of(disc))).sum();
            bank.discs[first..].iter_mut().for_each(|(_, weight)| *weight = (f64::from(*weight) / total) as f32);
            bank.nodes.push((bank.discs.len(), (smoothing / 2.0) as f32));
        }
        (bank.max_half_width() <= MAX_HALF_WIDTH).then_some(bank)
    }

    #[inline(always)]
    fn nearest_node(&self, radius_px: f32) -> usize {
        ((radius_px * STEPS_PER_PX + 0.5) as usize).min(self.nodes.len() - 1)
    }

    #[inline(always)]
    fn runs_of(&self, disc: usize) -> &[ColumnRun] {
        let first = disc.checked_sub(1).map_or(0, |before| self.discs[before].0);
        &self.runs[first..self.discs[disc].0]
    }

    /// Returns the discs of the kernel nearest to a radius in pixels: their runs, and the weight of each of their
    /// pixels.
    #[inline(always)]
    pub fn kernel(&self, radius_px: f32) -> impl Iterator<Item = (&[ColumnRun], f32)> {
        let node = self.nearest_node(radius_px);
        let first = node.checked_sub(1).map_or(0, |before| self.nodes[before].0);
        (first..self.nodes[node].0).map(|disc| (self.runs_of(disc), self.discs[disc].1))
    }

    /// Returns the weight of each of a pixel's two neighbours, along both axes, in the smoothing of the rim.
    pub fn smoothing(&self, radius_px: f32) -> f32 {
        self.nodes[self.nearest_node(radius_px)].1
    }

    /// Returns the largest half-width of all kernels.
    pub fn max_half_width(&self) -> usize {
        self.half_width(self.nodes.len() as f32 / STEPS_PER_PX)
    }

    /// Returns the outermost pixel of the kernels up to a radius, with the smoothing.
    pub fn half_width(&self, radius_px: f32) -> usize {
        let outermost = self.kernel(radius_px).flat_map(|(runs, _)| runs).map(|run| run.offset).max();
        usize::from(outermost.unwrap_or(0).unsigned_abs()) + 1
    }

    /// Returns the number of pixels of the largest disc of a kernel.
    pub fn max_pixels(&self, radius_px: f32) -> f32 {
        self.kernel(radius_px).map(|(runs, _)| pixels(runs) as f32).fold(1.0, f32::max)
    }
}

/// Returns the number of pixels of some runs.
fn pixels(runs: &[ColumnRun]) -> f64 {
    runs.iter().map(|run| 2.0 * f64::from(run.half_height) + 1.0).sum()
}

/// Returns the variance per axis of a disc whose edge is anywhere between two radii with equal probability.
fn ring_variance(low: f64, high: f64) -> f64 {
    if high - low < 1e-6 {
        return low * low / 4.0;
    }
    (high.powi(5) - low.powi(5)) / 20.0 / ((high.powi(3) - low.powi(3)) / 3.0)
}

/// A disc of whole pixels: all with a centre within a radius.
#[derive(Clone, Copy)]
struct LatticeDisc {
    /// The squared radius.
    square: i32,
    pixels: f64,
    /// Variance per axis.
    variance: f64,
}

/// The discs of whole pixels, by their radius.
struct LatticeDiscs(Vec<LatticeDisc>);

impl LatticeDiscs {
    fn new(max_px: i32) -> Self {
        // Number of pixels, and sum of their squared columns, at each squared radius.
        let mut rings = vec![(0.0, 0.0); (max_px * max_px + 1) as usize];
        for y in -max_px..=max_px {
            for x in -max_px..=max_px {
                if let Some(ring) = rings.get_mut((x * x + y * y) as usize) {
                    (ring.0, ring.1) = (ring.0 + 1.0, ring.1 + f64::from(x * x));
                }
            }
        }
        let (mut pixels, mut squares) = (0.0, 0.0);
        let mut discs = Vec::new();
        for (square, ring) in (0..).zip(rings).filter(|(_, ring)| ring.0 > 0.0) {
            (pixels, squares) = (pixels + ring.0, squares + ring.1);
            discs.push(LatticeDisc { square, pixels, variance: squares / pixels });
        }
        Self(discs)
    }

    /// Returns two discs around a variance, at least `apart` below and above it, as squared radii, with the weights of
    /// their pixels at which they have that variance together.
    fn between(&self, variance: f64, apart: f64) -> [(i32, f64); 2] {
        let Self(discs) = self;
        let after = discs.partition_point(|disc| disc.variance < variance + apart).min(discs.len() - 1);
        let before = discs.partition_point(|disc| disc.variance <= variance - apart).saturating_sub(1);
        let [before, after] = [discs[before.min(after)], discs[after]];
        let excess = [after.pixels * (after.variance - variance), before.pixels * (variance - before.variance)];
        let total = excess[0] + excess[1];
        // The smallest disc is one pixel, which has no variance: nothing can have less.
        let weight = if total > 0.0 { (excess[0] / total).clamp(0.0, 1.0) } else { 1.0 };
        [(before.square, weight), (after.square, 1.0 - weight)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kernel_is_round_and_blurs_as_much_as_its_disc() {
        for rim in [0.0, 0.2, 0.6, 1.0] {
            let bank = DiscBank::new(rim, 28.0).unwrap();
            for step in 0..=300 {
                let radius_px = MIN_RADIUS_PX + step as f32 / 16.0;
                let [mut total, mut across, mut down] = [0.0; 3];
                for (run, weight) in
                    bank.kernel(radius_px).flat_map(|(runs, weight)| runs.iter().map(move |run| (run, weight)))
                {
                    assert!(usize::from(run.offset.unsigned_abs()) < bank.half_width(radius_px));
                    for y in -run.half_height..=run.half_height {
                        total += f64::from(weight);
                        across += f64::from(weight) * f64::from(run.offset).powi(2);
                        down += f64::from(weight) * f64::from(y).powi(2);
                    }
                }
                assert!((total - 1.0).abs() < 1e-5 && (across - down).abs() < 1e-4, "{radius_px} px");
                let (low, high, r) = (1.0 - f64::from(rim) / 2.0, 1.0 + f64::from(rim) / 2.0, f64::from(radius_px));
                let wanted = ring_variance(low * r, high * r) + PIXEL_VARIANCE;
                let got = across + 2.0 * f64::from(bank.smoothing(radius_px));
                assert!((got / wanted - 1.0).abs() < 0.02, "rim {rim}, {radius_px} px: {got} for {wanted}");
            }
        }
    }
}
