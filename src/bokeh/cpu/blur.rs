//! Pass `blur`: the low-rank filters over one strip of one bin, rows first, then columns.
//!
//! The radius is read at the edges of segments of `SEGMENT` pixels and the taps are linear between them, so that it
//! varies without steps.

#![allow(clippy::needless_range_loop)] // Terms and planes index several arrays at once.

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::filter::{
    BLOCK_ROWS, Taps, along_column, along_column_block, along_row, keep_in_range, most_row_len, row_len,
};
use super::rows::{Cells, EDGE_VALUES, Edges, PIECE, STRIP, STRIP_EDGES, STRIP_ROW, Strips};
use crate::bokeh::bank::Bank;
use crate::bokeh::plan::{CELL, Plan, SEGMENT};
use crate::compute::aligned::Aligned;
use crate::compute::simd::{load, prefetch, store};

/// Terms filtered at once; more are done in groups.
pub const GROUP: usize = 4;

/// One strip of one bin.
pub struct Strip<'a> {
    /// The bin; its `out` and `active` are passed on their own.
    pub source: &'a Strips,
    /// Columns and rows of the bin.
    pub size: (usize, usize),
    /// The grid as measured (what is where).
    pub cells: &'a Cells,
    /// Radius and range of colours, from `reach`.
    pub edges: &'a Edges,
    pub bank: &'a Bank,
    /// Whether the bin covers every pixel.
    pub whole: bool,
    /// Whether the aperture is turned (content in front of the focal plane).
    pub turned: bool,
    /// Outermost tap that this bin can need.
    pub reach: usize,
    pub strip: usize,
    /// `[row][4][STRIP]`: the result.
    pub out: &'a mut [f32],
    /// Per row of cells, whether the result holds anything: of the last frame before, of this one after.
    pub active: &'a mut [bool],
    /// Memory of the thread.
    pub scratch: &'a mut Scratch,
}

/// Rows of the horizontal filters' results that are kept: as many as a block of rows needs, up to a power of two, so
/// that an index is masked.
fn ring_rows(reach: usize) -> usize {
    (2 * reach + BLOCK_ROWS).next_power_of_two()
}

/// Memory of one thread for the pass `blur`.
pub struct Scratch {
    /// `[row % ring][term][4][STRIP]`.
    rows: Aligned,
    /// Rows of a strip and what the filters reach on both sides: `[BLOCK_ROWS][4][STRIP + 2 pad]`.
    lines: Aligned,
    /// Rows of cells whose rows are filtered.
    filtered: Vec<bool>,
}

