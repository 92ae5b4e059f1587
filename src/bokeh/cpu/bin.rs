//! Pass `bin`: the picture becomes linear light, and each bin gets its share of every pixel, premultiplied and
//! averaged down to its scale, with the coarse grid over it. One reading of the picture serves every bin.

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::{Simd, WithSimd};

use super::aligned::Line;
use super::fill::{Behind, HalfRows};
use super::rows::{CELL_PLANES, EMPTY_CELL, NO_COLOR, STRIP, STRIP_CELLS, STRIP_ROW};
use super::simd::{fma, load, store};
use super::tiles::{TILE_H, TILE_W, Tiles};
use super::unpack::{Piece, Source};
use crate::bokeh::plan::{CELL, COVERAGE_FLOOR, MAX_BINS, Share};

/// Columns of the picture that are read at once.
pub const BLOCK: usize = 4 * TILE_W;
/// Columns beyond a block on both sides that its averages reach.
const MARGIN: usize = 16;
const WIDE: usize = BLOCK + 2 * MARGIN;
/// Values of a plane of a block: a line more than needed, as planes at multiples of 4096 bytes hinder each other.
const PLANE: usize = BLOCK + 16;
/// Planes of a sum: premultiplied colour, coverage, coverage times |CoC|.
const SUMS: usize = 5;

/// One bin's memory of a band.
pub struct BinRows<'a> {
    /// What it takes of a pixel; `None` takes everything (no depth edges to respect).
    pub share: Option<Share>,
    /// Pixels of the picture a bin pixel covers, each way.
    pub scale: usize,
    /// Columns and rows of the bin.
    pub size: (usize, usize),
    /// Whether the range of its colours is wanted.
    pub ranged: bool,
    /// Rows of the bin in this band.
    pub rows: usize,
    /// As [`Strips`](super::rows::Strips) has it.
    pub out: &'a mut [f32],
    /// Strips across.
    pub across: usize,
    /// `[row of cells][CELL_PLANES][across]`.
    pub cells: &'a mut [f32],
    /// Per block, whether `out` holds anything but zeros there.
    pub filled: &'a mut [bool],
}

/// Some rows of the picture: whole rows of cells of every bin.
pub struct Band<'a> {
    /// The frame.
    pub source: Source<'a>,
    /// What is where.
    pub tiles: &'a Tiles,
    /// First row, and how many.
    pub rows: std::ops::Range<usize>,
    /// The bins to be filled, from one of the plan's on.
    pub bins: [Option<BinRows<'a>>; MAX_BINS],
    /// What near objects hide is left out (to be done when it is filled in), or put in.
    pub hidden: Hidden<'a>,
    /// Per block, whether it has to wait for the fill.
    pub waits: &'a mut [bool],
    /// Memory of the thread.
    pub sums: &'a mut BandSums,
}

/// How a band treats what near objects hide.
pub enum Hidden<'a> {
    /// There is nothing to hide.
    Nothing,
    /// Bins behind wait where anything is hidden (the share is that of all of them); the pyramid's base is laid.
    Waits(Share, HalfRows<'a>),
    /// Blocks that waited are done, for the bins behind alone.
    Filled(Behind<'a>),
}

/// Sums of a thread, for each bin: two rows that are being filled, and the row of cells.
pub struct BandSums(Vec<BinSums>);

#[derive(Clone)]
struct BinSums {
    rows: Line<[[[f32; WIDE]; SUMS]; 2]>,
    cells: CellSums,
    means: Means,
}

/// A row of a block of the bin: the planes of a sum.
type Means = Line<[[f32; PLANE]; SUMS]>;
/// The rows of a row of cells so far, column by column.
type CellSums = Line<[[f32; PLANE]; CELL_PLANES]>;

impl BandSums {
    /// Zeros.
    pub fn new() -> Self {
        let mut empty = BinSums {
            rows: Line([[[0.0; WIDE]; SUMS]; 2]),
            cells: Line([[0.0; PLANE]; CELL_PLANES]),
            means: Line([[0.0; PLANE]; SUMS]),
        };
        clear_cells(&mut empty.cells);
        Self(vec![empty; MAX_BINS])
    }
}

impl WithSimd for Band<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        for block in 0..self.waits.len() {
            self.block(simd, block);
        }
        for bin in self.bins.iter_mut().flatten() {
            bin.repeat_end();
        }
    }
}

