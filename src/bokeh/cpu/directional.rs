//! Directional inpainting, a part of the pass `fill`: continues outlines behind an occluder ([`DIRECTIONS`], after
//! Bertalmio et al., *Image Inpainting*, SIGGRAPH 2000, section 3). Works at a quarter of the picture's size, which is
//! fine enough.
//!
//! twin: shaders/blur/directional.wgsl

#![allow(clippy::needless_range_loop)] // Planes and directions index several arrays at once.

use std::f32::consts::SQRT_2;

use pulp::{Arch, Simd, WithSimd};

use super::levels::{Level, PLANES};
use super::silhouettes::Silhouettes;
use crate::bokeh::occlusion::{
    DIRECTIONS, MAX_STEPS, ONE_ENDED_FACTOR, ONE_SURFACE_PX, SILHOUETTE_CELL, TRUSTED_STEPS, coc_similarity,
};
use crate::compute::thread_pool::{MAX_ITEMS, ThreadPool};

/// Padding columns beside a row of steps, so that a sideways step stays inside it.
const PAD: usize = 2;
/// Search directions: each line both ways.
const WAYS: usize = 2 * DIRECTIONS.len();
/// Pixels of the picture per side of a level's pixel, which is a cell of the silhouettes' grid.
const PIXEL: usize = SILHOUETTE_CELL;
/// Step count without an end in that direction: steps saturate there.
const NO_END: u8 = u8::MAX;
const _: () = assert!(MAX_STEPS == NO_END - 1);

/// The known pixels of a level, and the distances to them from each hidden pixel.
pub struct DirectionalInpainting {
    width: usize,
    height: usize,
    /// Light and CoC of the known pixels.
    ends: Vec<[f32; 4]>,
    /// [`NO_END`] where unknown and outside the picture, else 0.
    unknown: Vec<u8>,
    /// For each way, a plane like `unknown`: steps to the next known pixel.
    steps: Vec<u8>,
}

impl DirectionalInpainting {
    /// Allocates for a level of `width` x `height`.
    pub fn new(width: usize, height: usize) -> Self {
        let padded = (width + 2 * PAD) * height;
        Self {
            width,
            height,
            ends: vec![[0.0; 4]; width * height],
            unknown: vec![NO_END; padded],
            steps: vec![NO_END; WAYS * padded],
        }
    }

    /// Fills the unknown pixels of a level that silhouettes uncover and whose lines reach a known pixel.
    pub fn fill(&mut self, level: &mut Level, silhouettes: &Silhouettes, workers: &mut ThreadPool, arch: Arch) {
        let (width, stride) = (self.width, self.stride());
        let each = self.height.div_ceil(MAX_ITEMS);
        let rows = self.ends.chunks_mut(each * width).zip(self.unknown.chunks_mut(each * stride));
        workers.run_each(rows.enumerate(), &|(part, (ends, unknown))| {
            arch.dispatch(CollectKnownPixels { level, first: part * each, ends, unknown });
        });
        let unknown = &self.unknown;
        workers.run_each(self.steps.chunks_mut(unknown.len()).enumerate(), &|(way, steps)| {
            arch.dispatch(DistanceToKnown { way, unknown, stride, steps });
        });
        let (seen, level_stride) = (&*self, level.rows.stride);
        let each_len = each * level.rows.row_len();
        workers.run_each(level.rows.data.chunks_mut(each_len).enumerate(), &|(part, rows)| {
            arch.dispatch(CombineLines { seen, silhouettes, first: part * each, rows, stride: level_stride });
        });
    }

    fn stride(&self) -> usize {
        self.width + 2 * PAD
    }
}

/// Length of a step in each direction.
const LENGTHS: PerDirection = [1.0, SQRT_5, SQRT_2, SQRT_5, 1.0, SQRT_5, SQRT_2, SQRT_5];
const SQRT_5: f32 = 2.236_068;

/// Returns the step of a way, across and down.
#[inline(always)]
fn way_step(way: usize) -> (isize, isize) {
    let (across, down) = DIRECTIONS[way / 2];
    let sign = if way.is_multiple_of(2) { -1 } else { 1 };
    (sign * across as isize, sign * down as isize)
}

