//! Semi-global cost aggregation: costs summed along paths, so that neighbours agree (Hirschmüller, *Stereo processing
//! by semiglobal matching and mutual information*, 2008):
//!
//! `L(p, d) = C(p, d) + min(L(q, d), L(q, d ± 1) + P1, min L(q) + P2) - min L(q)`, with `q` the pixel before `p`.
//!
//! Three paths: from the left, from the right and from above, so that one sweep over the rows suffices and no volume of
//! sums is kept. One from below was measured to gain 0.3 points of bad-2.0, and diagonal ones nothing. All values fit a
//! byte: a cost is at most 27 and P2 60, so that a path's are at most 87, and half of three of them are at most 129.

use super::super::Settings;
use super::super::fixed::SLOPE;
use super::super::penalty::Penalties;
use super::GROUP;

/// Bytes of 255 beyond both ends of the disparities, so that d - 1 and d + 1 need no test: a cache line.
const GUARD: usize = 64;
const LENGTH: usize = 2 * GUARD + Settings::MOST_DISPARITIES as usize;

/// The values L(q, d) of a path at a pixel, between bytes that are never the least, and the least of them.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Values {
    values: [u8; LENGTH],
    pub least: u8,
}

impl Values {
    /// Before the first pixel of a path, which takes its costs from there.
    pub fn start<const N: usize>() -> Self {
        let mut start = Self { values: [u8::MAX; LENGTH], least: 0 };
        start.of_mut::<N>().fill(0);
        start
    }

    /// The values of `N` disparities.
    #[inline(always)]
    pub fn of<const N: usize>(&self) -> &[u8; N] {
        self.from::<N>(0)
    }

    #[inline(always)]
    pub fn of_mut<const N: usize>(&mut self) -> &mut [u8; N] {
        self.values[GUARD..].first_chunk_mut().expect("the most disparities fit")
    }

    /// Takes over these values, of which `least` is the least.
    #[inline(always)]
    pub fn set<const N: usize>(&mut self, values: &[u8; N], least: u8) {
        *self.of_mut() = *values;
        self.least = least;
    }

    /// The values from disparity `first` on, -1 to 1.
    #[inline(always)]
    fn from<const N: usize>(&self, first: isize) -> &[u8; N] {
        self.values[GUARD.wrapping_add_signed(first)..].first_chunk().expect("the most disparities fit")
    }

    /// How the path goes on to a pixel whose P2 is `p2`.
    #[inline(always)]
    pub fn step<const N: usize>(&self, p2: u8) -> Step<'_, N> {
        let [lower, same, upper] = [self.from(-1), self.from(0), self.from(1)];
        Step { lower, same, upper, least: self.least, jump: self.least + p2 }
    }
}

/// A path between two pixels.
pub struct Step<'a, const N: usize> {
    lower: &'a [u8; N],
    same: &'a [u8; N],
    upper: &'a [u8; N],
    least: u8,
    jump: u8,
}

impl<const N: usize> Step<'_, N> {
    /// The value L(p, d) at a pixel of this cost, by the recurrence above.
    #[inline(always)]
    pub fn value(&self, d: usize, cost: u8) -> u8 {
        let near = self.lower[d].min(self.upper[d]).saturating_add(SLOPE);
        // Never wraps: see the bounds in the module's documentation.
        self.same[d].min(near).min(self.jump).wrapping_sub(self.least).wrapping_add(cost)
    }
}

/// The values of paths in a group. They are handed around by reference, as the compiler gives locals another place than
/// a cache line of their own.
pub struct Paths {
    /// Along the rows, at the pixel before and at the present one in turn.
    pub along: [[Values; GROUP]; 2],
    /// Down a column: above each row, and below the last one.
    pub down: [Values; GROUP + 1],
}

impl Paths {
    pub fn new() -> Self {
        Self { along: [[Values::start::<0>(); GROUP]; 2], down: [Values::start::<0>(); GROUP + 1] }
    }

    /// Back before the first pixels.
    pub fn clear<const N: usize>(&mut self) {
        self.along = [[Values::start::<N>(); GROUP]; 2];
        self.down = [Values::start::<N>(); GROUP + 1];
    }
}

/// The penalties P2 of the steps of paths in a group of rows, `[column][row]`. Rows below the picture have those of its
/// last one.
pub struct StepPenalties {
    /// Between the column before and this one.
    pub along: Vec<[u8; GROUP]>,
    /// Between the row above and this one.
    pub down: Vec<[u8; GROUP]>,
}

impl StepPenalties {
    /// Of `width` columns.
    pub fn new(width: usize) -> Self {
        Self { along: vec![[0; GROUP]; width], down: vec![[0; GROUP]; width] }
    }

    /// Computes them for the grey values of the rows from the one above the group to its last one.
    pub fn compute(&mut self, luma: [&[u8]; GROUP + 1], penalties: &Penalties) {
        for row in 0..GROUP {
            let (above, here) = (luma[row], luma[row + 1]);
            let mut before = here[0];
            for (((&above, &here), along), down) in above.iter().zip(here).zip(&mut self.along).zip(&mut self.down) {
                along[row] = penalties.between(here, before);
                down[row] = penalties.between(here, above);
                before = here;
            }
        }
    }
}