impl Band<'_> {
    #[inline(always)]
    fn block<V: Simd>(&mut self, simd: V, block: usize) {
        let columns = (block * (BLOCK / TILE_W)).saturating_sub(1)..(block + 1) * (BLOCK / TILE_W) + 1;
        let rows = (self.rows.start / TILE_H).saturating_sub(1)..self.rows.end.div_ceil(TILE_H) + 1;
        let (again, waits) = match &self.hidden {
            Hidden::Nothing => (false, false),
            Hidden::Waits(behind, _) => (false, self.tiles.lack(behind, columns.clone(), rows.clone())),
            Hidden::Filled(_) => (true, false),
        };
        if again && !self.waits[block] {
            return;
        }
        self.waits[block] = waits;
        let mut active = [false; MAX_BINS];
        let mut reach = 0;
        for (bin, active) in self.bins.iter_mut().zip(&mut active) {
            let Some(bin) = bin else { continue };
            // What waits is written later, but for bins in front.
            let front = |share: &Share| share.behind.0 <= 0.0;
            *active = match &bin.share {
                None => true,
                Some(share) if waits => front(share) && self.tiles.meet(share, columns.clone(), rows.clone()),
                Some(share) => again || self.tiles.meet(share, columns.clone(), rows.clone()),
            };
            if *active {
                reach = reach.max(bin.scale as isize / 2);
            } else if !waits || bin.share.as_ref().is_some_and(front) {
                bin.clear(block);
            }
        }
        if reach == 0 && !active.contains(&true) && !matches!(self.hidden, Hidden::Waits(..)) {
            return;
        }
        let mut piece: Piece<WIDE> = Line([[0.0; WIDE]; 4]);
        let columns = columns_of(block, self.source.color.width as usize);
        let height = self.source.color.height as isize;
        let (first, end) = (self.rows.start as isize, self.rows.end as isize);
        let last = end.min((height as usize).next_multiple_of(CELL) as isize);
        for y in first - reach..last + reach {
            let inside = y.clamp(0, height - 1) as usize;
            self.source.unpack::<V, WIDE>(
                inside,
                (block * BLOCK) as isize - MARGIN as isize,
                columns + 2 * MARGIN,
                &mut piece,
            );
            match &mut self.hidden {
                Hidden::Nothing => {}
                Hidden::Waits(behind, halves) => {
                    if (first..end.min(height)).contains(&y) {
                        halves.add(behind, block * BLOCK, MARGIN..MARGIN + columns, y as usize, &piece);
                    }
                }
                Hidden::Filled(behind) => {
                    let width = self.source.color.width as usize;
                    behind.put((block * BLOCK) as isize - MARGIN as isize, inside, width, &mut piece);
                }
            }
            let range = range_of(&piece.0[3][..columns + 2 * MARGIN]);
            for ((bin, sums), _) in self.bins.iter_mut().zip(&mut self.sums.0).zip(active).filter(|(_, active)| *active)
            {
                let Some(bin) = bin else { continue };
                match bin.scale {
                    1 => bin.add::<V, 1>(simd, sums, (block, columns), first, y, &piece, range),
                    2 => bin.add::<V, 2>(simd, sums, (block, columns), first, y, &piece, range),
                    4 => bin.add::<V, 4>(simd, sums, (block, columns), first, y, &piece, range),
                    _ => bin.add::<V, 8>(simd, sums, (block, columns), first, y, &piece, range),
                }
            }
        }
    }
}

/// Where row `row` of the strip at column `x` begins.
#[inline(always)]
fn strip_row(across: usize, x: usize, row: usize) -> usize {
    (row / CELL * across + x / STRIP) * STRIP_CELLS + row % CELL * STRIP_ROW
}

/// Columns of a block that hold anything, in whole vectors of the coarsest bin.
fn columns_of(block: usize, width: usize) -> usize {
    (width - block * BLOCK).next_multiple_of(2 * TILE_W).min(BLOCK)
}

#[inline(always)]
fn range_of(values: &[f32]) -> (f32, f32) {
    let (mut low, mut high) = ([f32::INFINITY; 16], [f32::NEG_INFINITY; 16]);
    for values in values.as_chunks::<16>().0 {
        for k in 0..16 {
            low[k] = if values[k] < low[k] { values[k] } else { low[k] };
            high[k] = if values[k] > high[k] { values[k] } else { high[k] };
        }
    }
    (low.into_iter().fold(f32::INFINITY, f32::min), high.into_iter().fold(f32::NEG_INFINITY, f32::max))
}

