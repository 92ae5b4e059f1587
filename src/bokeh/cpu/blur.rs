//! Pass `blur`: the low-rank filters over one strip of one bin, rows first, then columns.
//!
//! The radius is read at the edges of segments of `SEGMENT` pixels and the taps are linear between them, so that it
//! varies without steps. Where every profile is even, taps at -j and j share one multiplication.

#![allow(clippy::needless_range_loop)] // Terms and planes index several arrays at once.

use pulp::{Simd, WithSimd};

use super::aligned::Aligned;
use super::rows::{Cells, EDGE_VALUES, Edges, PIECE, STRIP, STRIP_EDGES, STRIP_ROW, Strips};
use super::simd::{fma, load, store};
use crate::bokeh::bank::Bank;
use crate::bokeh::plan::{CELL, Plan, SEGMENT};

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
    /// The filters.
    pub bank: &'a Bank,
    /// Whether the aperture is turned (content in front of the focal plane).
    pub turned: bool,
    /// Outermost tap that this bin can need.
    pub reach: usize,
    /// Which strip.
    pub strip: usize,
    /// `[row][4][STRIP]`: the result.
    pub out: &'a mut [f32],
    /// Per row of cells, whether the result holds anything: of the last frame before, of this one after.
    pub active: &'a mut [bool],
    /// Memory of the thread.
    pub scratch: &'a mut Scratch,
}

/// Rows of the horizontal filters' results that are kept: those that a column of this reach needs, in a power of two.
fn ring(reach: usize) -> usize {
    (2 * reach + 1).next_power_of_two()
}

/// Memory of one thread for the pass `blur`.
pub struct Scratch {
    /// `[row % ring][term][4][STRIP]`.
    rows: Aligned,
    /// A row of a strip and what the filters reach on both sides: `[4][STRIP + 2 pad]`.
    line: Aligned,
    /// Rows of cells whose rows are filtered.
    filtered: Vec<bool>,
}

