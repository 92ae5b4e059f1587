//! Finds the pixels beside depth discontinuities, and the disparity on the other side.

use pulp::{Arch, WithSimd};

use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;
use crate::depth::stereo::fixed::ONE;

/// Neighbours whose disparities differ by more, in fixed point, belong to two surfaces.
const MIN_DEPTH_STEP: u16 = ONE + ONE / 2;
/// Disparities of one surface differ by at most this within a window, in fixed point.
pub const SAME_SURFACE: u16 = 2 * ONE;
/// Pixels up to this far from a discontinuity on its nearer side are uncertain: the radius of the 9x9 census window.
const NEAR_SIDE_PX: usize = 4;
/// Pixels up to this far on its farther side, where errors are smaller.
const FAR_SIDE_PX: usize = 2;

/// No other surface: compares as farther than any.
pub const NO_OTHER_SIDE: u16 = u16::MAX;

/// The uncertain pixels.
pub struct UncertainPixels {
    width: usize,
    /// The disparity beyond the nearest discontinuity, or [`NO_OTHER_SIDE`].
    other_sides: Vec<u16>,
    /// Distance to that discontinuity in px: 1 beside it.
    distances_px: Vec<u8>,
}

impl UncertainPixels {
    /// Allocates for maps of this size.
    pub fn new((width, height): (usize, usize)) -> Self {
        Self { width, other_sides: vec![NO_OTHER_SIDE; width * height], distances_px: vec![0; width * height] }
    }

    /// Returns for each pixel the disparity beyond the nearest discontinuity, or [`NO_OTHER_SIDE`].
    pub fn other_sides(&self) -> &[u16] {
        &self.other_sides
    }

    /// Finds the pixels beside the discontinuities of `map`.
    pub fn find(&mut self, map: &[u16], workers: &mut ThreadPool, arch: Arch) {
        let Self { width, other_sides, distances_px } = self;
        let width = *width;
        let height = map.len() / width;
        let bands = Bands::new(height, 1, workers);
        let items = bands.rows().zip(bands.split(other_sides, width)).zip(bands.split(distances_px, width));
        workers.run_each(items, &|((rows, other_sides), distances_px)| {
            other_sides.fill(NO_OTHER_SIDE);
            distances_px.fill(u8::MAX);
            let first = rows.start;
            let mut band = Band { map, width, first, rows: rows.len(), other_sides, distances_px };
            for y in rows.clone() {
                let row = &map[y * width..(y + 1) * width];
                arch.dispatch(DepthSteps {
                    rows: [&row[..width - 1], &row[1..]],
                    at: |x| band.mark_both_sides((x, y), (1, 0)),
                });
            }
            // Discontinuities between rows outside the band may mark rows within it.
            for y in rows.start.saturating_sub(NEAR_SIDE_PX)..(rows.end + NEAR_SIDE_PX).min(height) - 1 {
                let (above, below) = map[y * width..(y + 2) * width].split_at(width);
                arch.dispatch(DepthSteps { rows: [above, below], at: |x| band.mark_both_sides((x, y), (0, 1)) });
            }
        });
    }
}

/// Calls `at` with each column in which two rows differ by a discontinuity.
struct DepthSteps<'a, F> {
    rows: [&'a [u16]; 2],
    at: F,
}

impl<F: FnMut(usize)> WithSimd for DepthSteps<'_, F> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(mut self, _: S) {
        const CHUNK: usize = 32;
        let apart = |(&a, &b): (&u16, &u16)| a.max(b) - a.min(b);
        let [one, two] = self.rows.map(|row| row.as_chunks::<CHUNK>());
        for (k, (one, two)) in one.0.iter().zip(two.0).enumerate() {
            // Most chunks have no discontinuity; the maximum is vector code.
            if one.iter().zip(two).map(apart).fold(0, u16::max) > MIN_DEPTH_STEP {
                self.scan_pairs(CHUNK * k, one, two);
            }
        }
        self.scan_pairs(CHUNK * one.0.len(), one.1, two.1);
    }
}

impl<F: FnMut(usize)> DepthSteps<'_, F> {
    fn scan_pairs(&mut self, first: usize, one: &[u16], two: &[u16]) {
        for (x, _) in one.iter().zip(two).enumerate().filter(|(_, (a, b))| a.abs_diff(**b) > MIN_DEPTH_STEP) {
            (self.at)(first + x);
        }
    }
}

/// A band of rows and the results in it.
struct Band<'a> {
    map: &'a [u16],
    width: usize,
    /// The first row of the band, and the number of its rows.
    first: usize,
    rows: usize,
    other_sides: &'a mut [u16],
    distances_px: &'a mut [u8],
}

impl Band<'_> {
    /// Marks the pixels on both sides of the discontinuity between a pixel and the next one in direction `(dx, dy)`.
    fn mark_both_sides(&mut self, (x, y): (usize, usize), (dx, dy): (usize, usize)) {
        let after = (x + dx, y + dy);
        let (one, two) = (self.map[y * self.width + x], self.map[after.1 * self.width + after.0]);
        let range_px = |own: u16, other: u16| if own > other { NEAR_SIDE_PX } else { FAR_SIDE_PX };
        for step in 0..range_px(one, two) {
            let (Some(x), Some(y)) = (x.checked_sub(step * dx), y.checked_sub(step * dy)) else { break };
            if !self.mark_pixel((x, y), one, two, step) {
                break;
            }
        }
        for step in 0..range_px(two, one) {
            let (x, y) = (after.0 + step * dx, after.1 + step * dy);
            if x >= self.width || y >= self.map.len() / self.width || !self.mark_pixel((x, y), two, one, step) {
                break;
            }
        }
    }

    /// Marks a pixel `step` px from a discontinuity between the disparities `own` and `other`, unless a nearer one is
    /// known. Returns false if the pixel is not on the surface with disparity `own`.
    fn mark_pixel(&mut self, (x, y): (usize, usize), own: u16, other: u16, step: usize) -> bool {
        if self.map[y * self.width + x].abs_diff(own) > SAME_SURFACE {
            return false;
        }
        if (self.first..self.first + self.rows).contains(&y) {
            let at = (y - self.first) * self.width + x;
            if self.distances_px[at] > step as u8 + 1 {
                (self.distances_px[at], self.other_sides[at]) = (step as u8 + 1, other);
            }
        }
        true
    }
}
