//! The layers of some pixels, front to back: what bins have there, and how they become one colour.
//!
//! The pixels of one view tile the picture, so the coverages of two bins are disjoint, not independent: among the near
//! bins, and among the others, a bin fills what is left. The near ones lie over the others; what stays open takes the
//! colour of the hindmost. Away from all silhouettes a pixel sees one surface alone, which is opaque: the bins that it goes
//! through fill the pixel among themselves.

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use pulp::Simd;

use super::encode::CHUNK;
use super::silhouettes::Reaching;
use crate::bokeh::occlusion::{FADE, MARGIN_PX, OWN_COVERAGE};
use crate::bokeh::plan::{Bin, HINDMOST_COVERAGE, MAX_BINS};
use crate::compute::aligned::Line;
use crate::compute::simd::{fma, load, store};

/// Bins less than this step away are of a pixel's own surface: a little less than where they begin to count less, so that rounding
/// does not matter.
const ONE_SURFACE: f32 = 0.49;

/// Bins composited front to back at some pixels: each covers what is still open.
#[derive(Clone, Copy)]
struct Pile<S: Simd> {
    color: [S::f32s; 3],
    /// How much of each pixel nothing has covered yet.
    open: S::f32s,
    /// The colour of the hindmost bin that counts here, and how far that is known.
    hindmost: [S::f32s; 3],
    known: S::f32s,
}

impl<S: Simd> Pile<S> {
    #[inline(always)]
    fn new(simd: S) -> Self {
        let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
        Self { color: [zero; 3], open: one, hindmost: [zero; 3], known: zero }
    }

    /// Adds a vector of a bin behind all others, premultiplied colour and coverage.
    #[inline(always)]
    fn add(&mut self, simd: S, layer: [S::f32s; 4]) {
        let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
        if simd.first_true_m32s(simd.greater_than_f32s(layer[3], zero)) == S::F32_LANES {
            return;
        }
        let covered = simd.min_f32s(layer[3], self.open);
        let inverse = simd.div_f32s(one, simd.max_f32s(layer[3], simd.splat_f32s(1e-6)));
        let weight = simd.min_f32s(simd.mul_f32s(layer[3], simd.splat_f32s(1.0 / HINDMOST_COVERAGE)), one);
        for p in 0..3 {
            let straight = simd.mul_f32s(layer[p], inverse);
            self.color[p] = fma(simd, straight, covered, self.color[p]);
            self.hindmost[p] = fma(simd, simd.sub_f32s(straight, self.hindmost[p]), weight, self.hindmost[p]);
        }
        self.known = fma(simd, simd.sub_f32s(one, self.known), weight, self.known);
        self.open = simd.sub_f32s(self.open, covered);
    }

    /// The colour, with what is still open in that of the hindmost bin: it was hidden from the camera behind all else.
    #[inline(always)]
    fn with_rest_filled(&self, simd: S) -> [S::f32s; 3] {
        let scale = simd.div_f32s(self.open, simd.max_f32s(self.known, simd.splat_f32s(1e-6)));
        let mut color = self.color;
        for p in 0..3 {
            color[p] = fma(simd, self.hindmost[p], scale, color[p]);
        }
        color
    }
}

/// The layers of a chunk, front to back: what bins have there.
pub struct Layers {
    planes: Box<[Line<[[f32; CHUNK]; 4]>]>,
    /// The CoC of each one's bin, in pixels.
    ranges_px: [(f32, f32); MAX_BINS],
    near: usize,
    count: usize,
    /// Where what lies in front of the subject ends: the CoC, and the slope of the hand-over.
    near_to_px: f32,
    near_slope: f32,
}

/// What bins have at some pixels, as a vector.
#[inline(always)]
fn layer<S: Simd>(simd: S, planes: &Line<[[f32; CHUNK]; 4]>, x: usize) -> [S::f32s; 4] {
    let mut values = [simd.splat_f32s(0.0); 4];
    for p in 0..4 {
        values[p] = load::<S>(&planes.0[p], x);
    }
    values
}

impl Layers {
    /// Memory for all bins that there can be.
    pub fn new() -> Self {
        let planes = vec![Line([[0.0; CHUNK]; 4]); MAX_BINS].into();
        Self { planes, ranges_px: [(0.0, 0.0); MAX_BINS], near: 0, count: 0, near_to_px: -1.0, near_slope: 1.0 }
    }

