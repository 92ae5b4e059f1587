//! Discs as runs of columns: the kernel of a disc with a soft rim, for every radius.
//!
//! All pixels of a disc count alike, so its sum is, for each column, a difference of two cumulative sums down that
//! column: `2 (2 r + 1)` additions a pixel at radius `r`, exactly, where a decomposition takes a multiplication for each
//! tap of each term and is never exact. A soft rim is the sum of a few discs, smoothed by a small kernel.

use super::bank::STEPS_PER_PX;

/// Smallest radius, in bin pixels, at which discs of whole pixels are round enough.
pub const MIN_RADIUS_PX: f32 = 4.0;
/// Largest half-width of a kernel.
pub const MAX_HALF_WIDTH: usize = 64;
/// Widest rim, in bin pixels, that one smoothed disc shows.
const MAX_STEP_PX: f64 = 2.5;
/// Largest weight of a neighbour in the smoothing.
const MAX_SMOOTHING: f64 = 0.35;
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
    nodes: Vec<Node>,
}

/// The kernel of a radius.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// Where its runs end.
    end: usize,
    /// Number of their pixels.
    pixels: f32,
    /// Weight of each of the two neighbours along both axes in the smoothing of the rim.
    smoothing: f32,
}

impl DiscBank {
    /// Creates the kernels of a disc whose rim falls linearly over `rim` (0 to 1) of its radius, half inside and half
    /// outside, for radii up to `max_radius_px`.
    pub fn new(rim: f32, max_radius_px: f32) -> Self {
        let (rim, max_px) = (f64::from(rim.clamp(0.0, 1.0)), f64::from(max_radius_px.max(MIN_RADIUS_PX)));
        let lattice = LatticeDiscs::new((max_px * (1.0 + rim / 2.0)).ceil() as i32 + 1);
        let mut bank = Self { runs: Vec::new(), nodes: Vec::new() };
        for node in 0..=(max_px * f64::from(STEPS_PER_PX)).ceil() as usize {
            let radius_px = node as f64 / f64::from(STEPS_PER_PX);
            let discs = (rim * radius_px / MAX_STEP_PX).ceil().max(1.0);
            let smoothing_variance = (rim * radius_px / discs).powi(2) / 12.0 + PIXEL_VARIANCE;
            let first = bank.runs.len();
            let edge = |k: usize| radius_px * (1.0 + rim * (k as f64 / discs - 0.5));
            for disc in 0..discs as usize {
                let variance = ring_variance(edge(disc), edge(disc + 1)) + PIXEL_VARIANCE;
                lattice.append_runs(variance - smoothing_variance, variance, &mut bank.runs);
            }
            let (pixels, squares) = moments(&bank.runs[first..]);
            // There is a disc of whole pixels only for some variances: the smoothing makes up for the rest.
            let wanted = ring_variance(edge(0), edge(discs as usize)) + PIXEL_VARIANCE;
            let smoothing = ((wanted - squares / pixels) / 2.0).clamp(0.0, MAX_SMOOTHING) as f32;
            bank.nodes.push(Node { end: bank.runs.len(), pixels: pixels as f32, smoothing });
        }
        bank
    }

    #[inline(always)]
    fn nearest_node(&self, radius_px: f32) -> usize {
        ((radius_px * STEPS_PER_PX + 0.5) as usize).min(self.nodes.len() - 1)
    }

    /// Returns the runs of the kernel nearest to a radius in pixels, and the number of their pixels.
    #[inline(always)]
    pub fn kernel(&self, radius_px: f32) -> (&[ColumnRun], f32) {
        let node = self.nearest_node(radius_px);
        let first = node.checked_sub(1).map_or(0, |before| self.nodes[before].end);
        (&self.runs[first..self.nodes[node].end], self.nodes[node].pixels)
    }

    /// Returns the weight of each of a pixel's two neighbours, along both axes, in the smoothing of the rim.
    pub fn smoothing(&self, radius_px: f32) -> f32 {
        self.nodes[self.nearest_node(radius_px)].smoothing
    }

    /// Returns the largest half-width of all kernels.
    pub fn max_half_width(&self) -> usize {
        self.half_width(self.nodes.len() as f32 / STEPS_PER_PX)
    }

