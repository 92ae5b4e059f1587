//! Pass `blur`: the low-rank filters over one strip of one bin, rows first, then columns.
//!
//! The radius is read at the edges of segments of `SEGMENT` pixels and the taps are linear between them, so that it
//! varies without steps. Where every profile is even, taps at -j and j share one multiplication.

use pulp::{Simd, WithSimd};

use super::rows::{Cells, STRIP};
use super::simd::{fma, load, store};
use crate::bokeh::bank::Bank;
use crate::bokeh::plan::{CELL, SEGMENT};

/// Terms filtered at once; more are done in groups.
pub const GROUP: usize = 4;

/// One strip of one bin.
pub struct Strip<'a> {
    /// The bin; its `out` and `active` are passed on their own.
    pub source: &'a [f32],
    /// Values of a plane row of `source`, and its padding.
    pub stride: usize,
    /// Columns in front of the first pixel.
    pub pad: usize,
    /// Rows of the bin.
    pub height: usize,
    /// The grid as measured (what is where).
    pub cells: &'a Cells,
    /// The grid after `reach`.
    pub near_cells: &'a Cells,
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
    /// Per row of cells: in, whether the result is wanted; out, whether it holds anything.
    pub active: &'a mut [bool],
    /// Whether a row of cells is wanted whatever it holds (set by the caller), or only if content reaches it.
    pub wanted: Option<&'a [bool]>,
    /// `height * GROUP * 4 * STRIP` values for the rows' results, and one flag a row of cells.
    pub scratch: &'a mut Scratch,
}

/// Memory of one thread for the pass `blur`.
#[derive(Default)]
pub struct Scratch {
    /// `[row][term][4][STRIP]`.
    pub rows: Vec<f32>,
    /// Rows of cells whose rows are filtered.
    pub filtered: Vec<bool>,
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
            self.active[y] = filtered[reach].iter().any(|&f| f) && self.wanted.is_none_or(|wanted| wanted[y]);
        }
        for (y, &active) in self.active.iter().enumerate() {
            if !active {
                let end = ((y + 1) * CELL).min(self.height);
                self.out[y * CELL * 4 * STRIP..end * 4 * STRIP].fill(0.0);
            }
        }
        self.active.iter().any(|&a| a)
    }

    #[inline(always)]
    fn group<S: Simd, const R: usize, const EVEN: bool>(&mut self, simd: S, first: usize) {
        let mut scratch = std::mem::take(&mut self.scratch.rows);
        let rows = &mut scratch[..self.height * R * 4 * STRIP];
        let down = self.reach.div_ceil(CELL);
        for y in 0..self.height {
            let (cell, out) = (y / CELL, &mut rows[y * R * 4 * STRIP..][..R * 4 * STRIP]);
            let needed = cell.saturating_sub(down)..(cell + down + 1).min(self.active.len());
            if !self.active[needed].iter().any(|&a| a) {
                continue;
            }
            if !self.filtered(cell) {
                out.fill(0.0);
                continue;
            }
            let source = &self.source[y * 5 * self.stride..][..5 * self.stride];
            let at = self.pad + self.strip * STRIP - self.reach;
            let planes: [&[f32]; 4] =
                std::array::from_fn(|p| &source[p * self.stride + at..][..STRIP + 2 * self.reach]);
            self.segments::<S, R>(y, first, &self.bank.horizontal, |taps, x| {
                let sums = if taps.steady {
                    along_row::<S, R, EVEN, false>(simd, &taps, &planes, x + self.reach)
                } else {
                    along_row::<S, R, EVEN, true>(simd, &taps, &planes, x + self.reach)
                };
                for (k, sum) in sums.iter().flatten().enumerate() {
                    store::<S>(out, k * STRIP + x, *sum);
                }
            });
        }
        let last = first + R >= self.bank.terms;
        let result = std::mem::take(&mut self.out);
        for y in (0..self.height).filter(|y| self.active[y / CELL]) {
            let out = &mut result[y * 4 * STRIP..][..4 * STRIP];
            self.segments::<S, R>(y, first, &self.bank.vertical, |taps, x| {
                let mut sums = if taps.steady {
                    along_column::<S, R, EVEN, false>(simd, &taps, rows, y, x, self.height)
                } else {
                    along_column::<S, R, EVEN, true>(simd, &taps, rows, y, x, self.height)
                };
                if first > 0 {
                    for (p, sum) in sums.iter_mut().enumerate() {
                        *sum = simd.add_f32s(*sum, load::<S>(out, p * STRIP + x));
                    }
                }
                if last {
                    keep_in_range(simd, &mut sums, self.near_cells, y, self.strip * STRIP + x);
                }
                for (p, sum) in sums.iter().enumerate() {
                    store::<S>(out, p * STRIP + x, *sum);
                }
            });
        }
        self.out = result;
        self.scratch.rows = scratch;
    }

    #[inline(always)]
    fn filtered(&self, cell: usize) -> bool {
        self.scratch.filtered[cell]
    }

    /// Calls `work` for every vector of row `y`, with the taps of its segment and its column in the strip.
    #[inline(always)]
    fn segments<S: Simd, const R: usize>(
        &self,
        y: usize,
        first: usize,
        table: &[f32],
        mut work: impl FnMut(Taps<'_, R>, usize),
    ) {
        let nodes = self.nodes(y);
        for (segment, edges) in nodes.windows(2).enumerate() {
            let reach = self.bank.node_reach[edges[0].max(edges[1])] as usize;
            let origin = |node: usize| self.bank.tap(node, 0) + first;
            for lane in (0..SEGMENT).step_by(S::F32_LANES) {
                let taps = Taps {
                    table,
                    left: origin(edges[0]),
                    right: origin(edges[1]),
                    step: if self.turned { -(self.bank.terms as isize) } else { self.bank.terms as isize },
                    reach,
                    lane,
                    steady: edges[0] == edges[1],
                };
                work(taps, segment * SEGMENT + lane);
            }
        }
    }

    /// The nodes of the bank at the segment edges of this strip, in row `y`.
    #[inline(always)]
    fn nodes(&self, y: usize) -> [usize; STRIP / SEGMENT + 1] {
        let first = self.strip * STRIP / SEGMENT;
        std::array::from_fn(|k| self.bank.node(at_edge(self.near_cells, 1, y, first + k)))
    }
}

