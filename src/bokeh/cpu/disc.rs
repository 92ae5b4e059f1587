//! Pass `blur` for discs: sums of whole discs from cumulative sums down each column (summed-area rows), in integers, so
//! that they are exact whatever the order.

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use std::ops::Range;

use pulp::Simd;

use super::blur::Strip;
use super::rows::{COPY_WIDTH, STRIP, STRIP_ROW};
use crate::bokeh::disc::{ColumnRun, DiscBank, MAX_HALF_WIDTH};
use crate::bokeh::plan::{CELL, SEGMENT};
use crate::compute::simd::{madd, round_to_integer};

/// Lines of the source in memory at once: a row and its neighbours.
const LINES: usize = 4;
/// Largest number of steps of a value: what [`round_to_integer`] can round.
const MAX_STEPS: f32 = (1 << 22) as f32;

/// Scratch memory for the discs of a thread.
#[derive(Default)]
pub struct DiscScratch {
    /// Cumulative sums down the columns, as a ring of rows: `[row][plane][columns]`.
    sums: Vec<u32>,
    /// `[row % LINES][plane][columns]`.
    lines: Vec<f32>,
}

/// Columns of a line: those of a strip and a small, medium or large filter support on both sides.
const COLUMNS: [usize; 3] = [STRIP + 2 * COPY_WIDTH, STRIP + 4 * COPY_WIDTH, STRIP + 8 * COPY_WIDTH];
const _: () = assert!(COLUMNS[2] == STRIP + 2 * MAX_HALF_WIDTH);

/// Returns the columns of a line for filters of a half-width.
fn columns(half_width: usize) -> usize {
    COLUMNS.into_iter().find(|columns| STRIP + 2 * half_width <= *columns).unwrap_or(COLUMNS[2])
}

/// Returns the rows of the ring: a power of two, so that an index is masked.
fn ring_rows(half_width: usize) -> usize {
    (2 * half_width + 2).next_power_of_two()
}

impl DiscScratch {
    /// Allocates for filters up to a half-width.
    pub fn new(half_width: usize) -> Self {
        let columns = columns(half_width);
        Self { sums: vec![0; ring_rows(half_width) * 4 * columns], lines: vec![0.0; LINES * 4 * columns] }
    }
}

