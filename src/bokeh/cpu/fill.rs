//! Pass `fill`, the inpainting of disocclusions: colour and CoC of the background that near objects occlude, before the
//! bins behind them are made.
//!
//! Pull-push (Gortler et al., *The Lumigraph*, SIGGRAPH 1996): averages of known pixels over ever larger areas flow
//! back into the holes. Directional inpainting takes precedence where lines through a hole show which surface continues
//! behind it. Each layer is inpainted separately, from pixels that are not in front of it: behind a head are the trees,
//! and behind both the sky.
//!
//! twin: shaders/hide.wgsl, pull.wgsl, coarse.wgsl, fill.wgsl

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use pulp::{Arch, Simd};

use super::directional::Directional;
use super::levels::{Base, Level, PLANES, Pull, Push};
use super::rows::{PIECE, Rows};
use super::silhouettes::Silhouettes;
use super::unpack::Surfaces;
use crate::bokeh::occlusion::{GRAIN, other_surface};
use crate::bokeh::plan::{BinWeight, Plan};
use crate::compute::simd::{load, store};
use crate::compute::thread_pool::{DisjointParts, ThreadPool};

/// Known weight below which a pixel counts as unknown even after the push.
const KNOWN: f32 = 0.5;
/// Rows of a level per work item.
const PART: usize = 8;

/// The image pyramid, finest level (half the picture's size) first.
pub struct Pyramid {
    /// The picture at half size.
    halves: Rows<PLANES>,
    levels: Vec<Level>,
    /// Directional inpainting of the level above the finest.
    directional: Directional,
    /// Flags of the work items of the largest pass.
    taken: Vec<AtomicBool>,
}

/// Picture at half size, written by the bands: means of linear r, g, b and CoC, and the smallest CoC of any surface.
pub struct Halves<'a> {
    width: usize,
    stride: usize,
    rows: DisjointParts<'a, f32>,
}

/// One band of the picture at half size.
pub struct HalfRows<'a> {
    first: usize,
    width: usize,
    height: usize,
    stride: usize,
    rows: &'a mut [f32],
}

/// The inpainted background.
#[derive(Clone, Copy)]
pub struct Behind<'a> {
    level: &'a Level,
    silhouettes: &'a Silhouettes,
    unhidden: BinWeight,
    nearest_px: f32,
    /// Bins whose CoC are all above this contain nothing of a surface in front.
    focus_end_px: f32,
}

impl Pyramid {
    /// Allocates for pictures of `width` x `height`.
    pub fn new(width: usize, height: usize) -> Self {
        let mut levels = Vec::new();
        let (mut w, mut h) = (width.div_ceil(2), height.div_ceil(2));
        loop {
            levels.push(Level { width: w, height: h, rows: Rows::new(w, h, 0) });
            if w == 1 && h == 1 {
                break;
            }
            (w, h) = (w.div_ceil(2), h.div_ceil(2));
        }
        let taken = (0..height).map(|_| AtomicBool::new(false)).collect();
        let outlined = &levels[1.min(levels.len() - 1)];
        let directional = Directional::new(outlined.width, outlined.height);
        Self { halves: Rows::new(levels[0].width, levels[0].height, 0), levels, directional, taken }
    }

    /// Returns the picture at half size, to be written in bands of `rows` rows of the picture.
    pub fn halves(&mut self, rows: usize) -> Halves<'_> {
        let (stride, row_len) = (self.halves.stride, self.halves.row_len());
        let rows = DisjointParts::new(&mut self.halves.data, rows / 2 * row_len, &mut self.taken);
        Halves { width: self.levels[0].width, stride, rows }
    }

    /// Inpaints the pixels that are not `unhidden`, after the picture at half size is written.
    pub fn fill(&mut self, unhidden: &BinWeight, silhouettes: &Silhouettes, workers: &mut ThreadPool, arch: Arch) {
        self.compute_base(unhidden, workers, arch);
        for k in 1..self.levels.len() {
            let (fine, coarse) = self.levels.split_at_mut(k);
            let (fine, coarse) = (&fine[k - 1], &mut coarse[0]);
            let (width, stride, row_len) = (coarse.width, coarse.rows.stride, coarse.rows.row_len());
            let rows = DisjointParts::new(&mut coarse.rows.data, PART * row_len, &mut self.taken);
            workers.run(coarse.height.div_ceil(PART), &|part| {
                arch.dispatch(Pull { fine, first: part * PART, rows: rows.part(part), stride, width });
            });
        }
        if let Some(level) = self.levels.get_mut(1) {
            self.directional.fill(level, silhouettes, workers, arch);
        }
        for k in (1..self.levels.len()).rev() {
            let (fine, coarse) = self.levels.split_at_mut(k);
            let (fine, coarse) = (&mut fine[k - 1], &coarse[0]);
            let (width, stride, row_len) = (fine.width, fine.rows.stride, fine.rows.row_len());
            let rows = DisjointParts::new(&mut fine.rows.data, PART * row_len, &mut self.taken);
            workers.run(fine.height.div_ceil(PART), &|part| {
                arch.dispatch(Push { coarse, first: part * PART, rows: rows.part(part), stride, width });
            });
        }
    }

    /// Returns the background behind near objects for the layer of bins from `first` on, limited to where a silhouette
    /// uncovers it.
    pub fn behind<'a>(&'a self, silhouettes: &'a Silhouettes, plan: &Plan, first: usize) -> Behind<'a> {
        let (unhidden, nearest_px) = (plan.unhidden(first), plan.nearest_behind_px(first));
        Behind { level: &self.levels[0], silhouettes, unhidden, nearest_px, focus_end_px: plan.focus_end_px() }
    }

    /// Computes the finest level: a pixel is known if neither it nor a neighbour is covered by an occluder.
    fn compute_base(&mut self, unhidden: &BinWeight, workers: &mut ThreadPool, arch: Arch) {
        let level = &mut self.levels[0];
        let (width, height, row_len) = (level.width, level.height, level.rows.row_len());
        let halves = &self.halves;
        let data = DisjointParts::new(&mut level.rows.data, PART * row_len, &mut self.taken);
        workers.run(height.div_ceil(PART), &|part| {
            arch.dispatch(Base { halves, size: (width, height), unhidden, first: part * PART, rows: data.part(part) });
        });
    }
}

