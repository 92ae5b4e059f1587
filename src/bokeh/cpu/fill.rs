//! Pass `fill`, the inpainting of disocclusions: colour and CoC of the background that near objects occlude, before the
//! bins behind them are made.
//!
//! Pull-push (Gortler et al., *The Lumigraph*, SIGGRAPH 1996): averages of known pixels over ever larger areas flow
//! back into the holes. Each layer is inpainted separately, from pixels that are not in front of it: behind a head are the
//! trees, and behind both the sky. Where the matte knows what is hidden, that takes precedence.
//!
//! twin: shaders/blur/find_occluders.wgsl, pull.wgsl, coarse.wgsl, fill.wgsl

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use pulp::{Arch, Simd};

use super::levels::{Base, Level, PLANES, Pull, Push};
use super::rows::{COPY_WIDTH, PlanarRows};
use super::silhouettes::Silhouettes;
use super::unpack::Surfaces;
use crate::bokeh::occlusion::{SILHOUETTE_CELL, other_surface_likelihood};
use crate::bokeh::plan::{BinWeight, Plan};
use crate::compute::simd::{load, store};
use crate::compute::thread_pool::{DisjointParts, ThreadPool};

/// Known weight below which a pixel counts as unknown even after the push.
const MIN_KNOWN: f32 = 0.5;
/// Rows of a level per work item.
const ROWS_PER_ITEM: usize = 8;

/// The image pyramid, finest level (half the picture's size) first.
pub struct Pyramid {
    /// The picture at half size.
    halves: PlanarRows<PLANES>,
    levels: Vec<Level>,
    /// Flags of the work items of the largest pass.
    taken: Vec<AtomicBool>,
}

/// Picture at half size, written by the bands: means of linear r, g, b and CoC, and the smallest CoC of any surface.
pub struct HalfPicture<'a> {
    width: usize,
    stride: usize,
    rows: DisjointParts<'a, f32>,
}

/// One band of the picture at half size.
pub struct HalfPictureBand<'a> {
    first: usize,
    width: usize,
    height: usize,
    stride: usize,
    rows: &'a mut [f32],
}

/// The inpainted background.
#[derive(Clone, Copy)]
pub struct InpaintedBackground<'a> {
    level: &'a Level,
    silhouettes: &'a Silhouettes,
    visible_weight: BinWeight,
    nearest_px: f32,
    /// Bins whose CoC are all above this contain nothing of a surface in front.
    focus_border_px: f32,
}

impl Pyramid {
    /// Allocates for pictures of `width` x `height`.
    pub fn new(width: usize, height: usize) -> Self {
        let mut levels = Vec::new();
        let (mut w, mut h) = (width.div_ceil(2), height.div_ceil(2));
        loop {
            levels.push(Level { width: w, height: h, rows: PlanarRows::new(w, h, 0) });
            if w == 1 && h == 1 {
                break;
            }
            (w, h) = (w.div_ceil(2), h.div_ceil(2));
        }
        let taken = (0..height).map(|_| AtomicBool::new(false)).collect();
        Self { halves: PlanarRows::new(levels[0].width, levels[0].height, 0), levels, taken }
    }

