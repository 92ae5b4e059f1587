//! Where the bins of a frame lie in the buffers that all bins share, and what is filtered at once.

use std::ops::Range;
use std::sync::Arc;

use super::shaders::{Bin, RESULT_TILE, ROWS_TILE, SHARED_FROM, TILE};
use crate::bokeh::ladder::Compositing;
use crate::bokeh::plan::{CELL, MAX_BINS, Plan, SEGMENT};

/// Columns of a tile of the CPU executor: both executors' grids are as wide, so that their cells agree.
const GRID_ROUNDING: usize = 64;

/// The bins of a frame.
pub struct Layout {
    /// Uniforms, front to back.
    pub bins: Vec<Bin>,
    /// How many of them lie in front of the focal plane.
    pub near: usize,
    /// Bins that are filtered at once: as many as the memory for rows holds.
    pub batches: Vec<Range<usize>>,
}

/// Elements that the shared buffers need for any frame of a plan.
#[derive(Clone, Copy, Debug, Default)]
pub struct Capacity {
    /// Pixels of all bins.
    pub pixels: usize,
    /// Pixels of the bins that are filtered at once: the largest bin.
    pub rows: usize,
    /// Cells of all bins.
    pub cells: usize,
    /// Edges of all bins.
    pub edges: usize,
    /// Tiles of all bins as they are made.
    pub binned: usize,
    /// Tiles of rows of all bins.
    pub filtered: usize,
    /// Tiles of the results of all bins.
    pub active: usize,
}

impl Capacity {
    /// What the bins of any frame need, at any level.
    pub fn of(plan: &Plan) -> Self {
        if plan.compositing == Compositing::Layers {
            return Self::of_scales(plan, (0..plan.slots()).map(|slot| plan.least_scale(slot)));
        }
        // Otherwise a level has the same bins in every frame: the maximum over all levels suffices.
        let mut plan = plan.clone();
        let ladder = Arc::clone(&plan.ladder);
        ladder.iter().fold(Self::default(), |most, step| {
            plan.set_quality(step.quality);
            most.max(Self::of_scales(&plan, plan.bins.iter().map(|bin| bin.scale)))
        })
    }

    /// What bins at these scales need.
    fn of_scales(plan: &Plan, scales: impl Iterator<Item = usize>) -> Self {
        let mut capacity = Self::default();
        for scale in scales {
            let (width, height) = (plan.width.div_ceil(scale), plan.height.div_ceil(scale));
            let [cells, edges] = [cells(width, height), edges(width, height)].map(|[a, b]| a * b);
            capacity.pixels += width * height;
            capacity.rows = capacity.rows.max(width * height);
            capacity.cells += cells;
            capacity.edges += edges;
            let size = [width as u32, height as u32];
            capacity.binned += binned_tiles(size, scale as u32);
            capacity.filtered += tiles(size, ROWS_TILE);
            capacity.active += tiles(size, RESULT_TILE);
        }
        capacity
    }

    /// The larger of each.
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

/// How many tiles cover a bin.
pub fn tiles(size: [u32; 2], tile: [usize; 2]) -> usize {
    (size[0] as usize).div_ceil(tile[0]) * (size[1] as usize).div_ceil(tile[1])
}

/// How many tiles pass `bin` makes a bin from.
pub fn binned_tiles(size: [u32; 2], scale: u32) -> usize {
    let sharing = if scale >= SHARED_FROM { 2 } else { 1 };
    tiles(size.map(|side| side * sharing), [TILE as usize; 2])
}

/// Cells across and down a bin.
fn cells(width: usize, height: usize) -> [usize; 2] {
    [width.next_multiple_of(GRID_ROUNDING) / CELL, height.div_ceil(CELL)]
}

/// Edges across, and rows of cells.
fn edges(width: usize, height: usize) -> [usize; 2] {
    let [across, down] = cells(width, height);
    [across * CELL / SEGMENT + 1, down]
}

impl Layout {
    /// No bins; room for any plan's, so that laying out allocates nothing.
    pub fn new() -> Self {
        Self { bins: Vec::with_capacity(MAX_BINS), near: 0, batches: Vec::with_capacity(MAX_BINS) }
    }

    /// Gives the current bins of a plan their places in the shared buffers, and divides them into batches whose pixels
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
            let ([cells_across, down], [edges, _]) = (cells(bin.width, bin.height), edges(bin.width, bin.height));
            let pixels = bin.width * bin.height;
            if batch_pixels + pixels > capacity.rows && k > first {
                self.batches.push(first..k);
                (first, batch_pixels) = (k, 0);
            }
            let share = plan.share(k);
            let size = [bin.width as u32, bin.height as u32];
            self.bins.push(Bin {
                size,
                cells: [cells_across as u32, down as u32],
                scale: bin.scale as u32,
                edges: edges as u32,
                turned: u32::from(bin.near),
                whole: u32::from(plan.compositing != Compositing::Layers),
                front: share.front.into(),
                behind: share.behind.into(),
                max_radius_px: bin.max_radius_px,
                sigma_cells: bin.sigma_cells(),
                reach_cells: plan.reach_cells(bin) as u32,
                pixels_at: used.pixels as u32,
                rows_at: batch_pixels as u32,
                edges_at: used.edges as u32,
                cells_at: used.cells as u32,
                binned_at: used.binned as u32,
                reach: match plan.compositing {
                    // Each pixel has its own radius, which no bin limits.
                    Compositing::Gather => plan.bank.reach as u32,
                    _ => plan.bin_reach(bin) as u32,
                },
                filtered_at: used.filtered as u32,
                active_at: used.active as u32,
                has_lobes: u32::from(plan.has_lobes(bin)),
            });
            used.pixels += pixels;
            used.cells += cells_across * down;
            used.edges += edges * down;
            used.binned += binned_tiles(size, bin.scale as u32);
            used.filtered += tiles(size, ROWS_TILE);
            used.active += tiles(size, RESULT_TILE);
            batch_pixels += pixels;
        }
        if !plan.bins.is_empty() {
            self.batches.push(first..plan.bins.len());
        }
    }
}
