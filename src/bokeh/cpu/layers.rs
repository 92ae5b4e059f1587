//! The layers of some pixels, front to back, and their compositing into one colour.
//!
//! The pixels of one view tile the picture, so the coverages of two bins are disjoint, not independent: among the near
//! bins, and among the others, a bin fills the remaining coverage. The near bins are composited over the others; the
//! uncovered rest has the colour of the hindmost bin. Away from all silhouettes a pixel shows only one surface, which
//! is opaque: the bins that the surface spans fill the pixel together.
//!
//! twin: shaders/blur/surfaces.wgsl

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use std::ops::Range;

use pulp::Simd;

use super::encode::CHUNK;
use super::silhouettes::Proximity;
use crate::bokeh::occlusion::{FADE_FRACTION, MARGIN_PX, MIN_OWN_COVERAGE};
use crate::bokeh::plan::{Bin, HINDMOST_COVERAGE, MAX_BINS};
use crate::compute::aligned::CacheAligned;
use crate::compute::simd::{abs, fma, load, store};

/// Relative CoC distance below which a bin belongs to a pixel's own surface: slightly less than where its weight starts
/// to fall, so that rounding does not matter.
const ONE_SURFACE: f32 = 0.49;

/// Bins composited front to back at some pixels: each covers part of the remaining coverage.
#[derive(Clone, Copy)]
struct LayerStack<S: Simd> {
    color: [S::f32s; 3],
    /// Uncovered fraction of each pixel.
    uncovered: S::f32s,
    /// Colour of the hindmost bin that counts here, and how far it is known.
    hindmost: [S::f32s; 3],
    known: S::f32s,
}

impl<S: Simd> LayerStack<S> {
    #[inline(always)]
    fn new(simd: S) -> Self {
        let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
        Self { color: [zero; 3], uncovered: one, hindmost: [zero; 3], known: zero }
    }

    /// Adds a vector of a bin behind all others: premultiplied colour and coverage.
    #[inline(always)]
    fn add(&mut self, simd: S, layer: [S::f32s; 4]) {
        let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
        if simd.first_true_m32s(simd.greater_than_f32s(layer[3], zero)) == S::F32_LANES {
            return;
        }
        let covered = simd.min_f32s(layer[3], self.uncovered);
        let inverse = simd.div_f32s(one, simd.max_f32s(layer[3], simd.splat_f32s(1e-6)));
        let weight = simd.min_f32s(simd.mul_f32s(layer[3], simd.splat_f32s(1.0 / HINDMOST_COVERAGE)), one);
        let (rest, covering) = (simd.sub_f32s(one, weight), simd.mul_f32s(covered, inverse));
        let hindmost = simd.mul_f32s(weight, inverse);
        for p in 0..3 {
            self.color[p] = fma(simd, layer[p], covering, self.color[p]);
            self.hindmost[p] = fma(simd, layer[p], hindmost, simd.mul_f32s(self.hindmost[p], rest));
        }
        self.known = fma(simd, self.known, rest, weight);
        self.uncovered = simd.sub_f32s(self.uncovered, covered);
    }

    /// Returns the colour, with the uncovered rest in the colour of the hindmost bin: that rest is hidden from the
    /// camera.
    #[inline(always)]
    fn fill_uncovered(&self, simd: S) -> [S::f32s; 3] {
        let scale = simd.div_f32s(self.uncovered, simd.max_f32s(self.known, simd.splat_f32s(1e-6)));
        let mut color = self.color;
        for p in 0..3 {
            color[p] = fma(simd, self.hindmost[p], scale, color[p]);
        }
        color
    }
}

/// Layers of a chunk, front to back: the content of the bins there.
pub struct Layers {
    planes: Box<[CacheAligned<[[f32; CHUNK]; 4]>]>,
    /// CoC range of each layer's bin, in pixels.
    ranges_px: [(f32, f32); MAX_BINS],
    near: usize,
    count: usize,
    /// CoC where the region in front of the subject ends; `near_slope` is the slope of the cross-fade.
    near_border_px: f32,
    near_slope: f32,
}

/// Loads a bin's content at some pixels as vectors.
#[inline(always)]
fn load_layer<S: Simd>(simd: S, planes: &CacheAligned<[[f32; CHUNK]; 4]>, x: usize) -> [S::f32s; 4] {
    let mut values = [simd.splat_f32s(0.0); 4];
    for p in 0..4 {
        values[p] = load::<S>(&planes.0[p], x);
    }
    values
}

impl Layers {
    /// Allocates for the largest number of bins.
    pub fn new() -> Self {
        let planes = vec![CacheAligned([[0.0; CHUNK]; 4]); MAX_BINS].into();
        Self { planes, ranges_px: [(0.0, 0.0); MAX_BINS], near: 0, count: 0, near_border_px: -1.0, near_slope: 1.0 }
    }

