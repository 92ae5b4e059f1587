//! The paper's plain forms, for comparison: every pixel gathers with exactly its own radius, from all around it,
//! with no regard to depth edges. Separable (passes `blur`), or exact in two dimensions (pass `gather`).

use pulp::{Simd, WithSimd};

use super::rows::Rows;
use super::simd::madd;
use crate::bokeh::bank::Bank;

/// One row of the exact gather: each pixel with the full kernel of its own radius.
pub struct Exact<'a> {
    /// Colour and coverage (1 everywhere), padded by the reach.
    pub source: &'a Rows<4>,
    /// Columns and rows.
    pub size: (usize, usize),
    /// Kernels by node, `(2 r + 1)^2` taps each, far and turned.
    pub kernels: &'a [[Vec<f32>; 2]],
    /// The bank (for the nodes).
    pub bank: &'a Bank,
    /// Signed CoC of this row.
    pub coc: &'a [f32],
    /// The row.
    pub y: usize,
    /// `[3][width]`.
    pub out: &'a mut [f32],
}

impl WithSimd for Exact<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (width, height) = self.size;
        for x in 0..width {
            let node = self.bank.node(self.coc[x].abs());
            let reach = self.bank.node_reach[node] as usize;
            let kernel = &self.kernels[node][usize::from(self.coc[x] < 0.0)];
            let side = 2 * reach + 1;
            let mut sums = [simd.splat_f32s(0.0); 3];
            let mut tails = [0.0f32; 3];
            for (k, taps) in kernel.chunks_exact(side).enumerate() {
                let y = (self.y + k).saturating_sub(reach).min(height - 1);
                let row = self.source.row(y);
                let (taps, taps_tail) = S::as_simd_f32s(taps);
                for p in 0..3 {
                    let values = &row[p * self.source.stride + self.source.pad + x - reach..][..side];
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
pub struct GatherRow<'a> {
    /// As in [`Exact`].
    pub source: &'a Rows<4>,
    /// Columns.
    pub width: usize,
    /// The filters.
    pub bank: &'a Bank,
    /// Signed CoC of this row.
    pub coc: &'a [f32],
    /// The row.
    pub y: usize,
    /// The result.
    pub out: &'a mut [f32],
}

impl WithSimd for GatherRow<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let row = self.source.row(self.y);
        for x in 0..self.width {
            let node = self.bank.node(self.coc[x].abs());
            let reach = self.bank.node_reach[node] as isize;
            let sign = if self.coc[x] < 0.0 { -1 } else { 1 };
            for t in 0..self.bank.terms {
                let mut sum = [0.0f32; 3];
                for j in -reach..=reach {
                    let tap = self.bank.horizontal[self.bank.tap(node, sign * j) + t];
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
pub struct GatherColumn<'a> {
    /// All rows of the horizontal pass.
    pub rows: &'a [f32],
    /// Columns and rows.
    pub size: (usize, usize),
    /// The filters.
    pub bank: &'a Bank,
    /// Signed CoC of this row.
    pub coc: &'a [f32],
    /// The row.
    pub y: usize,
    /// The result.
    pub out: &'a mut [f32],
}

impl WithSimd for GatherColumn<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (width, height) = self.size;
        let terms = self.bank.terms;
        for x in 0..width {
            let node = self.bank.node(self.coc[x].abs());
            let reach = self.bank.node_reach[node] as isize;
            let sign = if self.coc[x] < 0.0 { -1 } else { 1 };
            let mut sum = [0.0f32; 3];
            for j in -reach..=reach {
                let y = self.y.saturating_add_signed(j).min(height - 1);
                let row = &self.rows[y * terms * 3 * width..][..terms * 3 * width];
                let taps = &self.bank.vertical[self.bank.tap(node, sign * j)..][..terms];
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