/// Collects the known pixels of some rows of the level, from row `first` on.
struct CollectKnownPixels<'a> {
    level: &'a Level,
    first: usize,
    ends: &'a mut [[f32; 4]],
    unknown: &'a mut [u8],
}

impl WithSimd for CollectKnownPixels<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (width, stride) = (self.level.width, self.level.rows.stride);
        let rows = self.ends.chunks_exact_mut(width).zip(self.unknown.chunks_exact_mut(width + 2 * PAD));
        for (y, (ends, unknown)) in (self.first..).zip(rows) {
            let row = self.level.rows.row(y);
            let known = &row[(PLANES - 1) * stride..][..width];
            for (unknown, known) in unknown[PAD..][..width].iter_mut().zip(known) {
                *unknown = if *known > 0.0 { 0 } else { NO_END };
            }
            for (x, end) in ends.iter_mut().enumerate() {
                let scale = 1.0 / known[x].max(1e-6);
                *end = std::array::from_fn(|p| row[p * stride + x] * scale);
            }
        }
    }
}

/// Distance transform along one way: steps of a pixel = steps of the pixel one step on, plus 1.
struct DistanceToKnown<'a> {
    way: usize,
    unknown: &'a [u8],
    stride: usize,
    steps: &'a mut [u8],
}

impl WithSimd for DistanceToKnown<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { way, unknown, stride, steps } = self;
        let ((across, down), height) = (way_step(way), unknown.len() / stride);
        let columns = PAD..stride - PAD;
        let next = (PAD as isize + across) as usize;
        for k in 0..height {
            // In the order that makes the pixel one step on come first.
            let y = if down > 0 { height - 1 - k } else { k };
            let unknown = &unknown[y * stride..][..stride];
            let (before, rest) = steps.split_at_mut(y * stride);
            let (row, after) = rest.split_at_mut(stride);
            match down {
                0 => {
                    for x in 0..stride - 2 * PAD {
                        let x = if across > 0 { stride - 1 - PAD - x } else { PAD + x };
                        row[x] = unknown[x] & row[(x as isize + across) as usize].saturating_add(1);
                    }
                }
                // Outside the picture there is no known pixel.
                _ if y as isize + down < 0 || y as isize + down >= height as isize => {
                    row[columns.clone()].copy_from_slice(&unknown[columns.clone()]);
                }
                _ => {
                    let there = match down > 0 {
                        true => &after[(down as usize - 1) * stride..][..stride],
                        false => &before[before.len() - down.unsigned_abs() * stride..][..stride],
                    };
                    let there = &there[next..][..columns.len()];
                    for ((row, unknown), there) in
                        row[columns.clone()].iter_mut().zip(&unknown[columns.clone()]).zip(there)
                    {
                        *row = unknown & there.saturating_add(1);
                    }
                }
            }
        }
    }
}

/// Combines the lines through the unknown pixels of some rows.
struct CombineLines<'a> {
    seen: &'a DirectionalInpainting,
    silhouettes: &'a Silhouettes,
    first: usize,
    rows: &'a mut [f32],
    stride: usize,
}

impl WithSimd for CombineLines<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (seen, stride) = (self.seen, self.stride);
        let padded = seen.stride();
        for (y, row) in (self.first..).zip(self.rows.chunks_exact_mut(stride * PLANES)) {
            let unknown = &seen.unknown[y * padded + PAD..][..seen.width];
            let [visible, _] = self.silhouettes.row(y * PIXEL);
            for x in (0..seen.width).filter(|&x| unknown[x] == NO_END && visible[x] > 0.0) {
                if let Some(value) = seen.interpolate(x, y) {
                    for (p, value) in value.into_iter().enumerate() {
                        row[p * stride + x] = value;
                    }
                }
            }
        }
    }
}

/// One value per direction.
type PerDirection = [f32; DIRECTIONS.len()];