    /// Composites some `columns` of the layers to linear light, at pixels with these CoC and with `proximity` from silhouettes. If the
    /// pixels are `is_one_surface`, away from silhouettes, no CoC is needed.
    #[inline(always)]
    pub fn composite<S: Simd>(
        &self,
        simd: S,
        columns: Range<usize>,
        proximity: &Option<Proximity>,
        coc_px: &[f32; CHUNK],
        is_one_surface: bool,
        color: &mut CacheAligned<[[f32; CHUNK]; 3]>,
    ) {
        let zero = simd.splat_f32s(0.0);
        for x in columns.step_by(S::F32_LANES) {
            let coc_px = load::<S>(coc_px, x);
            let light = match proximity {
                Some(proximity) if proximity.any_inside(x, S::F32_LANES) => {
                    let squares = proximity.interpolate(x, S::F32_LANES);
                    self.composite_near_silhouettes(simd, &squares, coc_px, x)
                }
                _ => self.composite_one_surface(simd, coc_px, is_one_surface, x),
            };
            for p in 0..3 {
                store::<S>(&mut color.0[p], x, simd.max_f32s(light[p], zero));
            }
        }
    }

    /// Composites away from all silhouettes: only a pixel's own surface.
    #[inline(always)]
    fn composite_one_surface<S: Simd>(&self, simd: S, coc_px: S::f32s, is_one_surface: bool, x: usize) -> [S::f32s; 3] {
        let (mut light, is_thin) = self.composite_own_surface(simd, coc_px, is_one_surface, x);
        if simd.first_true_m32s(is_thin) < S::F32_LANES {
            let all = self.composite_all_surfaces(simd, simd.splat_f32s(1.0), x);
            for p in 0..3 {
                light[p] = simd.select_f32s(is_thin, all[p], light[p]);
            }
        }
        light
    }

    /// Composites near silhouettes: all surfaces, cross-faded to the pixel's own by these squared distances.
    #[inline(always)]
    fn composite_near_silhouettes<S: Simd, const N: usize>(
        &self,
        simd: S,
        squares: &[[f32; N]; 2],
        coc_px: S::f32s,
        x: usize,
    ) -> [S::f32s; 3] {
        let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
        // Radius of the silhouettes of the pixel's own surface, if it is a near one.
        let radius_px = simd.add_f32s(simd.max_f32s(simd.neg_f32s(coc_px), zero), simd.splat_f32s(MARGIN_PX));
        let scale =
            simd.div_f32s(one, simd.mul_f32s(simd.mul_f32s(radius_px, radius_px), simd.splat_f32s(FADE_FRACTION)));
        let mut visibility = [zero; 2];
        for (visibility, squares) in visibility.iter_mut().zip(squares) {
            *visibility = simd.mul_f32s(load::<S>(squares, 0), scale);
            *visibility = simd.min_f32s(simd.max_f32s(*visibility, zero), one);
        }
        // A pixel that is not in front shows the whole background behind near layers.
        let back_weight = simd.sub_f32s(coc_px, simd.splat_f32s(self.near_border_px));
        let back_weight = fma(simd, back_weight, simd.splat_f32s(self.near_slope), simd.splat_f32s(0.5));
        let back_weight = simd.min_f32s(simd.max_f32s(back_weight, zero), one);
        let back_visibility = simd.max_f32s(visibility[1], back_weight);
        if simd.first_true_m32s(simd.less_than_f32s(visibility[0], one)) == S::F32_LANES {
            return self.composite_all_surfaces(simd, back_visibility, x);
        }
        let (own, is_thin) = self.composite_own_surface(simd, coc_px, self.count < 2, x);
        let mut light = self.composite_all_surfaces(simd, simd.select_f32s(is_thin, one, back_visibility), x);
        let visibility = simd.select_f32s(is_thin, one, visibility[0]);
        for p in 0..3 {
            light[p] = fma(simd, simd.sub_f32s(light[p], own[p]), visibility, own[p]);
        }
        light
    }

    /// Begins a frame whose near bins end at `near_border`: the CoC, and the slope of the cross-fade.
    pub fn set_near_border(&mut self, near_border: (f32, f32)) {
        (self.near_border_px, self.near_slope) = near_border;
    }

    /// Removes all layers, for other pixels.
    #[inline(always)]
    pub fn clear(&mut self) {
        (self.near, self.count) = (0, 0);
    }

    /// Returns the buffer of the next layer.
    #[inline(always)]
    pub fn next_buffer(&mut self) -> &mut [[f32; CHUNK]; 4] {
        &mut self.planes[self.count].0
    }

    /// Appends the content of [`Layers::next_buffer`] as the layer of a bin.
    #[inline(always)]
    pub fn push(&mut self, bin: &Bin) {
        self.ranges_px[self.count] = (bin.low_px, bin.high_px);
        self.count += 1;
        self.near += usize::from(bin.near);
    }

