//! Pass `bin`: a bin's share of each pixel, premultiplied and averaged down, and the coarse grid over it.

use pulp::{Simd, WithSimd};

use super::aligned::Line;
use super::rows::{CELL_PLANES, MARGIN, NO_COLOR, Rows, TILE_W, repeat_ends};
use super::simd::madd;
use crate::bokeh::plan::{CELL, COVERAGE_FLOOR, Share};

/// One row of cells of one bin.
pub struct BinBand<'a> {
    /// The picture from `unpack`.
    pub scene: &'a Rows<4>,
    /// Columns and rows of the picture.
    pub size: (usize, usize),
    /// CoC range of each tile of the picture.
    pub tiles: &'a [(f32, f32)],
    /// The bin's share; `None` takes everything whole (no depth edges to respect).
    pub share: Option<Share>,
    /// Pixels of the picture a bin pixel covers, each way.
    pub scale: usize,
    /// Which row of cells.
    pub band: usize,
    /// Columns of the bin.
    pub width: usize,
    /// The bin's rows of this band.
    pub out: &'a mut [f32],
    /// Values of a plane row of `out`, and columns in front of its first pixel.
    pub stride: usize,
    /// Padding on both sides.
    pub pad: usize,
    /// This row of cells.
    pub cells: &'a mut [f32],
    /// Per tile across, whether `out` holds anything but zeros there.
    pub filled: &'a mut [bool],
}

impl WithSimd for BinBand<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        match self.scale {
            1 => self.fill::<S, 1, TILE_W>(),
            2 => self.fill::<S, 2, WIDE>(),
            _ => self.fill::<S, 4, WIDE>(),
        }
    }
}

