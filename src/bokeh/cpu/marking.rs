//! Marks the silhouettes of a frame: CoC discontinuities between neighbouring pixels, and mixed pixels.
//!
//! twin: shaders/blur/silhouette.wgsl, shaders/blur/unpack.wgsl

#![allow(clippy::needless_range_loop)] // Columns index several arrays at once.

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::pixels::Radii;
use super::silhouettes::NO_SILHOUETTE;
use super::tiles::TILE_W;
use super::unpack::{InputFrame, compute_coc_row};
use crate::bokeh::occlusion::{DISTANCES_PER_CELL, SILHOUETTE_CELL, excess_step_px, silhouette_between};
use crate::frame::{Matte, MixedPixel};
use crate::optics::CocField;

/// Marks the silhouettes of a row of tiles.
pub struct MarkSilhouettes<'a> {
    pub source: &'a InputFrame<'a>,
    /// CoC range of each tile, in this row of tiles and in the next one.
    pub ranges: [&'a [(f32, f32)]; 2],
    /// Rows of the picture; `marks` are the rows of the grid over them.
    pub rows: Range<usize>,
    pub marks: &'a mut [f32],
    /// Mixed pixels in these rows.
    pub mixed: &'a [MixedPixel],
    /// Radius from which something in front is a layer of its own, in pixels.
    pub near_from_px: f32,
}

impl WithSimd for MarkSilhouettes<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        self.marks.fill(NO_SILHOUETTE);
        // A smaller map has steps between its own pixels that are no silhouettes.
        let min_step_px = match self.source.coc {
            Radii::Field(CocField::Depth(_), Some(map)) => self.source.size.0 as f32 / map.width.max(1) as f32,
            _ => 1.0,
        };
        let ([here, below], min_step_px) = (self.ranges, min_step_px.max(1.0));
        for tile in 0..here.len() {
            let around = [here[tile], here[(tile + 1).min(here.len() - 1)], below[tile]];
            let low_px = around.iter().fold(f32::INFINITY, |low, range| low.min(range.0));
            let high_px = around.iter().fold(f32::NEG_INFINITY, |high, range| high.max(range.1));
            // No step within a tile, or to the next ones, exceeds their CoC range.
            if high_px - low_px >= min_step_px {
                self.mark_steps(tile * TILE_W, min_step_px);
            }
        }
        self.mark_mixed_pixels(min_step_px);
    }
}

impl MarkSilhouettes<'_> {
    /// Marks the steps in the tile from column `x0` on, and to the next tiles.
    #[inline(always)]
    fn mark_steps(&mut self, x0: usize, min_step_px: f32) {
        let (source, near_from_px) = (self.source, self.near_from_px);
        let (width, height) = source.size;
        let (across, last) = (width.div_ceil(SILHOUETTE_CELL), TILE_W.min(width - x0 - 1));
        let mut below = [0.0; TILE_W + 1];
        compute_coc_row(source, self.rows.start, x0, &mut below[..=last]);
        let lines = self.marks.chunks_exact_mut(DISTANCES_PER_CELL * across);
        for (first, line) in self.rows.clone().step_by(SILHOUETTE_CELL).zip(lines) {
            let mut distances_px = [[NO_SILHOUETTE; TILE_W]; DISTANCES_PER_CELL];
            for y in first..(first + SILHOUETTE_CELL).min(self.rows.end) {
                let mut here = below;
                compute_coc_row(source, (y + 1).min(height - 1), x0, &mut below[..=last]);
                // The outermost pixels repeat.
                for row in [&mut here, &mut below] {
                    let last_px = row[last];
                    row[last..].fill(last_px);
                }
                let mut any = false;
                for x in 0..TILE_W {
                    let [right_px, down_px] = [here[x + 1], below[x]].map(|px| {
                        let (near_px, far_px) = if here[x] < px { (here[x], px) } else { (px, here[x]) };
                        excess_step_px(near_px, far_px, min_step_px)
                    });
                    any |= (right_px >= 0.0) | (down_px >= 0.0);
                }
                if !any {
                    continue;
                }
                for x in 0..TILE_W {
                    let right_px = silhouette_between(here[x], here[x + 1], min_step_px, near_from_px);
                    let down_px = silhouette_between(here[x], below[x], min_step_px, near_from_px);
                    for p in 0..DISTANCES_PER_CELL {
                        distances_px[p][x] = distances_px[p][x].max(right_px[p]).max(down_px[p]);
                    }
                }
            }
            for (plane, distances_px) in line.chunks_exact_mut(across).zip(&distances_px) {
                let cells = distances_px.as_chunks::<SILHOUETTE_CELL>().0;
                for (mark, &[a, b, c, d]) in plane[x0 / SILHOUETTE_CELL..].iter_mut().zip(cells) {
                    *mark = a.max(b).max(c.max(d));
                }
            }
        }
    }

    #[inline(always)]
    fn mark_mixed_pixels(self, min_step_px: f32) {
        let Radii::Field(CocField::Depth(lens), _) = self.source.coc else { return };
        let width = self.source.size.0;
        let across = width.div_ceil(SILHOUETTE_CELL);
        let (mut last, mut distances_px) = ((0, [f32::NAN; 2]), [NO_SILHOUETTE; DISTANCES_PER_CELL]);
        for (x, y, pixel) in Matte::locate(self.mixed, self.rows.start, width) {
            let line = (y - self.rows.start) / SILHOUETTE_CELL * DISTANCES_PER_CELL;
            let this = (line * across + x / SILHOUETTE_CELL, [pixel.near_m, pixel.far_m]);
            // Neighbours are mostly mixed of the same surfaces.
            if this == last {
                continue;
            }
            if this.1 != last.1 {
                let [near_px, far_px] = this.1.map(|metres| lens.coc_px(metres));
                distances_px = silhouette_between(near_px, far_px, min_step_px, self.near_from_px);
            }
            for (mark, px) in self.marks[this.0..].iter_mut().step_by(across).zip(distances_px) {
                *mark = mark.max(px);
            }
            last = this;
        }
    }
}