impl Scratch {
    /// Memory for every bin of a plan.
    pub fn new(plan: &Plan) -> Self {
        let reach = plan.reach();
        Self {
            rows: Aligned::zeros(ring(reach) * GROUP.min(plan.bank.terms) * STRIP_ROW),
            line: Aligned::zeros(4 * (STRIP + 2 * reach.next_multiple_of(PIECE))),
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
        let terms = self.bank.terms;
        for first in (0..terms).step_by(GROUP) {
            match ((terms - first).min(GROUP), self.bank.even) {
                (1, true) => self.group::<S, 1, true>(simd, first),
                (2, true) => self.group::<S, 2, true>(simd, first),
                (3, true) => self.group::<S, 3, true>(simd, first),
                (_, true) => self.group::<S, 4, true>(simd, first),
                (1, false) => self.group::<S, 1, false>(simd, first),
                (2, false) => self.group::<S, 2, false>(simd, first),
                (3, false) => self.group::<S, 3, false>(simd, first),
                (_, false) => self.group::<S, 4, false>(simd, first),
            }
        }
    }
}

impl Strip<'_> {
    /// Finds which rows of cells get a result and which rows have to be filtered for it; false when none.
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
            if was && !active {
                let end = ((y + 1) * CELL).min(self.size.1);
                self.out[y * CELL * 4 * STRIP..end * 4 * STRIP].fill(0.0);
            }
        }
        self.active.iter().any(|&a| a)
    }

    /// Filters `R` terms from `first` on: all rows, then all columns.
    #[inline(always)]
    fn group<S: Simd, const R: usize, const EVEN: bool>(&mut self, simd: S, first: usize) {
        let mut scratch = std::mem::take(&mut self.scratch.rows);
        let (row_len, ring) = (R * STRIP_ROW, ring(self.reach));
        let mut next = 0;
        for y in 0..self.size.1 {
            if !self.active[y / CELL] {
                continue;
            }
            // A ring of rows, no more than the columns reach, stays in the nearest cache.
            for above in next.max(y.saturating_sub(self.reach))..(y + self.reach + 1).min(self.size.1) {
                let row = &mut scratch[above % ring * row_len..][..row_len];
                if self.scratch.filtered[above / CELL] {
                    self.row::<S, R, EVEN>(simd, first, above, row);
                } else {
                    row.fill(0.0);
                }
                next = above + 1;
            }
            self.columns::<S, R, EVEN>(simd, first, y, &scratch[..ring * row_len]);
        }
        self.scratch.rows = scratch;
    }

    #[inline(always)]
    fn row<S: Simd, const R: usize, const EVEN: bool>(&mut self, simd: S, first: usize, y: usize, out: &mut [f32]) {
        let mut line = std::mem::take(&mut self.scratch.line);
        let pad = self.reach.next_multiple_of(PIECE);
        let span = STRIP + 2 * pad;
        self.source.line(self.strip, y, self.size.0, pad, &mut line);
        let plane = |p: usize| &line[p * span..][..span];
        let planes = [plane(0), plane(1), plane(2), plane(3)];
        let edges = self.edges.at(self.strip, y);
        let mut x = 0;
        while x < STRIP {
            let taps = self.taps::<R>(&self.bank.horizontal, first, &edges, x);
            let sums = if taps.steady {
                along_row::<S, R, EVEN, false>(simd, &taps, &planes, x + pad)
            } else {
                along_row::<S, R, EVEN, true>(simd, &taps, &planes, x + pad)
            };
            for r in 0..R {
                for p in 0..4 {
                    store::<S>(out, (r * 4 + p) * STRIP + x, sums[r][p]);
                }
            }
            x += S::F32_LANES;
        }
        self.scratch.line = line;
    }

    #[inline(always)]
    fn columns<S: Simd, const R: usize, const EVEN: bool>(&mut self, simd: S, first: usize, y: usize, rows: &[f32]) {
        let edges = self.edges.at(self.strip, y);
        let mut x = 0;
        while x < STRIP {
            let taps = self.taps::<R>(&self.bank.vertical, first, &edges, x);
            let mut sums = if taps.steady {
                along_column::<S, R, EVEN, false>(simd, &taps, rows, y, x, self.size.1)
            } else {
                along_column::<S, R, EVEN, true>(simd, &taps, rows, y, x, self.size.1)
            };
            let out = &mut self.out[y * 4 * STRIP..][..4 * STRIP];
            if first > 0 {
                for p in 0..4 {
                    sums[p] = simd.add_f32s(sums[p], load::<S>(out, p * STRIP + x));
                }
            }
            if first + R >= self.bank.terms {
                keep_in_range(simd, &mut sums, &edges, x);
            }
            for p in 0..4 {
                store::<S>(out, p * STRIP + x, sums[p]);
            }
            x += S::F32_LANES;
        }
    }

    /// The taps of the vector at column `x` of the strip.
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

/// Truncation leaves lobes: no result may leave the range of the colours that went into it.
#[inline(always)]
fn keep_in_range<S: Simd>(simd: S, sums: &mut [S::f32s; 4], edges: &[[f32; EDGE_VALUES]; STRIP_EDGES], x: usize) {
    let (left, right) = (&edges[x / SEGMENT], &edges[x / SEGMENT + 1]);
    let across = load::<S>(&ACROSS, x % SEGMENT);
    let coverage = simd.min_f32s(simd.max_f32s(sums[3], simd.splat_f32s(0.0)), simd.splat_f32s(1.0));
    for p in 0..3 {
        let low = between(simd, left[1 + p], right[1 + p], across);
        let high = between(simd, left[4 + p], right[4 + p], across);
        let at_least = simd.max_f32s(sums[p], simd.mul_f32s(low, coverage));
        sums[p] = simd.min_f32s(at_least, simd.mul_f32s(high, coverage));
    }
    sums[3] = coverage;
}

/// Where each pixel of a segment lies between the segment's edges.
const ACROSS: [f32; SEGMENT] = {
    let mut at = [0.0; SEGMENT];
    let mut k = 0;
    while k < SEGMENT {
        at[k] = (k as f32 + 0.5) / SEGMENT as f32;
        k += 1;
    }
    at
};

#[inline(always)]
fn between<S: Simd>(simd: S, left: f32, right: f32, across: S::f32s) -> S::f32s {
    fma(simd, simd.splat_f32s(right - left), across, simd.splat_f32s(left))
}