/// Cells of nothing.
#[inline(always)]
fn clear_cells(cells: &mut CellSums) {
    for (plane, &value) in cells.0.iter_mut().zip(&EMPTY_CELL) {
        plane.fill(value);
    }
}

impl BinRows<'_> {
    /// Empties a block.
    #[inline(always)]
    fn clear(&mut self, block: usize) {
        let (x0, width) = (block * BLOCK / self.scale, BLOCK / self.scale);
        for row in 0..self.rows_of_cells() {
            let blocks = self.blocks();
            if std::mem::take(&mut self.filled[row * blocks + block]) {
                let first = row * self.across + x0 / STRIP;
                let count = (width / STRIP).min(self.across - x0 / STRIP);
                self.out[first * STRIP_CELLS..][..count * STRIP_CELLS].fill(0.0);
            }
        }
        let across = self.size.0.div_ceil(CELL);
        let (first, cells) = (x0 / CELL, (width / CELL).min(across.saturating_sub(x0 / CELL)));
        let total = self.cells.len() / (CELL_PLANES * self.rows_of_cells());
        for (k, plane) in self.cells.chunks_exact_mut(total).enumerate() {
            plane[first..first + cells].fill(EMPTY_CELL[k % CELL_PLANES]);
        }
    }

    /// Row `row` of the strip at column `x`.
    #[inline(always)]
    fn strip_row(&mut self, x: usize, row: usize) -> &mut [f32] {
        &mut self.out[strip_row(self.across, x, row)..][..STRIP_ROW]
    }

    /// Repeats the last column to the end of the last strip.
    fn repeat_end(&mut self) {
        let last = (self.size.0 - 1) % STRIP;
        for row in 0..self.rows {
            for plane in self.strip_row(self.size.0 - 1, row).as_chunks_mut::<STRIP>().0 {
                let value = plane[last];
                plane[last + 1..].fill(value);
            }
        }
    }

    fn blocks(&self) -> usize {
        self.filled.len() / self.rows_of_cells()
    }

    fn rows_of_cells(&self) -> usize {
        self.rows.div_ceil(CELL)
    }

    /// Adds row `y` of the picture (it may lie outside) to the bin rows of a band that begins at row `first`.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn add<V: Simd, const S: usize>(
        &mut self,
        simd: V,
        sums: &mut BinSums,
        (block, columns): (usize, usize),
        first: isize,
        y: isize,
        piece: &Piece<WIDE>,
        range: (f32, f32),
    ) {
        let rows = self.rows as isize;
        let meets = self.share.is_none_or(|share| share.meets(range));
        if S == 1 {
            if (0..rows).contains(&(y - first)) {
                self.whole_row(simd, (block, columns), (y - first) as usize, sums, meets.then_some(piece));
            }
            return;
        }
        // The bin row above takes this row as the `k + S`-th of its tent, the one below as the `k`-th.
        let s = S as isize;
        let from = y - first + s / 2;
        let (lower, k) = (from.div_euclid(s), from.rem_euclid(s));
        let upper = lower - 1;
        if from < 0 || upper >= rows {
            return;
        }
        let [even, odd] = &mut sums.rows.0;
        let (above, below) = if upper.rem_euclid(2) == 0 { (even, odd) } else { (odd, even) };
        if meets {
            let rise = (k as f32 + 0.5) / (S * S) as f32;
            sum_row(
                simd,
                &ShareAt::new(simd, &self.share),
                piece,
                columns,
                [1.0 / S as f32 - rise, rise],
                above,
                below,
            );
        }
        if k == s - 1 {
            if upper >= 0 {
                reduce::<V, S>(simd, above, columns, &mut sums.means);
            }
            above.as_flattened_mut().fill(0.0);
            if upper == rows - 1 {
                below.as_flattened_mut().fill(0.0);
            }
            if upper >= 0 {
                self.finish_row::<V, S>(simd, (block, columns), upper as usize, sums);
            }
        }
    }

    /// A row of a bin at full scale, straight from the picture; none holds nothing.
    #[inline(always)]
    fn whole_row<V: Simd>(
        &mut self,
        simd: V,
        (block, columns): (usize, usize),
        row: usize,
        sums: &mut BinSums,
        piece: Option<&Piece<WIDE>>,
    ) {
        let columns = columns.min(self.across * STRIP - block * BLOCK);
        match piece {
            None => (0..columns).step_by(STRIP).for_each(|x| self.strip_row(block * BLOCK + x, row).fill(0.0)),
            Some(piece) => {
                let share = ShareAt::new(simd, &self.share);
                let cells = &mut sums.cells.0;
                let [floor, nothing] = [COVERAGE_FLOOR, NO_COLOR].map(|value| simd.splat_f32s(value));
                for x in (0..columns).step_by(V::F32_LANES) {
                    let values = share.of(simd, piece, MARGIN + x);
                    let out = self.strip_row(block * BLOCK + x, row);
                    for p in 0..4 {
                        store::<V>(out, p * STRIP + x % STRIP, values[p]);
                    }
                    for p in 0..2 {
                        let sum = simd.add_f32s(load::<V>(&cells[p], x), values[3 + p]);
                        store::<V>(&mut cells[p], x, sum);
                    }
                    if self.ranged {
                        let counts = simd.greater_than_f32s(values[3], floor);
                        let beyond = simd.select_f32s(counts, simd.splat_f32s(0.0), nothing);
                        for p in 0..3 {
                            let own = load::<V>(&piece.0[p], MARGIN + x);
                            let low = simd.min_f32s(load::<V>(&cells[2 + p], x), simd.add_f32s(own, beyond));
                            let high = simd.max_f32s(load::<V>(&cells[5 + p], x), simd.sub_f32s(own, beyond));
                            store::<V>(&mut cells[2 + p], x, low);
                            store::<V>(&mut cells[5 + p], x, high);
                        }
                    }
                }
                let blocks = self.blocks();
                self.filled[row / CELL * blocks + block] = true;
            }
        }
        self.close_cells::<1>((block, columns), row, sums);
    }

    /// Stores the row of cells when its last row is done.
    #[inline(always)]
    fn close_cells<const S: usize>(&mut self, block: (usize, usize), row: usize, sums: &mut BinSums) {
        if row % CELL == CELL - 1 || row == self.rows - 1 {
            self.finish_cells::<S>(block, row / CELL, &sums.cells);
            clear_cells(&mut sums.cells);
        }
    }

    /// Stores a row of the bin, and adds it to its cells.
    #[inline(always)]
    fn finish_row<V: Simd, const S: usize>(
        &mut self,
        simd: V,
        (block, columns): (usize, usize),
        row: usize,
        sums: &mut BinSums,
    ) {
        let (x0, width) = (block * BLOCK / S, columns / S);
        let (means, cells) = (&sums.means.0, &mut sums.cells.0);
        let ranged = self.ranged;
        for x in (0..width.min(self.across * STRIP - x0)).step_by(STRIP) {
            let out = &mut self.out[strip_row(self.across, x0 + x, row)..][..STRIP_ROW];
            for p in 0..4 {
                out[p * STRIP..][..STRIP].copy_from_slice(&means[p][x..x + STRIP]);
            }
        }
        let blocks = self.blocks();
        self.filled[row / CELL * blocks + block] = true;
        let [floor, zero, one, nothing] = [COVERAGE_FLOOR, 0.0, 1.0, NO_COLOR].map(|value| simd.splat_f32s(value));
        for x in (0..width).step_by(V::F32_LANES) {
            let coverage = load::<V>(&means[3], x);
            for p in 0..2 {
                let sum = simd.add_f32s(load::<V>(&cells[p], x), load::<V>(&means[3 + p], x));
                store::<V>(&mut cells[p], x, sum);
            }
            if !ranged {
                continue;
            }
            let counts = simd.greater_than_f32s(coverage, floor);
            let inverse = simd.div_f32s(one, simd.max_f32s(coverage, floor));
            let beyond = simd.select_f32s(counts, zero, nothing);
            for p in 0..3 {
                let own = simd.mul_f32s(load::<V>(&means[p], x), inverse);
                let low = simd.min_f32s(load::<V>(&cells[2 + p], x), simd.add_f32s(own, beyond));
                let high = simd.max_f32s(load::<V>(&cells[5 + p], x), simd.sub_f32s(own, beyond));
                store::<V>(&mut cells[2 + p], x, low);
                store::<V>(&mut cells[5 + p], x, high);
            }
        }
        self.close_cells::<S>((block, columns), row, sums);
    }

    #[inline(always)]
    fn finish_cells<const S: usize>(&mut self, (block, columns): (usize, usize), row: usize, cells: &CellSums) {
        let across = self.cells.len() / (CELL_PLANES * self.rows_of_cells());
        let (x0, width) = (block * BLOCK / S, columns / S);
        let valid = width.min(self.size.0.saturating_sub(x0));
        for (p, values) in cells.0.iter().enumerate().take(if self.ranged { CELL_PLANES } else { 2 }) {
            let out = &mut self.cells[(row * CELL_PLANES + p) * across + x0 / CELL..];
            for (out, values) in out.iter_mut().zip(values[..valid].chunks(CELL)) {
                let values = values.iter().copied();
                *out = match p {
                    0 | 1 => values.sum(),
                    2..5 => values.fold(NO_COLOR, f32::min),
                    _ => values.fold(-NO_COLOR, f32::max),
                };
            }
        }
    }
}

