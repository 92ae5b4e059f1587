//! Matting along depth edges: which pixels show two surfaces at once, how much of each, and in which colours.
//!
//! A depth map has one sample a pixel, a camera's pixel is an area: on an outline it is a share of what is near and the
//! rest of what is far. Both surfaces have pure pixels close by, whose colours say how likely the mixed pixel's is for
//! each share (Bayesian matting, after Chuang et al. 2001), and the map says which shares are likely before that.
//! Everything is local, from one frame, and in time that grows with the length of the outlines.

mod clusters;
pub mod mask;
mod share;

use std::ops::Range;

use pulp::WithSimd;

use crate::color::light_of_codes;
use crate::frame::{ColorImage, DepthMap, Matte, MixedPixel};

use clusters::{Clusters, View};
use share::{Evidence, Labels, Prior};

/// Where the CoC jumps by so many pixels or more, pixels are worth taking apart.
pub const FROM_PX: f32 = 0.5;
/// Shares beyond this are those of a pure pixel.
const NEARLY_PURE: f32 = 0.98;

/// Neighbours of a pixel with this share are looked at, too, where the map has no edge.
const TRACED_FROM: f32 = 0.15;
/// What the map says of them: nothing.
const TRACED: Labels = Labels { is_near: false, borders: false, is_thin: false };
/// Pixels of a row that are looked at at once.
const BLOCK: usize = 64;
/// So many pixels away from an edge, at most.
const MOST_STEPS: usize = 16;

/// What is known of a pixel that was traced: it has nothing of what is near, it has some, it is part of something wide.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
enum Trail {
    #[default]
    None,
    Faint,
    Seen,
    Wide,
}

/// Estimates mattes; owns the memory for it.
#[derive(Debug)]
pub struct Matting {
    light: Box<[f32; 256]>,
    /// Whether pixels differ in depth from one of their eight neighbours: the others are pure.
    at_edge: Vec<bool>,
    /// Inverse depth of three rows, in 1/m, 0 where it is unknown; their highest and lowest, with a column more on either side.
    rows: [Vec<f32>; 3],
    ranges: [Vec<f32>; 2],
    edges: Vec<EdgePixel>,
    clusters: Clusters,
    evidence: Vec<Evidence>,
    /// What is known of pixels that were traced, while they are.
    trails: Vec<Trail>,
}

/// A pixel beside a jump of depth.
#[derive(Clone, Copy, Debug)]
struct EdgePixel {
    x: u32,
    y: u32,
    /// Inverse depth of the nearest and the farthest of the pixel and its neighbours, in 1/m.
    near: f32,
    far: f32,
}

impl EdgePixel {
    /// Whether an inverse depth is closer to that of the near surface.
    #[inline(always)]
    fn is_near(&self, inverse: f32) -> bool {
        inverse > 0.5 * (self.near + self.far)
    }
}

impl Default for Matting {
    fn default() -> Self {
        Self {
            light: light_of_codes(),
            at_edge: Vec::new(),
            rows: Default::default(),
            ranges: [Vec::new(), Vec::new()],
            edges: Vec::new(),
            clusters: Clusters::default(),
            evidence: Vec::new(),
            trails: Vec::new(),
        }
    }
}

impl Matting {
    /// Finds the mixed pixels of a map as large as its picture, beside jumps of inverse depth of more than `jump`, in 1/m.
    /// Of another size, or where `jump` is not finite, or with more edges than [`Matte::most`], it has none.
    pub fn find(&mut self, map: &mut DepthMap, color: &ColorImage, jump: f32) {
        self.find_before(map, color, jump, |_, _| None);
    }

    /// The same where `behind` may know the light behind a pixel, by its place and the inverse depth of its nearer surface.
    pub fn find_before(
        &mut self,
        map: &mut DepthMap,
        color: &ColorImage,
        jump: f32,
        behind: impl Fn(usize, f32) -> Option<[f32; 3]>,
    ) {
        pulp::Arch::new().dispatch(Find { matting: self, map, color, jump, behind });
    }

