//! Layout of the bins of a frame in the buffers that all bins share, and the batches that are filtered together.

use std::ops::Range;
use std::sync::Arc;

use super::shaders::{Bin, RESULT_TILE, ROWS_TILE, SHARED_FROM_SCALE, TILE};
use crate::bokeh::ladder::Compositing;
use crate::bokeh::plan::{CELL, MAX_BINS, Plan, SEGMENT};

/// Columns of a tile of the CPU executor: the grids of both executors have the same width, so that their cells agree.
const GRID_ROUNDING: usize = 64;

/// Layout of the bins of a frame.
pub struct Layout {
    /// Uniforms, front to back.
    pub bins: Vec<Bin>,
    /// Number of bins in front of the focal plane.
    pub near: usize,
    /// Bins that are filtered together, limited by the buffer for rows.
    pub batches: Vec<Range<usize>>,
}

/// Elements that the shared buffers need for any frame of a plan.
#[derive(Clone, Copy, Debug, Default)]
pub struct Capacity {
    /// Pixels of all bins.
    pub pixels: usize,
    /// Pixels of the largest bin: a batch always holds at least one bin.
    pub rows: usize,
    /// Cells of all bins.
    pub cells: usize,
    /// Edges of all bins.
    pub edges: usize,
    /// Tiles of all bins in pass `bin`.
    pub binned: usize,
    /// Row tiles of all bins.
    pub filtered: usize,
    /// Result tiles of all bins.
    pub active: usize,
}

impl Capacity {
    /// Returns the elements that the bins of any frame need, at any quality level.
    pub fn for_plan(plan: &Plan) -> Self {
        if plan.compositing == Compositing::Layers {
            return Self::for_scales(plan, (0..plan.slot_count()).map(|slot| plan.min_scale(slot)));
        }
        // Otherwise a level has the same bins in every frame: the maximum over all levels suffices.
        let mut plan = plan.clone();
        let ladder = Arc::clone(&plan.ladder);
        ladder.iter().fold(Self::default(), |largest, step| {
            plan.set_quality(step.quality);
            largest.max(Self::for_scales(&plan, plan.bins.iter().map(|bin| bin.scale)))
        })
    }

    /// Returns the elements that bins of these scales need.
    fn for_scales(plan: &Plan, scales: impl Iterator<Item = usize>) -> Self {
        let mut capacity = Self::default();
        for scale in scales {
            let (width, height) = (plan.width.div_ceil(scale), plan.height.div_ceil(scale));
            let [cells, edges] = [grid_size(width, height), edge_grid_size(width, height)].map(|[a, b]| a * b);
            capacity.pixels += width * height;
            capacity.rows = capacity.rows.max(width * height);
            capacity.cells += cells;
            capacity.edges += edges;
            let size = [width as u32, height as u32];
            capacity.binned += count_bin_tiles(size, scale as u32);
            capacity.filtered += count_tiles(size, ROWS_TILE);
            capacity.active += count_tiles(size, RESULT_TILE);
        }
        capacity
    }

    /// Returns the elementwise maximum.
    fn max(self, other: Self) -> Self {
        Self {
            pixels: self.pixels.max(other.pixels),
            rows: self.rows.max(other.rows),
            cells: self.cells.max(other.cells),
            edges: self.edges.max(other.edges),
            binned: self.binned.max(other.binned),
            filtered: self.filtered.max(other.filtered),
            active: self.active.max(other.active),
        }
    }
}

/// Returns the number of tiles that cover a bin.
pub fn count_tiles(size: [u32; 2], tile: [usize; 2]) -> usize {
    (size[0] as usize).div_ceil(tile[0]) * (size[1] as usize).div_ceil(tile[1])
}

/// Returns the number of tiles of a bin in pass `bin`.
pub fn count_bin_tiles(size: [u32; 2], scale: u32) -> usize {
    let sharing = if scale >= SHARED_FROM_SCALE { 2 } else { 1 };
    count_tiles(size.map(|side| side * sharing), [TILE as usize; 2])
}

/// Returns the cells across and down a bin.
fn grid_size(width: usize, height: usize) -> [usize; 2] {
    [width.next_multiple_of(GRID_ROUNDING) / CELL, height.div_ceil(CELL)]
}

/// Returns the edges across, and the rows of cells.
fn edge_grid_size(width: usize, height: usize) -> [usize; 2] {
    let [across, down] = grid_size(width, height);
    [across * CELL / SEGMENT + 1, down]
}

impl Layout {
    /// Creates an empty layout with capacity for any plan, so that [`Self::lay_out`] allocates nothing.
    pub fn new() -> Self {
        Self { bins: Vec::with_capacity(MAX_BINS), near: 0, batches: Vec::with_capacity(MAX_BINS) }
    }

    /// Assigns the current bins of a plan to offsets in the shared buffers, and divides them into batches whose pixels
    /// fit `capacity.rows`.
    pub fn lay_out(&mut self, plan: &Plan, capacity: &Capacity) {
        self.bins.clear();
        self.batches.clear();
        self.near = match plan.compositing {
            Compositing::Layers => plan.bins.iter().take_while(|bin| bin.near).count(),
            _ => 0,
        };
        let mut used = Capacity::default();
        let (mut first, mut batch_pixels) = (0, 0);
        for (k, bin) in plan.bins.iter().enumerate() {
            let ([cells_across, down], [edges, _]) =
                (grid_size(bin.width, bin.height), edge_grid_size(bin.width, bin.height));
            let pixels = bin.width * bin.height;
            // Starts a new batch when the buffer for rows is full.
            if batch_pixels + pixels > capacity.rows && k > first {
                self.batches.push(first..k);
                (first, batch_pixels) = (k, 0);
            }
            let weight = plan.bin_weight(k);
            let size = [bin.width as u32, bin.height as u32];
            self.bins.push(Bin {
                size,
                cells: [cells_across as u32, down as u32],
                scale: bin.scale as u32,
                edges: edges as u32,
                decimation: bin.decimation as u32,
                whole: u32::from(plan.compositing != Compositing::Layers),
                front: weight.front.into(),
                behind: weight.behind.into(),
                max_radius_px: bin.max_radius_px,
                sigma_cells: bin.sigma_cells(),
                radius_cells: plan.radius_cells(bin) as u32,
                pixels_at: used.pixels as u32,
                rows_at: batch_pixels as u32,
                edges_at: used.edges as u32,
                cells_at: used.cells as u32,
                binned_at: used.binned as u32,
                half_width: match plan.compositing {
                    // Each pixel has its own radius, which no bin limits.
                    Compositing::Gather => plan.bank.half_width as u32,
                    _ => plan.bin_half_width(bin) as u32,
                },
                filtered_at: used.filtered as u32,
                active_at: used.active as u32,
                has_overshoot: u32::from(plan.has_overshoot(bin)),
            });
            used.pixels += pixels;
            used.cells += cells_across * down;
            used.edges += edges * down;
            used.binned += count_bin_tiles(size, bin.scale as u32);
            used.filtered += count_tiles(size, ROWS_TILE);
            used.active += count_tiles(size, RESULT_TILE);
            batch_pixels += pixels;
        }
        if !plan.bins.is_empty() {
            self.batches.push(first..plan.bins.len());
        }
    }
}