impl Halves<'_> {
    /// Returns a band of `rows` rows of the picture (`height` rows in all).
    pub fn band(&self, band: usize, rows: usize, height: usize) -> HalfRows<'_> {
        HalfRows { first: band * rows, width: self.width, height, stride: self.stride, rows: self.rows.part(band) }
    }
}

impl HalfRows<'_> {
    /// Adds the inner columns of row `y`: `columns` of the piece, which begin at column `x0` of the picture.
    #[inline(always)]
    pub fn add<const W: usize>(&mut self, x0: usize, columns: Range<usize>, y: usize, surfaces: &Surfaces<W>) {
        let (row, odd) = ((y - self.first) / 2, y % 2 == 1);
        let first = x0 / 2;
        let count = (columns.len() / 2).min(self.width - first);
        let shown;
        let seen = match surfaces.mixed {
            // A mixed pixel counts as the composite it shows: its farther surface is not in front of the subject.
            true => {
                shown = surfaces.shown();
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

impl Behind<'_> {
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
        let (row, [shows, uncovers]) = (self.level.rows.row(y / 2), self.silhouettes.row(y));
        for start in (0..W).step_by(PIECE) {
            let coc = &mut surfaces.back.0[3][start..start + PIECE];
            // A pixel that a silhouette only touches keeps its colour: it is visible, and inpainting would smear it.
            let mut hidden = [0.0; PIECE];
            let mut any = false;
            for x in 0..PIECE {
                hidden[x] = 1.0 - self.unhidden.at(coc[x]);
                any |= hidden[x] > 0.0;
            }
            if !any {
                continue;
            }
            let first = x0 + start as isize;
            // Pieces begin at cell borders. Away from all silhouettes the background is not visible.
            let cell = |x: usize| ((first + x as isize).max(0) as usize / GRAIN).min(uncovers.len() - 1);
            // Where the background matters only for the blur of others, it must not mix with the surface in front, not
            // even by half.
            let (mut square, mut any_uncovered) = ([0.0; PIECE], false);
            for (k, square) in square.as_chunks_mut::<GRAIN>().0.iter_mut().enumerate() {
                let cell = cell(k * GRAIN);
                any_uncovered |= uncovers[cell] > 0.0;
                square.fill(if uncovers[cell] > 0.0 { shows[cell].max(0.0) } else { -1.0 });
            }
            if !any_uncovered {
                continue;
            }
            let mut fill = [[0.0; PIECE]; PLANES];
            for (p, fill) in fill.iter_mut().enumerate() {
                let plane = &row[p * self.level.rows.stride..];
                if first >= 0 && first as usize + PIECE <= width {
                    // Pieces begin at even columns; two columns share a half-size column.
                    let halves = &plane[first as usize / 2..][..PIECE / 2];
                    for k in 0..PIECE / 2 {
                        (fill[2 * k], fill[2 * k + 1]) = (halves[k], halves[k]);
                    }
                } else {
                    for x in 0..PIECE {
                        fill[x] = plane[(first + x as isize).clamp(0, width as isize - 1) as usize / 2];
                    }
                }
            }
            for x in 0..PIECE {
                // If something near touches every pixel, nothing is known, and there is no background.
                let known = if fill[PLANES - 1][x] > KNOWN { hidden[x] } else { 0.0 };
                hidden[x] = known * other_surface(coc[x], fill[3][x]);
                let (px, square) = (fill[3][x], square[x]);
                let is_wanted = match px > self.focus_end_px {
                    true => square > 0.0 || square == 0.0 && hidden[x] >= 1.0,
                    false => square > px * px,
                };
                hidden[x] = if is_wanted { hidden[x] } else { 0.0 };
            }
            for x in 0..PIECE {
                fill[3][x] = if fill[3][x] > self.nearest_px { fill[3][x] } else { self.nearest_px };
            }
            // Explicit vectors, because the compiler would vectorise across the planes.
            for (plane, fill) in surfaces.back.0.iter_mut().zip(&fill) {
                for x in (0..PIECE).step_by(S::F32_LANES) {
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
                let before = self.unhidden.at(*coc_px);
                (*alpha, *behind) = (*alpha * before, 1.0 - (1.0 - *behind) * before);
            }
        }
    }
}
