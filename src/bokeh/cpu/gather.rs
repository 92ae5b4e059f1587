//! The paper's plain forms, for comparison: every pixel gathers from its surroundings with exactly its own radius,
//! ignoring depth discontinuities. Separable (passes `blur`; McGraw, eq. 2), or exact in two dimensions (pass
//! `gather`).
//!
//! twin: shaders/blur/gather.wgsl

use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;

use pulp::{Arch, Simd, WithSimd};

use super::rows::{PlanarRows, STRIP, Strips, max_pad, repeat_edges};
use super::unpack::{InputFrame, compute_coc_row};
use crate::bokeh::bank::FilterBank;
use crate::bokeh::plan::Plan;
use crate::compute::simd::madd;
use crate::compute::thread_pool::{DisjointParts, ThreadPool};

/// Rows of the exact gather between two calls of `check_stop`: for each thread, and at most for all of them, as they
/// wait for one another after each of these steps.
const ROWS_PER_THREAD: usize = 16;
const ROWS_AT_ONCE: usize = 64;

/// Both forms of the gather, with their buffers.
pub struct Gather {
    /// Kernels of [`ExactGatherRow`]; empty unless the plan is exact.
    kernels: Vec<[Vec<f32>; 2]>,
    source: PlanarRows<4>,
    /// Signed CoC, `[row][width]`.
    coc: Vec<f32>,
    /// Results of the horizontal pass, `[row][term][3][width]`; empty if the plan is exact.
    rows: Vec<f32>,
    result: Vec<f32>,
}

impl Gather {
    /// Allocates for the pictures of a plan.
    pub fn new(plan: &Plan) -> Self {
        let (bank, pixels) = (&plan.bank, plan.width * plan.height);
        Self {
            kernels: if plan.exact {
                let turned = |node| if bank.is_symmetric { Vec::new() } else { bank.kernel(node, true) };
                (0..bank.nodes).map(|node| [bank.kernel(node, false), turned(node)]).collect()
            } else {
                Vec::new()
            },
            source: PlanarRows::new(plan.width, plan.height, max_pad(plan)),
            coc: vec![0.0; pixels],
            rows: vec![0.0; if plan.exact { 0 } else { pixels * 3 * plan.ladder.max_terms() }],
            result: vec![0.0; pixels * 3],
        }
    }

    /// Returns the result of the last frame, `[row][3][width]`.
    pub fn result(&self) -> &[f32] {
        &self.result
    }

    /// Blurs a frame whose only bin is in `strips`: copies it to padded rows, computes the CoC of every pixel, and
    /// gathers with the full kernels, which takes long and therefore calls `check_stop` now and then, or with the
    /// separable ones.
    pub fn run(
        &mut self,
        (workers, arch): (&mut ThreadPool, Arch),
        plan: &Plan,
        frame: &InputFrame<'_>,
        strips: &Strips,
        taken: &mut [AtomicBool],
        mut check_stop: impl FnMut() -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let (size, bank) = ((plan.width, plan.height), &*plan.bank);
        let (stride, pad, row_len) = (self.source.stride, self.source.pad, self.source.row_len());
        let padded = DisjointParts::new(&mut self.source.data, row_len, taken);
        workers.run(size.1, &|y| {
            for (p, plane) in padded.part(y).chunks_exact_mut(stride).enumerate() {
                for (strip, out) in plane[pad..pad + size.0].chunks_mut(STRIP).enumerate() {
                    out.copy_from_slice(&strips.row(strip, y)[p * STRIP..][..out.len()]);
                }
                repeat_edges(plane, pad, size.0);
            }
        });
        let source = &self.source;
        let coc = DisjointParts::new(&mut self.coc, size.0, taken);
        workers.run(size.1, &|y| compute_coc_row(frame, y, 0, coc.part(y)));
        let coc = |y: usize| &self.coc[y * size.0..][..size.0];
        if plan.exact {
            let out = DisjointParts::new(&mut self.result, 3 * size.0, taken);
            let kernels = &self.kernels;
            let rows_at_once = ROWS_AT_ONCE.min(ROWS_PER_THREAD * workers.thread_count());
            for first in (0..size.1).step_by(rows_at_once) {
                workers.run(rows_at_once.min(size.1 - first), &|row| {
                    let y = first + row;
                    arch.dispatch(ExactGatherRow { source, size, kernels, bank, coc: coc(y), y, out: out.part(y) });
                });
                check_stop()?;
            }
            return ControlFlow::Continue(());
        }
        let rows = &mut self.rows[..bank.terms * 3 * size.0 * size.1];
        let filtered = DisjointParts::new(rows, bank.terms * 3 * size.0, taken);
        workers.run(size.1, &|y| {
            arch.dispatch(GatherRow { source, width: size.0, bank, coc: coc(y), y, out: filtered.part(y) });
        });
        let out = DisjointParts::new(&mut self.result, 3 * size.0, taken);
        let rows = &self.rows;
        workers.run(size.1, &|y| {
            arch.dispatch(GatherColumn { rows, size, bank, coc: coc(y), y, out: out.part(y) });
        });
        ControlFlow::Continue(())
    }
}