    /// Returns the picture at half size, to be written in bands of `rows` rows of the picture.
    pub fn half_picture(&mut self, rows: usize) -> HalfPicture<'_> {
        let (stride, row_len) = (self.halves.stride, self.halves.row_len());
        let rows = DisjointParts::new(&mut self.halves.data, rows / 2 * row_len, &mut self.taken);
        HalfPicture { width: self.levels[0].width, stride, rows }
    }

    /// Inpaints the pixels whose `visible_weight` is below 1, after the picture at half size is written.
    pub fn fill(&mut self, visible_weight: &BinWeight, workers: &mut ThreadPool, arch: Arch) {
        self.compute_base(visible_weight, workers, arch);
        for k in 1..self.levels.len() {
            let (finer, coarser) = self.levels.split_at_mut(k);
            let (fine, coarse) = (&finer[k - 1], &mut coarser[0]);
            let (width, stride, row_len) = (coarse.width, coarse.rows.stride, coarse.rows.row_len());
            let rows = DisjointParts::new(&mut coarse.rows.data, ROWS_PER_ITEM * row_len, &mut self.taken);
            workers.run(coarse.height.div_ceil(ROWS_PER_ITEM), &|part| {
                arch.dispatch(Pull { fine, first: part * ROWS_PER_ITEM, rows: rows.part(part), stride, width });
            });
        }
        for k in (1..self.levels.len()).rev() {
            let (finer, coarser) = self.levels.split_at_mut(k);
            let (fine, coarse) = (&mut finer[k - 1], &coarser[0]);
            let (width, stride, row_len) = (fine.width, fine.rows.stride, fine.rows.row_len());
            let rows = DisjointParts::new(&mut fine.rows.data, ROWS_PER_ITEM * row_len, &mut self.taken);
            workers.run(fine.height.div_ceil(ROWS_PER_ITEM), &|part| {
                arch.dispatch(Push { coarse, first: part * ROWS_PER_ITEM, rows: rows.part(part), stride, width });
            });
        }
    }

    /// Returns the background behind near objects for the layer of bins from `first` on, limited to where a silhouette
    /// uncovers it.
    pub fn background<'a>(
        &'a self,
        silhouettes: &'a Silhouettes,
        plan: &Plan,
        first: usize,
    ) -> InpaintedBackground<'a> {
        let (visible_weight, nearest_px) = (plan.visible_weight(first), plan.min_inpainted_px(first));
        InpaintedBackground {
            level: &self.levels[0],
            silhouettes,
            visible_weight,
            nearest_px,
            focus_border_px: plan.focus_border_px(),
        }
    }

    /// Computes the finest level: a pixel is known if neither it nor a neighbour is covered by an occluder.
    fn compute_base(&mut self, visible_weight: &BinWeight, workers: &mut ThreadPool, arch: Arch) {
        let level = &mut self.levels[0];
        let (width, height, row_len) = (level.width, level.height, level.rows.row_len());
        let halves = &self.halves;
        let data = DisjointParts::new(&mut level.rows.data, ROWS_PER_ITEM * row_len, &mut self.taken);
        workers.run(height.div_ceil(ROWS_PER_ITEM), &|part| {
            arch.dispatch(Base {
                halves,
                size: (width, height),
                visible_weight,
                first: part * ROWS_PER_ITEM,
                rows: data.part(part),
            });
        });
    }
}

impl HalfPicture<'_> {
    /// Returns a band of `rows` rows of the picture (`height` rows in all).
    pub fn band(&self, band: usize, rows: usize, height: usize) -> HalfPictureBand<'_> {
        HalfPictureBand {
            first: band * rows,
            width: self.width,
            height,
            stride: self.stride,
            rows: self.rows.part(band),
        }
    }
}

impl HalfPictureBand<'_> {
    /// Adds the inner columns of row `y`: `columns` of the piece, which begin at column `x0` of the picture.
    #[inline(always)]
    pub fn add_row<const W: usize>(&mut self, x0: usize, columns: Range<usize>, y: usize, surfaces: &Surfaces<W>) {
        let (row, odd) = ((y - self.first) / 2, y % 2 == 1);
        let first = x0 / 2;
        let count = (columns.len() / 2).min(self.width - first);
        let shown;
        let seen = match surfaces.mixed {
            // A mixed pixel counts as the composite it shows: its farther surface is not in front of the subject.
            true => {
                shown = surfaces.composite_surfaces();
                &shown
            }
            false => &surfaces.back,
        };
        let pairs = |p: usize| seen.0[p][columns.start..].as_chunks::<2>().0.iter().take(count);
        // A last row without a partner counts twice.
        let weight = if !odd && y + 1 == self.height { 0.5 } else { 0.25 };
        let planes = &mut self.rows[row * PLANES * self.stride..][..PLANES * self.stride];
        let (means, nearest) = planes.split_at_mut((PLANES - 1) * self.stride);
        for (p, plane) in means.chunks_exact_mut(self.stride).enumerate() {
            for (value, &[a, b]) in plane[first..].iter_mut().zip(pairs(p)) {
                let before = if odd { *value } else { 0.0 };
                *value = before + weight * (a + b);
            }
        }
        let nearest = &mut nearest[first..];
        for (value, &[a, b]) in nearest.iter_mut().zip(pairs(3)) {
            let here = if a < b { a } else { b };
            *value = if odd && *value < here { *value } else { here };
        }
        if surfaces.mixed {
            // A pixel that a near surface covers partly is not known either.
            let fronts = surfaces.front.0[3][columns.start..].as_chunks::<2>().0.iter().take(count);
            let alphas = surfaces.alpha.0[columns.start..].as_chunks::<2>().0;
            for ((value, cocs_px), alphas) in nearest.iter_mut().zip(fronts).zip(alphas) {
                for (coc_px, alpha) in cocs_px.iter().zip(alphas) {
                    *value = if *alpha > 0.0 && *coc_px < *value { *coc_px } else { *value };
                }
            }
        }
    }
}

