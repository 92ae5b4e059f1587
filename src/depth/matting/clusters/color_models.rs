//! Colour models around edge pixels: pixels of one cell between the same surfaces share one model.
//! twin: shaders/matte/surfaces.wgsl, matte/enter.wgsl

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::super::EdgePixel;
use super::super::contrast::Contrast;
use super::cell::cluster_cell;
use super::{CELL_PX, Cluster, FRINGE, FrameView, Sums, Surfaces, compute_contrast};
use crate::compute::bands;
use crate::compute::thread_pool::ThreadPool;

/// Search radii in cells: the next one is used if a surface has no pixels, as at the tips of hair.
pub(in super::super) const RADII_CELLS: [usize; 3] = [1, 2, 5];
/// Distance, in pixels, at which a cluster's weight falls to an eighth; its long tail covers hair.
pub(in super::super) const FALLOFF_PX: f32 = 7.0;
/// Weights of the fringe from which it starts to count, and from which it counts fully: a lone hair is mostly
/// background.
pub(in super::super) const FRINGE_PIXELS: [f32; 2] = [6.0, 14.0];
/// Minimum number of cells, and of models, per thread.
const MIN_CELLS: usize = 16;
const MIN_MODELS: usize = 32;

/// The clusters near edges, created on demand, and the colour models.
#[derive(Debug, Default)]
pub struct Clusters {
    across: usize,
    down: usize,
    /// Per cell, the index of its clusters plus one; 0 if not created.
    place: Vec<u32>,
    /// Clusters of the near surface, of the far one, and of the near one's edge pixels.
    clusters: Vec<[Cluster; 3]>,
    /// The cell of each entry of `clusters`.
    cells: Vec<u32>,
    /// Per cell, the index of its latest model plus one; neighbouring pixels mostly share it.
    latest_model: Vec<u32>,
    models: Vec<ColorModel>,
}

/// The colour model around the cell of an edge pixel; `contrast` is `None` if one of the surfaces has no pixels in any
/// radius.
#[derive(Clone, Copy, Debug)]
struct ColorModel {
    edge: EdgePixel,
    contrast: Option<Contrast>,
}

impl Clusters {
    /// Removes the models of the previous frame.
    pub(in super::super) fn clear(&mut self, (width, height): (usize, usize)) {
        (self.across, self.down) = (width.div_ceil(CELL_PX), height.div_ceil(CELL_PX));
        for places in [&mut self.place, &mut self.latest_model] {
            places.clear();
            places.resize(self.across * self.down, 0);
        }
        self.clusters.clear();
        self.cells.clear();
        self.models.clear();
    }

    /// Returns the index of the model for an edge pixel: the latest one of its cell if the surfaces are as far, or a
    /// new one, to be fitted by [`Self::fit_models`].
    #[inline(always)]
    pub(in super::super) fn request_model(&mut self, depth_step: f32, edge: &EdgePixel) -> u32 {
        let latest_model = &mut self.latest_model[edge.y as usize / CELL_PX * self.across + edge.x as usize / CELL_PX];
        let same = |ColorModel { edge: e, .. }: &ColorModel| {
            (e.near - edge.near).abs() <= depth_step && (e.far - edge.far).abs() <= depth_step
        };
        if let Some(last) = latest_model.checked_sub(1).filter(|&last| same(&self.models[last as usize])) {
            return last;
        }
        self.models.push(ColorModel { edge: *edge, contrast: None });
        *latest_model = self.models.len() as u32;
        *latest_model - 1
    }

    /// Returns the number of models.
    pub(in super::super) fn model_count(&self) -> usize {
        self.models.len()
    }

    /// Fits all models from index `from` on.
    pub(in super::super) fn fit_models(
        &mut self,
        (arch, workers): (Arch, &mut ThreadPool),
        view: &FrameView,
        from: usize,
    ) {
        let Self { across, down, place, clusters, cells, models, .. } = self;
        let (across, down, models) = (*across, *down, &mut models[from..]);
        // Per radius: clusters the missing cells around the models without a contrast, and fits these models again.
        for radius in RADII_CELLS {
            if models.iter().all(|model| model.contrast.is_some()) {
                break;
            }
            let first_new = clusters.len();
            for ColorModel { edge, .. } in models.iter().filter(|model| model.contrast.is_none()) {
                let (columns, rows) = cells_around(edge, radius, (across, down));
                for cell in rows.flat_map(|row| columns.clone().map(move |column| row * across + column)) {
                    if place[cell] == 0 {
                        cells.push(cell as u32);
                        place[cell] = cells.len() as u32;
                    }
                }
            }
            clusters.resize(cells.len(), Default::default());
            let (new_cells, new_clusters) = (&cells[first_new..], &mut clusters[first_new..]);
            let each = bands::chunk_len(new_cells.len(), MIN_CELLS);
            workers.run_each(new_cells.chunks(each).zip(new_clusters.chunks_mut(each)), &|(cells, clusters)| {
                arch.dispatch(ClusterCells { view, across, cells, clusters });
            });
            let surroundings = Surroundings { across, down, place, clusters };
            let each = bands::chunk_len(models.len(), MIN_MODELS);
            workers.run_each(models.chunks_mut(each), &|models| {
                arch.dispatch(FitModels { surroundings, view, radius, models });
            });
        }
    }

