//! Where what is hidden may be seen: squares of the picture, beside those where as much is open.

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::KNOWN;
use crate::compute::bands::Bands;
use crate::compute::thread_pool::{MOST_ITEMS, ThreadPool};
use crate::frame::DepthMap;

/// Side of a cell, and the step of the search in it, in pixels.
pub const CELL: usize = 16;
const STEP: usize = 2;

/// The squares of a picture.
#[derive(Debug, Default)]
pub struct Cells {
    cells: Vec<Cell>,
    /// Columns and rows of the picture.
    size: (usize, usize),
}

#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// Whether anything in it hides what is known, and whether anything that is known is open.
    hides: bool,
    open: bool,
    /// Whether something open is near in its row, and whether in the picture.
    beside: bool,
    wanted: bool,
}

impl Cells {
    /// Looks at pixels of all cells. Returns the largest inverse depth of what hides anything.
    pub fn survey(&mut self, workers: &mut ThreadPool, size: (usize, usize), known: &Known) -> f32 {
        let (width, height) = size;
        self.size = size;
        let across = width.div_ceil(CELL);
        self.cells.clear();
        self.cells.resize(across * height.div_ceil(CELL), Cell::default());
        let bands = Bands::new(height, CELL, workers);
        let mut nearest = [0.0f32; MOST_ITEMS];
        let cells = bands.split_tiles(&mut self.cells, CELL, across);
        workers.run_each(bands.rows().zip(cells).zip(&mut nearest), &|((rows, cells), nearest)| {
            *nearest = Arch::new().dispatch(Survey { known, width, rows, cells });
        });
        nearest.into_iter().fold(0.0, f32::max)
    }

    /// Wanted are cells that hide something, up to `reach_px` away from an open one.
    pub fn spread(&mut self, reach_px: f32) {
        let reach = (reach_px / CELL as f32).ceil() as usize;
        let across = self.size.0.div_ceil(CELL);
        let down = self.cells.len() / across;
        for row in 0..down {
            self.walk(|k| row * across + k, across, reach, |cell| cell.open, |cell| &mut cell.beside);
        }
        for column in 0..across {
            self.walk(|k| k * across + column, down, reach, |cell| cell.beside, |cell| &mut cell.wanted);
        }
    }

    /// Marks, of a line of `count` cells, those that are up to `reach` away from one that `is` something.
    fn walk(
        &mut self,
        place: impl Fn(usize) -> usize,
        count: usize,
        reach: usize,
        is: impl Fn(&Cell) -> bool,
        mark: impl Fn(&mut Cell) -> &mut bool,
    ) {
        for back in [false, true] {
            let mut since = usize::MAX - count;
            for k in 0..count {
                let cell = &mut self.cells[place(if back { count - 1 - k } else { k })];
                since = if is(cell) { 0 } else { since + 1 };
                *mark(cell) |= since <= reach;
            }
        }
    }

    /// The columns of each wanted cell that row `y` of the picture goes through.
    #[inline(always)]
    pub fn wanted_in(&self, y: usize) -> impl Iterator<Item = Range<usize>> {
        let (width, across) = (self.size.0, self.size.0.div_ceil(CELL));
        let cells = self.cells[y / CELL * across..][..across].iter().enumerate();
        let wanted = cells.filter(|(_, cell)| cell.hides && cell.wanted);
        wanted.map(move |(k, _)| k * CELL..((k + 1) * CELL).min(width))
    }
}

/// Looks at the cells of some rows; the largest inverse depth of what hides anything.
struct Survey<'a> {
    known: &'a Known<'a>,
    width: usize,
    rows: Range<usize>,
    cells: &'a mut [Cell],
}

impl WithSimd for Survey<'_> {
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
                    let (inverse, hiding, open) = known.look(metres[k], rounds[k], inverse[k]);
                    let is_looked_at = u32::from(k % STEP == 0);
                    let hiding = hiding & is_looked_at;
                    is_hiding |= hiding;
                    is_open |= open & is_looked_at;
                    let inverse = if hiding != 0 { inverse } else { 0.0 };
                    nearest[k] = if inverse > nearest[k] { inverse } else { nearest[k] };
                }
                cell.hides |= is_hiding != 0;
                cell.open |= is_open != 0;
            }
        }
        nearest.into_iter().fold(0.0, f32::max)
    }
}

/// What is remembered, and the map before it.
#[derive(Clone, Copy)]
pub struct Known<'a> {
    /// Depth of the pixels of the map, in metres.
    pub metres: &'a [f32],
    /// For how many rounds what is remembered was seen, and its inverse depth, in 1/m.
    pub rounds: &'a [u8],
    pub inverse: &'a [f32],
    /// Surfaces are another beyond this step of inverse depth, in 1/m.
    pub other: f32,
}

impl<'a> Known<'a> {
    /// Some pixels from `at` on: depth, rounds, and inverse depth that is remembered.
    #[inline(always)]
    pub fn pixels(&self, at: usize, count: usize) -> (&'a [f32], &'a [u8], &'a [f32]) {
        (&self.metres[at..][..count], &self.rounds[at..][..count], &self.inverse[at..][..count])
    }

    /// The inverse depth of such a pixel, and where something is known behind it, whether it hides that or is open: 1, or else 0.
    #[inline(always)]
    pub fn look(&self, metres: f32, rounds: u8, inverse: f32) -> (f32, u32, u32) {
        let own = DepthMap::inverse_of(metres);
        let (is_known, is_before) = (rounds >= KNOWN, own - inverse > self.other);
        (own, u32::from(is_known & is_before), u32::from(is_known & !is_before))
    }
}
