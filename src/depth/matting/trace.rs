//! Thin things beyond the edges of the map.

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::clusters::{Clusters, View};
use super::share::Labels;
use super::{EdgePixel, Pixel, around};
use crate::compute::thread_pool::ThreadPool;
use crate::depth::bits::{Bits, places};
use crate::frame::DepthMap;

/// Neighbours of a pixel with this share are looked at, too, where the map has no edge.
pub const TRACED_FROM: f32 = 0.1;

/// Follows thin things, such as hair, to where the depth map has nothing of them: from pixels that show something near though
/// the map has none there, to neighbours that do so, too (hysteresis, as edges are traced).
pub struct Trace<'a> {
    pub arch: Arch,
    pub workers: &'a mut ThreadPool,
    /// As in a [`View`].
    pub size: (usize, usize),
    pub metres: &'a [f32],
    pub jump: f32,
    pub rgb: &'a [u8],
    pub light: &'a [f32; 256],
    pub at_edge: &'a mut Bits,
    pub clusters: &'a mut Clusters,
    /// From these of the pixels one step is taken; what that finds is added to them.
    pub compared: Range<usize>,
    pub pixels: &'a mut Vec<Pixel>,
}

impl WithSimd for Trace<'_> {
    /// How many pixels it has marked.
    type Output = usize;
    // One after the other, as the clusters that one needs are made of what is marked until then.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> usize {
        let Self { arch, workers, size, metres, jump, rgb, light, at_edge, clusters, compared, pixels } = self;
        let mut marked = 0;
        for k in compared {
            let Pixel { edge, share, .. } = pixels[k];
            if edge.labels.is_near || share < TRACED_FROM {
                continue;
            }
            let (xs, ys) = around(&edge, 1, size);
            for y in ys {
                for place in places(!at_edge.from(xs.start, y) & below(xs.len())) {
                    let x = xs.start + place;
                    let is_far = (DepthMap::inverse_of(metres[y * size.0 + x]) - edge.far).abs() <= jump;
                    if !is_far {
                        continue;
                    }
                    at_edge.set(x, y);
                    marked += 1;
                    let next = EdgePixel { x: x as u32, y: y as u32, labels: Labels::BEYOND, ..edge };
                    let asked = clusters.asked();
                    let answer = clusters.ask(jump, &next);
                    if answer as usize == asked {
                        clusters.find((arch, workers), &View { size, metres, jump, at_edge, rgb, light }, asked);
                    }
                    if clusters.at(answer).is_some() {
                        pixels.push(Pixel::new(next, answer));
                    }
                }
            }
        }
        marked
    }
}

/// So many bits, the lowest ones.
#[inline(always)]
fn below(count: usize) -> u64 {
    (1 << count) - 1
}

/// Tells what is wide from what is thin; owns the memory for it.
#[derive(Debug, Default)]
pub struct Wide {
    /// The places of the pixels that each step has traced.
    pub steps: Vec<Range<usize>>,
    /// What was traced, what of that has some of what is near, and what is part of something wide.
    traced: Bits,
    seen: Bits,
    wide: Bits,
    /// The places of those in the middle of something wide, of a step.
    middles: Vec<usize>,
}

impl Wide {
    /// Lets go of pixels that were traced into something far that looks like what is near: a hair nowhere fills a square of three
    /// pixels, as a picture's frame does.
    pub fn drop(&mut self, size: (usize, usize), pixels: &mut [Pixel]) {
        let Self { steps, traced, seen, wide, middles } = self;
        if steps.iter().all(Range::is_empty) {
            return;
        }
        for bits in [&mut *traced, &mut *seen, &mut *wide] {
            bits.clear(size);
        }
        for Pixel { edge, share, .. } in steps.iter().flat_map(|step| &pixels[step.clone()]) {
            let (x, y) = (edge.x as usize, edge.y as usize);
            traced.set(x, y);
            if *share >= TRACED_FROM {
                seen.set(x, y);
            }
        }
        for step in &*steps {
            let is_middle = |edge: &EdgePixel| {
                let (xs, ys) = around(edge, 1, size);
                let missing = ys.fold(0, |missing, y| missing | !seen.from(xs.start, y));
                missing & below(xs.len()) == 0
            };
            middles.clear();
            middles.extend(step.clone().filter(|&k| is_middle(&pixels[k].edge)));
            // The outline of what is wide is part of it, and seen from the next step on.
            for &middle in &*middles {
                let (xs, ys) = around(&pixels[middle].edge, 2, size);
                for y in ys {
                    let part = traced.from(xs.start, y) & below(xs.len());
                    seen.set_from(xs.start, y, part);
                    wide.set_from(xs.start, y, part);
                }
            }
        }
        for pixel in steps.iter().flat_map(|step| step.clone()) {
            let Pixel { edge, share, .. } = &mut pixels[pixel];
            if wide.has(edge.x as usize, edge.y as usize) {
                *share = 0.0;
            }
        }
    }
}