    /// Returns the contrast of a model, if it has one.
    #[inline(always)]
    pub(in super::super) fn contrast(&self, model: u32) -> Option<&Contrast> {
        self.models[model as usize].contrast.as_ref()
    }
}

/// Returns the columns and rows of the cells within `radius` cells of an edge pixel's cell.
#[inline(always)]
fn cells_around(edge: &EdgePixel, radius: usize, (across, down): (usize, usize)) -> (Range<usize>, Range<usize>) {
    let (column, row) = (edge.x as usize / CELL_PX, edge.y as usize / CELL_PX);
    (
        column.saturating_sub(radius)..(column + radius + 1).min(across),
        row.saturating_sub(radius)..(row + radius + 1).min(down),
    )
}

/// Creates the clusters of cells.
struct ClusterCells<'a> {
    view: &'a FrameView<'a>,
    across: usize,
    cells: &'a [u32],
    clusters: &'a mut [[Cluster; 3]],
}

impl WithSimd for ClusterCells<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { view, across, cells, clusters } = self;
        for (&cell, clusters) in cells.iter().zip(clusters) {
            *clusters = cluster_cell(simd, view, cell as usize % across, cell as usize / across);
        }
    }
}

/// Fits the models without a contrast, from clusters that exist.
struct FitModels<'a> {
    surroundings: Surroundings<'a>,
    view: &'a FrameView<'a>,
    radius: usize,
    models: &'a mut [ColorModel],
}

impl WithSimd for FitModels<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { surroundings, view, radius, models } = self;
        for model in models {
            if model.contrast.is_none() {
                // No closure: it would not be compiled for the caller's instruction set.
                if let Some(surfaces) = surroundings.surfaces_within(view, radius, &model.edge) {
                    model.contrast = Some(compute_contrast(surfaces));
                }
            }
        }
    }
}

/// Existing clusters around a cell.
#[derive(Clone, Copy)]
struct Surroundings<'a> {
    across: usize,
    down: usize,
    place: &'a [u32],
    clusters: &'a [[Cluster; 3]],
}

impl Surroundings<'_> {
    /// Returns the surfaces around an edge pixel, within `radius` cells.
    #[inline(always)]
    fn surfaces_within(&self, view: &FrameView, radius: usize, edge: &EdgePixel) -> Option<Surfaces> {
        // A surface's inverse depth may vary around, but not as far as to the other surface.
        let tolerance = (2.0 * view.depth_step).max(0.25 * (edge.near - edge.far));
        let (column, row) = (edge.x as usize / CELL_PX, edge.y as usize / CELL_PX);
        let [x, y] = [column, row].map(|cell| (cell * CELL_PX) as f32 + 0.5 * (CELL_PX - 1) as f32);
        let mut sums = [Sums::default(); 3];
        let (columns, rows) = cells_around(edge, radius, (self.across, self.down));
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
                    let falloff = 1.0 / (1.0 + square / (FALLOFF_PX * FALLOFF_PX));
                    let weight = falloff * falloff * falloff;
                    sums[if is_fringe { FRINGE } else { usize::from(!is_near) }].add(weight, &cluster.sums);
                }
            }
        }
        let [near, far, fringe] = sums.map(|sum| (sum.weight() > 0.0).then(|| sum.color()));
        let near = near.map(|color| color.with_uncertainty(sums[0].weight()));
        let [few, enough] = FRINGE_PIXELS;
        let weight = ((sums[FRINGE].weight() - few) / (enough - few)).clamp(0.0, 1.0);
        Some(Surfaces { near: near?, far: far?, fringe: fringe.zip(Some(weight)) })
    }
}
