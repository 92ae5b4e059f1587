//! Pass `blur`: the low-rank separable filters over one strip of one bin, rows first, then columns (McGraw, *Fast Bokeh
//! Effects Using Low-Rank Linear Filters*, eq. 2).
//!
//! The radius is sampled at the edges of segments of `SEGMENT` pixels, and the taps are linear between them, so that
//! the blur varies without steps.
//!
//! twin: shaders/blur/blur_rows.wgsl, shaders/blur/blur_columns.wgsl

#![allow(clippy::needless_range_loop)] // Terms and planes index several arrays at once.

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::decimate::Decimated;
use super::filter::{
    BLOCK_ROWS, Taps, clamp_to_range, filter_column, filter_column_block, filter_row, max_row_len, row_len,
};
use super::rows::{COPY_WIDTH, CellGrid, EDGE_VALUES, STRIP, STRIP_EDGES, STRIP_ROW, SegmentEdges, Strips, max_pad};
use crate::bokeh::bank::FilterBank;
use crate::bokeh::plan::{CELL, Plan, SEGMENT};
use crate::compute::aligned::Aligned;
use crate::compute::simd::{load, prefetch, store};

/// Terms filtered at once; more are done in groups.
const TERMS_PER_GROUP: usize = 4;

/// One strip of one bin.
pub struct Strip<'a> {
    /// The bin's input; `out` and `active` are passed separately.
    pub source: &'a Strips,
    /// Its colours decimated, if they are.
    pub decimated: Option<&'a Decimated>,
    /// Columns and rows of the bin.
    pub size: (usize, usize),
    /// Rows of the picture whose result is wanted.
    pub wanted_px: Range<usize>,
    /// Pixels of the picture per bin pixel and axis.
    pub scale: usize,
    /// The coarse grid with the bin's coverage.
    pub cells: &'a CellGrid,
    /// Radius and range of colours, from `reach`.
    pub edges: &'a SegmentEdges,
    pub bank: &'a FilterBank,
    /// Whether the bin covers every pixel.
    pub whole: bool,
    /// Whether the aperture is rotated by 180 degrees (content in front of the focal plane).
    pub turned: bool,
    /// Outermost tap of this bin's filters.
    pub half_width: usize,
    pub strip: usize,
    /// `[row][4][STRIP]`: the result.
    pub out: &'a mut [f32],
    /// Per row of cells, whether the result has any content: of the last frame before, of this one after.
    pub active: &'a mut [bool],
    /// Scratch memory of the thread.
    pub scratch: &'a mut Scratch,
}

/// Returns the capacity of the ring of horizontally filtered rows: enough for a block of rows, rounded up to a power of
/// two so that an index is masked.
fn ring_capacity(half_width: usize) -> usize {
    (2 * half_width + BLOCK_ROWS).next_power_of_two()
}

/// Scratch memory of one thread for the pass `blur`.
pub struct Scratch {
    /// `[row % ring][term][4][STRIP]`.
    rows: Aligned,
    /// Rows of a strip with the filter support on both sides: `[BLOCK_ROWS][4][STRIP + 2 pad]`.
    lines: Aligned,
    /// Rows of cells that have content to filter.
    pub(super) filtered: Vec<bool>,
    /// Rows of cells whose result is made.
    pub(super) made: Vec<bool>,
}

impl Scratch {
    /// Allocates for every bin of a plan.
    pub fn new(plan: &Plan) -> Self {
        let half_width = plan.ladder.max_half_width();
        Self {
            rows: Aligned::zeros(ring_capacity(half_width) * max_row_len(TERMS_PER_GROUP.min(plan.ladder.max_terms()))),
            lines: Aligned::zeros(BLOCK_ROWS * 4 * (STRIP + 2 * max_pad(plan))),
            filtered: Vec::with_capacity(plan.height.div_ceil(CELL)),
            made: Vec::with_capacity(plan.height.div_ceil(CELL)),
        }
    }
}

impl WithSimd for Strip<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        if !self.mark_active() {
            return;
        }
        // A whole bin has coverage 1 everywhere, which needs no filter.
        match self.whole {
            true => self.filter_groups::<S, 3>(simd),
            false => self.filter_groups::<S, 4>(simd),
        }
    }
}