impl DirectionalInpainting {
    /// Returns light and CoC of an unknown pixel, times their trust, and the trust. Returns `None` if only one surface
    /// is seen from it, or nothing near enough.
    #[inline(always)]
    fn interpolate(&self, x: usize, y: usize) -> Option<[f32; PLANES]> {
        let (stride, plane) = (self.stride(), self.unknown.len());
        let at = y * stride + PAD + x;
        let (mut ends, mut steps, mut coc_px) =
            ([[0; DIRECTIONS.len()]; 2], [[0.0; DIRECTIONS.len()]; 2], [PerDirection::default(); 2]);
        for way in 0..WAYS {
            let (d, side, (across, down)) = (way / 2, way % 2, way_step(way));
            let count = self.steps[way * plane + at];
            // Without an end any pixel will do, because its weight is 0.
            let count_on = if count < NO_END { isize::from(count) } else { 0 };
            let end = (y as isize + count_on * down) as usize * self.width + (x as isize + count_on * across) as usize;
            (ends[side][d], steps[side][d], coc_px[side][d]) = (end, f32::from(count), self.ends[end][3]);
        }
        let seen_px = steps.as_flattened().iter().zip(coc_px.as_flattened());
        let seen_px = seen_px.filter(|&(&steps, _)| steps <= f32::from(MAX_STEPS)).map(|(_, &px)| px);
        let (low_px, high_px) = seen_px.fold((f32::MAX, f32::MIN), |(low, high), px| (low.min(px), high.max(px)));
        if high_px - low_px < ONE_SURFACE_PX {
            return None;
        }
        let (mut weights, mut second, mut line_px) =
            (PerDirection::default(), PerDirection::default(), PerDirection::default());
        let mut shortest = f32::MAX;
        for d in 0..DIRECTIONS.len() {
            let ([to_a, to_b], [a_px, b_px]) = (steps.map(|steps| steps[d]), coc_px.map(|coc_px| coc_px[d]));
            let (has_a, has_b) = (to_a <= f32::from(MAX_STEPS), to_b <= f32::from(MAX_STEPS));
            let similarity = coc_similarity(a_px, b_px);
            let (to_a, to_b) = (if has_a { to_a } else { 0.0 }, if has_b { to_b } else { 0.0 });
            let sum = to_a + to_b;
            let length = LENGTHS[d] * sum * if has_a && has_b { 1.0 } else { ONE_ENDED_FACTOR };
            let agreement = if has_a && has_b { similarity * similarity } else { 1.0 };
            weights[d] = if length > 0.0 { agreement / length } else { 0.0 };
            shortest = if length > 0.0 { shortest.min(length) } else { shortest };
            let fraction = if has_b { to_a / sum } else { 0.0 };
            second[d] = if has_a { fraction } else { 1.0 };
            line_px[d] = a_px + (b_px - a_px) * second[d];
        }
        let trust = (2.0 - shortest / TRUSTED_STEPS).clamp(0.0, 1.0);
        if trust <= 0.0 {
            return None;
        }
        // Agreement of a line with the others counts to the fourth power: a mean of two surfaces would be neither.
        let mut scores = PerDirection::default();
        for e in 0..DIRECTIONS.len() {
            for d in 0..DIRECTIONS.len() {
                scores[d] += weights[e] * coc_similarity(line_px[d], line_px[e]);
            }
        }
        let best = scores.iter().fold(1e-30f32, |best, &score| best.max(score));
        let mut total = 0.0;
        for d in 0..DIRECTIONS.len() {
            let agreed = scores[d] * scores[d] / (best * best);
            weights[d] *= agreed * agreed;
            total += weights[d];
        }
        if total <= 0.0 {
            return None;
        }
        let mut sum = [0.0, 0.0, 0.0, 0.0, trust];
        for d in 0..DIRECTIONS.len() {
            let weight = trust * weights[d] / total;
            let end_weights = [weight * (1.0 - second[d]), weight * second[d]];
            for (ends, end_weight) in ends.iter().zip(end_weights) {
                let end = &self.ends[ends[d]];
                for p in 0..4 {
                    sum[p] += end_weight * end[p];
                }
            }
        }
        Some(sum)
    }
}

#[cfg(test)]
mod tests;