/// A plane of the coarse grid, at row `y` of the bin and the left edge of segment `segment`.
#[inline(always)]
pub fn at_edge(cells: &Cells, plane: usize, y: usize, segment: usize) -> f32 {
    let right = segment * SEGMENT / CELL;
    let (left, right) = (right.saturating_sub(1), right.min(cells.width - 1));
    let along = (y as f32 - (CELL as f32 - 1.0) / 2.0) / CELL as f32;
    let along = along.clamp(0.0, (cells.height - 1) as f32);
    let (above, share) = (along as usize, along.fract());
    let below = (above + 1).min(cells.height - 1);
    let mean = |y: usize| {
        let row = cells.plane(y, plane);
        0.5 * (row[left] + row[right])
    };
    mean(above) * (1.0 - share) + mean(below) * share
}

/// Truncation leaves lobes: no result may leave the range of the colours that went into it.
#[inline(always)]
fn keep_in_range<S: Simd>(simd: S, sums: &mut [S::f32s; 4], cells: &Cells, y: usize, x: usize) {
    let (segment, lane) = (x / SEGMENT, x % SEGMENT);
    let across = load::<S>(&ACROSS, lane);
    let (zero, one) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0));
    let coverage = simd.min_f32s(simd.max_f32s(sums[3], zero), one);
    let bound = |plane: usize| {
        let (left, right) = (at_edge(cells, plane, y, segment), at_edge(cells, plane, y, segment + 1));
        let value = fma(simd, simd.splat_f32s(right - left), across, simd.splat_f32s(left));
        simd.mul_f32s(value, coverage)
    };
    for (p, sum) in sums.iter_mut().take(3).enumerate() {
        *sum = simd.min_f32s(simd.max_f32s(*sum, bound(2 + p)), bound(5 + p));
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
        let read = |origin: usize| &self.table[origin.wrapping_add_signed(j * self.step)..][..R];
        let left = read(self.left);
        if !VARY {
            return std::array::from_fn(|r| simd.splat_f32s(left[r]));
        }
        let right = read(self.right);
        let across = load::<S>(&ACROSS, self.lane);
        std::array::from_fn(|r| fma(simd, simd.splat_f32s(right[r] - left[r]), across, simd.splat_f32s(left[r])))
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
    let weights = taps.at::<S, VARY>(simd, 0);
    let centre: [S::f32s; 4] = std::array::from_fn(|p| load::<S>(planes[p], x));
    let mut sums: [[S::f32s; 4]; R] =
        std::array::from_fn(|r| std::array::from_fn(|p| simd.mul_f32s(weights[r], centre[p])));
    for j in 1..=taps.reach {
        let weights = taps.at::<S, VARY>(simd, j as isize);
        let opposite = if EVEN { weights } else { taps.at::<S, VARY>(simd, -(j as isize)) };
        for p in 0..4 {
            let (after, before) = (load::<S>(planes[p], x + j), load::<S>(planes[p], x - j));
            let both = simd.add_f32s(after, before);
            for r in 0..R {
                if EVEN {
                    sums[r][p] = fma(simd, weights[r], both, sums[r][p]);
                } else {
                    sums[r][p] = fma(simd, weights[r], after, sums[r][p]);
                    sums[r][p] = fma(simd, opposite[r], before, sums[r][p]);
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
    let row = |y: usize| &rows[y * R * 4 * STRIP..][..R * 4 * STRIP];
    let weights = taps.at::<S, VARY>(simd, 0);
    let here = row(y);
    let mut sums = [simd.splat_f32s(0.0); 4];
    for r in 0..R {
        for p in 0..4 {
            sums[p] = fma(simd, weights[r], load::<S>(here, (r * 4 + p) * STRIP + x), sums[p]);
        }
    }
    for j in 1..=taps.reach {
        let (below, above) = (row((y + j).min(height - 1)), row(y.saturating_sub(j)));
        let weights = taps.at::<S, VARY>(simd, j as isize);
        let opposite = if EVEN { weights } else { taps.at::<S, VARY>(simd, -(j as isize)) };
        for r in 0..R {
            for p in 0..4 {
                let at = (r * 4 + p) * STRIP + x;
                let (below, above) = (load::<S>(below, at), load::<S>(above, at));
                if EVEN {
                    sums[p] = fma(simd, weights[r], simd.add_f32s(below, above), sums[p]);
                } else {
                    sums[p] = fma(simd, weights[r], below, sums[p]);
                    sums[p] = fma(simd, opposite[r], above, sums[p]);
                }
            }
        }
    }
    sums
}