    /// Whether there are none.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Whether the first layer covers all of a vector of pixels, or none of it; `None` if neither.
    #[inline(always)]
    pub fn front_covers<S: Simd>(&self, simd: S, x: usize) -> Option<bool> {
        let coverage = load::<S>(&self.planes[0].0[3], x);
        let first = |mask| simd.first_true_m32s(mask) == S::F32_LANES;
        match first(simd.less_than_f32s(coverage, simd.splat_f32s(1.0 - 1e-5))) {
            true => Some(true),
            false => first(simd.greater_than_f32s(coverage, simd.splat_f32s(0.0))).then_some(false),
        }
    }

    /// Whether every layer fully counts as the surface of each pixel whose CoC is in one of these ranges.
    #[inline(always)]
    pub fn have_one_surface(&self, ranges_px: &[(f32, f32)]) -> bool {
        if self.count < 2 {
            return true;
        }
        let (mut low_px, mut high_px) = ranges_px[0];
        for range in ranges_px {
            (low_px, high_px) = (low_px.min(range.0), high_px.max(range.1));
        }
        // The distance to a layer's CoC range is monotonic on either side of the focal plane: the extremes suffice.
        let turns_px = [low_px, high_px, low_px.max(0.0).min(high_px)];
        let mut max_distance = 0.0_f32;
        for &(from_px, to_px) in &self.ranges_px[..self.count] {
            for px in turns_px {
                max_distance = max_distance.max((from_px - px).max(px - to_px) / (px.abs() + 1.0));
            }
        }
        max_distance < ONE_SURFACE
    }

    /// Composites the near layers over the others, as far as these are visible (`back_visibility`, 0 to 1); otherwise
    /// the near layers fill the pixel.
    #[inline(always)]
    fn composite_all_surfaces<S: Simd>(&self, simd: S, back_visibility: S::f32s, x: usize) -> [S::f32s; 3] {
        let (near, rest) = self.planes[..self.count].split_at(self.near);
        let mut back = LayerStack::new(simd);
        for planes in rest {
            back.add(simd, load_layer(simd, planes, x));
        }
        let mut light = back.fill_uncovered(simd);
        if !near.is_empty() {
            let mut front = LayerStack::new(simd);
            for planes in near {
                front.add(simd, load_layer(simd, planes, x));
            }
            let alone = front.fill_uncovered(simd);
            // Without a background, too; almost empty near layers have no colour to fill a pixel with.
            let has_back = simd.greater_than_f32s(back.known, simd.splat_f32s(1e-4));
            let has_front = simd.greater_than_f32s(front.known, simd.splat_f32s(1e-3));
            let visibility = simd.select_f32s(has_front, back_visibility, simd.splat_f32s(1.0));
            for p in 0..3 {
                let over = fma(simd, light[p], front.uncovered, front.color[p]);
                let ahead = simd.select_f32s(has_front, alone[p], over);
                let both = fma(simd, simd.sub_f32s(over, ahead), visibility, ahead);
                light[p] = simd.select_f32s(has_back, both, alone[p]);
            }
        }
        light
    }

    /// Returns the colour of the surfaces of about this CoC, or of all layers if they are `is_one_surface`, as if
    /// nothing else were there, and a mask of the pixels that it does not fill.
    #[inline(always)]
    fn composite_own_surface<S: Simd>(
        &self,
        simd: S,
        coc_px: S::f32s,
        is_one_surface: bool,
        x: usize,
    ) -> ([S::f32s; 3], S::m32s) {
        let (zero, one, two) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0), simd.splat_f32s(2.0));
        let mut stack = LayerStack::new(simd);
        let inverse = simd.div_f32s(one, simd.add_f32s(abs(simd, coc_px), one));
        let slack = simd.min_f32s(simd.max_f32s(simd.neg_f32s(coc_px), zero), simd.splat_f32s(0.5));
        for (planes, &(low_px, high_px)) in self.planes[..self.count].iter().zip(&self.ranges_px) {
            let mut layer = load_layer(simd, planes, x);
            if !is_one_surface {
                // In front, nearer content is blurred more and spreads farther.
                let farther = simd.mul_f32s(simd.sub_f32s(simd.splat_f32s(low_px), coc_px), inverse);
                let nearer = simd.mul_f32s(simd.sub_f32s(coc_px, simd.splat_f32s(high_px)), inverse);
                let step = simd.max_f32s(farther, simd.sub_f32s(nearer, slack));
                let weight = simd.sub_f32s(two, simd.mul_f32s(two, step));
                let weight = simd.min_f32s(simd.max_f32s(weight, zero), one);
                for plane in &mut layer {
                    *plane = simd.mul_f32s(*plane, weight);
                }
            }
            stack.add(simd, layer);
        }
        let covered = simd.max_f32s(simd.sub_f32s(one, stack.uncovered), simd.splat_f32s(1e-6));
        let inverse = simd.div_f32s(one, covered);
        for plane in &mut stack.color {
            *plane = simd.mul_f32s(*plane, inverse);
        }
        (stack.color, simd.less_than_f32s(covered, simd.splat_f32s(MIN_OWN_COVERAGE)))
    }
}
