//! Square cells of the picture in which blur may reveal the hidden background: those near cells where the background is
//! open.

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::MIN_ROUNDS;
use crate::compute::bands::Bands;
use crate::compute::thread_pool::{MAX_ITEMS, ThreadPool};
use crate::frame::DepthMap;

/// Side of a cell, and the sampling step in it, in pixels.
pub const CELL: usize = 16;
const STEP: usize = 2;

/// The cells of a picture.
#[derive(Debug, Default)]
pub struct Cells {
    cells: Vec<Cell>,
    /// Columns and rows of the picture.
    size: (usize, usize),
}

#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// Whether a known background is hidden, and whether one is visible, anywhere in the cell.
    has_hidden: bool,
    has_visible: bool,
    /// Whether a cell with visible background is within the blur radius, along its row, and in two dimensions.
    is_beside_visible: bool,
    is_selected: bool,
}

impl Cells {
    /// Classifies all cells. Returns the largest inverse depth of the surfaces that hide a known background, in 1/m.
    pub fn classify(&mut self, workers: &mut ThreadPool, size: (usize, usize), known: &BackgroundView) -> f32 {
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
        nearest.into_iter().fold(0.0, f32::max)
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

/// Classifies the cells of some rows. Returns the largest inverse depth of what hides a known background.
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
        let (first, across) = (rows.start, width.div_ceil(CELL));
        let mut nearest = [0.0; CELL];
        for y in rows.step_by(STEP) {
            for (column, cell) in cells[(y - first) / CELL * across..][..across].iter_mut().enumerate() {
                let begin = column * CELL;
                let count = (width - begin).min(CELL);
                let (metres, rounds, inverse) = known.pixels(y * width + begin, count);
                let nearest = &mut nearest[..count];
                let (mut is_hiding, mut is_open) = (0, 0);
                for k in 0..count {
                    let (inverse, hiding, open) = known.classify_pixel(metres[k], rounds[k], inverse[k]);
                    let is_looked_at = u32::from(k % STEP == 0);
                    let hiding = hiding & is_looked_at;
                    is_hiding |= hiding;
                    is_open |= open & is_looked_at;
                    let inverse = if hiding != 0 { inverse } else { 0.0 };
                    nearest[k] = if inverse > nearest[k] { inverse } else { nearest[k] };
                }
                cell.has_hidden |= is_hiding != 0;
                cell.has_visible |= is_open != 0;
            }
        }
        nearest.into_iter().fold(0.0, f32::max)
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
