//! Cells of a picture: their trimap label from the mask.

use std::ops::Range;

use super::BackgroundPlate;
use crate::depth::bitmap::Bitmap;
use crate::depth::tap::Tap;
use crate::frame::{ColorImage, Mask};

/// Mask value from which a pixel is surely near; below 1 minus this, it is surely far.
pub const SURE: f32 = 0.95;

/// Mask pixels up to this distance from a cell count for its label, in mask pixels: half a pixel reaches all between
/// which its pixels are interpolated, and the rest allows for errors of the mask's outline.
const REACH: f32 = 0.75;

/// Trimap label of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cell {
    Near,
    Far,
    /// The unknown region: mask undecided in the cell, or close to it.
    Band,
}

/// The pixels of a run of cells with one label.
#[derive(Clone, Debug)]
pub struct Run {
    pub cell: Cell,
    /// Row of cells.
    pub row: usize,
    /// Columns of pixels.
    pub xs: Range<usize>,
}

/// The input of matting, and the layout of its cells.
pub struct MaskView<'a> {
    pub mask: &'a Mask,
    /// A mask as large as the picture, for where colours say nothing.
    pub given: Option<&'a Mask>,
    pub color: &'a ColorImage,
    pub light: &'a [f32; 256],
    pub backdrop: Option<&'a BackgroundPlate<'a>>,
    /// Per column of the picture, the mask columns on both sides.
    pub columns: &'a [Tap],
    pub cell_px: usize,
    pub across: usize,
    pub down: usize,
}

impl MaskView<'_> {
    /// Returns the pixel columns of a column of cells.
    #[inline(always)]
    pub fn pixel_columns(&self, column: usize) -> Range<usize> {
        column * self.cell_px..((column + 1) * self.cell_px).min(self.color.width as usize)
    }

    /// Returns the pixel rows of a row of cells.
    #[inline(always)]
    pub fn pixel_rows(&self, row: usize) -> Range<usize> {
        row * self.cell_px..((row + 1) * self.cell_px).min(self.color.height as usize)
    }

    /// Returns the linear light of a pixel.
    #[inline(always)]
    pub fn light_at(&self, at: usize) -> [f32; 3] {
        self.color.rgb.as_chunks::<3>().0[at].map(|code| self.light[usize::from(code)])
    }

    /// Interpolates the mask vertically, to a row of pixels.
    #[inline(always)]
    pub fn interpolate_mask_row(&self, y: usize, mask_row: &mut Vec<f32>) {
        let width = self.mask.width as usize;
        let Tap { first, second, weight } = Tap::new(y, self.color.height as usize, self.mask.height as usize);
        let (above, below) = (&self.mask.alpha[first * width..][..width], &self.mask.alpha[second * width..][..width]);
        mask_row.resize(width, 0.0);
        for ((value, above), below) in mask_row.iter_mut().zip(above).zip(below) {
            *value = above + (below - above) * weight;
        }
    }

    /// Returns the mask value in a column of pixels, interpolated horizontally.
    #[inline(always)]
    pub fn mask_at(&self, mask_row: &[f32], x: usize) -> f32 {
        let Tap { first, second, weight } = self.columns[x];
        mask_row[first] + (mask_row[second] - mask_row[first]) * weight
    }

    /// Computes the trimap label of each cell. `spans` and `undecided` are scratch memory.
    #[inline(always)]
    pub fn classify_cells(&self, cells: &mut Vec<Cell>, spans: &mut Vec<Range<usize>>, undecided: &mut Vec<u8>) {
        /// Bits of mask pixels that are not surely near, and not surely far.
        const NOT_NEAR: u8 = 1;
        const NOT_FAR: u8 = 2;
        let (across, down, width) = (self.across, self.down, self.mask.width as usize);
        let span = |of: usize, count: usize, side: usize| {
            let scale = side as f32 / count as f32;
            let start = (of as f32 * scale - REACH).max(0.0) as usize;
            start.min(side - 1)..(((of + 1) as f32 * scale + REACH).ceil() as usize).min(side)
        };
        spans.clear();
        spans.extend((0..across).map(|column| span(column, across, width)));
        cells.clear();
        for row in 0..down {
            // Column by column first, since neighbouring cells share them.
            undecided.clear();
            undecided.resize(width, 0);
            for y in span(row, down, self.mask.height as usize) {
                for (bits, &alpha) in undecided.iter_mut().zip(&self.mask.alpha[y * width..][..width]) {
                    *bits |= if alpha > SURE { 0 } else { NOT_NEAR } | if alpha < 1.0 - SURE { 0 } else { NOT_FAR };
                }
            }
            cells.extend(spans.iter().map(
                |span| match undecided[span.clone()].iter().fold(0, |all, bits| all | bits) {
                    NOT_FAR => Cell::Near,
                    NOT_NEAR => Cell::Far,
                    _ => Cell::Band,
                },
            ));
        }
    }

    /// Lists the runs of cells, except far ones, in raster order.
    pub fn find_runs(&self, cells: &[Cell], runs: &mut Vec<Run>) {
        runs.clear();
        for (row, cells) in cells.chunks_exact(self.across).enumerate() {
            let mut column = 0;
            for alike in cells.chunk_by(|a, b| a == b) {
                let (first, last) = (column, column + alike.len() - 1);
                if alike[0] != Cell::Far {
                    let xs = self.pixel_columns(first).start..self.pixel_columns(last).end;
                    runs.push(Run { cell: alike[0], row, xs });
                }
                column = last + 1;
            }
        }
    }

    /// Marks the cells within `radius` of the unknown region.
    pub fn mark_around_band(&self, cells: &[Cell], radius: usize, marked: &mut Bitmap) {
        marked.clear((self.across, self.down));
        for at in (0..cells.len()).filter(|&at| cells[at] == Cell::Band) {
            for near in self.cells_within(at, radius) {
                marked.set(near % self.across, near / self.across);
            }
        }
    }

    /// Returns the two cells, in one direction, whose centres enclose a pixel: interpolation hides the cells.
    #[inline(always)]
    pub fn enclosing_cells(&self, at: usize, count: usize) -> Tap {
        Tap::at(self.place_of(at), count)
    }

    /// Returns the place of a pixel in units of cells from the first one's centre, in one direction.
    #[inline(always)]
    pub fn place_of(&self, at: usize) -> f32 {
        let half = 0.5 * self.cell_px as f32;
        (at as f32 + 0.5 - half) / self.cell_px as f32
    }

    /// Returns the two columns of cells whose centres enclose a column of pixels, the same one twice at the border, and
    /// the first column of pixels that they do not enclose.
    #[inline(always)]
    pub fn columns_around(&self, x: usize) -> ([usize; 2], usize) {
        let half = self.cell_px / 2;
        let passed = (x + self.cell_px - half) / self.cell_px;
        ([passed.saturating_sub(1), passed.min(self.across - 1)], passed * self.cell_px + half)
    }

    /// Iterates over the cells within `radius` of a cell, including itself.
    pub fn cells_within(&self, at: usize, radius: usize) -> impl Iterator<Item = usize> + use<> {
        let (across, row, column) = (self.across, at / self.across, at % self.across);
        let columns = column.saturating_sub(radius)..(column + radius + 1).min(across);
        let rows = row.saturating_sub(radius)..(row + radius + 1).min(self.down);
        rows.flat_map(move |row| columns.clone().map(move |column| row * across + column))
    }
}
