//! Costs summed along paths, so that neighbours agree (Hirschmüller, *Stereo processing by semiglobal matching and mutual
//! information*, 2008):
//!
//! `L(p, d) = C(p, d) + min(L(q, d), L(q, d ± 1) + P1, min L(q) + P2) - min L(q)`, with `q` the pixel before `p`.
//!
//! Four paths: from the left, the right, above and below; diagonal ones were measured to gain nothing. All values fit a
//! byte: a cost is at most 27 and P2 60, so that a path's are at most 87, and half of four of them are at most 172.

use pulp::WithSimd;

use super::GROUP;
use crate::compute::aligned::Aligned;

/// For a disparity that differs by one.
const SLOPE: u8 = 8;
/// For any other: this much across an edge of the picture, where a jump is likely, and up to so much more without one.
const JUMP: (f32, f32) = (20.0, 40.0);
/// Difference of grey values that takes away all but 1/e of the additional penalty.
const EDGE: f32 = 10.0;

/// What lies beyond both ends of the range.
const GUARD: usize = 64;

/// P2 by the difference of grey values from pixel to pixel.
pub struct Penalties([u8; 256]);

impl Penalties {
    /// Computes them.
    pub fn new() -> Self {
        let mut table = [0; 256];
        for (step, p2) in table.iter_mut().enumerate() {
            *p2 = (JUMP.0 + JUMP.1 * (-(step as f32) / EDGE).exp()) as u8;
        }
        Self(table)
    }

    #[inline(always)]
    fn between(&self, a: u8, b: u8) -> u8 {
        self.0[usize::from(a.abs_diff(b))]
    }
}

/// The `N` bytes from `at` on.
#[inline(always)]
fn bytes<const N: usize>(from: &[u8], at: usize) -> &[u8; N] {
    &from[at..at + N].as_chunks::<N>().0[0]
}

/// The `N` bytes from `at` on.
#[inline(always)]
fn bytes_mut<const N: usize>(from: &mut [u8], at: usize) -> &mut [u8; N] {
    &mut from[at..at + N].as_chunks_mut::<N>().0[0]
}

/// The states of paths: the values of each at the pixel where it is, with [`GUARD`] bytes on both sides that are never
/// the least, and the least of them. Those of the pixel before are kept beside those that are being made.
pub struct States {
    values: [Aligned<u8>; 2],
    least: Vec<u8>,
    each: usize,
}

impl States {
    /// Of `paths` paths.
    pub fn new(paths: usize, disparities: usize) -> Self {
        let each = disparities + GUARD;
        let mut values = [(); 2].map(|()| Aligned::zeros(GUARD + paths * each));
        values.iter_mut().for_each(|values| values.fill(u8::MAX));
        Self { values, least: vec![0; paths], each }
    }

    /// Path `path` begins at a pixel of these costs.
    #[inline(always)]
    fn begin<const N: usize>(&mut self, path: usize, cost: &[u8; N]) -> &[u8; N] {
        let values = bytes_mut::<N>(&mut self.values[0], GUARD + path * self.each);
        let mut least = u8::MAX;
        for d in 0..N {
            values[d] = cost[d];
            least = least.min(cost[d]);
        }
        self.least[path] = least;
        values
    }

    /// Path `path` goes on to a pixel of these costs.
    #[inline(always)]
    fn go<const N: usize>(&mut self, path: usize, p2: u8, cost: &[u8; N]) -> &[u8; N] {
        let [now, before] = &mut self.values;
        let at = GUARD + path * self.each;
        let values = bytes_mut::<N>(now, at);
        let (lower, same, upper) = (bytes::<N>(before, at - 1), bytes::<N>(before, at), bytes::<N>(before, at + 1));
        let last = self.least[path];
        let cap = last + p2;
        let mut least = u8::MAX;
        for d in 0..N {
            let near = lower[d].min(upper[d]).saturating_add(SLOPE);
            let value = same[d].min(near).min(cap).wrapping_sub(last).wrapping_add(cost[d]);
            values[d] = value;
            least = least.min(value);
        }
        self.least[path] = least;
        values
    }

    /// All paths have gone their step.
    #[inline(always)]
    fn turn(&mut self) {
        let [now, before] = &mut self.values;
        std::mem::swap(now, before);
    }
}

/// The paths from the left and from the right along a group of rows, together: while one waits for the end of its own
/// last step, the others go theirs.
pub struct Rows<'a, const N: usize> {
    /// `[column][row][disparity]`.
    pub costs: &'a [u8],
    /// Grey values of the left picture, `[row][column]`: of the rows of the group that there are.
    pub luma: &'a [u8],
    /// Columns.
    pub width: usize,
    /// P2.
    pub penalties: &'a Penalties,
    /// Of `2 * GROUP` paths.
    pub states: &'a mut States,
    /// Half of both paths' values, laid out as the costs.
    pub sums: &'a mut [u8],
}

