//! What is around the edge pixels of a cell: the same for all of them that lie between the same surfaces.

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::super::EdgePixel;
use super::super::contrast::Contrast;
use super::cell::split;
use super::{CELL_PX, Cluster, FRINGE, Sums, Surfaces, View, contrast};
use crate::compute::bands;
use crate::compute::thread_pool::ThreadPool;

/// So many cells in every direction are looked at; more where they have nothing of a surface, as at the tips of hair.
pub(in super::super) const REACHES_CELLS: [usize; 3] = [1, 2, 5];
/// A cluster's weight falls to an eighth at this distance, in pixels; its long tail reaches hair.
pub(in super::super) const HALF_PX: f32 = 6.0;
/// So many pixels of the fringe, near ones above all, tell nothing, as a lone hair is mostly what is behind it; so many are enough.
pub(in super::super) const FRINGE_PIXELS: [f32; 2] = [6.0, 14.0];
/// Fewer cells, and answers, are not worth another thread.
const LEAST_CELLS: usize = 16;
const LEAST_ANSWERS: usize = 32;

/// The clusters near edges, made once an answer needs them.
#[derive(Debug, Default)]
pub struct Clusters {
    across: usize,
    down: usize,
    /// Per cell, the place of its clusters plus one; 0 where none were made yet.
    place: Vec<u32>,
    /// Near, far, and what of the near surface is at edges.
    clusters: Vec<[Cluster; 3]>,
    /// The cells of the clusters.
    cells: Vec<u32>,
    /// Per cell, the place of its last answer plus one: pixels side by side ask for the same.
    answered: Vec<u32>,
    answers: Vec<Answer>,
}

/// What is around the cell of an edge pixel, between its near and its far surface; none where one of these has no pixels, not
/// even further away.
#[derive(Clone, Copy, Debug)]
struct Answer {
    edge: EdgePixel,
    contrast: Option<Contrast>,
}

impl Clusters {
    /// Forgets the frame before.
    pub(in super::super) fn clear(&mut self, (width, height): (usize, usize)) {
        (self.across, self.down) = (width.div_ceil(CELL_PX), height.div_ceil(CELL_PX));
        for places in [&mut self.place, &mut self.answered] {
            places.clear();
            places.resize(self.across * self.down, 0);
        }
        self.clusters.clear();
        self.cells.clear();
        self.answers.clear();
    }

    /// The place of the answer for an edge pixel: that of the pixels before it in its cell, where its surfaces are as far, or a
    /// new one, for [`Self::find`].
    #[inline(always)]
    pub(in super::super) fn ask(&mut self, jump: f32, edge: &EdgePixel) -> u32 {
        let answered = &mut self.answered[edge.y as usize / CELL_PX * self.across + edge.x as usize / CELL_PX];
        let same =
            |Answer { edge: e, .. }: &Answer| (e.near - edge.near).abs() <= jump && (e.far - edge.far).abs() <= jump;
        if let Some(last) = answered.checked_sub(1).filter(|&last| same(&self.answers[last as usize])) {
            return last;
        }
        self.answers.push(Answer { edge: *edge, contrast: None });
        *answered = self.answers.len() as u32;
        *answered - 1
    }

    /// How many answers there are.
    pub(in super::super) fn asked(&self) -> usize {
        self.answers.len()
    }

    /// Finds the contrasts of all answers from a place on.
    pub(in super::super) fn find(&mut self, (arch, workers): (Arch, &mut ThreadPool), view: &View, from: usize) {
        let Self { across, down, place, clusters, cells, answers, .. } = self;
        let (across, down, answers) = (*across, *down, &mut answers[from..]);
        for reach in REACHES_CELLS {
            if answers.iter().all(|answer| answer.contrast.is_some()) {
                break;
            }
            let made = clusters.len();
            for Answer { edge, .. } in answers.iter().filter(|answer| answer.contrast.is_none()) {
                let (columns, rows) = cells_around(edge, reach, (across, down));
                for cell in rows.flat_map(|row| columns.clone().map(move |column| row * across + column)) {
                    if place[cell] == 0 {
                        cells.push(cell as u32);
                        place[cell] = cells.len() as u32;
                    }
                }
            }
            clusters.resize(cells.len(), Default::default());
            let new = &cells[made..];
            let each = bands::share(new.len(), LEAST_CELLS);
            workers.run_each(new.chunks(each).zip(clusters[made..].chunks_mut(each)), &|(cells, clusters)| {
                arch.dispatch(SplitCells { view, across, cells, clusters });
            });
            let surroundings = Surroundings { across, down, place, clusters };
            let each = bands::share(answers.len(), LEAST_ANSWERS);
            workers.run_each(answers.chunks_mut(each), &|answers| {
                arch.dispatch(FindContrasts { surroundings, view, reach, answers });
            });
        }
    }

