//! What the passes leave behind, for comparing the executors pass by pass.

use super::CpuBokeh;
use super::rows::STRIP;
use crate::bokeh::Probe;

impl CpuBokeh {
    /// The result of a pass over the last frame, in the layout that [`Probe`] states. Allocates; for tests.
    pub fn probe(&self, probe: Probe) -> Vec<[f32; 4]> {
        match probe {
            Probe::Scene => Vec::new(),
            Probe::Bin(k) => {
                let (bin, source) = (&self.plan.bins[k], &self.slots[self.plan.bins[k].slot].source);
                let pixels = |y: usize| (0..bin.width).map(move |x| (x, y));
                let at =
                    |(x, y): (usize, usize)| std::array::from_fn(|p| source.row(x / STRIP, y)[p * STRIP + x % STRIP]);
                (0..bin.height).flat_map(pixels).map(at).collect()
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

    /// Whether anything in the last frame belonged to bin `k`; if not, its passes were left out.
    pub fn is_present(&self, k: usize) -> bool {
        self.slots[self.plan.bins[k].slot].present
    }
}
