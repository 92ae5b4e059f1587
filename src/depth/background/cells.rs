//! Where what is hidden may be seen: squares of the picture, beside those where as much is open.

use std::ops::Range;

use crate::compute::bands::Bands;
use crate::compute::thread_pool::{MOST_ITEMS, ThreadPool};

/// Side of a cell, and the step of the search in it, in pixels.
const CELL: usize = 16;
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
    /// Looks at pixels of all cells: `look` tells, of those behind which something is known, the inverse depth and whether
    /// they hide it. Returns the largest inverse depth of what hides.
    pub fn survey(
        &mut self,
        workers: &mut ThreadPool,
        size: (usize, usize),
        look: impl Fn(usize) -> Option<(f32, bool)> + Sync,
    ) -> f32 {
        let (width, height) = size;
        self.size = size;
        let across = width.div_ceil(CELL);
        self.cells.clear();
        self.cells.resize(across * height.div_ceil(CELL), Cell::default());
        let bands = Bands::new(height, CELL, workers);
        let mut nearest = [0.0f32; MOST_ITEMS];
        let cells = bands.split_tiles(&mut self.cells, CELL, across);
        workers.run_each(bands.rows().zip(cells).zip(&mut nearest), &|((rows, cells), nearest)| {
            let first = rows.start;
            for y in rows.step_by(STEP) {
                let cells = &mut cells[(y - first) / CELL * across..][..across];
                for x in (0..width).step_by(STEP) {
                    let Some((inverse, hides)) = look(y * width + x) else { continue };
                    let cell = &mut cells[x / CELL];
                    cell.hides |= hides;
                    cell.open |= !hides;
                    *nearest = if hides && inverse > *nearest { inverse } else { *nearest };
                }
            }
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

    /// The columns of each cell that row `y` of the picture goes through, and whether it is wanted.
    pub fn row(&self, y: usize) -> impl Iterator<Item = (Range<usize>, bool)> {
        let (width, across) = (self.size.0, self.size.0.div_ceil(CELL));
        let cells = self.cells[y / CELL * across..][..across].iter().enumerate();
        cells.map(move |(k, cell)| (k * CELL..((k + 1) * CELL).min(width), cell.hides && cell.wanted))
    }
}