    /// Returns the outermost pixel of the kernels up to a radius, with the smoothing.
    pub fn half_width(&self, radius_px: f32) -> usize {
        let outermost = self.kernel(radius_px).0.iter().map(|run| run.offset).max();
        usize::from(outermost.unwrap_or(0).unsigned_abs()) + 1
    }
}

/// Returns the variance per axis of a disc whose edge is anywhere between two radii with equal probability.
fn ring_variance(low: f64, high: f64) -> f64 {
    if high - low < 1e-6 {
        return low * low / 4.0;
    }
    (high.powi(5) - low.powi(5)) / 20.0 / ((high.powi(3) - low.powi(3)) / 3.0)
}

/// Returns the number of pixels of some runs, and the sum of their squared columns.
fn moments(runs: &[ColumnRun]) -> (f64, f64) {
    runs.iter().fold((0.0, 0.0), |(pixels, squares), run| {
        let (count, offset) = (2.0 * f64::from(run.half_height) + 1.0, f64::from(run.offset));
        (pixels + count, squares + count * offset * offset)
    })
}

/// The discs of whole pixels: all with a centre within a radius.
struct LatticeDiscs {
    /// By variance: squared radius and variance per axis.
    discs: Vec<(i32, f64)>,
}

impl LatticeDiscs {
    fn new(max_px: i32) -> Self {
        // Number of pixels, and sum of their squared columns, at each squared radius.
        let mut rings = vec![(0u32, 0i64); (max_px * max_px + 1) as usize];
        for y in -max_px..=max_px {
            for x in -max_px..=max_px {
                if let Some(ring) = rings.get_mut((x * x + y * y) as usize) {
                    (ring.0, ring.1) = (ring.0 + 1, ring.1 + i64::from(x * x));
                }
            }
        }
        let (mut pixels, mut squares) = (0, 0);
        let mut discs = Vec::new();
        for (square, ring) in rings.into_iter().enumerate().filter(|(_, ring)| ring.0 > 0) {
            (pixels, squares) = (pixels + ring.0, squares + ring.1);
            discs.push((square as i32, squares as f64 / f64::from(pixels)));
        }
        Self { discs }
    }

    /// Appends the runs of the disc whose variance is nearest, and not above a limit.
    fn append_runs(&self, variance: f64, max_variance: f64, runs: &mut Vec<ColumnRun>) {
        let after = self.discs.partition_point(|disc| disc.1 < variance).clamp(1, self.discs.len() - 1);
        let [before, after] = [self.discs[after - 1], self.discs[after]];
        let is_before = variance - before.1 < after.1 - variance || after.1 > max_variance;
        let (square, _) = if is_before { before } else { after };
        let width = square.isqrt();
        runs.extend(
            (-width..=width).map(|x| ColumnRun { offset: x as i16, half_height: (square - x * x).isqrt() as i16 }),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kernel_is_round_and_blurs_as_much_as_its_disc() {
        for rim in [0.0, 0.2, 0.6] {
            let bank = DiscBank::new(rim, 14.0);
            for step in 0..=160 {
                let radius_px = MIN_RADIUS_PX + step as f32 / 16.0;
                let (runs, count) = bank.kernel(radius_px);
                let (pixels, across) = moments(runs);
                assert_eq!(pixels, f64::from(count));
                let down = runs.iter().flat_map(|run| -run.half_height..=run.half_height);
                assert_eq!(across, down.map(|y| f64::from(y).powi(2)).sum::<f64>(), "{radius_px} px");
                let (low, high) = (1.0 - f64::from(rim) / 2.0, 1.0 + f64::from(rim) / 2.0);
                let r = f64::from(radius_px);
                let wanted = ring_variance(low * r, high * r) + PIXEL_VARIANCE;
                let got = across / pixels + 2.0 * f64::from(bank.smoothing(radius_px));
                assert!((got / wanted - 1.0).abs() < 0.03, "rim {rim}, {radius_px} px: {got} for {wanted}");
                assert!(runs.iter().all(|run| usize::from(run.offset.unsigned_abs()) < bank.half_width(radius_px)));
            }
        }
    }
}