impl<const N: usize> WithSimd for Rows<'_, N> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { costs, luma, width, penalties, states, sums } = self;
        let rows = luma.len() / width;
        let (costs, sums) = (costs.as_chunks::<N>().0, sums.as_chunks_mut::<N>().0);
        let last = width - 1;
        for k in 0..width {
            for row in 0..rows {
                let luma = &luma[row * width..(row + 1) * width];
                // The path that comes to a pixel first leaves its values there, and the other adds its own.
                let ways = [(k, k.wrapping_sub(1), k > last - k), (last - k, width - k, k >= last - k)];
                for (way, (x, from, is_second)) in ways.into_iter().enumerate() {
                    let cells = x * GROUP + row;
                    let (path, cost, sum) = (row * 2 + way, &costs[cells], &mut sums[cells]);
                    let values = if k == 0 {
                        states.begin(path, cost)
                    } else {
                        states.go(path, penalties.between(luma[x], luma[from]), cost)
                    };
                    if is_second {
                        add_half(values, sum);
                    } else {
                        for d in 0..N {
                            sum[d] = values[d] >> 1;
                        }
                    }
                }
            }
            states.turn();
        }
    }
}

/// Columns that one thread goes down, or up.
pub const STRIPE: usize = 32;

/// Adds half of the values.
#[inline(always)]
fn add_half<const N: usize>(values: &[u8; N], sum: &mut [u8; N]) {
    for d in 0..N {
        sum[d] = sum[d].wrapping_add(values[d] >> 1);
    }
}

/// The paths down or up the columns of a stripe, along a group of rows.
pub struct Columns<'a, const N: usize> {
    /// Costs and sums of the stripe.
    pub volumes: Volumes<'a>,
    /// The first row of the group, and how many there are.
    pub rows: (usize, usize),
    /// Grey values of the left picture, and its columns.
    pub luma: (&'a [u8], usize),
    /// First column of the stripe, and one past its last.
    pub columns: (usize, usize),
    /// P2.
    pub penalties: &'a Penalties,
    /// Of [`STRIPE`] paths; kept from group to group.
    pub states: &'a mut States,
}

/// Costs and sums, both `[column][row][disparity]`, and the way the paths go.
pub enum Volumes<'a> {
    /// Down: half of the values is added to the sums.
    Down {
        /// What pixels cost.
        costs: &'a [u8],
        /// Of the paths so far.
        sums: &'a mut [u8],
    },
    /// Up: the sums are done, and take the place of the costs.
    Up {
        /// What pixels cost; then the sums of all paths.
        costs: &'a mut [u8],
        /// Of the paths so far.
        sums: &'a [u8],
    },
}

impl<const N: usize> WithSimd for Columns<'_, N> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { volumes, rows: (first, rows), luma: (luma, width), columns, penalties, states } = self;
        let luma_at = |y: usize| &luma[y * width + columns.0..y * width + columns.1];
        match volumes {
            Volumes::Down { costs, sums } => {
                let (costs, sums) = (costs.as_chunks::<N>().0, sums.as_chunks_mut::<N>().0);
                for row in 0..rows {
                    let y = first + row;
                    let (here, there) = (luma_at(y), luma_at(y.saturating_sub(1)));
                    for (column, (&here, &there)) in here.iter().zip(there).enumerate() {
                        let cells = column * GROUP + row;
                        let cost = &costs[cells];
                        let values = if y == 0 {
                            states.begin(column, cost)
                        } else {
                            states.go(column, penalties.between(here, there), cost)
                        };
                        add_half(values, &mut sums[cells]);
                    }
                    states.turn();
                }
            }
            Volumes::Up { costs, sums } => {
                let (costs, sums) = (costs.as_chunks_mut::<N>().0, sums.as_chunks::<N>().0);
                let last = luma.len() / width - 1;
                for row in (0..rows).rev() {
                    let y = first + row;
                    let (here, there) = (luma_at(y), luma_at((y + 1).min(last)));
                    for (column, (&here, &there)) in here.iter().zip(there).enumerate() {
                        let cells = column * GROUP + row;
                        let (cost, sum) = (&mut costs[cells], &sums[cells]);
                        let values = if y == last {
                            states.begin(column, cost)
                        } else {
                            states.go(column, penalties.between(here, there), cost)
                        };
                        for d in 0..N {
                            cost[d] = sum[d].wrapping_add(values[d] >> 1);
                        }
                    }
                    states.turn();
                }
            }
        }
    }
}