    /// Composites the layers to linear light, at pixels of such CoC that silhouettes reach so far. Where all are
    /// `of_one_surface`, away from silhouettes, no CoC is needed.
    #[inline(always)]
    pub fn flatten<S: Simd>(
        &self,
        simd: S,
        reaching: &Option<Reaching>,
        coc_px: &[f32; CHUNK],
        of_one_surface: bool,
        color: &mut Line<[[f32; CHUNK]; 3]>,
    ) {
        let zero = simd.splat_f32s(0.0);
        for x in (0..CHUNK).step_by(S::F32_LANES) {
            let light = match reaching.as_ref().and_then(|reaching| reaching.pixels(x, S::F32_LANES)) {
                Some(squares) => self.beside_silhouettes(simd, &squares, load::<S>(coc_px, x), x),
                None => self.away(simd, load::<S>(coc_px, x), of_one_surface, x),
            };
            for p in 0..3 {
                store::<S>(&mut color.0[p], x, simd.max_f32s(light[p], zero));
            }
        }
    }

    /// Away from all silhouettes: a pixel's own surface.
    #[inline(always)]
    fn away<S: Simd>(&self, simd: S, coc_px: S::f32s, of_one_surface: bool, x: usize) -> [S::f32s; 3] {
        let (mut light, is_thin) = self.own_surface(simd, coc_px, of_one_surface, x);
        if simd.first_true_m32s(is_thin) < S::F32_LANES {
            let all = self.all_surfaces(simd, simd.splat_f32s(1.0), x);
            for p in 0..3 {
                light[p] = simd.select_f32s(is_thin, all[p], light[p]);
            }
        }
        light
    }

    /// Where silhouettes reach, so far as these squares say: all surfaces, faded out to a pixel's own.
    #[inline(always)]
    fn beside_silhouettes<S: Simd, const N: usize>(
        &self,
        simd: S,
        squares: &[[f32; N]; 2],
        coc_px: S::f32s,
        x: usize,
    ) -> [S::f32s; 3] {
        let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
        // That of the silhouettes of the pixel's own surface, where it is a near one.
        let reach = simd.add_f32s(simd.max_f32s(simd.neg_f32s(coc_px), zero), simd.splat_f32s(MARGIN_PX));
        let scale = simd.div_f32s(one, simd.mul_f32s(simd.mul_f32s(reach, reach), simd.splat_f32s(FADE)));
        let mut shows = [zero; 2];
        for (shows, squares) in shows.iter_mut().zip(squares) {
            *shows = simd.mul_f32s(load::<S>(squares, 0), scale);
            *shows = simd.min_f32s(simd.max_f32s(*shows, zero), one);
        }
        // What is not in front itself has all behind what is.
        let lies_back = simd.sub_f32s(coc_px, simd.splat_f32s(self.near_to_px));
        let lies_back = fma(simd, lies_back, simd.splat_f32s(self.near_slope), simd.splat_f32s(0.5));
        let lies_back = simd.min_f32s(simd.max_f32s(lies_back, zero), one);
        let back_shows = simd.max_f32s(shows[1], lies_back);
        if simd.first_true_m32s(simd.less_than_f32s(shows[0], one)) == S::F32_LANES {
            return self.all_surfaces(simd, back_shows, x);
        }
        let (own, is_thin) = self.own_surface(simd, coc_px, self.count < 2, x);
        let mut light = self.all_surfaces(simd, simd.select_f32s(is_thin, one, back_shows), x);
        let shows = simd.select_f32s(is_thin, one, shows[0]);
        for p in 0..3 {
            light[p] = fma(simd, simd.sub_f32s(light[p], own[p]), shows, own[p]);
        }
        light
    }

    /// Begins a frame whose near bins end at `near_to`: the CoC, and the slope of the hand-over.
    pub fn begin(&mut self, near_to: (f32, f32)) {
        (self.near_to_px, self.near_slope) = near_to;
    }

    /// No layers yet, at other pixels.
    #[inline(always)]
    pub fn clear(&mut self) {
        (self.near, self.count) = (0, 0);
    }

    /// Memory for the next layer.
    #[inline(always)]
    pub fn next(&mut self) -> &mut [[f32; CHUNK]; 4] {
        &mut self.planes[self.count].0
    }