/// Adds a row's shares to two rows of sums.
#[inline(always)]
fn sum_row<S: Simd>(
    simd: S,
    share: &ShareAt<S>,
    piece: &Piece<WIDE>,
    columns: usize,
    weights: [f32; 2],
    above: &mut [[f32; WIDE]; SUMS],
    below: &mut [[f32; WIDE]; SUMS],
) {
    let weights = weights.map(|weight| simd.splat_f32s(weight));
    for x in (0..columns + 2 * MARGIN).step_by(S::F32_LANES) {
        let values = share.of(simd, piece, x);
        for p in 0..SUMS {
            let sums = [&above[p], &below[p]].map(|sums| load::<S>(sums, x));
            store::<S>(&mut above[p], x, fma(simd, values[p], weights[0], sums[0]));
            store::<S>(&mut below[p], x, fma(simd, values[p], weights[1], sums[1]));
        }
    }
}

/// A share, ready for vectors.
struct ShareAt<S: Simd> {
    steps: Option<[[S::f32s; 2]; 2]>,
}

impl<S: Simd> ShareAt<S> {
    #[inline(always)]
    fn new(simd: S, share: &Option<Share>) -> Self {
        // A step at `at` of a slope: slope c + (1/2 - slope at).
        let step = |(at, slope): (f32, f32)| [simd.splat_f32s(slope), simd.splat_f32s(0.5 - slope * at)];
        Self { steps: share.as_ref().map(|share| [step(share.front), step(share.behind)]) }
    }

