//! Pass `bin`: a bin's share of each pixel, premultiplied and averaged down, and the coarse grid over it.

use pulp::{Simd, WithSimd};

use super::rows::{CELL_PLANES, Rows};
use super::simd::madd;
use super::unpack::{TILE_H, TILE_W};
use crate::bokeh::plan::{CELL, COVERAGE_FLOOR};

/// How much of a pixel with a given CoC a bin takes.
#[derive(Clone, Copy, Debug)]
pub struct Share {
    /// Border to the bin in front: CoC and slope of the hand-over.
    pub front: Option<(f32, f32)>,
    /// Border to the bin behind.
    pub behind: Option<(f32, f32)>,
}

impl Share {
    /// The share at a CoC, 0 to 1; the shares of all bins of a plan sum to 1.
    #[inline(always)]
    pub fn at(&self, coc_px: f32) -> f32 {
        step(self.front, coc_px, 1.0) - step(self.behind, coc_px, 0.0)
    }

    /// Whether any CoC in a range has a share.
    pub fn meets(&self, (low_px, high_px): (f32, f32)) -> bool {
        step(self.front, high_px, 1.0) > 0.0 && step(self.behind, low_px, 0.0) < 1.0
    }
}

#[inline(always)]
fn step(border: Option<(f32, f32)>, coc_px: f32, without: f32) -> f32 {
    match border {
        Some((at, slope)) => ((coc_px - at) * slope + 0.5).clamp(0.0, 1.0),
        None => without,
    }
}

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
    /// Sums of up to 4 rows at picture scale: `5 * TILE_W` values.
    pub scratch: &'a mut [f32],
}

impl WithSimd for BinBand<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        match self.scale {
            1 => self.fill::<S, 1>(),
            2 => self.fill::<S, 2>(),
            _ => self.fill::<S, 4>(),
        }
    }
}

impl BinBand<'_> {
    #[inline(always)]
    fn fill<V: Simd, const S: usize>(mut self) {
        let cells_across = self.cells.len() / CELL_PLANES;
        let rows = self.out.len() / (5 * self.stride);
        self.cells[..2 * cells_across].fill(0.0);
        self.cells[2 * cells_across..5 * cells_across].fill(f32::INFINITY);
        self.cells[5 * cells_across..].fill(f32::NEG_INFINITY);
        for chunk in 0..self.size.0.div_ceil(TILE_W) {
            let (x0, across) = (chunk * TILE_W / S, TILE_W / S);
            let meets = self.share.is_none_or(|share| {
                let first = self.band * CELL * S / TILE_H;
                let tiles_across = self.size.0.div_ceil(TILE_W);
                (first..(first + S).min(self.tiles.len() / tiles_across))
                    .any(|row| share.meets(self.tiles[row * tiles_across + chunk]))
            });
            for row in 0..rows {
                for plane in 0..5 {
                    let start = (row * 5 + plane) * self.stride + self.pad + x0;
                    let take = across.min(self.stride - self.pad - x0);
                    self.out[start..start + take].fill(0.0);
                }
                if meets {
                    self.average::<V, S>(row, chunk);
                    self.measure(row, x0, across.min(self.width.saturating_sub(x0)));
                }
            }
        }
        for planes in self.out.chunks_exact_mut(self.stride) {
            let (first, last) = (planes[self.pad], planes[self.pad + self.width - 1]);
            planes[..self.pad].fill(first);
            planes[self.pad + self.width..].fill(last);
        }
    }

    /// Averages one row of one chunk.
    #[inline(always)]
    fn average<V: Simd, const S: usize>(&mut self, row: usize, chunk: usize) {
        let (width, height) = self.size;
        let sums: &mut [[f32; TILE_W]] = self.scratch.as_chunks_mut().0;
        let Some(sums) = sums.first_chunk_mut::<5>() else { return };
        *sums = [[0.0; TILE_W]; 5];
        let x0 = chunk * TILE_W;
        let take = TILE_W.min(width - x0);
        for sub in 0..S {
            let y = ((self.band * CELL + row) * S + sub).min(height - 1);
            let planes = self.scene.row(y);
            let plane = |p: usize| &planes[p * self.scene.stride + x0..][..take];
            let (r, g, b, c) = (plane(0), plane(1), plane(2), plane(3));
            for x in 0..take {
                let share = self.share.map_or(1.0, |share| share.at(c[x]));
                sums[0][x] = madd::<V>(share, r[x], sums[0][x]);
                sums[1][x] = madd::<V>(share, g[x], sums[1][x]);
                sums[2][x] = madd::<V>(share, b[x], sums[2][x]);
                sums[3][x] += share;
                sums[4][x] = madd::<V>(share, c[x].abs(), sums[4][x]);
            }
        }
        let out_width = take.div_ceil(S);
        for (plane, sum) in sums.iter_mut().enumerate() {
            for x in take..out_width * S {
                sum[x] = sum[take - 1];
            }
            let start = (row * 5 + plane) * self.stride + self.pad + x0 / S;
            let out = &mut self.out[start..start + out_width];
            for (out, group) in out.iter_mut().zip(sum.as_chunks::<S>().0) {
                *out = group.iter().sum::<f32>() * (1.0 / (S * S) as f32);
            }
        }
    }

    /// Adds a row of one chunk to its cells.
    #[inline(always)]
    fn measure(&mut self, row: usize, x0: usize, take: usize) {
        let across = self.cells.len() / CELL_PLANES;
        let plane = |p: usize| (row * 5 + p) * self.stride + self.pad + x0;
        for first in (0..take).step_by(CELL) {
            let cell = (x0 + first) / CELL;
            let span = CELL.min(take - first);
            let coverage = &self.out[plane(3) + first..][..span];
            let sum: f32 = coverage.iter().sum();
            if sum <= 0.0 {
                continue;
            }
            self.cells[cell] += sum;
            self.cells[across + cell] += self.out[plane(4) + first..][..span].iter().sum::<f32>();
            for p in 0..3 {
                let color = &self.out[plane(p) + first..][..span];
                let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
                for (&color, &coverage) in color.iter().zip(coverage) {
                    let own = color / coverage;
                    let counts = coverage > COVERAGE_FLOOR;
                    low = if counts && own < low { own } else { low };
                    high = if counts && own > high { own } else { high };
                }
                let (lows, highs) = ((2 + p) * across + cell, (5 + p) * across + cell);
                self.cells[lows] = self.cells[lows].min(low);
                self.cells[highs] = self.cells[highs].max(high);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shares_of_all_bins_sum_to_one() {
        let borders = [(-7.0, 0.5), (-1.0, 3.0), (1.0, 3.0), (4.0, 0.8)];
        let bin = |k: usize| Share { front: k.checked_sub(1).map(|k| borders[k]), behind: borders.get(k).copied() };
        for step in -200..200 {
            let coc_px = step as f32 * 0.1;
            let sum: f32 = (0..=borders.len()).map(|k| bin(k).at(coc_px)).sum();
            assert!((sum - 1.0).abs() < 1e-6);
            assert!((0..=borders.len()).all(|k| bin(k).at(coc_px) >= 0.0));
            assert!((0..=borders.len()).all(|k| bin(k).at(coc_px) == 0.0 || bin(k).meets((coc_px, coc_px))));
        }
    }
}
