//! The sweeps over a group of rows: from the right with the costs and one path, then from the left with the other two
//! paths and the winners. What the first leaves to the second stays in the cache of the core that makes both.

use pulp::WithSimd;

use super::super::penalty::Penalties;
use super::GROUP;
use super::cost::{self, Codes, Costs};
use super::path::Values;
use super::winner::Eyes;
use crate::compute::aligned::{Aligned, Line};

/// The penalties P2 in a group of rows, `[column][row]`. Rows below the picture have those of its last one.
pub struct Steps {
    /// Between the column before and this one.
    along: Vec<[u8; GROUP]>,
    /// Between the row above and this one.
    down: Vec<[u8; GROUP]>,
}

impl Steps {
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

/// What the sweep from the right leaves of a group, `[column][row]`: costs, and half of the values of the path from the
/// right.
pub struct Cells(Aligned<u8>);

type Column<const N: usize> = [[[u8; N]; 2]; GROUP];

impl Cells {
    /// Of `width` columns.
    pub fn new(width: usize, disparities: usize) -> Self {
        Self(Aligned::zeros(width * GROUP * 2 * disparities))
    }

    #[inline(always)]
    fn columns<const N: usize>(&self) -> &[Column<N>] {
        self.0.as_chunks().0.as_chunks().0.as_chunks().0
    }

    #[inline(always)]
    fn columns_mut<const N: usize>(&mut self) -> &mut [Column<N>] {
        self.0.as_chunks_mut().0.as_chunks_mut().0.as_chunks_mut().0
    }
}

/// Paths along the rows of a group. Two buffers take turns: the values of the pixel before, and those that are made.
pub type Along = [[Values; GROUP]; 2];

/// Before the first pixels.
#[inline(always)]
pub fn start<const N: usize>() -> Along {
    [[Values::start::<N>(); GROUP]; 2]
}

/// The path of row `row` for its step to column `x`: its values before, and those that are made.
#[inline(always)]
fn turn(along: &mut Along, row: usize, x: usize) -> (&Values, &mut Values) {
    let [first, second] = along;
    if x.is_multiple_of(2) { (&first[row], &mut second[row]) } else { (&second[row], &mut first[row]) }
}

/// The costs of a group, and the path from the right.
pub struct FromRight<'a, const N: usize> {
    /// From the row above the group to the one below it.
    pub codes: [Codes<'a>; cost::ROWS],
    pub steps: &'a Steps,
    /// Of each row, one more than the likely disparity, or 0.
    pub likely: Option<[&'a [u16]; GROUP]>,
    pub cells: &'a mut Cells,
}

impl<const N: usize> WithSimd for FromRight<'_, N> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { codes, steps, likely, cells } = self;
        let width = steps.along.len();
        let columns = &mut cells.columns_mut::<N>()[..width];
        let mut made = Costs::<N>::new(&codes, width);
        let mut along = start::<N>();
        for x in (0..width).rev() {
            let made = made.of_column(x);
            let p2 = steps.along[(x + 1).min(width - 1)];
            let likely = likely.map_or([0; GROUP], |likely| likely.map(|row| row[x]));
            for row in 0..GROUP {
                let (before, now) = turn(&mut along, row, x);
                let [costs, halves] = &mut columns[x][row];
                step(before, p2[row], likely[row], &made.0[row], now, costs, halves);
            }
        }
    }
}

/// A step of a path: `made` are the costs without the bonus for the likely disparity.
#[inline(always)]
fn step<const N: usize>(
    before: &Values,
    p2: u8,
    likely: u16,
    made: &[u8; N],
    now: &mut Values,
    costs: &mut [u8; N],
    halves: &mut [u8; N],
) {
    let (step, bonus, numbers) = (before.step::<N>(p2), cost::bonus(likely), cost::numbers::<N>());
    let values = now.of_mut::<N>();
    let mut least = u8::MAX;
    for d in 0..N {
        let cost = made[d].saturating_sub(bonus(numbers[d]));
        let value = step.value(d, cost);
        costs[d] = cost;
        values[d] = value;
        halves[d] = value >> 1;
        least = least.min(value);
    }
    now.least = least;
}