    /// Premultiplied colour, coverage, and coverage times |CoC| of a vector of pixels.
    #[inline(always)]
    fn of(&self, simd: S, piece: &Piece<WIDE>, x: usize) -> [S::f32s; SUMS] {
        let [r, g, b, coc] = piece.0.each_ref().map(|plane| load::<S>(plane, x));
        let [zero, one] = [0.0, 1.0].map(|value| simd.splat_f32s(value));
        let share = match &self.steps {
            None => one,
            Some(steps) => {
                let at = |[slope, offset]: [S::f32s; 2]| {
                    simd.min_f32s(simd.max_f32s(fma(simd, coc, slope, offset), zero), one)
                };
                simd.sub_f32s(at(steps[0]), at(steps[1]))
            }
        };
        let by = |value| simd.mul_f32s(share, value);
        [by(r), by(g), by(b), share, by(simd.abs_f32s(coc))]
    }
}

/// The tent across: a row of sums at the bin's scale.
#[inline(always)]
fn reduce<V: Simd, const S: usize>(simd: V, sums: &[[f32; WIDE]; SUMS], columns: usize, means: &mut Means) {
    // The ascending half of the tent, and the descending one, as often as they fit.
    let ramp: [f32; BLOCK] = const {
        let mut ramp = [0.0; BLOCK];
        let mut k = 0;
        while k < BLOCK {
            ramp[k] = ((k % S) as f32 + 0.5) / (S * S) as f32;
            k += 1;
        }
        ramp
    };
    let (rise, fall) = (load::<V>(&ramp, 0), {
        let mut fall = [0.0; BLOCK];
        for k in 0..V::F32_LANES {
            fall[k] = 1.0 / S as f32 - ramp[k];
        }
        load::<V>(&fall, 0)
    });
    let mut weighed = Line([0.0f32; BLOCK]);
    for (mean, sum) in means.0.iter_mut().zip(sums) {
        let start = MARGIN - S / 2;
        for x in (0..columns).step_by(V::F32_LANES) {
            let (before, after) = (load::<V>(sum, start + x), load::<V>(sum, start + S + x));
            store::<V>(&mut weighed.0, x, fma(simd, after, fall, simd.mul_f32s(before, rise)));
        }
        for (mean, group) in mean[..columns / S].iter_mut().zip(weighed.0.as_chunks::<S>().0) {
            *mean = group.iter().sum();
        }
    }
}
