//! Traces thin structures, such as hair, beyond the edges of the depth map.
//! twin: shaders/matte/trace.wgsl, matte/claim.wgsl, matte/wide.wgsl

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::alpha::Labels;
use super::clusters::{Clusters, FrameView};
use super::{EdgePixel, Pixel, neighbourhood};
use crate::compute::thread_pool::ThreadPool;
use crate::depth::bitmap::{Bitmap, set_bits};
use crate::frame::DepthMap;

/// Minimum alpha of a pixel whose neighbours are traced, where the map has no edge.
pub const MIN_TRACED_ALPHA: f32 = 0.05;

/// Follows thin structures to where the depth map does not have them: from pixels with some alpha that are far in the
/// map, to their neighbours, if these have some alpha too (hysteresis, as in Canny's edge tracing).
pub struct Trace<'a> {
    pub arch: Arch,
    pub workers: &'a mut ThreadPool,
    /// See [`FrameView`].
    pub size: (usize, usize),
    pub metres: &'a [f32],
    pub depth_step: f32,
    pub rgb: &'a [u8],
    pub light: &'a [f32; 256],
    pub at_edge: &'a mut Bitmap,
    pub clusters: &'a mut Clusters,
    /// The pixels from which to trace one step; the new ones are appended to `pixels`.
    pub compared: Range<usize>,
    pub pixels: &'a mut Vec<Pixel>,
}

impl WithSimd for Trace<'_> {
    /// The number of newly marked pixels.
    type Output = usize;
    // Sequential: a new colour model depends on the pixels marked so far.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> usize {
        let Self { arch, workers, size, metres, depth_step, rgb, light, at_edge, clusters, compared, pixels } = self;
        let mut marked = 0;
        for k in compared {
            let Pixel { edge, alpha, .. } = pixels[k];
            if edge.labels.is_near || alpha < MIN_TRACED_ALPHA {
                continue;
            }
            let (xs, ys) = neighbourhood(&edge, 1, size);
            for y in ys {
                for place in set_bits(!at_edge.word_at(xs.start, y) & low_bits(xs.len())) {
                    let x = xs.start + place;
                    let is_far = (DepthMap::inverse_depth(metres[y * size.0 + x]) - edge.far).abs() <= depth_step;
                    if !is_far {
                        continue;
                    }
                    at_edge.set(x, y);
                    marked += 1;
                    let next = EdgePixel { x: x as u32, y: y as u32, labels: Labels::BEYOND, ..edge };
                    let count = clusters.model_count();
                    let model = clusters.request_model(depth_step, &next);
                    if model as usize == count {
                        clusters.fit_models(
                            (arch, workers),
                            &FrameView { size, metres, depth_step, at_edge, rgb, light },
                            count,
                        );
                    }
                    if clusters.contrast(model).is_some() {
                        pixels.push(Pixel::new(next, model));
                    }
                }
            }
        }
        marked
    }
}

/// Returns a mask of the `count` lowest bits.
#[inline(always)]
fn low_bits(count: usize) -> u64 {
    (1 << count) - 1
}

/// Separates wide regions from thin structures; owns the memory for it.
#[derive(Debug, Default)]
pub struct WideRegions {
    /// Ranges of the pixels that were traced in each step.
    pub steps: Vec<Range<usize>>,
    /// Traced pixels, those of them with some alpha, and those in wide regions.
    traced: Bitmap,
    seen: Bitmap,
    wide: Bitmap,
    /// Indices of the pixels of a step whose 3x3 neighbourhood is full.
    middles: Vec<usize>,
}

impl WideRegions {
    /// Discards pixels that were traced into a far surface that looks like the near one: a hair never fills a square of
    /// three pixels, as the edge of a picture frame does.
    pub fn discard_wide(&mut self, size: (usize, usize), pixels: &mut [Pixel]) {
        let Self { steps, traced, seen, wide, middles } = self;
        if steps.iter().all(Range::is_empty) {
            return;
        }
        for bits in [&mut *traced, &mut *seen, &mut *wide] {
            bits.clear(size);
        }
        for Pixel { edge, alpha, .. } in steps.iter().flat_map(|step| &pixels[step.clone()]) {
            let (x, y) = (edge.x as usize, edge.y as usize);
            traced.set(x, y);
            if *alpha >= MIN_TRACED_ALPHA {
                seen.set(x, y);
            }
        }
        for step in &*steps {
            let is_middle = |edge: &EdgePixel| {
                let (xs, ys) = neighbourhood(edge, 1, size);
                let missing = ys.fold(0, |missing, y| missing | !seen.word_at(xs.start, y));
                missing & low_bits(xs.len()) == 0
            };
            middles.clear();
            middles.extend(step.clone().filter(|&k| is_middle(&pixels[k].edge)));
            // The outline of a wide region belongs to it, and counts as seen from the next step on.
            for &middle in &*middles {
                let (xs, ys) = neighbourhood(&pixels[middle].edge, 2, size);
                for y in ys {
                    let part = traced.word_at(xs.start, y) & low_bits(xs.len());
                    seen.set_word(xs.start, y, part);
                    wide.set_word(xs.start, y, part);
                }
            }
        }
        for pixel in steps.iter().flat_map(|step| step.clone()) {
            let Pixel { edge, alpha, .. } = &mut pixels[pixel];
            if wide.has(edge.x as usize, edge.y as usize) {
                *alpha = 0.0;
            }
        }
    }
}
