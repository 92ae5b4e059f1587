//! Pass `bin`: the picture becomes linear light, and each bin gets its share of every pixel, premultiplied and
//! averaged down to its scale, with the coarse grid over it. One reading of the picture serves every bin.

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::{Simd, WithSimd};

use super::aligned::Line;
use super::fill::{Behind, HalfRows};
use super::rows::{CELL_PLANES, EMPTY_CELL, NO_COLOR, repeat_ends};
use super::simd::madd;
use super::tiles::{TILE_H, TILE_W, Tiles};
use super::unpack::{Piece, Source};
use crate::bokeh::plan::{CELL, COVERAGE_FLOOR, MAX_BINS, Share};

/// Columns of the picture that are read at once.
pub const BLOCK: usize = 4 * TILE_W;
/// Columns beyond a block on both sides that its averages reach.
const MARGIN: usize = 16;
const WIDE: usize = BLOCK + 2 * MARGIN;
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
    /// `[row][4][stride]`: premultiplied colour and coverage.
    pub out: &'a mut [f32],
    /// Values of a plane row of `out`.
    pub stride: usize,
    /// Columns in front of the first pixel.
    pub pad: usize,
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
    cells: Line<[[f32; BLOCK]; CELL_PLANES]>,
}

impl BandSums {
    /// Zeros.
    pub fn new() -> Self {
        let mut empty = BinSums { rows: Line([[[0.0; WIDE]; SUMS]; 2]), cells: Line([[0.0; BLOCK]; CELL_PLANES]) };
        clear_cells(&mut empty.cells.0);
        Self(vec![empty; MAX_BINS])
    }
}

impl WithSimd for Band<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        for block in 0..self.waits.len() {
            self.block::<S>(block);
        }
        for bin in self.bins.iter_mut().flatten() {
            let (pad, width) = (bin.pad, bin.size.0);
            bin.out.chunks_exact_mut(bin.stride).for_each(|plane| repeat_ends(plane, pad, width));
        }
    }
}

impl Band<'_> {
    #[inline(always)]
    fn block<V: Simd>(&mut self, block: usize) {
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
            } else {
                bin.clear(block);
            }
        }
        if reach == 0 && !active.contains(&true) && !matches!(self.hidden, Hidden::Waits(..)) {
            return;
        }
        let mut piece: Piece<WIDE> = Line([[0.0; WIDE]; 4]);
        let height = self.source.color.height as isize;
        let (first, end) = (self.rows.start as isize, self.rows.end as isize);
        let last = end.min((height as usize).next_multiple_of(CELL) as isize);
        for y in first - reach..last + reach {
            let inside = y.clamp(0, height - 1) as usize;
            self.source.unpack(inside, (block * BLOCK) as isize - MARGIN as isize, &mut piece);
            match &mut self.hidden {
                Hidden::Nothing => {}
                Hidden::Waits(behind, halves) => {
                    if (first..end.min(height)).contains(&y) {
                        halves.add(behind, block * BLOCK, MARGIN, y as usize, &piece);
                    }
                }
                Hidden::Filled(behind) => {
                    let width = self.source.color.width as usize;
                    behind.put((block * BLOCK) as isize - MARGIN as isize, inside, width, &mut piece);
                }
            }
            let range = range_of(&piece.0[3]);
            for ((bin, sums), _) in self.bins.iter_mut().zip(&mut self.sums.0).zip(active).filter(|(_, active)| *active)
            {
                let Some(bin) = bin else { continue };
                match bin.scale {
                    1 => bin.add::<V, 1>(sums, block, first, y, &piece, range),
                    2 => bin.add::<V, 2>(sums, block, first, y, &piece, range),
                    4 => bin.add::<V, 4>(sums, block, first, y, &piece, range),
                    _ => bin.add::<V, 8>(sums, block, first, y, &piece, range),
                }
            }
        }
    }
}

