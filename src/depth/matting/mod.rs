//! Matting along depth edges: which pixels show two surfaces at once, how much of each, and in which colours.
//!
//! A depth map has one sample a pixel, a camera's pixel is an area: on an outline it is a share of what is near and the
//! rest of what is far. Both surfaces have pure pixels close by, whose colours say how likely the mixed pixel's is for
//! each share (Bayesian matting, after Chuang et al. 2001), and the map says which shares are likely before that.
//! Everything is local, from one frame, and in time that grows with the length of the outlines.

mod clusters;
pub mod mask;
mod share;
mod survey;
mod symmetric;
mod trace;

use std::ops::Range;

use pulp::{Arch, WithSimd};

use crate::color::light_of_codes;
use crate::compute::bands;
use crate::compute::thread_pool::{MOST_ITEMS, ThreadPool};
use crate::frame::{ColorImage, DepthMap, Matte, MixedPixel};

use clusters::{Clusters, View};
use share::{Evidence, Labels, Prior};
use survey::Survey;
use trace::{Trace, Trail};

/// Where the CoC jumps by so many pixels or more, pixels are worth taking apart.
pub const FROM_PX: f32 = 0.5;
/// Shares beyond this are those of a pure pixel.
const NEARLY_PURE: f32 = 0.98;

/// What the map says of pixels that were traced: nothing.
const TRACED: Labels = Labels { is_near: false, borders: false, is_thin: false };
/// So many pixels away from an edge, at most.
const MOST_STEPS: usize = 16;
/// Fewer pixels are not worth another thread.
const LEAST_PIXELS: usize = 256;

/// Estimates mattes; owns the memory for it.
#[derive(Debug)]
pub struct Matting {
    arch: Arch,
    light: Box<[f32; 256]>,
    /// Whether pixels differ in depth from one of their eight neighbours: the others are pure.
    at_edge: Vec<bool>,
    survey: Survey,
    /// The pixels at edges, and then those that were traced.
    edges: Vec<EdgePixel>,
    clusters: Clusters,
    /// The place of the answer for each.
    answers: Vec<u32>,
    evidence: Vec<Evidence>,
    /// What is known of pixels that were traced, while they are.
    trails: Vec<Trail>,
}

/// A pixel beside a jump of depth.
#[derive(Clone, Copy, Debug, Default)]
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
            arch: Arch::new(),
            light: light_of_codes(),
            at_edge: Vec::new(),
            survey: Survey::default(),
            edges: Vec::new(),
            clusters: Clusters::default(),
            answers: Vec::new(),
            evidence: Vec::new(),
            trails: Vec::new(),
        }
    }
}

impl Matting {
    /// Finds the mixed pixels of a map as large as its picture, beside jumps of inverse depth of more than `jump`, in 1/m.
    /// Of another size, or where `jump` is not finite, or with more edges than [`Matte::most`], it has none.
    pub fn find(&mut self, map: &mut DepthMap, color: &ColorImage, jump: f32) {
        self.find_before(&mut ThreadPool::new("matte", 1), (map, color), jump, |_, _| None);
    }

