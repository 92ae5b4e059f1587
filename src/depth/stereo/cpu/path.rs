//! Costs summed along paths, so that neighbours agree (Hirschmüller, *Stereo processing by semiglobal matching and mutual
//! information*, 2008):
//!
//! `L(p, d) = C(p, d) + min(L(q, d), L(q, d ± 1) + P1, min L(q) + P2) - min L(q)`, with `q` the pixel before `p`.
//!
//! Four paths: from the left, the right, above and below; diagonal ones were measured to gain nothing. All values fit a
//! byte: a cost is at most 27 and P2 60, so that a path's are at most 87, and half of four of them are at most 172.

use pulp::WithSimd;

use crate::compute::team::Shelf;

/// For a disparity that differs by one.
const SLOPE: u8 = 8;
/// For any other: this much across an edge of the picture, where a jump is likely, and up to so much more without one.
const JUMP: (f32, f32) = (20.0, 40.0);
/// Difference of grey values that takes away all but 1/e of the additional penalty.
const EDGE: f32 = 10.0;

/// Bytes after the disparities of a pixel's state that are never the least: what lies beyond both ends of the range.
pub const GUARD: usize = 64;

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

/// What one step of a path is made of; all slices but `before` have one byte for each disparity.
struct Step<'a> {
    /// The values of the pixel before, with a byte that is never the least on both sides; empty where the path begins.
    before: &'a [u8],
    /// The least of them.
    least: u8,
    p2: u8,
    cost: &'a [u8],
    out: &'a mut [u8],
    /// Half of the values is added to what is kept of this.
    sum: &'a mut [u8],
    /// All bits, or none.
    keep: u8,
}

impl Step<'_> {
    /// Goes the step; returns the least value.
    #[inline(always)]
    fn go<const L: usize>(self) -> u8 {
        let Self { before, least, p2, cost, out, sum, keep } = self;
        let mut lowest = [u8::MAX; L];
        let blocks = cost.as_chunks::<L>().0.iter().zip(out.as_chunks_mut::<L>().0).zip(sum.as_chunks_mut::<L>().0);
        if before.is_empty() {
            for ((cost, out), sum) in blocks {
                for i in 0..L {
                    out[i] = cost[i];
                    sum[i] = (sum[i] & keep) + (cost[i] >> 1);
                    lowest[i] = lowest[i].min(cost[i]);
                }
            }
        } else {
            let cap = least + p2;
            let length = before.len() - 2;
            let (lower, same, upper) = (&before[..length], &before[1..=length], &before[2..]);
            let beside = lower.as_chunks::<L>().0.iter().zip(same.as_chunks::<L>().0).zip(upper.as_chunks::<L>().0);
            for (((cost, out), sum), ((lower, same), upper)) in blocks.zip(beside) {
                for i in 0..L {
                    let near = lower[i].min(upper[i]).saturating_add(SLOPE);
                    let value = same[i].min(near).min(cap).wrapping_sub(least).wrapping_add(cost[i]);
                    out[i] = value;
                    sum[i] = (sum[i] & keep).wrapping_add(value >> 1);
                    lowest[i] = lowest[i].min(value);
                }
            }
        }
        let mut least = u8::MAX;
        for value in lowest {
            least = least.min(value);
        }
        least
    }
}

/// Rows that a [`Rows`] goes along together: while one waits for its own last step, the others go theirs.
pub const TOGETHER: usize = 4;
const WAYS: usize = 2;

/// The paths from the left and from the right along some rows.
pub struct Rows<'a, const L: usize> {
    /// Costs, `[row][column][disparity]`.
    pub costs: &'a [u8],
    /// Grey values of the left picture, `[row][column]`: one row for each row of costs, at most [`TOGETHER`].
    pub luma: &'a [u8],
    /// Columns.
    pub width: usize,
    /// Bytes from row to row of `costs` and `sums`.
    pub stride: usize,
    /// Disparities, a multiple of `L`.
    pub disparities: usize,
    /// P2.
    pub penalties: &'a Penalties,
    /// Memory of [`row_states`] bytes.
    pub states: &'a mut [u8],
    /// Half of both paths' values, laid out as the costs.
    pub sums: &'a mut [u8],
}

/// Bytes of memory for the states of [`Rows`].
pub fn row_states(disparities: usize) -> usize {
    2 * (GUARD + TOGETHER * WAYS * (disparities + GUARD))
}