#[inline(always)]
fn range_of(values: &[f32; WIDE]) -> (f32, f32) {
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
fn clear_cells(cells: &mut [[f32; BLOCK]; CELL_PLANES]) {
    for (plane, &value) in cells.iter_mut().zip(&EMPTY_CELL) {
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
                for plane in self.out.chunks_exact_mut(self.stride).skip(row * CELL * 4).take(CELL * 4) {
                    plane[self.pad + x0..][..width].fill(0.0);
                }
            }
        }
        let across = self.size.0.div_ceil(CELL);
        let (first, cells) = (x0 / CELL, (width / CELL).min(across.saturating_sub(x0 / CELL)));
        let total = self.cells.len() / (CELL_PLANES * self.rows_of_cells());
        for (k, plane) in self.cells.chunks_exact_mut(total).enumerate() {
            plane[first..first + cells].fill(EMPTY_CELL[k % CELL_PLANES]);
        }
    }

    fn blocks(&self) -> usize {
        self.filled.len() / self.rows_of_cells()
    }

    fn rows_of_cells(&self) -> usize {
        (self.out.len() / (4 * self.stride)).div_ceil(CELL)
    }

    /// Adds row `y` of the picture (it may lie outside) to the bin rows of a band that begins at row `first`.
    #[inline(always)]
    fn add<V: Simd, const S: usize>(
        &mut self,
        sums: &mut BinSums,
        block: usize,
        first: isize,
        y: isize,
        piece: &Piece<WIDE>,
        range: (f32, f32),
    ) {
        let s = S as isize;
        let rows = (self.out.len() / (4 * self.stride)) as isize;
        // Row `upper` and the one below it take this row; for both it is the `k`-th (and `k + S`-th) of their tents.
        let from = y - first + s / 2;
        let (lower, k) = (from.div_euclid(s), from.rem_euclid(s));
        let upper = lower - if S > 1 { 1 } else { 0 };
        if from < 0 || upper >= rows {
            return;
        }
        if self.share.is_none_or(|share| share.meets(range)) {
            let up = (2.0 - (k as f32 + 0.5) / S as f32 - 0.0) - 1.0;
            let weights = if S == 1 { [1.0, 0.0] } else { [up / S as f32, (1.0 - up) / S as f32] };
            let [even, odd] = &mut sums.rows.0;
            let (above, below) = if upper.rem_euclid(2) == 0 { (even, odd) } else { (odd, even) };
            match &self.share {
                None => sum_row::<V, S>(|_| 1.0, piece, weights, above, below),
                Some(share) => sum_row::<V, S>(|c| share.at(c), piece, weights, above, below),
            }
        }
        if k == s - 1 && upper >= 0 {
            let done = &mut sums.rows.0[upper.rem_euclid(2) as usize];
            let means = reduce::<V, S>(done);
            done.as_flattened_mut().fill(0.0);
            self.finish_row::<S>(block, upper as usize, &means, &mut sums.cells.0);
        } else if k == s - 1 {
            sums.rows.0[upper.rem_euclid(2) as usize].as_flattened_mut().fill(0.0);
        }
        if y - first == rows * s + s / 2 - 1 {
            sums.rows.0[lower.rem_euclid(2) as usize].as_flattened_mut().fill(0.0);
        }
    }

    /// Stores a row of the bin, and adds it to its cells.
    #[inline(always)]
    fn finish_row<const S: usize>(
        &mut self,
        block: usize,
        row: usize,
        means: &Line<[[f32; BLOCK]; SUMS]>,
        cells: &mut [[f32; BLOCK]; CELL_PLANES],
    ) {
        let (x0, width) = (block * BLOCK / S, BLOCK / S);
        let means = &means.0;
        for p in 0..4 {
            self.out[(row * 4 + p) * self.stride + self.pad + x0..][..width].copy_from_slice(&means[p][..width]);
        }
        let blocks = self.blocks();
        self.filled[row / CELL * blocks + block] = true;
        for x in 0..width {
            cells[0][x] += means[3][x];
            cells[1][x] += means[4][x];
            let counts = means[3][x] > COVERAGE_FLOOR;
            let inverse = if counts { 1.0 / means[3][x] } else { 0.0 };
            // An addition, where a choice would become masked stores that the next row waits for.
            let out_of_range = if counts { 0.0 } else { NO_COLOR };
            for p in 0..3 {
                let own = means[p][x] * inverse;
                let (low, high) = (own + out_of_range, own - out_of_range);
                cells[2 + p][x] = if low < cells[2 + p][x] { low } else { cells[2 + p][x] };
                cells[5 + p][x] = if high > cells[5 + p][x] { high } else { cells[5 + p][x] };
            }
        }
        let rows = self.out.len() / (4 * self.stride);
        if row % CELL == CELL - 1 || row == rows - 1 {
            self.finish_cells::<S>(block, row / CELL, cells);
            clear_cells(cells);
        }
    }

    #[inline(always)]
    fn finish_cells<const S: usize>(&mut self, block: usize, row: usize, cells: &[[f32; BLOCK]; CELL_PLANES]) {
        let across = self.cells.len() / (CELL_PLANES * self.rows_of_cells());
        let (x0, width) = (block * BLOCK / S, BLOCK / S);
        let valid = width.min(self.size.0.saturating_sub(x0));
        for (p, values) in cells.iter().enumerate() {
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
fn sum_row<V: Simd, const S: usize>(
    share: impl Fn(f32) -> f32,
    piece: &Piece<WIDE>,
    weights: [f32; 2],
    above: &mut [[f32; WIDE]; SUMS],
    below: &mut [[f32; WIDE]; SUMS],
) {
    let [r, g, b, c] = &piece.0;
    let [a0, a1, a2, a3, a4] = above;
    let [b0, b1, b2, b3, b4] = below;
    for x in 0..WIDE {
        let share = share(c[x]);
        let values = [share * r[x], share * g[x], share * b[x], share, share * c[x].abs()];
        a0[x] = madd::<V>(values[0], weights[0], a0[x]);
        a1[x] = madd::<V>(values[1], weights[0], a1[x]);
        a2[x] = madd::<V>(values[2], weights[0], a2[x]);
        a3[x] = madd::<V>(values[3], weights[0], a3[x]);
        a4[x] = madd::<V>(values[4], weights[0], a4[x]);
        if S > 1 {
            b0[x] = madd::<V>(values[0], weights[1], b0[x]);
            b1[x] = madd::<V>(values[1], weights[1], b1[x]);
            b2[x] = madd::<V>(values[2], weights[1], b2[x]);
            b3[x] = madd::<V>(values[3], weights[1], b3[x]);
            b4[x] = madd::<V>(values[4], weights[1], b4[x]);
        }
    }
}

/// The tent across: a row of sums at the bin's scale.
#[inline(always)]
fn reduce<V: Simd, const S: usize>(sums: &[[f32; WIDE]; SUMS]) -> Line<[[f32; BLOCK]; SUMS]> {
    let mut means = Line([[0.0; BLOCK]; SUMS]);
    for (mean, sum) in means.0.iter_mut().zip(sums) {
        if S == 1 {
            mean.copy_from_slice(&sum[MARGIN..MARGIN + BLOCK]);
            continue;
        }
        let groups = sum[MARGIN - S / 2..].as_chunks::<S>().0;
        for (x, mean) in mean[..BLOCK / S].iter_mut().enumerate() {
            let (before, after) = (&groups[x], &groups[x + 1]);
            let mut total = 0.0;
            for k in 0..S {
                let weight = (k as f32 + 0.5) / (S * S) as f32;
                total = madd::<V>(weight, before[k], total);
                total = madd::<V>(weight, after[S - 1 - k], total);
            }
            *mean = total;
        }
    }
    means
}
