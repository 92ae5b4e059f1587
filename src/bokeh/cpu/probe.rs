//! Read access to intermediate results, for comparing the executors pass by pass.

use pulp::Scalar;

use super::CpuBokeh;
use super::rows::{STRIP, STRIP_ROW};
use super::tiles::{TILE_H, TILE_W};
use crate::bokeh::Probe;

impl CpuBokeh {
    /// Returns the result of a pass over the last frame, in the layout of [`Probe`]. Allocates; not for every frame.
    pub fn probe(&self, probe: Probe) -> Vec<[f32; 4]> {
        match probe {
            Probe::Bin(k) => {
                let (bin, slot) = (&self.plan.bins[k], &self.slots[self.plan.bins[k].slot]);
                let mut row = [0.0; STRIP_ROW];
                let mut pixels = vec![[0.0; 4]; bin.width * bin.height];
                for (n, pixel) in pixels.iter_mut().enumerate() {
                    let (x, y) = (n % bin.width, n / bin.width);
                    if x % STRIP == 0 {
                        row.copy_from_slice(slot.source.row(x / STRIP, y));
                        if let Some(decimated) = slot.decimated.as_ref().filter(|decimated| decimated.is_in_use()) {
                            decimated.recolor_line(Scalar::new(), (x / STRIP, y), 0, &mut row);
                        }
                    }
                    *pixel = std::array::from_fn(|p| row[p * STRIP + x % STRIP]);
                }
                pixels
            }
            Probe::Reach(k) => self.slots[self.plan.bins[k].slot].edges.data.as_chunks::<4>().0.to_vec(),
            Probe::Blur(k) => {
                let (bin, rows) = (&self.plan.bins[k], &self.slots[self.plan.bins[k].slot]);
                let pixels = |y: usize| (0..bin.width).map(move |x| (x, y));
                let at = |(x, y): (usize, usize)| {
                    let start = (x / STRIP * bin.height + y) * 4 * STRIP + x % STRIP;
                    std::array::from_fn(|p| rows.out[start + p * STRIP])
                };
                (0..bin.height).flat_map(pixels).map(at).collect()
            }
        }
    }

    /// Whether bin `k` had any content in the last frame; if not, its passes were skipped.
    pub fn is_present(&self, k: usize) -> bool {
        self.slots[self.plan.bins[k].slot].present
    }

    /// Whether a pixel of a bin of scale `scale`, or any within `around` bin pixels of it, is in a tile that no bin of
    /// the last frame needed because its surroundings are in focus: the bins may be empty there.
    pub fn is_idle_around(&self, (x, y): (usize, usize), around: usize, scale: usize) -> bool {
        let tiles = |at: usize, tile: usize, count: usize| {
            let first = at.saturating_sub(around) * scale / tile;
            first..((at + around) * scale / tile + 1).min(count).max(first)
        };
        let (across, down) = (self.tiles.across, self.tiles.down);
        let columns = tiles(x, TILE_W, across);
        tiles(y, TILE_H, down).any(|row| columns.clone().any(|column| self.tiles.idle[row * across + column]))
    }
}
