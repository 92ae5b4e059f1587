//! Square cells of the picture: which need the memory's attention, and in which blur may reveal the hidden background,
//! those near cells where the background is open.

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::MIN_ROUNDS;
use super::learning::SURE;
use crate::compute::bands::Bands;
use crate::compute::thread_pool::{MAX_ITEMS, ThreadPool};
use crate::frame::DepthMap;

/// Side of a cell, and the interval of the rows that are sampled in it, in pixels.
pub const CELL: usize = 16;
const ROW_STEP: usize = 4;

/// The cells of a picture.
#[derive(Debug, Default)]
pub struct Cells {
    /// Empty if nothing is known of the current picture.
    cells: Vec<Cell>,
    /// Columns and rows of the picture.
    size: (usize, usize),
    /// Largest inverse depth in a cell with surfaces that hide a known background, in 1/m.
    pub nearest_hiding: f32,
}

#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// Whether a known background is hidden, and whether one is visible, anywhere in the cell.
    has_hidden: bool,
    has_visible: bool,
    /// Whether anything of it is neither hidden nor surely known.
    is_unsettled: bool,
    /// Whether a cell with visible background is within the blur radius, along its row, and in two dimensions.
    is_beside_visible: bool,
    is_selected: bool,
    /// Largest and smallest inverse depth, in 1/m.
    nearest: f32,
    farthest: f32,
}

impl Cells {
    /// Classifies all cells.
    pub fn classify(&mut self, workers: &mut ThreadPool, size: (usize, usize), known: &BackgroundView) {
        let (width, height) = size;
        self.size = size;
        let across = width.div_ceil(CELL);
        self.cells.clear();
        self.cells.resize(across * height.div_ceil(CELL), Cell::default());
        let bands = Bands::new(height, CELL, workers);
        let mut nearest = [0.0f32; MAX_ITEMS];
        let cells = bands.split_tiles(&mut self.cells, CELL, across);
        workers.run_each(bands.rows().zip(cells).zip(&mut nearest), &|((rows, cells), nearest)| {
            *nearest = Arch::new().dispatch(ClassifyCells { known, width, rows, cells });
        });
        self.nearest_hiding = nearest.into_iter().fold(0.0, f32::max);
    }

    /// Forgets the cells, since the memory starts anew.
    pub fn clear(&mut self) {
        self.cells.clear();
    }

    /// Whether the memory has to look at row `y` from column `x` on, for `count` pixels: to learn, or to fade what is hidden if
    /// it `fades`.
    #[inline(always)]
    pub fn needs_update(&self, (x, y): (usize, usize), count: usize, fades: bool) -> bool {
        let at = y / CELL * self.size.0.div_ceil(CELL);
        let cells = self.cells.get(at + x / CELL..at + (x + count).div_ceil(CELL));
        cells.is_none_or(|cells| cells.iter().any(|cell| cell.is_unsettled | (fades & cell.has_hidden)))
    }

    /// Iterates over the columns of the cells in a row of cells at whose outlines the inverse depth may differ by more than
    /// `step`, in 1/m.
    pub fn outline_columns(&self, row: usize, step: f32) -> impl Iterator<Item = Range<usize>> {
        let (width, across) = (self.size.0, self.size.0.div_ceil(CELL));
        let first = row * across;
        let has_outline = move |column: &usize| {
            let at = first + column;
            let beside = [(*column > 0).then(|| at - 1), (column + 1 < across).then_some(at + 1)];
            let around = beside.into_iter().flatten().chain(at.checked_sub(across)).chain([at, at + across]);
            let farthest =
                around.filter_map(|at| self.cells.get(at)).fold(f32::MAX, |least, cell| least.min(cell.farthest));
            self.cells.get(at).is_some_and(|cell| cell.nearest - farthest > step)
        };
        (0..across).filter(has_outline).map(move |column| column * CELL..((column + 1) * CELL).min(width))
    }

    /// Selects the cells within `radius_px`, rounded up to cells, of one with visible background.
    pub fn select_near_visible(&mut self, radius_px: f32) {
        let radius = (radius_px / CELL as f32).ceil() as usize;
        let across = self.size.0.div_ceil(CELL);
        let down = self.cells.len() / across;
        for row in 0..down {
            self.mark_within(
                |k| row * across + k,
                across,
                radius,
                |cell| cell.has_visible,
                |cell| &mut cell.is_beside_visible,
            );
        }
        for column in 0..across {
            self.mark_within(
                |k| k * across + column,
                down,
                radius,
                |cell| cell.is_beside_visible,
                |cell| &mut cell.is_selected,
            );
        }
    }

    /// Marks the cells of a line that are up to `radius` away from one that satisfies `is`.
    fn mark_within(
        &mut self,
        place: impl Fn(usize) -> usize,
        count: usize,
        radius: usize,
        is: impl Fn(&Cell) -> bool,
        mark: impl Fn(&mut Cell) -> &mut bool,
    ) {
        for back in [false, true] {
            let mut since = usize::MAX - count;
            for k in 0..count {
                let cell = &mut self.cells[place(if back { count - 1 - k } else { k })];
                since = if is(cell) { 0 } else { since + 1 };
                *mark(cell) |= since <= radius;
            }
        }
    }