/// The taps of a group of `R` terms for one vector of a segment.
struct Taps<'a, const R: usize> {
    table: &'a [f32],
    /// Tap 0 at the left and right edge of the segment.
    left: usize,
    right: usize,
    /// From one tap to the next.
    step: isize,
    reach: usize,
    lane: usize,
    /// Whether the taps are the same all along.
    steady: bool,
}

impl<const R: usize> Taps<'_, R> {
    #[inline(always)]
    fn at<S: Simd, const VARY: bool>(&self, simd: S, j: isize) -> [S::f32s; R] {
        let left = &self.table[self.left.wrapping_add_signed(j * self.step)..][..R];
        let mut taps = [simd.splat_f32s(0.0); R];
        if VARY {
            let right = &self.table[self.right.wrapping_add_signed(j * self.step)..][..R];
            let across = load::<S>(&ACROSS, self.lane);
            for r in 0..R {
                taps[r] = between(simd, left[r], right[r], across);
            }
        } else {
            for r in 0..R {
                taps[r] = simd.splat_f32s(left[r]);
            }
        }
        taps
    }
}

/// The horizontal pass for one vector: every term of the group, every plane.
#[inline(always)]
fn along_row<S: Simd, const R: usize, const EVEN: bool, const VARY: bool>(
    simd: S,
    taps: &Taps<'_, R>,
    planes: &[&[f32]; 4],
    x: usize,
) -> [[S::f32s; 4]; R] {
    let mut sums = [[simd.splat_f32s(0.0); 4]; R];
    let weights = taps.at::<S, VARY>(simd, 0);
    for p in 0..4 {
        let here = load::<S>(planes[p], x);
        for r in 0..R {
            sums[r][p] = simd.mul_f32s(weights[r], here);
        }
    }
    for j in 1..=taps.reach {
        let weights = taps.at::<S, VARY>(simd, j as isize);
        let opposite = if EVEN { weights } else { taps.at::<S, VARY>(simd, -(j as isize)) };
        for p in 0..4 {
            let (after, before) = (load::<S>(planes[p], x + j), load::<S>(planes[p], x - j));
            if EVEN {
                let both = simd.add_f32s(after, before);
                for r in 0..R {
                    sums[r][p] = fma(simd, weights[r], both, sums[r][p]);
                }
            } else {
                for r in 0..R {
                    sums[r][p] = fma(simd, opposite[r], before, fma(simd, weights[r], after, sums[r][p]));
                }
            }
        }
    }
    sums
}

/// The vertical pass for one vector: the terms of the group summed, every plane.
#[inline(always)]
fn along_column<S: Simd, const R: usize, const EVEN: bool, const VARY: bool>(
    simd: S,
    taps: &Taps<'_, R>,
    rows: &[f32],
    y: usize,
    x: usize,
    height: usize,
) -> [S::f32s; 4] {
    let row_len = R * 4 * STRIP;
    let weights = taps.at::<S, VARY>(simd, 0);
    // A power of two of rows.
    let last = rows.len() / row_len - 1;
    let here = &rows[(y & last) * row_len..][..row_len];
    let mut sums = [simd.splat_f32s(0.0); 4];
    for r in 0..R {
        for p in 0..4 {
            sums[p] = fma(simd, weights[r], load::<S>(here, (r * 4 + p) * STRIP + x), sums[p]);
        }
    }
    for j in 1..=taps.reach {
        let below = &rows[((y + j).min(height - 1) & last) * row_len..][..row_len];
        let above = &rows[(y.saturating_sub(j) & last) * row_len..][..row_len];
        let weights = taps.at::<S, VARY>(simd, j as isize);
        let opposite = if EVEN { weights } else { taps.at::<S, VARY>(simd, -(j as isize)) };
        for r in 0..R {
            for p in 0..4 {
                let at = (r * 4 + p) * STRIP + x;
                let (below, above) = (load::<S>(below, at), load::<S>(above, at));
                sums[p] = if EVEN {
                    fma(simd, weights[r], simd.add_f32s(below, above), sums[p])
                } else {
                    fma(simd, opposite[r], above, fma(simd, weights[r], below, sums[p]))
                };
            }
        }
    }
    sums
}