impl Scratch {
    /// Memory for every bin of a plan.
    pub fn new(plan: &Plan) -> Self {
        let reach = plan.ladder.most_reach();
        Self {
            rows: Aligned::zeros(ring_rows(reach) * most_row_len(GROUP.min(plan.ladder.most_terms()))),
            lines: Aligned::zeros(BLOCK_ROWS * 4 * (STRIP + 2 * reach.next_multiple_of(PIECE))),
            filtered: Vec::with_capacity(plan.height.div_ceil(CELL)),
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
        // A whole bin covers every pixel, and that needs no filter.
        if self.whole {
            self.filter_groups::<S, 3>(simd);
        } else {
            self.filter_groups::<S, 4>(simd);
        }
    }
}

impl Strip<'_> {
    /// Filters `P` planes, a group of terms at a time.
    #[inline(always)]
    fn filter_groups<S: Simd, const P: usize>(&mut self, simd: S) {
        let terms = self.bank.terms;
        for first in (0..terms).step_by(GROUP) {
            match ((terms - first).min(GROUP), self.bank.even) {
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

    /// Finds the rows of cells that get a result (`active`), and those whose rows have to be filtered for it: most of a
    /// bin is empty, as its surface covers part of the picture. False when nothing reaches the strip.
    #[inline(always)]
    fn mark_active(&mut self) -> bool {
        let (across, down) = (self.reach.div_ceil(CELL), self.reach.div_ceil(CELL));
        let rows = self.active.len();
        let first = self.strip * STRIP / CELL;
        let columns = first.saturating_sub(across)..(first + STRIP / CELL + across).min(self.cells.width);
        let filtered = &mut self.scratch.filtered;
        filtered.clear();
        filtered.extend((0..rows).map(|y| self.cells.plane(y, 0)[columns.clone()].iter().any(|&c| c > 0.0)));
        for y in 0..rows {
            let reach = y.saturating_sub(down)..(y + down + 1).min(rows);
            let active = filtered[reach].iter().any(|&f| f);
            let was = std::mem::replace(&mut self.active[y], active);
            // Clears what the previous frame left there; elsewhere there are zeros already.
            if was && !active {
                let end = ((y + 1) * CELL).min(self.size.1);
                self.out[y * CELL * 4 * STRIP..end * 4 * STRIP].fill(0.0);
            }
        }
        self.active.iter().any(|&a| a)
    }

    /// Filters `R` terms from `first` on: all rows, then all columns.
    #[inline(always)]
    fn filter_group<S: Simd, const R: usize, const EVEN: bool, const P: usize>(&mut self, simd: S, first: usize) {
        let mut scratch = std::mem::take(&mut self.scratch.rows);
        let rows = &mut scratch[..ring_rows(self.reach) * row_len::<S>(R)];
        let mut next_y = 0;
        for y in (0..self.size.1).step_by(BLOCK_ROWS) {
            if !self.active[y / CELL] {
                continue;
            }
            // A ring of rows, no more than the columns reach, stays in the nearest caches.
            let end_y = (y + self.reach + BLOCK_ROWS).min(self.size.1);
            next_y = next_y.max(y.saturating_sub(self.reach));
            while next_y < end_y {
                let source_ys = next_y..(next_y + BLOCK_ROWS).min(end_y);
                self.filter_rows::<S, R, EVEN, P>(simd, first, source_ys, rows);
                next_y = (next_y + BLOCK_ROWS).min(end_y);
            }
            let ys = y..(y + BLOCK_ROWS).min(self.size.1);
            prefetch(&self.out[ys.end * STRIP_ROW..(ys.end + BLOCK_ROWS).min(self.size.1) * STRIP_ROW]);
            self.filter_columns::<S, R, EVEN, P>(simd, first, ys, rows);
        }
        self.scratch.rows = scratch;
    }

    /// The horizontal pass over the rows `ys`, `BLOCK_ROWS` at most: `R` terms from `first` on, all planes of each in turn in
    /// the ring `rows`.
    #[inline(always)]
    fn filter_rows<S: Simd, const R: usize, const EVEN: bool, const P: usize>(
        &mut self,
        simd: S,
        first: usize,
        ys: Range<usize>,
        rows: &mut [f32],
    ) {
        let row_len = row_len::<S>(R);
        let ring_mask = rows.len() / row_len - 1;
        let mut lines = std::mem::take(&mut self.scratch.lines);
        // The source's rows are copied `PIECE` columns at a time.
        let pad = self.reach.next_multiple_of(PIECE);
        let span = STRIP + 2 * pad;
        // All copies come first, as a line is read across the vectors it was written in: at once, that has to wait.
        for (k, y) in ys.clone().enumerate() {
            if self.scratch.filtered[y / CELL] {
                self.source.copy_line(self.strip, y, self.size.0, pad, &mut lines[k * 4 * span..][..4 * span]);
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
                // The radius is linear between two edges, and the same at both nearly everywhere: then a tap is one number
                // for the whole vector and not a vector of its own.
                let sums = if taps.steady {
                    along_row::<S, R, EVEN, false, P>(simd, &taps, &planes, x + pad)
                } else {
                    along_row::<S, R, EVEN, true, P>(simd, &taps, &planes, x + pad)
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

    /// The vertical pass for the rows `ys` of the result, `BLOCK_ROWS` at most, from the ring of filtered `rows`.
    #[inline(always)]
    fn filter_columns<S: Simd, const R: usize, const EVEN: bool, const P: usize>(
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
            // With one radius for the whole picture, the rows of a block have the same taps and share what they read.
            if P == 3 && ys.len() == BLOCK_ROWS {
                let shared = self.taps::<R>(table, first, &edges[0], x);
                let mut same = true;
                for edges in &edges {
                    let taps = self.taps::<R>(table, first, edges, x);
                    same &= taps.steady && taps.left == shared.left;
                }
                if same {
                    let sums = along_column_block::<S, R, EVEN, P>(simd, &shared, rows, ys.start, x, self.size.1);
                    for k in 0..BLOCK_ROWS {
                        self.add_to_result::<S, R, P>(simd, first, (x, ys.start + k), sums[k], &edges[k]);
                    }
                    continue;
                }
            }
            for (edges, y) in edges.iter().zip(ys.clone()) {
                let taps = self.taps::<R>(table, first, edges, x);
                let sums = if taps.steady {
                    along_column::<S, R, EVEN, false, P>(simd, &taps, rows, y, x, self.size.1)
                } else {
                    along_column::<S, R, EVEN, true, P>(simd, &taps, rows, y, x, self.size.1)
                };
                self.add_to_result::<S, R, P>(simd, first, (x, y), sums, edges);
            }
        }
    }

    /// Adds the sums of a group to the result; after the last group, clamps it.
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
            keep_in_range(simd, &mut sums, edges, x);
        }
        for p in 0..4 {
            store::<S>(out, p * STRIP + x, sums[p]);
        }
    }

    /// The taps in `table` of the vector at column `x` of the strip, for the terms from `first` on.
    #[inline(always)]
    fn taps<'b, const R: usize>(
        &self,
        table: &'b [f32],
        first: usize,
        edges: &[[f32; EDGE_VALUES]; STRIP_EDGES],
        x: usize,
    ) -> Taps<'b, R> {
        let segment = x / SEGMENT;
        let (left, right) = (self.bank.node(edges[segment][0]), self.bank.node(edges[segment + 1][0]));
        Taps {
            table,
            left: self.bank.tap(left, 0) + first,
            right: self.bank.tap(right, 0) + first,
            step: if self.turned { -(self.bank.terms as isize) } else { self.bank.terms as isize },
            reach: self.bank.node_reach[left.max(right)] as usize,
            lane: x % SEGMENT,
            steady: left == right,
        }
    }
}