    /// Iterates over the column ranges of the selected cells that row `y` of the picture crosses.
    #[inline(always)]
    pub fn selected_columns(&self, y: usize) -> impl Iterator<Item = Range<usize>> {
        let (width, across) = (self.size.0, self.size.0.div_ceil(CELL));
        let cells = self.cells[y / CELL * across..][..across].iter().enumerate();
        let is_selected = cells.filter(|(_, cell)| cell.has_hidden && cell.is_selected);
        is_selected.map(move |(k, _)| k * CELL..((k + 1) * CELL).min(width))
    }
}

/// Classifies the cells of some rows. Returns the largest inverse depth in those that hide a known background.
struct ClassifyCells<'a> {
    known: &'a BackgroundView<'a>,
    width: usize,
    rows: Range<usize>,
    cells: &'a mut [Cell],
}

impl WithSimd for ClassifyCells<'_> {
    type Output = f32;
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> f32 {
        let Self { known, width, rows, cells } = self;
        let mut nearest_hiding = 0.0;
        for (y, cells) in rows.clone().step_by(CELL).zip(cells.chunks_mut(width.div_ceil(CELL))) {
            for (x, cells) in (0..width).step_by(CHUNK).zip(cells.chunks_mut(CHUNK / CELL)) {
                let mut samples = Samples { flags: [0; CHUNK], nearest: [0; CHUNK], farthest: [u32::MAX; CHUNK] };
                for y in (y..(y + CELL).min(rows.end)).step_by(ROW_STEP) {
                    samples.add(known, y * width + x, (width - x).min(CHUNK));
                }
                for (k, cell) in cells.iter_mut().enumerate() {
                    *cell = samples.cell(k);
                    if cell.has_hidden {
                        nearest_hiding = f32::max(nearest_hiding, cell.nearest);
                    }
                }
            }
        }
        nearest_hiding
    }
}

/// Samples of some cells of a row, by column. Inverse depths, in 1/m, are bits: for what is not negative, these have the
/// same order, and their extremes are vector code.
struct Samples {
    /// Any of [`HIDING`], [`OPEN`] and [`UNSETTLED`].
    flags: [u32; CHUNK],
    nearest: [u32; CHUNK],
    farthest: [u32; CHUNK],
}

const HIDING: u32 = 1;
const OPEN: u32 = 2;
const UNSETTLED: u32 = 4;
/// Number of pixels whose columns are sampled at once.
const CHUNK: usize = 8 * CELL;

impl Samples {
    /// Adds `count` pixels from `at` on.
    #[inline(always)]
    fn add(&mut self, known: &BackgroundView, at: usize, count: usize) {
        let (metres, rounds, inverse) = known.pixels(at, count);
        let Self { flags, nearest, farthest } = self;
        let (flags, nearest, farthest) = (&mut flags[..count], &mut nearest[..count], &mut farthest[..count]);
        for k in 0..count {
            let (own, is_hiding, is_open) = known.classify_pixel(metres[k], rounds[k], inverse[k]);
            let is_seen = (rounds[k] >= SURE) & ((own - inverse[k]).abs() <= known.surface_step);
            let is_unsettled = u32::from(!is_seen) & (is_hiding ^ 1);
            flags[k] |= (HIDING * is_hiding) | (OPEN * is_open) | (UNSETTLED * is_unsettled);
            nearest[k] = nearest[k].max(own.to_bits());
            farthest[k] = farthest[k].min(own.to_bits());
        }
    }

    /// Returns the cell at index `k`.
    #[inline(always)]
    fn cell(&self, k: usize) -> Cell {
        let columns = k * CELL..(k + 1) * CELL;
        let flags = self.flags[columns.clone()].iter().fold(0, |all, flags| all | flags);
        Cell {
            has_hidden: flags & HIDING != 0,
            has_visible: flags & OPEN != 0,
            is_unsettled: flags & UNSETTLED != 0,
            nearest: f32::from_bits(self.nearest[columns.clone()].iter().fold(0, |most, &bits| most.max(bits))),
            farthest: f32::from_bits(self.farthest[columns].iter().fold(u32::MAX, |least, &bits| least.min(bits))),
            ..Cell::default()
        }
    }
}

/// The remembered background, and the map in front of it.
#[derive(Clone, Copy)]
pub struct BackgroundView<'a> {
    /// Depth of the map's pixels, in metres.
    pub metres: &'a [f32],
    /// Number of rounds in which the background was seen, and its inverse depth, in 1/m.
    pub rounds: &'a [u8],
    pub inverse: &'a [f32],
    /// Minimum step of inverse depth between different surfaces, in 1/m.
    pub surface_step: f32,
}

impl<'a> BackgroundView<'a> {
    /// Returns `count` pixels from `at` on: depth, and of the background, rounds and inverse depth.
    #[inline(always)]
    pub fn pixels(&self, at: usize, count: usize) -> (&'a [f32], &'a [u8], &'a [f32]) {
        (&self.metres[at..][..count], &self.rounds[at..][..count], &self.inverse[at..][..count])
    }

    /// Returns a pixel's inverse depth, and whether it hides a known background, or shows it: 1 or 0.
    #[inline(always)]
    pub fn classify_pixel(&self, metres: f32, rounds: u8, inverse: f32) -> (f32, u32, u32) {
        let own = DepthMap::inverse_depth(metres);
        let (is_known, is_before) = (rounds >= MIN_ROUNDS, own - inverse > self.surface_step);
        (own, u32::from(is_known & is_before), u32::from(is_known & !is_before))
    }
}
