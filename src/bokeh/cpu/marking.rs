//! Marks the silhouettes of a frame: CoC discontinuities between neighbouring pixels, and mixed pixels.
//!
//! twin: shaders/blur/silhouette.wgsl, shaders/blur/unpack.wgsl

use pulp::{Simd, WithSimd};

use super::pixels::Radii;
use super::silhouettes::{NO_SILHOUETTE, maximum};
use super::tiles::TILE_W;
use super::unpack::{InputFrame, compute_coc_row};
use crate::bokeh::occlusion::{self, DISTANCES_PER_CELL, SILHOUETTE_CELL, Silhouette};
use crate::optics::{CocField, DepthCoc};

/// Pixels processed together: a row of a tile.
const CHUNK: usize = TILE_W;
/// Depth of unmeasured or farther pixels, in metres.
const FAR_M: f32 = 1e6;

/// Marks the silhouettes of a row of tiles.
pub struct MarkSilhouettes<'a> {
    pub source: &'a InputFrame<'a>,
    /// CoC range of each tile, in this row of tiles and in the next one.
    pub ranges: [&'a [(f32, f32)]; 2],
    /// Rows of the picture; `marks` are the rows of the grid over them.
    pub rows: std::ops::Range<usize>,
    pub marks: &'a mut [f32],
    /// Radius from which something in front is a layer of its own, in pixels.
    pub near_from_px: f32,
}

impl WithSimd for MarkSilhouettes<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (width, height) = self.source.size;
        let across = width.div_ceil(SILHOUETTE_CELL);
        self.marks.fill(NO_SILHOUETTE);
        // A smaller map has steps between its own pixels that are no silhouettes.
        let (min_step_px, metres) = match self.source.coc {
            Radii::Field(CocField::Depth(lens), Some(map)) => {
                let min_step_px = (width as f32 / map.width.max(1) as f32).max(1.0);
                (min_step_px, (map.size() == (width as u32, height as u32)).then_some((lens, &map.metres)))
            }
            _ => (1.0, None),
        };
        let (mut here, mut below) = ([0.0; CHUNK + 1], [0.0; CHUNK]);
        for y in self.rows.clone() {
            let next = (y + 1).min(height - 1);
            let row = &mut self.marks[(y - self.rows.start) / SILHOUETTE_CELL * DISTANCES_PER_CELL * across..]
                [..DISTANCES_PER_CELL * across];
            for x0 in (0..width).step_by(CHUNK) {
                let take = CHUNK.min(width - x0);
                let with_next = (take + 1).min(width - x0);
                // No step within a tile, or to the next one, exceeds their CoC range.
                let tiles = self.ranges.map(|ranges| &ranges[x0 / TILE_W..]);
                if coc_span_px(tiles, next >= self.rows.end) < min_step_px {
                    continue;
                }
                // The test on depth needs no division and rejects nearly all pixels.
                if let Some((lens, metres)) = metres {
                    let (a, b) = (&metres[y * width + x0..][..with_next], &metres[next * width + x0..][..take]);
                    if !has_step(lens, min_step_px, &a[..take], b)
                        && !has_step(lens, min_step_px, &a[..with_next - 1], &a[1..])
                    {
                        continue;
                    }
                }
                compute_coc_row(self.source, y, x0, &mut here[..with_next]);
                compute_coc_row(self.source, next, x0, &mut below[..take]);
                let last_px = here[with_next - 1];
                here[with_next..].fill(last_px);
                let mut excess_step_px = [f32::MIN; CHUNK];
                for x in 0..take {
                    let [right_px, down_px] = [here[x + 1], below[x]].map(|px| {
                        let (near_px, far_px) = if here[x] < px { (here[x], px) } else { (px, here[x]) };
                        occlusion::excess_step_px(near_px, far_px, min_step_px)
                    });
                    excess_step_px[x] = if right_px > down_px { right_px } else { down_px };
                }
                if maximum(&excess_step_px) < 0.0 {
                    continue;
                }
                for x in (0..take).filter(|&x| excess_step_px[x] >= 0.0) {
                    for other in [here[x + 1], below[x]] {
                        let silhouette = Silhouette::between(here[x], other, min_step_px, self.near_from_px);
                        mark_cell(row, across, x0 + x, silhouette);
                    }
                }
            }
        }
        self.mark_mixed_pixels(min_step_px);
    }
}

impl MarkSilhouettes<'_> {
    #[inline(always)]
    fn mark_mixed_pixels(self, min_step_px: f32) {
        let (Some(matte), Radii::Field(CocField::Depth(lens), _)) = (self.source.matte, self.source.coc) else {
            return;
        };
        let width = self.source.size.0;
        let across = width.div_ceil(SILHOUETTE_CELL);
        for pixel in matte.pixels_in(self.rows.start * width..self.rows.end * width) {
            let (x, y) = (pixel.at as usize % width, pixel.at as usize / width);
            let (near_px, far_px) = (lens.coc_px(pixel.near_m), lens.coc_px(pixel.far_m));
            let row = &mut self.marks[(y - self.rows.start) / SILHOUETTE_CELL * DISTANCES_PER_CELL * across..]
                [..DISTANCES_PER_CELL * across];
            mark_cell(row, across, x, Silhouette::between(near_px, far_px, min_step_px, self.near_from_px));
        }
    }
}

/// Returns the CoC range of the first two tiles together, and of the one below if it is `with_below`.
#[inline(always)]
fn coc_span_px([here, below]: [&[(f32, f32)]; 2], with_below: bool) -> f32 {
    let (first, second, below) = (here[0], here[1.min(here.len() - 1)], if with_below { below[0] } else { here[0] });
    first.1.max(second.1).max(below.1) - first.0.min(second.0).min(below.0)
}

#[inline(always)]
fn mark_cell(row: &mut [f32], across: usize, x: usize, silhouette: Option<Silhouette>) {
    let Some(silhouette) = silhouette else { return };
    let distances_px = [silhouette.visible_px, silhouette.background_visible_px, silhouette.needed_px];
    for (plane, px) in row.chunks_exact_mut(across).zip(distances_px) {
        plane[x / SILHOUETTE_CELL] = plane[x / SILHOUETTE_CELL].max(px);
    }
}

/// Whether the CoC may step by `min_step_px` between any two of these, in metres. Needs no division: the CoC is linear
/// in 1/depth, except for the sharp range and its clamps, which make steps smaller.
#[inline(always)]
fn has_step(lens: &DepthCoc, min_step_px: f32, a: &[f32], b: &[f32]) -> bool {
    let (steep, far) = (lens.coc_at_infinity_px * lens.far_m(), |m: f32| if m > 0.0 && m < FAR_M { m } else { FAR_M });
    let excess = |a: f32, b: f32| {
        let (a, b) = (far(a), far(b));
        (a - b).abs() * steep - 0.999 * min_step_px * a * b
    };
    let mut most = [f32::MIN; 16];
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<16>(), b.as_chunks::<16>());
    for (a, b) in a.iter().zip(b) {
        for k in 0..16 {
            let excess = excess(a[k], b[k]);
            most[k] = if excess > most[k] { excess } else { most[k] };
        }
    }
    maximum(&most) >= 0.0 || a_rest.iter().zip(b_rest).any(|(&a, &b)| excess(a, b) >= 0.0)
}