impl InpaintedBackground<'_> {
    /// Replaces the hidden pixels in a piece of row `y` that begins at column `x0` of the picture.
    #[inline(always)]
    pub fn inpaint<S: Simd, const W: usize>(
        &self,
        simd: S,
        x0: isize,
        y: usize,
        width: usize,
        surfaces: &mut Surfaces<W>,
    ) {
        let (row, [visible, needed]) = (self.level.rows.row(y / 2), self.silhouettes.row(y));
        for start in (0..W).step_by(COPY_WIDTH) {
            let coc = &mut surfaces.back.0[3][start..start + COPY_WIDTH];
            // A pixel that a silhouette only touches keeps its colour: it is visible, and inpainting would smear it.
            let mut hidden = [0.0; COPY_WIDTH];
            let mut any = false;
            for x in 0..COPY_WIDTH {
                hidden[x] = 1.0 - self.visible_weight.at(coc[x]);
                any |= hidden[x] > 0.0;
            }
            if !any {
                continue;
            }
            let first = x0 + start as isize;
            // Pieces begin at cell borders. Away from all silhouettes the background is not visible.
            let cell = |x: usize| ((first + x as isize).max(0) as usize / SILHOUETTE_CELL).min(needed.len() - 1);
            // Where the background matters only for the blur of others, it must not mix with the surface in front, not
            // even by half.
            let (mut square, mut any_needed) = ([0.0; COPY_WIDTH], false);
            for (k, square) in square.as_chunks_mut::<SILHOUETTE_CELL>().0.iter_mut().enumerate() {
                let cell = cell(k * SILHOUETTE_CELL);
                any_needed |= needed[cell] > 0.0;
                square.fill(if needed[cell] > 0.0 { visible[cell].max(0.0) } else { -1.0 });
            }
            if !any_needed {
                continue;
            }
            let mut fill = [[0.0; COPY_WIDTH]; PLANES];
            for (p, fill) in fill.iter_mut().enumerate() {
                let plane = &row[p * self.level.rows.stride..];
                if first >= 0 && first as usize + COPY_WIDTH <= width {
                    // Pieces begin at even columns; two columns share a half-size column.
                    let halves = &plane[first as usize / 2..][..COPY_WIDTH / 2];
                    for k in 0..COPY_WIDTH / 2 {
                        (fill[2 * k], fill[2 * k + 1]) = (halves[k], halves[k]);
                    }
                } else {
                    for x in 0..COPY_WIDTH {
                        fill[x] = plane[(first + x as isize).clamp(0, width as isize - 1) as usize / 2];
                    }
                }
            }
            for x in 0..COPY_WIDTH {
                // If something near touches every pixel, nothing is known, and there is no background.
                let known = if fill[PLANES - 1][x] > MIN_KNOWN { hidden[x] } else { 0.0 };
                hidden[x] = known * other_surface_likelihood(coc[x], fill[3][x]);
                let (px, square) = (fill[3][x], square[x]);
                let is_wanted = match px > self.focus_border_px {
                    true => square > 0.0 || square == 0.0 && hidden[x] >= 1.0,
                    false => square > px * px,
                };
                hidden[x] = if is_wanted { hidden[x] } else { 0.0 };
            }
            for x in 0..COPY_WIDTH {
                fill[3][x] = if fill[3][x] > self.nearest_px { fill[3][x] } else { self.nearest_px };
            }
            // Explicit vectors, because the compiler would vectorise across the planes.
            for (plane, fill) in surfaces.back.0.iter_mut().zip(&fill) {
                for x in (0..COPY_WIDTH).step_by(S::F32_LANES) {
                    let own = load::<S>(plane, start + x);
                    let change = simd.sub_f32s(load::<S>(fill, x), own);
                    let change = simd.mul_f32s(change, load::<S>(&hidden, x));
                    store::<S>(plane, start + x, simd.add_f32s(own, change));
                }
            }
        }
        if surfaces.mixed {
            // Behind the nearer surface of a mixed pixel is its farther one.
            let planes = surfaces.alpha.0.iter_mut().zip(&mut surfaces.behind.0);
            for ((alpha, behind), coc_px) in planes.zip(&surfaces.front.0[3]) {
                let before = self.visible_weight.at(*coc_px);
                (*alpha, *behind) = (*alpha * before, 1.0 - (1.0 - *behind) * before);
            }
        }
    }
}