impl BinBand<'_> {
    #[inline(always)]
    fn fill<V: Simd, const S: usize, const W: usize>(mut self) {
        let across = self.cells.len() / CELL_PLANES;
        self.cells[..2 * across].fill(0.0);
        self.cells[2 * across..5 * across].fill(NO_COLOR);
        self.cells[5 * across..].fill(-NO_COLOR);
        for chunk in 0..self.filled.len() {
            if self.meets::<S>(chunk) {
                self.chunk::<V, S, W>(chunk);
                self.filled[chunk] = true;
            } else if std::mem::take(&mut self.filled[chunk]) {
                for plane in self.out.chunks_exact_mut(self.stride) {
                    plane[self.pad + chunk * (TILE_W / S)..][..TILE_W / S].fill(0.0);
                }
            }
        }
        for plane in self.out.chunks_exact_mut(self.stride) {
            repeat_ends(plane, self.pad, self.width);
        }
    }

    /// Whether a chunk of this row of cells, or what its averages reach beyond it, has anything for this bin.
    #[inline(always)]
    fn meets<const S: usize>(&self, chunk: usize) -> bool {
        let Some(share) = self.share else { return true };
        let (across, beyond) = (self.filled.len(), usize::from(S > 1));
        let rows =
            (self.band * S).saturating_sub(beyond)..((self.band + 1) * S + beyond).min(self.tiles.len() / across);
        let columns = chunk.saturating_sub(beyond)..(chunk + beyond + 1).min(across);
        rows.into_iter().any(|row| self.tiles[row * across..][columns.clone()].iter().any(|&tile| share.meets(tile)))
    }

    /// One chunk of all rows, and its cells.
    #[inline(always)]
    fn chunk<V: Simd, const S: usize, const W: usize>(&mut self, chunk: usize) {
        let rows = self.out.len() / (5 * self.stride);
        let (x0, width) = (chunk * TILE_W / S, TILE_W / S);
        let mut sums = Line([[[0.0f32; W]; 5]; CELL]);
        let sums = &mut sums.0[..rows];
        self.sum_rows::<V, S, W>(chunk, sums);
        let (mut coverage, mut range) = (Line([[0.0f32; TILE_W]; 2]), Line([[NO_COLOR; TILE_W]; 6]));
        let (coverage, range) = (&mut coverage.0, &mut range.0);
        range[3..].fill([-NO_COLOR; TILE_W]);
        let taps = tent::<S>();
        for (row, sum) in sums.iter().enumerate() {
            let mut means = Line([[0.0f32; TILE_W]; 5]);
            let means = &mut means.0;
            for (mean, sum) in means.iter_mut().zip(sum) {
                if S == 1 {
                    mean.copy_from_slice(&sum[..TILE_W]);
                    continue;
                }
                let groups = sum[(W - TILE_W) / 2 - S / 2..].as_chunks::<S>().0;
                for (x, mean) in mean[..TILE_W / S].iter_mut().enumerate() {
                    let mut total = 0.0;
                    for k in 0..S {
                        total = madd::<V>(taps[k], groups[x][k], total);
                        total = madd::<V>(taps[S + k], groups[x + 1][k], total);
                    }
                    *mean = total;
                }
            }
            for (p, mean) in means.iter().enumerate() {
                self.out[(row * 5 + p) * self.stride + self.pad + x0..][..width].copy_from_slice(&mean[..width]);
            }
            for x in 0..width {
                coverage[0][x] += means[3][x];
                coverage[1][x] += means[4][x];
                let counts = means[3][x] > COVERAGE_FLOOR;
                let inverse = if counts { 1.0 / means[3][x] } else { 0.0 };
                // An addition, where a choice would become masked stores that the next row waits for.
                let out_of_range = if counts { 0.0 } else { NO_COLOR };
                for p in 0..3 {
                    let own = means[p][x] * inverse;
                    let (low, high) = (own + out_of_range, own - out_of_range);
                    range[p][x] = if low < range[p][x] { low } else { range[p][x] };
                    range[3 + p][x] = if high > range[3 + p][x] { high } else { range[3 + p][x] };
                }
            }
        }
        let across = self.cells.len() / CELL_PLANES;
        let valid = width.min(self.width.saturating_sub(x0));
        for first in (0..valid).step_by(CELL) {
            let (cell, span) = ((x0 + first) / CELL, first..(first + CELL).min(valid));
            for p in 0..2 {
                self.cells[p * across + cell] = coverage[p][span.clone()].iter().sum();
                for k in 0..3 {
                    let values = range[3 * p + k][span.clone()].iter().copied();
                    let value = &mut self.cells[(2 + 3 * p + k) * across + cell];
                    *value = if p == 0 { values.fold(*value, f32::min) } else { values.fold(*value, f32::max) };
                }
            }
        }
    }

    /// The rows of the picture around each row of the bin, weighted and summed.
    #[inline(always)]
    fn sum_rows<V: Simd, const S: usize, const W: usize>(&self, chunk: usize, sums: &mut [[[f32; W]; 5]]) {
        let taps = tent::<S>();
        let (before, taps_down) = if S > 1 { (S / 2, 2 * S) } else { (0, 1) };
        let start = MARGIN + chunk * TILE_W - (W - TILE_W) / 2;
        // Row `k` of the picture from the first that the first bin row needs.
        for k in 0..(sums.len() - 1) * S + taps_down {
            let y = (self.band * CELL * S + k).saturating_sub(before).min(self.size.1 - 1);
            let planes = self.scene.row(y);
            let plane = |p: usize| planes[p * self.scene.stride + start..].first_chunk::<W>();
            let (Some(r), Some(g), Some(b), Some(c)) = (plane(0), plane(1), plane(2), plane(3)) else { continue };
            let mut values = Line([[1.0f32; W]; 5]);
            let values = &mut values.0;
            if let Some(share) = self.share {
                for x in 0..W {
                    values[3][x] = share.at(c[x]);
                }
            }
            for x in 0..W {
                let share = values[3][x];
                values[0][x] = share * r[x];
                values[1][x] = share * g[x];
                values[2][x] = share * b[x];
                values[4][x] = share * c[x].abs();
            }
            // The last bin row that starts at or before row `k`, and the one above it while its taps reach here.
            let last = (k / S).min(sums.len() - 1);
            for row in last.saturating_sub(1)..=last {
                let Some(&tap) = (k - row * S < taps_down).then(|| &taps[k - row * S]) else { continue };
                for (sum, value) in sums[row].iter_mut().zip(values.iter()) {
                    for x in 0..W {
                        sum[x] = madd::<V>(tap, value[x], sum[x]);
                    }
                }
            }
        }
    }
}

/// Columns summed for a chunk of a reduced bin: the chunk and a margin on both sides.
const WIDE: usize = TILE_W + 2 * MARGIN;

/// The weights of the `2 S` pixels around a bin pixel: a tent, so that reducing a picture keeps its centroid.
#[inline(always)]
fn tent<const S: usize>() -> [f32; 8] {
    let mut taps = [0.0; 8];
    if S == 1 {
        taps[0] = 1.0;
        return taps;
    }
    for (k, tap) in taps[..2 * S].iter_mut().enumerate() {
        *tap = (1.0 - ((k as f32 + 0.5) / S as f32 - 1.0).abs()) / S as f32;
    }
    taps
}