/// One row of the exact gather: each pixel with the full kernel of its own radius.
struct ExactGatherRow<'a> {
    /// Colour and coverage (1 everywhere), padded by the filter half-width.
    pub source: &'a PlanarRows<4>,
    pub size: (usize, usize),
    /// Kernels by node, `(2 r + 1)^2` taps each, far and turned; the turned ones are empty if the aperture is
    /// symmetric.
    pub kernels: &'a [[Vec<f32>; 2]],
    /// The bank, for its nodes.
    pub bank: &'a FilterBank,
    /// Signed CoC of this row.
    pub coc: &'a [f32],
    pub y: usize,
    /// `[3][width]`.
    pub out: &'a mut [f32],
}

impl WithSimd for ExactGatherRow<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (width, height) = self.size;
        // Each pixel has its own kernel, so the vectors run along the kernel's rows and not over pixels.
        for x in 0..width {
            let node = self.bank.nearest_node(self.coc[x].abs());
            let half_width = self.bank.node_half_width[node] as usize;
            let kernel = &self.kernels[node][usize::from(self.coc[x] < 0.0 && !self.bank.is_symmetric)];
            let side = 2 * half_width + 1;
            let mut sums = [simd.splat_f32s(0.0); 3];
            let mut tails = [0.0f32; 3];
            for (k, taps) in kernel.chunks_exact(side).enumerate() {
                // Beyond the picture its outermost row repeats.
                let y = (self.y + k).saturating_sub(half_width).min(height - 1);
                let row = self.source.row(y);
                let (taps, taps_tail) = S::as_simd_f32s(taps);
                for p in 0..3 {
                    let values = &row[p * self.source.stride + self.source.pad + x - half_width..][..side];
                    let (values, values_tail) = S::as_simd_f32s(values);
                    for (tap, value) in taps.iter().zip(values) {
                        sums[p] = simd.mul_add_f32s(*tap, *value, sums[p]);
                    }
                    for (tap, value) in taps_tail.iter().zip(values_tail) {
                        tails[p] = madd::<S>(*tap, *value, tails[p]);
                    }
                }
            }
            for p in 0..3 {
                self.out[p * width + x] = simd.reduce_sum_f32s(sums[p]) + tails[p];
            }
        }
    }
}

/// One row of the horizontal pass of the separable gather: `[term][3][width]`.
struct GatherRow<'a> {
    /// Same as in [`ExactGatherRow`].
    pub source: &'a PlanarRows<4>,
    pub width: usize,
    pub bank: &'a FilterBank,
    /// Signed CoC of this row.
    pub coc: &'a [f32],
    pub y: usize,
    pub out: &'a mut [f32],
}

impl WithSimd for GatherRow<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let row = self.source.row(self.y);
        for x in 0..self.width {
            let node = self.bank.nearest_node(self.coc[x].abs());
            let half_width = self.bank.node_half_width[node] as isize;
            // In front of the focal plane a lens rotates its aperture by 180 degrees.
            let sign = if self.coc[x] < 0.0 { -1 } else { 1 };
            for t in 0..self.bank.terms {
                let mut sum = [0.0f32; 3];
                for j in -half_width..=half_width {
                    let tap = self.bank.horizontal[self.bank.tap_index(node, sign * j) + t];
                    let at = (self.source.pad + x).wrapping_add_signed(j);
                    for p in 0..3 {
                        sum[p] = madd::<S>(tap, row[p * self.source.stride + at], sum[p]);
                    }
                }
                (0..3).for_each(|p| self.out[(t * 3 + p) * self.width + x] = sum[p]);
            }
        }
    }
}

/// One row of the vertical pass: `[3][width]`.
struct GatherColumn<'a> {
    /// All rows of the horizontal pass.
    pub rows: &'a [f32],
    pub size: (usize, usize),
    pub bank: &'a FilterBank,
    /// Signed CoC of this row.
    pub coc: &'a [f32],
    pub y: usize,
    pub out: &'a mut [f32],
}

impl WithSimd for GatherColumn<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (width, height) = self.size;
        let terms = self.bank.terms;
        for x in 0..width {
            let node = self.bank.nearest_node(self.coc[x].abs());
            let half_width = self.bank.node_half_width[node] as isize;
            let sign = if self.coc[x] < 0.0 { -1 } else { 1 };
            let mut sum = [0.0f32; 3];
            for j in -half_width..=half_width {
                let y = self.y.saturating_add_signed(j).min(height - 1);
                // Row `y` was filtered with the radii of its own pixels, not of this one: the error of a separable
                // gather.
                let row = &self.rows[y * terms * 3 * width..][..terms * 3 * width];
                let taps = &self.bank.vertical[self.bank.tap_index(node, sign * j)..][..terms];
                for (t, tap) in taps.iter().enumerate() {
                    for p in 0..3 {
                        sum[p] = madd::<S>(*tap, row[(t * 3 + p) * width + x], sum[p]);
                    }
                }
            }
            (0..3).for_each(|p| self.out[p * width + x] = sum[p]);
        }
    }
}
