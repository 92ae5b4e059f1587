//! Thin things beyond the edges of the map.

use pulp::{Arch, WithSimd};

use super::clusters::{Clusters, View};
use super::share::{Evidence, Labels, Prior};
use super::{EdgePixel, around};
use crate::compute::thread_pool::ThreadPool;
use crate::frame::DepthMap;

/// Neighbours of a pixel with this share are looked at, too, where the map has no edge.
const TRACED_FROM: f32 = 0.15;
/// What the map says of them: nothing.
const TRACED: Labels = Labels { is_near: false, borders: false, is_thin: false };
/// So many pixels away from an edge, at most.
const MOST_STEPS: usize = 16;

/// What is known of a pixel that was traced: it has nothing of what is near, it has some, it is part of something wide.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub enum Trail {
    #[default]
    None,
    Faint,
    Seen,
    Wide,
}

/// Where thin things are looked for.
pub struct Search<'a, B> {
    /// Columns and rows.
    pub size: (usize, usize),
    /// No further where there are so many pixels already.
    pub most: usize,
    /// As in a [`View`].
    pub metres: &'a [f32],
    pub rgb: &'a [u8],
    pub light: &'a [f32; 256],
    pub jump: f32,
    /// As for [`Matting::find_before`](super::Matting::find_before).
    pub behind: &'a B,
}

impl<B: Fn(usize, f32) -> Option<[f32; 3]>> Search<'_, B> {
    /// Follows thin things, such as hair, to where the depth map has nothing of them: from pixels that show something near
    /// though the map has none there, to neighbours that do so, too (hysteresis, as edges are traced). One after the other, as
    /// each changes what the next one sees.
    pub fn trace(
        self,
        (arch, workers): (Arch, &mut ThreadPool),
        prior: &Prior,
        at_edge: &mut [bool],
        clusters: &mut Clusters,
        evidence: &mut Vec<Evidence>,
    ) {
        arch.dispatch(Trace { search: self, arch, workers, prior, at_edge, clusters, evidence });
    }
}

/// See [`Search::trace`].
struct Trace<'a, B> {
    search: Search<'a, B>,
    arch: Arch,
    workers: &'a mut ThreadPool,
    prior: &'a Prior,
    at_edge: &'a mut [bool],
    clusters: &'a mut Clusters,
    evidence: &'a mut Vec<Evidence>,
}

impl<B: Fn(usize, f32) -> Option<[f32; 3]>> WithSimd for Trace<'_, B> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { search, arch, workers, prior, at_edge, clusters, evidence } = self;
        let Search { size, most, metres, rgb, light, jump, behind } = search;
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
                        let asked = clusters.asked();
                        let answer = clusters.ask(jump, &next);
                        if answer as usize == asked {
                            clusters.find((arch, workers), &view, asked);
                        }
                        if let Some(contrast) = clusters.at(answer) {
                            let lights = (view.light(at), behind(at, next.near));
                            evidence.push(Evidence::new(&next, TRACED, lights, (answer, contrast)));
                        }
                    }
                }
            }
            (from, steps) = (end, steps + 1);
        }
    }
}

/// Lets go of what was traced, those after the first `on_edges`, into something far that looks like what is near: a hair
/// nowhere fills a square of three pixels, as a picture's frame does.
pub fn drop_wide(
    size: (usize, usize),
    on_edges: usize,
    prior: &Prior,
    (evidence, trails): (&mut Vec<Evidence>, &mut Vec<Trail>),
) {
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
    let mut kept = on_edges;
    for k in on_edges..evidence.len() {
        if std::mem::take(&mut trails[place(&evidence[k])]) != Trail::Wide {
            evidence[kept] = evidence[k];
            kept += 1;
        }
    }
    evidence.truncate(kept);
}
