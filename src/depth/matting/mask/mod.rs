//! Matting from a mask of the nearer surface, such as a network's coarse and soft one.
//!
//! Where the mask is sure (the known regions of a trimap), cells gather means and covariances of both surfaces'
//! colours. Each other pixel is projected on Fisher's linear discriminant between them. Its alpha is the posterior
//! mean, with a prior from the mask for 0 and 1 and a uniform one between (Bayesian matting, Chuang et al. 2001).

mod backdrop;
mod cells;
mod connection;
mod models;
mod outline;
mod posterior;
mod rows;
mod separation;

use std::ops::Range;

pub use backdrop::BackgroundPlate;
pub use outline::{Outline, depth_from_mask};

use crate::color::srgb_to_linear_table;
use crate::depth::bitmap::Bitmap;
use crate::depth::tap::Tap;
use crate::frame::{ColorImage, DepthMap, Mask, Matte};
use cells::{Cell, MaskView, Run};
use connection::Connection;
use models::Models;
use posterior::Posterior;
use rows::RowBuffers;

/// Side of a cell in mask pixels, and its minimum in picture pixels.
const CELL_OF_MASK: f32 = 1.6;
const MIN_CELL_PX: usize = 4;
/// Minimum of mask and alpha for a seed of the near surface, and minimum alpha of pixels connected to one.
const NEAR_FROM: f32 = 0.6;
const CONNECTED_FROM: f32 = 0.15;
/// Distance from the unknown region, in cells, within which blur may reveal the background.
const REVEALED_CELLS: usize = 5;

/// Computes mattes from masks; owns the memory for it.
#[derive(Debug)]
pub struct MaskMatting {
    light: Box<[f32; 256]>,
    posterior: Posterior,
    /// Per column of the picture, the mask columns on both sides.
    columns: Vec<Tap>,
    cells: Vec<Cell>,
    /// Per column of cells, its mask columns, and per mask column, what is undecided in it.
    spans: Vec<Range<usize>>,
    undecided: Vec<u8>,
    runs: Vec<Run>,
    models: Models,
    buffers: RowBuffers,
    /// Alpha of the pixels in the unknown region, in raster order.
    alphas: Vec<f32>,
    connection: Connection,
    /// Cells whose background blur may reveal.
    revealed: Bitmap,
}

impl Default for MaskMatting {
    fn default() -> Self {
        Self {
            light: srgb_to_linear_table(),
            posterior: Posterior::new(),
            columns: Vec::new(),
            cells: Vec::new(),
            spans: Vec::new(),
            undecided: Vec::new(),
            runs: Vec::new(),
            models: Models::default(),
            buffers: RowBuffers::default(),
            alphas: Vec::new(),
            connection: Connection::default(),
            revealed: Bitmap::default(),
        }
    }
}

impl MaskMatting {
    /// Fills in the nearer surface of `map`, at [`DepthMap::SUBJECT_M`], where `mask` and the colours have it, and the
    /// mixed pixels between both. On entry, `map` is as large as its picture, and has the distance of the background
    /// everywhere. With a known background (`backdrop`), covered pixels near the outline become mixed pixels, too, with
    /// all of the background behind them.
    pub fn compute_matte(
        &mut self,
        mask: &Mask,
        color: &ColorImage,
        backdrop: Option<&BackgroundPlate>,
        map: &mut DepthMap,
    ) {
        self.compute_outlined(mask, (None, true), color, backdrop, map);
    }

    /// Does the same as [`MaskMatting::compute_matte`]. Where colours do not tell the surfaces apart, alpha is that of
    /// `given`, as large as the picture, if there is one; without `follows_color`, that is everywhere.
    fn compute_outlined(
        &mut self,
        mask: &Mask,
        (given, follows_color): (Option<&Mask>, bool),
        color: &ColorImage,
        backdrop: Option<&BackgroundPlate>,
        map: &mut DepthMap,
    ) {
        map.matte.pixels.clear();
        let (width, height) = (color.width as usize, color.height as usize);
        let backdrop = backdrop.filter(|backdrop| backdrop.color.size() == color.size());
        if map.size() != color.size() || mask.alpha.is_empty() || width * height == 0 {
            return;
        }
        pulp::Arch::new().dispatch(ComputeMatte { matting: self, mask, given, follows_color, color, backdrop, map });
    }
}

/// Arguments of [`MaskMatting::compute_outlined`].
struct ComputeMatte<'a> {
    matting: &'a mut MaskMatting,
    mask: &'a Mask,
    given: Option<&'a Mask>,
    follows_color: bool,
    color: &'a ColorImage,
    backdrop: Option<&'a BackgroundPlate<'a>>,
    map: &'a mut DepthMap,
}

impl pulp::WithSimd for ComputeMatte<'_> {
    type Output = ();
    // Few explicit vectors: the dispatch compiles these loops for the processor's instruction set.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { matting, mask, given, follows_color, color, backdrop, map } = self;
        let (width, height) = (color.width as usize, color.height as usize);
        let cell_px = ((CELL_OF_MASK * width as f32 / mask.width as f32).round() as usize).max(MIN_CELL_PX);
        let MaskMatting { columns, cells, runs, models, alphas, connection, revealed, .. } = matting;
        columns.clear();
        columns.extend((0..width).map(|x| Tap::new(x, width, mask.width as usize)));
        let (across, down) = (width.div_ceil(cell_px), height.div_ceil(cell_px));
        let light = &matting.light;
        let view = MaskView { mask, given, color, light, backdrop, columns, cell_px, across, down };
        view.classify_cells(cells, &mut matting.spans, &mut matting.undecided);
        view.find_runs(cells, runs);
        models.clear(cells.len());
        if follows_color {
            models.fit(simd, &view, cells);
        }
        alphas.clear();
        connection.clear((width, height));
        view.compute_alphas((runs, models, &matting.posterior), &mut matting.buffers, alphas, connection);
        connection.connect();
        if backdrop.is_some() {
            view.mark_around_band(cells, REVEALED_CELLS, revealed);
        }
        let mut alphas = alphas.as_slice();
        // In raster order, which is that of the matte's pixels, and of alpha.
        for runs in runs.chunk_by(|a, b| a.row == b.row) {
            for y in view.pixel_rows(runs[0].row) {
                for Run { cell, row, xs } in runs.iter().cloned() {
                    if cell == Cell::Band {
                        let (own, later) = alphas.split_at(xs.len());
                        alphas = later;
                        view.separate_pixels(models, (xs, y), (own, connection), map);
                        continue;
                    }
                    if let Some(backdrop) = backdrop {
                        for column in (xs.start / cell_px..across).take_while(|column| column * cell_px < xs.end) {
                            if revealed.has(column, row) {
                                view.add_background(backdrop, (view.pixel_columns(column), y), map);
                            }
                        }
                    }
                    map.metres[y * width..][xs].fill(DepthMap::SUBJECT_M);
                }
            }
        }
        if map.matte.pixels.len() > Matte::max_pixels(width, height) {
            map.matte.pixels.retain(|pixel| pixel.alpha < 1.0);
        }
    }
}
