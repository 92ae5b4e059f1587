//! Thin things beyond the edges of the map.

use pulp::{Arch, WithSimd};

use super::clusters::{Clusters, View};
use super::share::{Evidence, Prior};
use super::{EdgePixel, around};
use crate::compute::thread_pool::ThreadPool;
use crate::frame::DepthMap;

/// Neighbours of a pixel with this share are looked at, too, where the map has no edge.
const TRACED_FROM: f32 = 0.15;

/// What is known of a pixel that was traced: it has nothing of what is near, it has some, it is part of something wide.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub enum Trail {
    #[default]
    None,
    Faint,
    Seen,
    Wide,
}

/// Follows thin things, such as hair, to where the depth map has nothing of them: from pixels that show something near though
/// the map has none there, to neighbours that do so, too (hysteresis, as edges are traced).
pub struct Trace<'a> {
    pub arch: Arch,
    pub workers: &'a mut ThreadPool,
    pub prior: &'a Prior,
    /// As in a [`View`].
    pub size: (usize, usize),
    pub metres: &'a [f32],
    pub jump: f32,
    pub rgb: &'a [u8],
    pub light: &'a [f32; 256],
    pub at_edge: &'a mut [bool],
    pub clusters: &'a mut Clusters,
    pub evidence: &'a [Evidence],
    /// Adds to these the pixels one step away from the evidence, and their answers.
    pub edges: &'a mut Vec<EdgePixel>,
    pub answers: &'a mut Vec<u32>,
}

impl WithSimd for Trace<'_> {
    type Output = ();
    // One after the other, as the clusters that one needs are made of what is marked until then.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { arch, workers, prior, size, metres, jump, rgb, light, at_edge, clusters, evidence, .. } = self;
        for one in evidence {
            if one.labels.is_near || prior.share(one) < TRACED_FROM {
                continue;
            }
            let (xs, ys) = around(&one.edge, 1, size);
            for y in ys {
                for x in xs.clone() {
                    let (at, next) = (y * size.0 + x, EdgePixel { x: x as u32, y: y as u32, ..one.edge });
                    let is_far = (DepthMap::inverse_of(metres[at]) - next.far).abs() <= jump;
                    if !is_far || std::mem::replace(&mut at_edge[at], true) {
                        continue;
                    }
                    let asked = clusters.asked();
                    let answer = clusters.ask(jump, &next);
                    if answer as usize == asked {
                        clusters.find((arch, workers), &View { size, metres, jump, at_edge, rgb, light }, asked);
                    }
                    if clusters.at(answer).is_some() {
                        self.edges.push(next);
                        self.answers.push(answer);
                    }
                }
            }
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