impl Strip<'_> {
    /// Filters `P` planes, a group of terms at a time.
    #[inline(always)]
    fn filter_groups<S: Simd, const P: usize>(&mut self, simd: S) {
        let terms = self.bank.terms;
        for first in (0..terms).step_by(TERMS_PER_GROUP) {
            match ((terms - first).min(TERMS_PER_GROUP), self.bank.is_symmetric) {
                (1, true) => self.filter_group::<S, 1, true, P>(simd, first),
                (2, true) => self.filter_group::<S, 2, true, P>(simd, first),
                (3, true) => self.filter_group::<S, 3, true, P>(simd, first),
                (_, true) => self.filter_group::<S, 4, true, P>(simd, first),
                (1, false) => self.filter_group::<S, 1, false, P>(simd, first),
                (2, false) => self.filter_group::<S, 2, false, P>(simd, first),
                (3, false) => self.filter_group::<S, 3, false, P>(simd, first),
                (_, false) => self.filter_group::<S, 4, false, P>(simd, first),
            }
        }
    }

    /// Finds the rows of cells that get a result (`active`) and those that must be filtered for it: most of a bin is
    /// empty, because its surface covers part of the picture. Returns false if nothing of the strip is made.
    #[inline(always)]
    fn mark_active(&mut self) -> bool {
        let (across, down) = (self.half_width.div_ceil(CELL), self.half_width.div_ceil(CELL));
        let rows = self.active.len();
        let first = self.strip * STRIP / CELL;
        let columns = first.saturating_sub(across)..(first + STRIP / CELL + across).min(self.cells.width);
        let Scratch { filtered, made, .. } = &mut *self.scratch;
        filtered.clear();
        made.clear();
        let row_px = CELL * self.scale;
        filtered.extend((0..rows).map(|y| self.cells.plane(y, 0)[columns.clone()].iter().any(|&c| c > 0.0)));
        for y in 0..rows {
            // Between bin pixels the result is interpolated: a row of cells more is read on either side.
            let is_wanted = y * row_px < self.wanted_px.end + row_px && self.wanted_px.start < (y + 2) * row_px;
            if !is_wanted {
                made.push(false);
                continue;
            }
            let support = y.saturating_sub(down)..(y + down + 1).min(rows);
            let active = filtered[support].iter().any(|&f| f);
            made.push(active);
            let was = std::mem::replace(&mut self.active[y], active);
            // Clears the rows written in the previous frame; all others are zero already.
            if was && !active {
                let end = ((y + 1) * CELL).min(self.size.1);
                self.out[y * CELL * 4 * STRIP..end * 4 * STRIP].fill(0.0);
            }
        }
        made.contains(&true)
    }

    /// Filters `R` terms from `first` on: all rows, then all columns.
    #[inline(always)]
    fn filter_group<S: Simd, const R: usize, const SYMMETRIC: bool, const P: usize>(&mut self, simd: S, first: usize) {
        let mut scratch = std::mem::take(&mut self.scratch.rows);
        let rows = &mut scratch[..ring_capacity(self.half_width) * row_len::<S>(R)];
        let mut next_y = 0;
        for y in (0..self.size.1).step_by(BLOCK_ROWS) {
            if !self.scratch.made[y / CELL] {
                continue;
            }
            // The ring holds only the rows that the columns need, so that it stays in the nearest caches.
            let end_y = (y + self.half_width + BLOCK_ROWS).min(self.size.1);
            next_y = next_y.max(y.saturating_sub(self.half_width));
            while next_y < end_y {
                let source_ys = next_y..(next_y + BLOCK_ROWS).min(end_y);
                self.filter_rows::<S, R, SYMMETRIC, P>(simd, first, source_ys, rows);
                next_y = (next_y + BLOCK_ROWS).min(end_y);
            }
            let ys = y..(y + BLOCK_ROWS).min(self.size.1);
            prefetch(&self.out[ys.end * STRIP_ROW..(ys.end + BLOCK_ROWS).min(self.size.1) * STRIP_ROW]);
            self.filter_columns::<S, R, SYMMETRIC, P>(simd, first, ys, rows);
        }
        self.scratch.rows = scratch;
    }

    /// Filters the rows `ys` horizontally, at most `BLOCK_ROWS`: `R` terms from `first` on, every plane, into the ring
    /// `rows`.
    #[inline(always)]
    fn filter_rows<S: Simd, const R: usize, const SYMMETRIC: bool, const P: usize>(
        &mut self,
        simd: S,
        first: usize,
        ys: Range<usize>,
        rows: &mut [f32],
    ) {
        let row_len = row_len::<S>(R);
        let ring_mask = rows.len() / row_len - 1;
        let mut lines = std::mem::take(&mut self.scratch.lines);
        // The source's rows are copied `COPY_WIDTH` columns at a time.
        let pad = self.half_width.next_multiple_of(COPY_WIDTH);
        let span = STRIP + 2 * pad;
        // All lines are copied first: unaligned loads right after the stores would stall on store forwarding.
        for (k, y) in ys.clone().enumerate() {
            if self.scratch.filtered[y / CELL] {
                let line = &mut lines[k * 4 * span..][..4 * span];
                self.source.copy_line(self.strip, y, self.size.0, pad, line);
                if let Some(decimated) = self.decimated {
                    decimated.recolor_line(simd, (self.strip, y), pad, line);
                }
            }
        }
        for y in (ys.end..ys.end + BLOCK_ROWS).take_while(|&y| y < self.size.1) {
            if self.scratch.filtered[y / CELL] {
                self.source.prefetch_line(self.strip, y, pad);
            }
        }
        for (k, y) in ys.enumerate() {
            let out = &mut rows[(y & ring_mask) * row_len..][..row_len];
            if !self.scratch.filtered[y / CELL] {
                out.fill(0.0);
                continue;
            }
            let plane = |p: usize| &lines[(k * 4 + p) * span..][..span];
            let planes = [plane(0), plane(1), plane(2), plane(3)];
            let edges = self.edges.at(self.strip, y);
            for x in (0..STRIP).step_by(S::F32_LANES) {
                let taps = self.taps::<R>(&self.bank.horizontal, first, &edges, x);
                // The radius is mostly the same at both edges; a tap is then one number for the whole vector instead of
                // a vector of its own.
                let sums = if taps.is_constant {
                    filter_row::<S, R, SYMMETRIC, false, P>(simd, &taps, &planes, x + pad)
                } else {
                    filter_row::<S, R, SYMMETRIC, true, P>(simd, &taps, &planes, x + pad)
                };
                for r in 0..R {
                    for p in 0..P {
                        store::<S>(out, (r * 4 + p) * STRIP + x, sums[r][p]);
                    }
                }
            }
        }
        self.scratch.lines = lines;
    }

    /// Filters the rows `ys` of the result vertically, at most `BLOCK_ROWS`, from the ring of filtered `rows`.
    #[inline(always)]
    fn filter_columns<S: Simd, const R: usize, const SYMMETRIC: bool, const P: usize>(
        &mut self,
        simd: S,
        first: usize,
        ys: Range<usize>,
        rows: &[f32],
    ) {
        let table = &self.bank.vertical;
        let mut edges = [[[0.0; EDGE_VALUES]; STRIP_EDGES]; BLOCK_ROWS];
        for (edges, y) in edges.iter_mut().zip(ys.clone()) {
            *edges = self.edges.at(self.strip, y);
        }
        for x in (0..STRIP).step_by(S::F32_LANES) {
            // With a uniform radius, the rows of a block have the same taps and share their loads.
            if P == 3 && ys.len() == BLOCK_ROWS {
                let shared = self.taps::<R>(table, first, &edges[0], x);
                let mut same = true;
                for edges in &edges {
                    let taps = self.taps::<R>(table, first, edges, x);
                    same &= taps.is_constant && taps.left == shared.left;
                }
                if same {
                    let sums = filter_column_block::<S, R, SYMMETRIC, P>(simd, &shared, rows, ys.start, x, self.size.1);
                    for k in 0..BLOCK_ROWS {
                        self.add_to_result::<S, R, P>(simd, first, (x, ys.start + k), sums[k], &edges[k]);
                    }
                    continue;
                }
            }
            for (edges, y) in edges.iter().zip(ys.clone()) {
                let taps = self.taps::<R>(table, first, edges, x);
                let sums = if taps.is_constant {
                    filter_column::<S, R, SYMMETRIC, false, P>(simd, &taps, rows, y, x, self.size.1)
                } else {
                    filter_column::<S, R, SYMMETRIC, true, P>(simd, &taps, rows, y, x, self.size.1)
                };
                self.add_to_result::<S, R, P>(simd, first, (x, y), sums, edges);
            }
        }
    }

    /// Adds the sums of a group to the result, and clamps it after the last group.
    #[inline(always)]
    fn add_to_result<S: Simd, const R: usize, const P: usize>(
        &mut self,
        simd: S,
        first: usize,
        (x, y): (usize, usize),
        mut sums: [S::f32s; 4],
        edges: &[[f32; EDGE_VALUES]; STRIP_EDGES],
    ) {
        let out = &mut self.out[y * 4 * STRIP..][..4 * STRIP];
        if first > 0 {
            for p in 0..P {
                sums[p] = simd.add_f32s(sums[p], load::<S>(out, p * STRIP + x));
            }
        }
        if first + R >= self.bank.terms {
            // A whole bin was filtered without its coverage, which is 1.
            if P == 3 {
                sums[3] = simd.splat_f32s(1.0);
            }
            clamp_to_range(simd, &mut sums, edges, x);
        }
        for p in 0..4 {
            store::<S>(out, p * STRIP + x, sums[p]);
        }
    }

    /// Returns the taps in `table` for the vector at column `x` of the strip, for the terms from `first` on.
    #[inline(always)]
    fn taps<'b, const R: usize>(
        &self,
        table: &'b [f32],
        first: usize,
        edges: &[[f32; EDGE_VALUES]; STRIP_EDGES],
        x: usize,
    ) -> Taps<'b, R> {
        let segment = x / SEGMENT;
        let first_node = self.bank.first_node(self.scale);
        let [left, right] = [segment, segment + 1].map(|edge| first_node + self.bank.nearest_node(edges[edge][0]));
        Taps {
            table,
            left: self.bank.tap_index(left, 0) + first,
            right: self.bank.tap_index(right, 0) + first,
            step: if self.turned { -(self.bank.terms as isize) } else { self.bank.terms as isize },
            half_width: self.bank.node_half_width[left.max(right)] as usize,
            lane: x % SEGMENT,
            is_constant: left == right,
        }
    }
}
