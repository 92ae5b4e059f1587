//! Which pixels lie beside a jump of the disparity, and what is on its other side.

use pulp::{Arch, WithSimd};

use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;
use crate::depth::stereo::fixed::ONE;

/// Neighbours whose disparities differ by more, in fixed point, are of two surfaces.
const JUMP: u16 = ONE + ONE / 2;
/// Disparities of one surface differ by at most this, in fixed point, within the reach of a window.
pub const SURFACE: u16 = 2 * ONE;
/// In doubt are so many pixels from a jump on its nearer side, as many as the 9x9 window of the census reaches.
const NEARER_PX: usize = 4;
/// And on its farther side, where less is wrong.
const FARTHER_PX: usize = 2;

/// Stands for no other surface: farther than any.
pub const NONE: u16 = u16::MAX;

/// The pixels in doubt.
pub struct Doubts {
    width: usize,
    /// The disparity beyond the nearest jump, or [`NONE`].
    others: Vec<u16>,
    /// How far that jump is in px: 1 beside it.
    distances_px: Vec<u8>,
}

impl Doubts {
    /// For maps of this size.
    pub fn new((width, height): (usize, usize)) -> Self {
        Self { width, others: vec![NONE; width * height], distances_px: vec![0; width * height] }
    }

    /// Of each pixel, the disparity beyond the nearest jump, or [`NONE`].
    pub fn others(&self) -> &[u16] {
        &self.others
    }

    /// Finds the pixels beside the jumps of `map`.
    pub fn find(&mut self, map: &[u16], workers: &mut ThreadPool, arch: Arch) {
        let Self { width, others, distances_px } = self;
        let width = *width;
        let height = map.len() / width;
        let bands = Bands::new(height, 1, workers);
        let items = bands.rows().zip(bands.split(others, width)).zip(bands.split(distances_px, width));
        workers.run_each(items, &|((rows, others), distances_px)| {
            others.fill(NONE);
            distances_px.fill(u8::MAX);
            let first = rows.start;
            let mut band = Band { map, width, first, rows: rows.len(), others, distances_px };
            for y in rows.clone() {
                let row = &map[y * width..(y + 1) * width];
                arch.dispatch(Jumps { rows: [&row[..width - 1], &row[1..]], at: |x| band.mark((x, y), (1, 0)) });
            }
            // Jumps between rows outside the band reach into it, too.
            for y in rows.start.saturating_sub(NEARER_PX)..(rows.end + NEARER_PX).min(height) - 1 {
                let (above, below) = map[y * width..(y + 2) * width].split_at(width);
                arch.dispatch(Jumps { rows: [above, below], at: |x| band.mark((x, y), (0, 1)) });
            }
        });
    }
}

/// Calls `at` with each place where two rows differ by a jump.
struct Jumps<'a, F> {
    rows: [&'a [u16]; 2],
    at: F,
}

impl<F: FnMut(usize)> WithSimd for Jumps<'_, F> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(mut self, _: S) {
        const CHUNK: usize = 32;
        let apart = |(&a, &b): (&u16, &u16)| a.max(b) - a.min(b);
        let [one, two] = self.rows.map(|row| row.as_chunks::<CHUNK>());
        for (k, (one, two)) in one.0.iter().zip(two.0).enumerate() {
            // Most have none, which vector code tells.
            if one.iter().zip(two).map(apart).fold(0, u16::max) > JUMP {
                self.each(CHUNK * k, one, two);
            }
        }
        self.each(CHUNK * one.0.len(), one.1, two.1);
    }
}

impl<F: FnMut(usize)> Jumps<'_, F> {
    fn each(&mut self, first: usize, one: &[u16], two: &[u16]) {
        for (x, _) in one.iter().zip(two).enumerate().filter(|(_, (a, b))| a.abs_diff(**b) > JUMP) {
            (self.at)(first + x);
        }
    }
}

/// What is found in some rows.
struct Band<'a> {
    map: &'a [u16],
    width: usize,
    /// The first row, and how many.
    first: usize,
    rows: usize,
    others: &'a mut [u16],
    distances_px: &'a mut [u8],
}

impl Band<'_> {
    /// Marks the pixels on both sides of the jump between a pixel and the one after it in direction `(dx, dy)`.
    fn mark(&mut self, (x, y): (usize, usize), (dx, dy): (usize, usize)) {
        let after = (x + dx, y + dy);
        let (one, two) = (self.map[y * self.width + x], self.map[after.1 * self.width + after.0]);
        let reach = |own: u16, other: u16| if own > other { NEARER_PX } else { FARTHER_PX };
        for step in 0..reach(one, two) {
            let (Some(x), Some(y)) = (x.checked_sub(step * dx), y.checked_sub(step * dy)) else { break };
            if !self.mark_pixel((x, y), one, two, step) {
                break;
            }
        }
        for step in 0..reach(two, one) {
            let (x, y) = (after.0 + step * dx, after.1 + step * dy);
            if x >= self.width || y >= self.map.len() / self.width || !self.mark_pixel((x, y), two, one, step) {
                break;
            }
        }
    }

    /// Marks a pixel as `step` from a jump between the disparities `own` and `other`, unless a nearer one is known; false
    /// where it is not of the surface that has `own`.
    fn mark_pixel(&mut self, (x, y): (usize, usize), own: u16, other: u16, step: usize) -> bool {
        if self.map[y * self.width + x].abs_diff(own) > SURFACE {
            return false;
        }
        if (self.first..self.first + self.rows).contains(&y) {
            let at = (y - self.first) * self.width + x;
            if self.distances_px[at] > step as u8 + 1 {
                (self.distances_px[at], self.others[at]) = (step as u8 + 1, other);
            }
        }
        true
    }
}
