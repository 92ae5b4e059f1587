//! Surveys a frame for [`ChangeDetector`](crate::bokeh::reuse::ChangeDetector): the means of its tiles.

use pulp::{Simd, WithSimd};

use super::pixels::Pixels;
use super::unpack::{InputFrame, compute_coc_row};
use crate::frame::change::{TILE, add_squares, average_squares};

/// Rows of a tile whose CoC is read: depth has less detail than colour.
const COC_ROWS: [usize; 2] = [TILE / 4, TILE / 4 + TILE / 2];

/// Computes the means of a row of tiles.
pub struct SurveyRow<'a> {
    pub source: &'a InputFrame<'a>,
    pub row: usize,
    /// Mean light of red, green and blue, as squared codes, and mean CoC, in pixels, of each tile.
    pub means: [&'a mut [f32]; 4],
    /// Scratch for the sums of three rows' worth of samples.
    pub sums: &'a mut Vec<u32>,
    /// Scratch for one row of the picture.
    pub coc: &'a mut [f32],
    /// Whether the CoC may differ from frame to frame.
    pub follows_depth: bool,
}

impl WithSimd for SurveyRow<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { source, row, means, sums, coc, follows_depth } = self;
        let Pixels::Srgb(rgb) = source.pixels else { return };
        let (width, height) = source.size;
        let rows = row * TILE..((row + 1) * TILE).min(height);
        sums.clear();
        sums.resize(width * 3, 0);
        for line in rgb[rows.start * width * 3..rows.end * width * 3].chunks_exact(width * 3) {
            add_squares(sums, line);
        }
        let [red, green, blue, radii] = means;
        average_squares(sums, rows.len(), [red, green, blue]);
        if !follows_depth {
            // Without depth, the CoC is that of every frame; this large one marks all tiles as blurred.
            return radii.fill(f32::from(u8::MAX));
        }
        radii.fill(0.0);
        for offset in COC_ROWS {
            compute_coc_row(source, (rows.start + offset).min(height - 1), 0, coc);
            for (mean, part) in radii.iter_mut().zip(coc.chunks(TILE)) {
                *mean += part.iter().sum::<f32>() * (1.0 / (COC_ROWS.len() * part.len()) as f32);
            }
        }
    }
}
