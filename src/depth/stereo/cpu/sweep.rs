//! The two sweeps over a group of rows: from the right with the costs and one path, then from the left with the other
//! two paths and the winners. The output of the first stays in the cache of the core for the second.

use pulp::WithSimd;

use super::GROUP;
use super::cost::{self, CensusCodes, Costs};
use super::path::{PathValues, Paths, StepPenalties};
use super::winner::{WinnerRow, Winners};
use crate::compute::aligned::{Aligned, CacheAligned};

/// Output of the sweep from the right for a group, `[column][row]`: the costs, and half of the values of the path from
/// the right.
pub struct Cells(Aligned<u8>);

/// Costs and halved path values of the rows of a column.
type Cell<const N: usize> = [[[u8; N]; 2]; GROUP];

impl Cells {
    /// Allocates for `width` columns.
    pub fn new(width: usize, disparities: usize) -> Self {
        Self(Aligned::zeros(width * GROUP * 2 * disparities))
    }

    #[inline(always)]
    fn columns<const N: usize>(&self) -> &[Cell<N>] {
        self.0.as_chunks().0.as_chunks().0.as_chunks().0
    }

    #[inline(always)]
    fn columns_mut<const N: usize>(&mut self) -> &mut [Cell<N>] {
        self.0.as_chunks_mut().0.as_chunks_mut().0.as_chunks_mut().0
    }
}

/// Computes the costs of a group, and the path from the right.
pub struct SweepFromRight<'a, const N: usize> {
    /// From the row above the group to the one below it.
    pub codes: [CensusCodes<'a>; cost::ROWS],
    pub p2: &'a StepPenalties,
    /// For each row, one more than the likely disparity of each pixel, or 0.
    pub likely: Option<[&'a [u16]; GROUP]>,
    pub cells: &'a mut Cells,
    /// The path values before the first pixels.
    pub paths: &'a mut Paths,
}

impl<const N: usize> WithSimd for SweepFromRight<'_, N> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { codes, p2, likely, cells, paths } = self;
        let width = p2.along.len();
        let mut column = RightSweep { p2, likely, costs: Costs::<N>::new(codes, width), cells: cells.columns_mut() };
        let [one, two] = &mut paths.along;
        for x in (0..width).rev().step_by(2) {
            column.advance(x, one, two);
            if x > 0 {
                column.advance(x - 1, two, one);
            }
        }
    }
}

/// State of a sweep from the right.
struct RightSweep<'a, const N: usize> {
    p2: &'a StepPenalties,
    likely: Option<[&'a [u16]; GROUP]>,
    costs: Costs<'a, N>,
    cells: &'a mut [Cell<N>],
}

impl<const N: usize> RightSweep<'_, N> {
    /// Advances the paths to column `x`.
    #[inline(always)]
    fn advance(&mut self, x: usize, before: &[PathValues; GROUP], now: &mut [PathValues; GROUP]) {
        let raw_costs = self.costs.next_column(x);
        let along = &self.p2.along;
        let p2 = along[(x + 1).min(along.len() - 1)];
        let likely = self.likely.map_or([0; GROUP], |likely| likely.map(|row| row[x]));
        let cells = &mut self.cells[x];
        for row in 0..GROUP {
            let mut cell = CacheAligned([[0; N]; 2]);
            advance_path(&before[row], p2[row], likely[row], &raw_costs.0[row], &mut now[row], &mut cell.0);
            cells[row] = cell.0;
        }
    }
}

/// Computes a step of a path; `raw_costs` are the costs without the bonus for the likely disparity.
#[inline(always)]
fn advance_path<const N: usize>(
    before: &PathValues,
    p2: u8,
    likely: u16,
    raw_costs: &[u8; N],
    now: &mut PathValues,
    [costs, halves]: &mut [[u8; N]; 2],
) {
    let (step, prior_bonus, disparities) =
        (before.step_to::<N>(p2), cost::prior_bonus(likely), cost::disparity_bytes::<N>());
    let values = now.as_array_mut::<N>();
    let mut least = u8::MAX;
    for d in 0..N {
        let cost = raw_costs[d].saturating_sub(prior_bonus(disparities[d]));
        let value = step.value(d, cost);
        costs[d] = cost;
        values[d] = value;
        halves[d] = value >> 1;
        least = least.min(value);
    }
    now.least = least;
}

/// Columns of a block: an even number, so that the paths along the rows continue in the buffer in which they stopped.
pub const BLOCK: usize = 64;

/// The paths down the columns of a block, at the last row that was processed.
pub struct DownPaths {
    /// `[column][disparity]`.
    values: Aligned<u8>,
    least: [u8; BLOCK],
}

impl DownPaths {
    pub fn new(disparities: usize) -> Self {
        Self { values: Aligned::zeros(BLOCK * disparities), least: [0; BLOCK] }
    }

    /// Resets the paths to before the first row.
    pub fn clear(&mut self) {
        self.values.fill(0);
        self.least.fill(0);
    }
}