    /// The contrast of an answer, if one was found.
    #[inline(always)]
    pub(in super::super) fn at(&self, answer: u32) -> Option<&Contrast> {
        self.answers[answer as usize].contrast.as_ref()
    }
}

/// The columns and rows of the cells around that of an edge pixel, so many in every direction.
#[inline(always)]
fn cells_around(edge: &EdgePixel, reach: usize, (across, down): (usize, usize)) -> (Range<usize>, Range<usize>) {
    let (column, row) = (edge.x as usize / CELL_PX, edge.y as usize / CELL_PX);
    (
        column.saturating_sub(reach)..(column + reach + 1).min(across),
        row.saturating_sub(reach)..(row + reach + 1).min(down),
    )
}

/// Makes the clusters of cells.
struct SplitCells<'a> {
    view: &'a View<'a>,
    across: usize,
    cells: &'a [u32],
    clusters: &'a mut [[Cluster; 3]],
}

impl WithSimd for SplitCells<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { view, across, cells, clusters } = self;
        for (&cell, clusters) in cells.iter().zip(clusters) {
            *clusters = split(simd, view, cell as usize % across, cell as usize / across);
        }
    }
}

/// Finds the contrasts that answers lack, in cells that were made.
struct FindContrasts<'a> {
    surroundings: Surroundings<'a>,
    view: &'a View<'a>,
    reach: usize,
    answers: &'a mut [Answer],
}

impl WithSimd for FindContrasts<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { surroundings, view, reach, answers } = self;
        for answer in answers {
            if answer.contrast.is_none() {
                // A closure would not have the vectors of what calls it.
                if let Some(surfaces) = surroundings.within(view, reach, &answer.edge) {
                    answer.contrast = Some(contrast(surfaces));
                }
            }
        }
    }
}

/// Clusters that were made.
#[derive(Clone, Copy)]
struct Surroundings<'a> {
    across: usize,
    down: usize,
    place: &'a [u32],
    clusters: &'a [[Cluster; 3]],
}

impl Surroundings<'_> {
    /// The surfaces around an edge pixel in so many cells in every direction.
    #[inline(always)]
    fn within(&self, view: &View, reach: usize, edge: &EdgePixel) -> Option<Surfaces> {
        // A surface's inverse depth may change on the way, but by less than would make it the other one.
        let tolerance = (2.0 * view.jump).max(0.25 * (edge.near - edge.far));
        let (column, row) = (edge.x as usize / CELL_PX, edge.y as usize / CELL_PX);
        let [x, y] = [column, row].map(|cell| (cell * CELL_PX) as f32 + 0.5 * (CELL_PX - 1) as f32);
        let mut sums = [Sums::default(); 3];
        let (columns, rows) = cells_around(edge, reach, (self.across, self.down));
        for row in rows {
            for column in columns.clone() {
                let place = self.place[row * self.across + column] as usize - 1;
                for (k, cluster) in self.clusters[place].iter().enumerate() {
                    let is_near = edge.is_near(cluster.inverse);
                    let is_fringe = k == FRINGE;
                    let surface = if is_near { edge.near } else { edge.far };
                    let is_other = (cluster.inverse - surface).abs() > tolerance || is_fringe && !is_near;
                    if cluster.sums.weight() <= 0.0 || is_other {
                        continue;
                    }
                    let square = (cluster.x - x) * (cluster.x - x) + (cluster.y - y) * (cluster.y - y);
                    let falloff = 1.0 / (1.0 + square / (HALF_PX * HALF_PX));
                    let weight = falloff * falloff * falloff;
                    sums[if is_fringe { FRINGE } else { usize::from(!is_near) }].add(weight, &cluster.sums);
                }
            }
        }
        let [near, far, fringe] = sums.map(|sum| (sum.weight() > 0.0).then(|| sum.color()));
        let [few, enough] = FRINGE_PIXELS;
        let weight = ((sums[FRINGE].weight() - few) / (enough - few)).clamp(0.0, 1.0);
        Some(Surfaces { near: near?, far: far?, fringe: fringe.zip(Some(weight)) })
    }
}
