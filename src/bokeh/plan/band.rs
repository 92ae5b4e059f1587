//! Plans of bands: rows of a picture that are blurred on their own, with the bins of the whole picture.

use std::ops::Range;

use super::{Bin, CELL, Compositing, Plan};

/// Rows around a row whose tiles decide whether it stays unchanged, and whether a bin needs it.
const TILE_ROWS: usize = 64;
/// Rows beside a band that inpainting reads ([`Plan::support_rows`]): farther pixels have hardly any weight in it.
const INPAINTING_ROWS: usize = 256;

/// The rows of a band.
#[derive(Clone, Debug)]
pub(super) struct BandRows {
    /// Rows of the whole picture.
    of_picture: usize,
    /// Number of the first row in the picture.
    first: usize,
    /// The rows of the plan whose result is wanted; the others only contribute to it.
    wanted: Range<usize>,
}

impl Plan {
    /// Returns the plan of some `rows` of the picture, for the result of those of them that are `wanted`: its bins are
    /// those of the last frame, and stay.
    pub fn for_band(&self, rows: Range<usize>, wanted: Range<usize>) -> Self {
        let band = BandRows { of_picture: self.height, first: rows.start, wanted };
        let mut plan = Self { height: rows.len(), band: Some(band), ..self.clone() };
        for bin in &mut plan.bins {
            bin.height = rows.len().div_ceil(bin.scale);
        }
        plan
    }

    /// Whether the bins follow each frame's depth: they are layers, and not those of a larger picture.
    pub(super) fn follows_depth(&self) -> bool {
        self.compositing == Compositing::Layers && self.band.is_none()
    }

    /// Returns the rows of the whole picture.
    pub(super) fn picture_rows(&self) -> usize {
        self.band.as_ref().map_or(self.height, |band| band.of_picture)
    }

    /// Returns the number of the first row in the whole picture.
    pub(in crate::bokeh) fn first_row(&self) -> usize {
        self.band.as_ref().map_or(0, |band| band.first)
    }

    /// Returns the rows whose result is wanted.
    pub fn wanted_rows(&self) -> Range<usize> {
        self.band.as_ref().map_or(0..self.height, |band| band.wanted.clone())
    }

    /// Returns the rows of the picture whose content in a bin can change a wanted row: those under its filter, and the
    /// cells that decide the filter's radius.
    pub fn content_rows(&self, bin: &Bin) -> Range<usize> {
        let (wanted, support) = (self.wanted_rows(), self.bin_support_rows(bin));
        wanted.start.saturating_sub(support)..(wanted.end + support).min(self.height)
    }

    fn bin_support_rows(&self, bin: &Bin) -> usize {
        // A filtered row, and each row that it reads, takes its radius from cells; one more of each is interpolated.
        (self.bin_half_width(bin) + bin.decimation_reach() + (self.radius_cells(bin) + 3) * CELL) * bin.scale
    }

    /// Returns how many rows above and below a row of the picture can change its result, with the bins of the last
    /// frame. Inpainting, which near bins need, reads the whole picture, but farther rows hardly count.
    pub fn support_rows(&self) -> usize {
        let of_bins = self.bins.iter().map(|bin| self.bin_support_rows(bin)).max().unwrap_or(0);
        let has_near = self.bins.iter().any(|bin| bin.near);
        TILE_ROWS + of_bins + if has_near { INPAINTING_ROWS } else { 0 }
    }
}