    /// The same on several threads, where `behind` may know the light behind a pixel, by its place and the inverse depth of its
    /// nearer surface. The matte is the same to the bit for any number of threads.
    pub fn find_before(
        &mut self,
        workers: &mut ThreadPool,
        (map, color): (&mut DepthMap, &ColorImage),
        jump: f32,
        behind: impl Fn(usize, f32) -> Option<[f32; 3]> + Sync,
    ) {
        map.matte.pixels.clear();
        if map.size() != color.size() || map.metres.is_empty() || !jump.is_finite() {
            return;
        }
        let Self { arch, light, at_edge, survey, edges, clusters, answers, evidence, trails } = self;
        let arch = *arch;
        survey.find((arch, workers), map, jump, (at_edge, edges));
        let size = (map.width as usize, map.height as usize);
        let most = Matte::most(size.0, size.1);
        if edges.len() > most {
            // Noise: so many edges no picture has.
            return;
        }
        clusters.clear(size);
        answers.clear();
        answers.extend(edges.iter().map(|edge| clusters.ask(jump, edge)));
        let (metres, matte, rgb) = (&map.metres, &mut map.matte, &color.rgb[..]);
        clusters.find((arch, workers), &View { size, metres, jump, at_edge, rgb, light }, 0);
        // Those between surfaces of which one has no pixels tell nothing.
        let mut kept = 0;
        for k in 0..edges.len() {
            if clusters.at(answers[k]).is_some() {
                (edges[kept], answers[kept]) = (edges[k], answers[k]);
                kept += 1;
            }
        }
        edges.truncate(kept);
        answers.truncate(kept);
        let (mut compared, mut prior, mut steps) = (0..0, Prior::default(), 0);
        loop {
            let (found, is_traced) = (compared.end..edges.len(), steps > 0);
            evidence.resize(found.end, Evidence::default());
            let each = bands::share(found.len(), LEAST_PIXELS);
            let view = View { size, metres, jump, at_edge, rgb, light };
            let asked = edges[found.clone()].chunks(each).zip(answers[found.clone()].chunks(each));
            let parts = asked.zip(evidence[found.clone()].chunks_mut(each));
            workers.run_each(parts, &|((edges, answers), evidence)| {
                let (view, behind) = (&view, &behind);
                arch.dispatch(Compare { view, clusters, behind, is_traced, edges, answers, evidence });
            });
            if !is_traced {
                prior = Prior::of(evidence);
            }
            compared = found;
            if compared.is_empty() || compared.end >= most || steps == MOST_STEPS {
                break;
            }
            let (prior, evidence) = (&prior, &evidence[compared.clone()]);
            let workers = &mut *workers;
            arch.dispatch(Trace {
                arch,
                workers,
                prior,
                size,
                metres,
                jump,
                rgb,
                light,
                at_edge,
                clusters,
                evidence,
                edges,
                answers,
            });
            steps += 1;
        }
        trace::drop_wide(size, kept, &prior, (evidence, trails));
        let has_traced = evidence.len() > kept;

        let each = bands::share(evidence.len(), LEAST_PIXELS);
        let (mut counts, light) = ([0; MOST_ITEMS], &**light);
        matte.pixels.resize(evidence.len(), MixedPixel::default());
        let parts = evidence.chunks(each).zip(matte.pixels.chunks_mut(each)).zip(&mut counts);
        workers.run_each(parts, &|((evidence, pixels), count)| {
            let (rgb, width) = (&color.rgb, size.0);
            *count = arch.dispatch(Mix { prior: &prior, clusters, light, rgb, width, evidence, pixels });
        });
        let mut kept = 0;
        for (first, count) in (0..).step_by(each).zip(counts).take_while(|(first, _)| *first < evidence.len()) {
            matte.pixels.copy_within(first..first + count, kept);
            kept += count;
        }
        matte.pixels.truncate(kept);
        if has_traced {
            matte.pixels.sort_unstable_by_key(|pixel| pixel.at);
        }
    }
}

/// Compares pixels at edges with the surfaces around them.
struct Compare<'a, B> {
    view: &'a View<'a>,
    clusters: &'a Clusters,
    behind: &'a B,
    is_traced: bool,
    edges: &'a [EdgePixel],
    answers: &'a [u32],
    evidence: &'a mut [Evidence],
}

impl<B: Fn(usize, f32) -> Option<[f32; 3]>> WithSimd for Compare<'_, B> {
    type Output = ();
    // No vectors by hand: the call has the compiler use what the processor has, in all that it takes in. Loops, not closures for
    // iterators, which would not have them.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { view, clusters, behind, is_traced, edges, answers, evidence } = self;
        for ((edge, &answer), evidence) in edges.iter().zip(answers).zip(evidence) {
            let Some(contrast) = clusters.at(answer) else { continue };
            let at = edge.y as usize * view.size.0 + edge.x as usize;
            let lights = (view.light(at), behind(at, edge.near));
            let labels = if is_traced { TRACED } else { labels(view, edge, at) };
            *evidence = Evidence::new(edge, labels, lights, (answer, contrast));
        }
    }
}

/// Writes the mixed pixels of all that are known; how many they are.
struct Mix<'a> {
    prior: &'a Prior,
    clusters: &'a Clusters,
    light: &'a [f32; 256],
    rgb: &'a [u8],
    width: usize,
    evidence: &'a [Evidence],
    pixels: &'a mut [MixedPixel],
}

impl WithSimd for Mix<'_> {
    type Output = usize;
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> usize {
        let Self { prior, clusters, light, rgb, width, evidence, pixels } = self;
        let mut count = 0;
        for one in evidence {
            let share = prior.share(one);
            let pure = if one.labels.is_near { share > NEARLY_PURE } else { share < 1.0 - NEARLY_PURE };
            let Some(contrast) = clusters.at(one.answer).filter(|_| !pure) else { continue };
            let at = one.edge.y as usize * width + one.edge.x as usize;
            let own = light_of(light, rgb, at);
            let (behind, difference) = match one.behind {
                Some(light) => (1.0, contrast.difference_before(light, own, share)),
                None => (1.0 - share, contrast.difference(own, share)),
            };
            let (near_m, far_m) = (one.edge.near.recip(), one.edge.far.recip());
            pixels[count] = MixedPixel { at: at as u32, near_m, far_m, share, behind, difference };
            count += 1;
        }
        count
    }
}

/// The colour of a pixel in linear light.
#[inline(always)]
fn light_of(light: &[f32; 256], rgb: &[u8], at: usize) -> [f32; 3] {
    [0, 1, 2].map(|p| light[usize::from(rgb[3 * at + p])])
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

/// The larger of two numbers: one instruction, unlike `f32::max`, which looks for what is no number.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}
