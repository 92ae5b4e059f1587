//! Semi-global cost aggregation along paths (Hirschmüller, *Stereo processing by semiglobal matching and mutual
//! information*, PAMI 2008, equation 13):
//!
//! `L(p, d) = C(p, d) + min(L(q, d), L(q, d ± 1) + P1, min L(q) + P2) - min L(q)`, with `q` the pixel before `p`.
//!
//! Three paths: from the left, from the right and from above, so that one sweep over the rows suffices and no volume of
//! sums is stored. A path from below was measured to gain 0.3 points of bad-2.0, and diagonal ones nothing. All values
//! fit a byte: a cost is at most 27 and P2 at most 60, so that the values of a path are at most 87, and the sum of
//! three halves at most 129.
//!
//! twin: shaders/stereo/path.wgsl

use super::super::Settings;
use super::super::fixed::P1;
use super::super::penalty::Penalties;
use super::GROUP;

/// Padding of 255 on both sides of the disparities, so that d - 1 and d + 1 need no bounds test: a cache line.
const GUARD: usize = 64;
const LENGTH: usize = 2 * GUARD + Settings::MAX_DISPARITIES as usize;

/// The values L(q, d) of a path at a pixel, between padding that is never the minimum, and their minimum.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct PathValues {
    values: [u8; LENGTH],
    pub least: u8,
}

impl PathValues {
    /// Returns the values before the first pixel of a path: zeros, so that the first values are the costs.
    pub fn start<const N: usize>() -> Self {
        let mut start = Self { values: [u8::MAX; LENGTH], least: 0 };
        start.as_array_mut::<N>().fill(0);
        start
    }

    /// Returns the values of `N` disparities.
    #[inline(always)]
    pub fn as_array<const N: usize>(&self) -> &[u8; N] {
        self.shifted::<N>(0)
    }

    #[inline(always)]
    pub fn as_array_mut<const N: usize>(&mut self) -> &mut [u8; N] {
        self.values[GUARD..].first_chunk_mut().expect("the most disparities fit")
    }

    /// Replaces the values and their minimum `least`.
    #[inline(always)]
    pub fn set<const N: usize>(&mut self, values: &[u8; N], least: u8) {
        *self.as_array_mut() = *values;
        self.least = least;
    }

    /// Returns the values from disparity `first` on, -1 to 1.
    #[inline(always)]
    fn shifted<const N: usize>(&self, first: isize) -> &[u8; N] {
        self.values[GUARD.wrapping_add_signed(first)..].first_chunk().expect("the most disparities fit")
    }

    /// Returns the step of the path to a pixel whose P2 is `p2`.
    #[inline(always)]
    pub fn step_to<const N: usize>(&self, p2: u8) -> PathStep<'_, N> {
        let [lower, same, upper] = [self.shifted(-1), self.shifted(0), self.shifted(1)];
        PathStep { lower, same, upper, least: self.least, min_plus_p2: self.least + p2 }
    }
}

/// A step of a path from one pixel to the next.
pub struct PathStep<'a, const N: usize> {
    lower: &'a [u8; N],
    same: &'a [u8; N],
    upper: &'a [u8; N],
    least: u8,
    min_plus_p2: u8,
}

impl<const N: usize> PathStep<'_, N> {
    /// Returns L(p, d) at a pixel with this cost, by the recurrence above.
    #[inline(always)]
    pub fn value(&self, d: usize, cost: u8) -> u8 {
        let near = self.lower[d].min(self.upper[d]).saturating_add(P1);
        // Never wraps: see the bounds in the module's documentation.
        self.same[d].min(near).min(self.min_plus_p2).wrapping_sub(self.least).wrapping_add(cost)
    }
}

/// The values of paths in a group. They are passed by reference, as the compiler would not align locals to a cache
/// line.
pub struct Paths {
    /// Along the rows, at the previous and the current pixel in turn.
    pub along: [[PathValues; GROUP]; 2],
    /// Down a column: above each row, and below the last one.
    pub down: [PathValues; GROUP + 1],
}

impl Paths {
    pub fn new() -> Self {
        Self { along: [[PathValues::start::<0>(); GROUP]; 2], down: [PathValues::start::<0>(); GROUP + 1] }
    }

    /// Resets the paths to before their first pixels.
    pub fn clear<const N: usize>(&mut self) {
        self.along = [[PathValues::start::<N>(); GROUP]; 2];
        self.down = [PathValues::start::<N>(); GROUP + 1];
    }
}

/// The penalties P2 of the steps of paths in a group of rows, `[column][row]`. Rows below the picture repeat those of
/// its last one.
pub struct StepPenalties {
    /// Between the previous column and this one.
    pub along: Vec<[u8; GROUP]>,
    /// Between the row above and this one.
    pub down: Vec<[u8; GROUP]>,
}

impl StepPenalties {
    /// Allocates for `width` columns.
    pub fn new(width: usize) -> Self {
        Self { along: vec![[0; GROUP]; width], down: vec![[0; GROUP]; width] }
    }

    /// Computes the penalties from the grey values of the row above the group to its last row.
    pub fn compute(&mut self, luma: [&[u8]; GROUP + 1], penalties: &Penalties) {
        for row in 0..GROUP {
            let (above, here) = (luma[row], luma[row + 1]);
            let mut before = here[0];
            for (((&above, &here), along), down) in above.iter().zip(here).zip(&mut self.along).zip(&mut self.down) {
                along[row] = penalties.p2(here, before);
                down[row] = penalties.p2(here, above);
                before = here;
            }
        }
    }
}
