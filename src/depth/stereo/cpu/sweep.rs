//! The sweeps over a group of rows: from the right with the costs and one path, then from the left with the other two
//! paths and the winners. What the first leaves to the second stays in the cache of the core that makes both.

use pulp::WithSimd;

use super::super::penalty::Penalties;
use super::GROUP;
use super::cost::{self, Codes, Costs, array};
use super::path::Values;
use super::winner::Eyes;
use crate::compute::aligned::{Aligned, Line};

/// What is known of the rows of a group.
#[derive(Clone, Copy)]
pub struct Group<'a> {
    /// Grey values of the left picture, `[row][column]`: of the rows of the group that there are.
    pub luma: &'a [u8],
    /// The row above, or the first one again.
    pub above: &'a [u8],
    pub width: usize,
    pub penalties: &'a Penalties,
}

impl Group<'_> {
    fn rows(&self) -> usize {
        self.luma.len() / self.width
    }

    /// P2 along row `row`, between column `x` and the one before it, `from`.
    #[inline(always)]
    fn along(&self, row: usize, x: usize, from: usize) -> u8 {
        let luma = &self.luma[row * self.width..];
        self.penalties.between(luma[x], luma[from])
    }

    /// P2 down column `x` to row `row`.
    #[inline(always)]
    fn down(&self, row: usize, x: usize) -> u8 {
        let above = if row == 0 { self.above[x] } else { self.luma[(row - 1) * self.width + x] };
        self.penalties.between(self.luma[row * self.width + x], above)
    }
}

/// What the sweep from the right leaves, `[column][row][disparity]`.
pub struct Cells {
    costs: Aligned<u8>,
    /// Half of the values of the path from the right.
    halves: Aligned<u8>,
}

impl Cells {
    /// Of `width` columns.
    pub fn new(width: usize, disparities: usize) -> Self {
        let plane = || Aligned::zeros(width * GROUP * disparities);
        Self { costs: plane(), halves: plane() }
    }
}

/// Paths along the rows of a group. Two buffers take turns: the values of the pixel before, and those that are made.
pub struct Along {
    values: [[Values; GROUP]; 2],
    second: bool,
}

impl Along {
    /// Before the first pixels.
    #[inline(always)]
    pub fn start<const N: usize>() -> Self {
        Self { values: [[Values::start::<N>(); GROUP]; 2], second: false }
    }

    /// The values before, and those that are made.
    #[inline(always)]
    fn turn(&mut self) -> (&[Values; GROUP], &mut [Values; GROUP]) {
        let [first, second] = &mut self.values;
        self.second = !self.second;
        if self.second { (first, second) } else { (second, first) }
    }
}

/// The costs of a group, and the path from the right.
pub struct FromRight<'a, const N: usize> {
    pub group: Group<'a>,
    /// From the row above the group to the one below it.
    pub codes: [Codes<'a>; cost::ROWS],
    /// One more than the likely disparity, or 0; laid out as the grey values.
    pub likely: Option<&'a [u16]>,
    pub cells: &'a mut Cells,
}

impl<const N: usize> WithSimd for FromRight<'_, N> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { group, codes, likely, cells } = self;
        let (width, rows) = (group.width, group.rows());
        let costs = &mut cells.costs.as_chunks_mut::<N>().0[..width * GROUP];
        let halves = &mut cells.halves.as_chunks_mut::<N>().0[..width * GROUP];
        let mut made = Costs::<N>::new(&codes, width);
        let mut along = Along::start::<N>();
        for x in (0..width).rev() {
            let made = made.of_column(x);
            let (before, now) = along.turn();
            for row in 0..rows {
                let likely = likely.map_or(0, |likely| likely[row * width + x]);
                let p2 = group.along(row, x, (x + 1).min(width - 1));
                let cell = x * GROUP + row;
                step(&before[row], p2, likely, &made.0[row], &mut now[row], &mut costs[cell], &mut halves[cell]);
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
    let (step, bonus) = (before.step::<N>(p2), cost::bonus(likely));
    let values = now.of_mut::<N>();
    let mut least = u8::MAX;
    for d in 0..N {
        let cost = made[d].saturating_sub(bonus(d as u8));
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
    pub group: Group<'a>,
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
        let Self { group, cells, first, along, down, eyes } = self;
        let (rows, columns) = (group.rows(), BLOCK.min(group.width - first));
        let costs = &cells.costs.as_chunks::<N>().0[first * GROUP..(first + columns) * GROUP];
        let halves = &cells.halves.as_chunks::<N>().0[first * GROUP..(first + columns) * GROUP];
        let states = &mut down.values.as_chunks_mut::<N>().0[..columns];
        // Above each row the values of a column, below the last one those for the next group.
        let mut between = [Values::start::<N>(); GROUP + 1];
        // Each row is a column behind the one above, so that no step waits for what was made just before it.
        for k in 0..columns + rows {
            if k >= rows {
                let x = k - rows;
                states[x] = *between[rows].of::<N>();
                down.least[x] = between[rows].least;
            }
            for row in (0..rows).rev() {
                let Some(at) = k.checked_sub(row).filter(|&at| at < columns) else { continue };
                let x = first + at;
                if row == 0 {
                    *between[0].of_mut::<N>() = states[at];
                    between[0].least = down.least[at];
                }
                let (above, below) = between.split_at_mut(row + 1);
                let p2 = (group.along(row, x, x.saturating_sub(1)), group.down(row, x));
                let [one, two] = &mut along.values;
                let (before, now) = if x % 2 == 0 { (&one[row], &mut two[row]) } else { (&two[row], &mut one[row]) };
                let cell = at * GROUP + row;
                let mut sums = Line([0; N]);
                let least = steps(
                    (before, &above[row]),
                    p2,
                    &costs[cell],
                    &halves[cell],
                    (now, &mut below[0]),
                    &mut sums.0,
                );
                eyes.take::<N>(row, x, &sums.0, least);
            }
        }
    }
}

/// Steps of the path along a row and of the one down a column; returns the least of the sums of all three paths.
#[inline(always)]
fn steps<const N: usize>(
    before: (&Values, &Values),
    p2: (u8, u8),
    costs: &[u8; N],
    halves: &[u8; N],
    now: (&mut Values, &mut Values),
    sums: &mut [u8; N],
) -> u8 {
    let (along, down) = (before.0.step::<N>(p2.0), before.1.step::<N>(p2.1));
    let (along_values, down_values) = (now.0.of_mut::<N>(), now.1.of_mut::<N>());
    let mut least = [u8::MAX; 3];
    for d in 0..N {
        let values = [along.value(d, costs[d]), down.value(d, costs[d])];
        [along_values[d], down_values[d]] = values;
        sums[d] = halves[d] + (values[0] >> 1) + (values[1] >> 1);
        least = [least[0].min(values[0]), least[1].min(values[1]), least[2].min(sums[d])];
    }
    (now.0.least, now.1.least) = (least[0], least[1]);
    least[2]
}