/// Computes the paths from the left and from above in a block of columns, and the winners of the sums of all paths.
pub struct SweepFromLeft<'a, const N: usize> {
    pub p2: &'a StepPenalties,
    pub cells: &'a Cells,
    /// First column of the block.
    pub first: usize,
    pub paths: &'a mut Paths,
    pub down: &'a mut DownPaths,
    pub winners: &'a mut Winners,
}

impl<const N: usize> WithSimd for SweepFromLeft<'_, N> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { p2, cells, first, paths, down, winners } = self;
        let end = (first + BLOCK).min(p2.along.len());
        let mut block = LeftSweep::<N> {
            p2: [&p2.along[first..end], &p2.down[first..end]],
            cells: &cells.columns()[first..end],
            columns: end - first,
            rows: winners.rows_mut(first..end),
        };
        let Paths { along: [one, two], down: between } = paths;
        between[0].set(&down.values.as_chunks::<N>().0[0], down.least[0]);
        // A wavefront: each row is one column behind the row above, so that consecutive steps do not depend on each
        // other. `GROUP` more steps let the last row finish.
        for k in (0..block.columns + GROUP).step_by(2) {
            block.advance(k, down, between, one, two);
            block.advance(k + 1, down, between, two, one);
        }
    }
}

/// State of a sweep from the left through a block.
struct LeftSweep<'a, const N: usize> {
    /// Along the rows and down the columns.
    p2: [&'a [[u8; GROUP]]; 2],
    cells: &'a [Cell<N>],
    columns: usize,
    rows: [WinnerRow<'a, N>; GROUP],
}

impl<const N: usize> LeftSweep<'_, N> {
    /// Advances the wavefront: row 0 to `column`, row 1 to the column before, and so on. `down` holds the paths from
    /// the group above, and `paths_between_rows[r]` the path that enters row `r` from above.
    #[inline(always)]
    fn advance(
        &mut self,
        column: usize,
        down: &mut DownPaths,
        paths_between_rows: &mut [PathValues; GROUP + 1],
        previous: &[PathValues; GROUP],
        current: &mut [PathValues; GROUP],
    ) {
        let states = &mut down.values.as_chunks_mut::<N>().0[..self.columns];
        let past = column.wrapping_sub(GROUP);
        if past < self.columns {
            states[past] = *paths_between_rows[GROUP].as_array::<N>();
            down.least[past] = paths_between_rows[GROUP].least;
        }
        self.advance_row::<3>(column, paths_between_rows, previous, current);
        self.advance_row::<2>(column, paths_between_rows, previous, current);
        self.advance_row::<1>(column, paths_between_rows, previous, current);
        self.advance_row::<0>(column, paths_between_rows, previous, current);
        // Loaded one step ahead of its use.
        if column + 1 < self.columns {
            paths_between_rows[0].set(&states[column + 1], down.least[column + 1]);
        }
    }

    /// Advances a row to its column, if that is inside the block.
    #[inline(always)]
    fn advance_row<const ROW: usize>(
        &mut self,
        column: usize,
        paths_between_rows: &mut [PathValues; GROUP + 1],
        previous: &[PathValues; GROUP],
        current: &mut [PathValues; GROUP],
    ) {
        let x = column.wrapping_sub(ROW);
        if x >= self.columns {
            return;
        }
        let mut sums = CacheAligned([0; N]);
        let p2 = self.p2.map(|p2| p2[x][ROW]);
        let cell = CacheAligned(self.cells[x][ROW]);
        let (above, below) = paths_between_rows.split_at_mut(ROW + 1);
        advance_two_paths(&previous[ROW], &above[ROW], p2, &cell.0, &mut current[ROW], &mut below[0], &mut sums.0);
        self.rows[ROW].update(x, &sums.0);
    }
}

/// Computes a step of the path along a row and of the one down a column, and the sums of all three paths.
#[inline(always)]
fn advance_two_paths<const N: usize>(
    previous: &PathValues,
    above: &PathValues,
    p2: [u8; 2],
    [costs, halves]: &[[u8; N]; 2],
    current: &mut PathValues,
    below: &mut PathValues,
    sums: &mut [u8; N],
) {
    let (along, down) = (previous.step_to::<N>(p2[0]), above.step_to::<N>(p2[1]));
    let (along_values, down_values) = (current.as_array_mut::<N>(), below.as_array_mut::<N>());
    let (mut along_least, mut down_least) = (u8::MAX, u8::MAX);
    for d in 0..N {
        let (along, down) = (along.value(d, costs[d]), down.value(d, costs[d]));
        (along_values[d], down_values[d]) = (along, down);
        sums[d] = halves[d] + (along >> 1) + (down >> 1);
        (along_least, down_least) = (along_least.min(along), down_least.min(down));
    }
    (current.least, below.least) = (along_least, down_least);
}

/// Writes the disparities that pass the left-right consistency check to `out`.
pub struct ConsistencyCheck<'a> {
    pub winners: &'a Winners,
    pub out: &'a mut [u16],
}

impl WithSimd for ConsistencyCheck<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.winners.write_consistent(self.out);
    }
}