    #[inline(always)]
    fn find_now<S: pulp::Simd>(
        &mut self,
        simd: S,
        (map, color): (&mut DepthMap, &ColorImage),
        jump: f32,
        behind: impl Fn(usize, f32) -> Option<[f32; 3]>,
    ) {
        map.matte.pixels.clear();
        if map.size() != color.size() || map.metres.is_empty() || !jump.is_finite() {
            return;
        }
        Survey { matting: self, map, jump }.with_simd(simd);
        let size = (map.width as usize, map.height as usize);
        let most = Matte::most(size.0, size.1);
        if self.edges.len() > most {
            // Noise: so many edges no picture has.
            return;
        }
        self.clusters.clear(size);
        self.evidence.clear();
        let Self { light, at_edge, edges, clusters, evidence, .. } = self;
        let view = View { size, metres: &map.metres, jump, at_edge, rgb: &color.rgb, light };
        // Loops, not closures for iterators, which would not have the vectors of this function.
        for edge in &*edges {
            let Some(place) = clusters.around(&view, edge) else { continue };
            let at = edge.y as usize * size.0 + edge.x as usize;
            let lights = (view.light(at), behind(at, edge.near));
            evidence.push(Evidence::new(edge, labels(&view, edge, at), lights, (place, clusters.at(place))));
        }
        let prior = Prior::of(&self.evidence);
        let on_edges = self.evidence.len();
        self.trace((size, most), jump, &prior, (&map.metres, &color.rgb, &behind));
        self.drop_wide(size, on_edges, &prior);
        let Self { light, at_edge, clusters, evidence, .. } = self;
        let view = View { size, metres: &map.metres, jump, at_edge, rgb: &color.rgb, light };
        for evidence in &*evidence {
            let share = prior.share(evidence);
            let pure = if evidence.labels.is_near { share > NEARLY_PURE } else { share < 1.0 - NEARLY_PURE };
            if pure {
                continue;
            }
            let at = evidence.edge.y as usize * size.0 + evidence.edge.x as usize;
            let (contrast, own) = (clusters.at(evidence.contrast), view.light(at));
            let (behind, difference) = match evidence.behind {
                Some(light) => (1.0, contrast.difference_before(light, own, share)),
                None => (1.0 - share, contrast.difference(own, share)),
            };
            let (near_m, far_m) = (evidence.edge.near.recip(), evidence.edge.far.recip());
            map.matte.pixels.push(MixedPixel { at: at as u32, near_m, far_m, share, behind, difference });
        }
        if self.evidence.len() > on_edges {
            map.matte.pixels.sort_unstable_by_key(|pixel| pixel.at);
        }
    }

    /// Follows thin things, such as hair, to where the depth map has nothing of them: from pixels that show something near
    /// though the map has none there, to neighbours that do so, too (hysteresis, as edges are traced); no further where there
    /// are `most` pixels already.
    #[inline(always)]
    fn trace(
        &mut self,
        (size, most): ((usize, usize), usize),
        jump: f32,
        prior: &Prior,
        (metres, rgb, behind): (&[f32], &[u8], &impl Fn(usize, f32) -> Option<[f32; 3]>),
    ) {
        let Self { light, at_edge, clusters, evidence, .. } = self;
        let (mut from, mut steps) = (0, 0);
        while from < evidence.len() && evidence.len() < most && steps < MOST_STEPS {
            let end = evidence.len();
            for k in from..end {
                let Evidence { edge, labels, .. } = evidence[k];
                if labels.is_near || prior.share(&evidence[k]) < TRACED_FROM {
                    continue;
                }
                let (xs, ys) = around(&edge, 1, size);
                for y in ys {
                    for x in xs.clone() {
                        let (at, next) = (y * size.0 + x, EdgePixel { x: x as u32, y: y as u32, ..edge });
                        let is_far = (DepthMap::inverse_of(metres[at]) - edge.far).abs() <= jump;
                        if !is_far || std::mem::replace(&mut at_edge[at], true) {
                            continue;
                        }
                        let view = View { size, metres, jump, at_edge, rgb, light };
                        if let Some(place) = clusters.around(&view, &next) {
                            let lights = (view.light(at), behind(at, next.near));
                            evidence.push(Evidence::new(&next, TRACED, lights, (place, clusters.at(place))));
                        }
                    }
                }
            }
            (from, steps) = (end, steps + 1);
        }
    }

    /// Lets go of what was traced, those after the first `on_edges`, into something far that looks like what is near: a hair
    /// nowhere fills a square of three pixels, as a picture's frame does.
    fn drop_wide(&mut self, size: (usize, usize), on_edges: usize, prior: &Prior) {
        let Self { evidence, trails, .. } = self;
        let at = |x: usize, y: usize| y * size.0 + x;
        let place = |one: &Evidence| at(one.edge.x as usize, one.edge.y as usize);
        trails.resize(size.0 * size.1, Trail::None);
        for one in &evidence[on_edges..] {
            trails[place(one)] = if prior.share(one) < TRACED_FROM { Trail::Faint } else { Trail::Seen };
        }
        for one in &evidence[on_edges..] {
            let (xs, ys) = around(&one.edge, 1, size);
            if !ys.flat_map(|y| xs.clone().map(move |x| at(x, y))).all(|at| trails[at] >= Trail::Seen) {
                continue;
            }
            // The outline of what is wide is part of it.
            let (xs, ys) = around(&one.edge, 2, size);
            for at in ys.flat_map(|y| xs.clone().map(move |x| at(x, y))) {
                if trails[at] != Trail::None {
                    trails[at] = Trail::Wide;
                }
            }
        }
        evidence.retain(|one| std::mem::take(&mut trails[place(one)]) != Trail::Wide);
    }
}