impl Strip<'_> {
    /// Sums the discs of `P` planes of all rows of cells that are made.
    #[inline(always)]
    pub(super) fn sum_discs<S: Simd, const P: usize>(&mut self, simd: S, (discs, max_light): (&DiscBank, f32)) {
        match columns(self.half_width) {
            columns if columns == COLUMNS[0] => self.sum_columns::<S, P, { COLUMNS[0] }>(simd, discs, max_light),
            columns if columns == COLUMNS[1] => self.sum_columns::<S, P, { COLUMNS[1] }>(simd, discs, max_light),
            _ => self.sum_columns::<S, P, { COLUMNS[2] }>(simd, discs, max_light),
        }
    }

    #[inline(always)]
    fn sum_columns<S: Simd, const P: usize, const C: usize>(&mut self, simd: S, discs: &DiscBank, max_light: f32) {
        let mut scratch = std::mem::take(&mut self.scratch.discs);
        let rows = ring_rows(self.half_width);
        let sums = &mut scratch.sums.as_chunks_mut::<C>().0[..rows * P];
        let lines = &mut scratch.lines[..LINES * 4 * C];
        // The largest power of two at which no value and no sum overflows.
        let pixels = discs.max_pixels(self.max_radius_px);
        let steps = MAX_STEPS.min((i32::MAX as f32) / (1.1 * pixels)) / max_light;
        let steps = f32::from_bits(steps.to_bits() & f32::INFINITY.to_bits());
        let smoothing = discs.smoothing(self.max_radius_px);
        let (height, down) = (self.size.1, self.half_width as isize);
        let mut y = 0;
        while y < height {
            if !self.scratch.made[y / CELL] {
                y = (y / CELL + 1) * CELL;
                continue;
            }
            let first_unmade = (y / CELL..height.div_ceil(CELL)).find(|&row| !self.scratch.made[row]);
            let end = first_unmade.map_or(height, |row| row * CELL);
            let first = y as isize - down;
            let mut running = [[0; C]; P];
            sums[((first - 1) as usize & (rows - 1)) * P..][..P].copy_from_slice(&running);
            self.copy_lines::<C>(first - 1..first + 1, lines);
            for next in first..end as isize + down {
                self.copy_lines::<C>(next + 1..next + 2, lines);
                self.add_row::<S, P, C>((next, rows), lines, (smoothing, steps), &mut running, sums);
                if next - down >= y as isize {
                    let row = (next - down) as usize;
                    self.sum_row::<S, P, C>(simd, discs, (row, rows), 1.0 / steps, sums);
                }
            }
            y = end;
        }
        self.scratch.discs = scratch;
    }

    /// Copies rows of the source with their support; beyond the picture its outermost rows repeat.
    #[inline(always)]
    fn copy_lines<const C: usize>(&self, ys: Range<isize>, lines: &mut [f32]) {
        for y in ys {
            let inside = y.clamp(0, self.size.1 as isize - 1) as usize;
            let line = &mut lines[(y as usize % LINES) * 4 * C..][..4 * C];
            if self.scratch.filtered[inside / CELL] {
                self.source.copy_line(self.strip, inside, self.size.0, (C - STRIP) / 2, line);
            } else {
                line.fill(0.0);
            }
        }
    }

    /// Adds row `y`, smoothed along both axes, to the cumulative sums.
    #[inline(always)]
    fn add_row<S: Simd, const P: usize, const C: usize>(
        &mut self,
        (y, rows): (isize, usize),
        lines: &[f32],
        (smoothing, steps): (f32, f32),
        running: &mut [[u32; C]; P],
        sums: &mut [[u32; C]],
    ) {
        let line = |y: isize, p: usize| -> &[f32; C] { &lines[(y as usize % LINES) * 4 * C..].as_chunks::<C>().0[p] };
        let middle = 1.0 - 2.0 * smoothing;
        let here = &mut sums[(y as usize & (rows - 1)) * P..][..P];
        for p in 0..P {
            let (above, own, below) = (line(y - 1, p), line(y, p), line(y + 1, p));
            let mut smoothed = [0.0; C];
            for x in 0..C {
                smoothed[x] = madd::<S>(above[x] + below[x], smoothing, own[x] * middle) * steps;
            }
            let (running, out) = (&mut running[p], &mut here[p]);
            for x in 1..C - 1 {
                let value = madd::<S>(smoothed[x - 1] + smoothed[x + 1], smoothing, smoothed[x] * middle);
                running[x] = running[x].wrapping_add(round_to_integer(value));
                out[x] = running[x];
            }
        }
    }

    /// Sums the discs around row `y` of the result.
    #[inline(always)]
    fn sum_row<S: Simd, const P: usize, const C: usize>(
        &mut self,
        simd: S,
        discs: &DiscBank,
        (y, rows): (usize, usize),
        unit: f32,
        sums: &[[u32; C]],
    ) {
        let edges = self.edges.at(self.strip, y);
        let out = &mut self.out[y * STRIP_ROW..][..STRIP_ROW];
        for segment in 0..STRIP / SEGMENT {
            let first = (C - STRIP) / 2 + segment * SEGMENT;
            let radius_px = 0.5 * (edges[segment][0] + edges[segment + 1][0]);
            for (disc, (runs, weight)) in discs.kernel(radius_px).enumerate() {
                for half in (0..SEGMENT).step_by(lanes::<S>() * S::U32_LANES) {
                    let totals = sum_runs::<S, P, C>(simd, runs, (y, rows), first + half, sums);
                    for (p, totals) in totals.iter().enumerate() {
                        let out = &mut out[p * STRIP + segment * SEGMENT + half..][..lanes::<S>() * S::U32_LANES];
                        let mut values = [0u32; SEGMENT];
                        for (lane, total) in totals.iter().take(lanes::<S>()).enumerate() {
                            S::as_mut_simd_u32s(&mut values[lane * S::U32_LANES..][..S::U32_LANES]).0[0] = *total;
                        }
                        for (out, value) in out.iter_mut().zip(values) {
                            let value = value as i32 as f32 * (weight * unit);
                            *out = if disc == 0 { value } else { *out + value };
                        }
                    }
                }
            }
        }
        // A whole bin is summed without its coverage, which is 1.
        if P == 3 {
            out[3 * STRIP..].fill(1.0);
        }
    }
}

/// Sums the runs around row `y` for some columns, from column `at` of the cumulative sums on.
#[inline(always)]
fn sum_runs<S: Simd, const P: usize, const C: usize>(
    simd: S,
    runs: &[ColumnRun],
    (y, rows): (usize, usize),
    at: usize,
    sums: &[[u32; C]],
) -> [[S::u32s; 2]; P] {
    let mut totals = [[simd.splat_u32s(0); 2]; P];
    for run in runs {
        let at = at.wrapping_add_signed(isize::from(run.offset));
        let top = (y as isize + isize::from(run.half_height)) as usize & (rows - 1);
        let bottom = (y as isize - isize::from(run.half_height) - 1) as usize & (rows - 1);
        let (top, bottom) = (&sums[top * P..][..P], &sums[bottom * P..][..P]);
        for p in 0..P {
            let (top, bottom) = (&top[p][at..], &bottom[p][at..]);
            for lane in 0..lanes::<S>() {
                let (top, bottom) = (load::<S>(top, lane * S::U32_LANES), load::<S>(bottom, lane * S::U32_LANES));
                totals[p][lane] = simd.sub_u32s(simd.add_u32s(totals[p][lane], top), bottom);
            }
        }
    }
    totals
}

/// Vectors of a segment that are summed at once: there are registers for two of every plane.
#[inline(always)]
fn lanes<S: Simd>() -> usize {
    if S::U32_LANES < SEGMENT { 2 } else { 1 }
}

#[inline(always)]
fn load<S: Simd>(values: &[u32], at: usize) -> S::u32s {
    S::as_simd_u32s(&values[at..at + S::U32_LANES]).0[0]
}