impl<const L: usize> WithSimd for Rows<'_, L> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { costs, luma, width, stride, disparities, penalties, states, sums } = self;
        let rows = luma.len() / width;
        states.fill(u8::MAX);
        let (mut now, mut before) = states.split_at_mut(states.len() / 2);
        let mut least = [[0u8; WAYS]; TOGETHER];
        for k in 0..width {
            let last = width - 1;
            // The path that comes to a pixel first leaves its values there, and the other adds its own.
            let ways = [(k, k.wrapping_sub(1), k > last - k), (last - k, width - k, k >= last - k)];
            for row in 0..rows {
                let luma = &luma[row * width..(row + 1) * width];
                for (way, (x, from, is_second)) in ways.into_iter().enumerate() {
                    let cells = row * stride + x * disparities..row * stride + (x + 1) * disparities;
                    let state = GUARD + (row * WAYS + way) * (disparities + GUARD);
                    let step = Step {
                        before: if k == 0 { &[] } else { &before[state - 1..state + disparities + 1] },
                        least: least[row][way],
                        p2: if k == 0 { 0 } else { penalties.between(luma[x], luma[from]) },
                        cost: &costs[cells.clone()],
                        out: &mut now[state..state + disparities],
                        sum: &mut sums[cells],
                        keep: if is_second { u8::MAX } else { 0 },
                    };
                    least[row][way] = step.go::<L>();
                }
            }
            std::mem::swap(&mut now, &mut before);
        }
    }
}

/// Columns that one thread goes down, or up.
pub const STRIPE: usize = 32;

/// The paths down or up the columns of a stripe, along some rows.
pub struct Columns<'a, const L: usize> {
    /// Costs, `[row][column][disparity]`, `STRIPE` columns from `x` on belonging to the stripe.
    pub costs: &'a [u8],
    /// Where the stripe begins in each row of `costs`, and bytes from row to row.
    pub first: usize,
    /// Bytes from row to row of `costs`.
    pub stride: usize,
    /// Rows of `costs`, in the order in which the path goes.
    pub order: Order,
    /// Number in the picture of the first row of `costs`.
    pub y: usize,
    /// Grey values of the left picture, and its columns.
    pub luma: (&'a [u8], usize),
    /// First column of the stripe and one past its last.
    pub columns: (usize, usize),
    /// Disparities, a multiple of `L`.
    pub disparities: usize,
    /// P2.
    pub penalties: &'a Penalties,
    /// Memory of [`column_states`] bytes for each parity of rows; kept from call to call.
    pub states: [&'a mut [u8]; 2],
    /// The least state of each column.
    pub least: &'a mut [u8],
    /// What the halves of the values are added to: part `row * parts + part` of it is the stripe's.
    pub sums: &'a Shelf<'a, u8>,
    /// Parts of a row of `sums`, and the number of this stripe.
    pub part: (usize, usize),
}

/// Which way a path goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// From the first of so many rows to the last.
    Down(usize),
    /// From the last of so many rows to the first.
    Up(usize),
}

/// Bytes of memory for the states of a stripe.
pub fn column_states(disparities: usize) -> usize {
    GUARD + STRIPE * (disparities + GUARD)
}

impl<const L: usize> WithSimd for Columns<'_, L> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { costs, first, stride, order, y, luma, columns, disparities, penalties, states, least, sums, part } =
            self;
        let [even, odd] = states;
        let ((luma, width), (rows, up)) = (
            luma,
            match order {
                Order::Down(rows) => (rows, false),
                Order::Up(rows) => (rows, true),
            },
        );
        let height = luma.len() / width;
        for k in 0..rows {
            let row = if up { rows - 1 - k } else { k };
            let y = y + row;
            let from = if up { y + 1 } else { y.wrapping_sub(1) };
            let begins = from >= height;
            let sums = sums.part(row * part.0 + part.1);
            let (now, before) = if y.is_multiple_of(2) { (&mut *even, &*odd) } else { (&mut *odd, &*even) };
            for (column, x) in (columns.0..columns.1).enumerate() {
                let cells = column * disparities..(column + 1) * disparities;
                let cost = &costs[row * stride + first..][cells.clone()];
                let state = GUARD + column * (disparities + GUARD);
                let step = Step {
                    before: if begins { &[] } else { &before[state - 1..state + disparities + 1] },
                    least: least[column],
                    p2: if begins { 0 } else { penalties.between(luma[y * width + x], luma[from * width + x]) },
                    cost,
                    out: &mut now[state..state + disparities],
                    sum: &mut sums[cells],
                    keep: u8::MAX,
                };
                least[column] = step.go::<L>();
            }
        }
    }
}