/// What the map says of the edge pixel `at` and its neighbours.
#[inline(always)]
fn labels(view: &View, edge: &EdgePixel, at: usize) -> Labels {
    let is_near = edge.is_near(view.inverse(at));
    let (mut borders, mut alike) = (false, 0);
    let (xs, ys) = around(edge, 1, view.size);
    for y in ys {
        for x in xs.clone() {
            let is_alike = edge.is_near(view.inverse(y * view.size.0 + x)) == is_near;
            alike += u32::from(is_alike);
            borders |= !is_alike && (x == edge.x as usize || y == edge.y as usize);
        }
    }
    // Itself, and two neighbours in a row.
    Labels { is_near, borders, is_thin: is_near && alike <= 3 }
}

/// The columns and rows of a pixel and those around it, `by` pixels to each side, as far as the picture has them.
#[inline(always)]
fn around(edge: &EdgePixel, by: usize, (width, height): (usize, usize)) -> (Range<usize>, Range<usize>) {
    let (x, y) = (edge.x as usize, edge.y as usize);
    (x.saturating_sub(by)..(x + by + 1).min(width), y.saturating_sub(by)..(y + by + 1).min(height))
}

/// See [`Matting::find_before`].
struct Find<'a, B> {
    matting: &'a mut Matting,
    map: &'a mut DepthMap,
    color: &'a ColorImage,
    jump: f32,
    behind: B,
}

impl<B: Fn(usize, f32) -> Option<[f32; 3]>> WithSimd for Find<'_, B> {
    type Output = ();
    // No vectors by hand: the call has the compiler use what the processor has, in all that it takes in.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { matting, map, color, jump, behind } = self;
        matting.find_now(simd, (map, color), jump, behind);
    }
}

/// Finds the pixels beside jumps of depth.
struct Survey<'a> {
    matting: &'a mut Matting,
    map: &'a DepthMap,
    jump: f32,
}

impl WithSimd for Survey<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { matting: Matting { at_edge, rows, ranges: [high, low], edges, .. }, map, jump } = self;
        let (width, height) = (map.width as usize, map.height as usize);
        at_edge.resize(width * height, false);
        edges.clear();
        rows.iter_mut().for_each(|row| row.resize(width, 0.0));
        for range in [&mut *high, &mut *low] {
            range.resize(width + 2, 0.0);
        }
        for y in 0..height {
            // The row below is new; before the first one, that itself is, too.
            for y in (if y == 0 { 0 } else { y + 1 })..(y + 2).min(height) {
                for (inverse, &metres) in rows[y % 3].iter_mut().zip(&map.metres[y * width..][..width]) {
                    *inverse = DepthMap::inverse_of(metres);
                }
            }
            let row = |y: usize| &rows[y % 3][..width];
            let (above, here, below) = (row(y.saturating_sub(1)), row(y), row((y + 1).min(height - 1)));
            let (most, least) = (&mut high[1..=width], &mut low[1..=width]);
            for x in 0..width {
                most[x] = larger(larger(above[x], here[x]), below[x]);
                least[x] = smaller(smaller(above[x], here[x]), below[x]);
            }
            for range in [&mut *high, &mut *low] {
                (range[0], range[width + 1]) = (range[1], range[width]);
            }
            let found = &mut at_edge[y * width..][..width];
            let [left, middle, right] = [0, 1, 2].map(|by| (&high[by..][..width], &low[by..][..width]));
            let around = |x: usize| {
                let near = larger(larger(left.0[x], middle.0[x]), right.0[x]);
                [near, smaller(smaller(left.1[x], middle.1[x]), right.1[x])]
            };
            for (x, found) in found.iter_mut().enumerate() {
                let [near, far] = around(x);
                *found = near - far > jump;
            }
            for (found, begin) in found.chunks(BLOCK).zip((0..).step_by(BLOCK)) {
                // `|` instead of an early exit, so that a block becomes vector code.
                if !found.iter().fold(false, |any, found| any | found) {
                    continue;
                }
                for x in (begin..).zip(found).filter(|(_, found)| **found).map(|(x, _)| x) {
                    let [near, far] = around(x);
                    edges.push(EdgePixel { x: x as u32, y: y as u32, near, far });
                }
            }
        }
    }
}

/// The larger of two numbers: one instruction, unlike `f32::max`, which looks for what is no number.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