    /// Keeps what was written to [`Layers::next`], of a bin.
    #[inline(always)]
    pub fn keep(&mut self, bin: &Bin) {
        self.ranges_px[self.count] = (bin.low_px, bin.high_px);
        self.count += 1;
        self.near += usize::from(bin.near);
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Whether every layer counts fully as the surface of each pixel whose CoC is in one of these ranges.
    #[inline(always)]
    pub fn are_of_one_surface(&self, ranges_px: &[(f32, f32)]) -> bool {
        if self.count < 2 {
            return true;
        }
        let (mut low_px, mut high_px) = ranges_px[0];
        for range in ranges_px {
            (low_px, high_px) = (low_px.min(range.0), high_px.max(range.1));
        }
        // Steps grow away from a layer's CoC, without turns on either side of the focal plane.
        let turns_px = [low_px, high_px, low_px.max(0.0).min(high_px)];
        let mut most = 0.0_f32;
        for &(from_px, to_px) in &self.ranges_px[..self.count] {
            for px in turns_px {
                most = most.max((from_px - px).max(px - to_px) / (px.abs() + 1.0));
            }
        }
        most < ONE_SURFACE
    }

    /// The near layers over the others, as far as these show (0 to 1); else the near ones have to fill the pixel.
    #[inline(always)]
    fn all_surfaces<S: Simd>(&self, simd: S, back_shows: S::f32s, x: usize) -> [S::f32s; 3] {
        let (near, rest) = self.planes[..self.count].split_at(self.near);
        let mut back = Pile::new(simd);
        for planes in rest {
            back.add(simd, layer(simd, planes, x));
        }
        let mut light = back.with_rest_filled(simd);
        if !near.is_empty() {
            let mut front = Pile::new(simd);
            for planes in near {
                front.add(simd, layer(simd, planes, x));
            }
            let alone = front.with_rest_filled(simd);
            // Where nothing lies behind, either; next to nothing in front has no colour to fill a pixel with.
            let has_back = simd.greater_than_f32s(back.known, simd.splat_f32s(1e-4));
            let has_front = simd.greater_than_f32s(front.known, simd.splat_f32s(1e-3));
            let shows = simd.select_f32s(has_front, back_shows, simd.splat_f32s(1.0));
            for p in 0..3 {
                let over = fma(simd, light[p], front.open, front.color[p]);
                let ahead = simd.select_f32s(has_front, alone[p], over);
                let both = fma(simd, simd.sub_f32s(over, ahead), shows, ahead);
                light[p] = simd.select_f32s(has_back, both, alone[p]);
            }
        }
        light
    }

    /// What the layers have of surfaces of about this CoC, or all of them where they are `of_one_surface`, as if nothing else were
    /// there, and where that does not fill a pixel.
    #[inline(always)]
    fn own_surface<S: Simd>(
        &self,
        simd: S,
        coc_px: S::f32s,
        of_one_surface: bool,
        x: usize,
    ) -> ([S::f32s; 3], S::m32s) {
        let (zero, one, two) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0), simd.splat_f32s(2.0));
        let mut pile = Pile::new(simd);
        let inverse = simd.div_f32s(one, simd.add_f32s(simd.abs_f32s(coc_px), one));
        let slack = simd.min_f32s(simd.max_f32s(simd.neg_f32s(coc_px), zero), simd.splat_f32s(0.5));
        for (planes, &(low_px, high_px)) in self.planes[..self.count].iter().zip(&self.ranges_px) {
            let mut layer = layer(simd, planes, x);
            if !of_one_surface {
                // In front, what is nearer is blurred more, and so reaches farther.
                let farther = simd.mul_f32s(simd.sub_f32s(simd.splat_f32s(low_px), coc_px), inverse);
                let nearer = simd.mul_f32s(simd.sub_f32s(coc_px, simd.splat_f32s(high_px)), inverse);
                let step = simd.max_f32s(farther, simd.sub_f32s(nearer, slack));
                let weight = simd.sub_f32s(two, simd.mul_f32s(two, step));
                let weight = simd.min_f32s(simd.max_f32s(weight, zero), one);
                for plane in &mut layer {
                    *plane = simd.mul_f32s(*plane, weight);
                }
            }
            pile.add(simd, layer);
        }
        let covered = simd.max_f32s(simd.sub_f32s(one, pile.open), simd.splat_f32s(1e-6));
        let inverse = simd.div_f32s(one, covered);
        for plane in &mut pile.color {
            *plane = simd.mul_f32s(*plane, inverse);
        }
        (pile.color, simd.less_than_f32s(covered, simd.splat_f32s(OWN_COVERAGE)))
    }
}