/// Columns of a block.
pub const BLOCK: usize = 64;

/// The paths down the columns of a block, at the last row so far.
pub struct Down {
    /// `[column][disparity]`.
    values: Aligned<u8>,
    least: [u8; BLOCK],
}

impl Down {
    pub fn new(disparities: usize) -> Self {
        Self { values: Aligned::zeros(BLOCK * disparities), least: [0; BLOCK] }
    }

    /// Back before the first row.
    pub fn clear(&mut self) {
        self.values.fill(0);
        self.least.fill(0);
    }
}

/// The paths from the left and from above, in a block of columns, and the winners of the sums of all paths.
pub struct FromLeft<'a, const N: usize> {
    pub steps: &'a Steps,
    pub cells: &'a Cells,
    /// First column of the block.
    pub first: usize,
    pub along: &'a mut Along,
    pub down: &'a mut Down,
    pub eyes: &'a mut Eyes,
}

impl<const N: usize> WithSimd for FromLeft<'_, N> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { steps, cells, first, along, down, eyes } = self;
        let end = (first + BLOCK).min(steps.along.len());
        let (p2_along, p2_down) = (&steps.along[first..end], &steps.down[first..end]);
        let columns = end - first;
        let cells = &cells.columns::<N>()[first..end];
        let states = &mut down.values.as_chunks_mut::<N>().0[..columns];
        let mut rows = eyes.rows::<N>(first..end);
        // Above each row the values of a column, below the last one those for the next group.
        let mut between = [Values::start::<N>(); GROUP + 1];
        // Each row is a column behind the one above, so that no step waits for what was made just before it.
        for k in 0..columns + GROUP {
            if let Some(x) = k.checked_sub(GROUP) {
                states[x] = *between[GROUP].of::<N>();
                down.least[x] = between[GROUP].least;
            }
            for row in (0..GROUP).rev() {
                let x = k.wrapping_sub(row);
                if x >= columns {
                    continue;
                }
                if row == 0 {
                    *between[0].of_mut::<N>() = states[x];
                    between[0].least = down.least[x];
                }
                let (above, below) = between.split_at_mut(row + 1);
                let (before, now) = turn(along, row, x);
                let [costs, halves] = &cells[x][row];
                let mut sums = Line([0; N]);
                let p2 = [p2_along[x][row], p2_down[x][row]];
                step_two(before, &above[row], p2, costs, halves, now, &mut below[0], &mut sums.0);
                rows[row].take(x, &sums.0);
            }
        }
    }
}

/// Steps of the path along a row and of the one down a column, and the sums of all three paths.
#[inline(always)]
fn step_two<const N: usize>(
    before: &Values,
    above: &Values,
    p2: [u8; 2],
    costs: &[u8; N],
    halves: &[u8; N],
    now: &mut Values,
    below: &mut Values,
    sums: &mut [u8; N],
) {
    let (along, down) = (before.step::<N>(p2[0]), above.step::<N>(p2[1]));
    let (along_values, down_values) = (now.of_mut::<N>(), below.of_mut::<N>());
    let (mut along_least, mut down_least) = (u8::MAX, u8::MAX);
    for d in 0..N {
        let (along, down) = (along.value(d, costs[d]), down.value(d, costs[d]));
        (along_values[d], down_values[d]) = (along, down);
        sums[d] = halves[d] + (along >> 1) + (down >> 1);
        (along_least, down_least) = (along_least.min(along), down_least.min(down));
    }
    (now.least, below.least) = (along_least, down_least);
}

/// Writes what both eyes agree on to `out`.
pub struct Agreed<'a> {
    pub eyes: &'a Eyes,
    pub out: &'a mut [u16],
}

impl WithSimd for Agreed<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.eyes.agreed(self.out);
    }
}
