//! Depth slicing by histogram: where a frame's CoC is split into bins: where few pixels lie, so that a surface stays in
//! one piece and two surfaces do not share a bin. A flat background then costs one bin, however wide the range that the
//! lens could reach.

use super::rung::{FOCUS_BORDER_PX, Rung};
use crate::frame::DepthMap;
use crate::optics::DepthCoc;

/// Buckets to an octave of `|c|`.
const PER_OCTAVE: usize = 16;
/// Buckets on one side of the focal plane: `|c|` from 1 px to 256 px, and beyond in the last.
const BUCKETS: usize = 8 * PER_OCTAVE;
/// Bits of a float below those that tell the bucket.
const BUCKET_SHIFT: u32 = f32::MANTISSA_DIGITS - 1 - PER_OCTAVE.ilog2();
/// The bits of 1.0, where the buckets begin.
const FIRST: u32 = FOCUS_BORDER_PX.to_bits() >> BUCKET_SHIFT;
/// At least as many samples are taken across a frame that has them, and less than twice as many.
const SAMPLES_ACROSS: usize = 320;
/// A bin more must lower the spread of `ln |c|` within the bins by this much, as variance times share of the picture.
const BIN_COST: f64 = 0.002;
/// This share of a bin's pixels may have a smaller radius than its scale is made for.
const STRAY: f32 = 0.02;

/// A range of `|c|` on one side of the focal plane, and where in it pixels lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Border towards the focal plane, pixels.
    pub border_px: f32,
    /// Below this lies nothing but strays.
    pub low_px: f32,
    pub high_px: f32,
}

/// The CoC of a frame, counted.
#[derive(Clone, Debug)]
pub struct Counts {
    sides: [[u32; BUCKETS]; 2],
    samples: u32,
}

impl Default for Counts {
    fn default() -> Self {
        Self { sides: [[0; BUCKETS]; 2], samples: 0 }
    }
}

impl Counts {
    /// Counts the pixels of a frame, on a grid that is fine enough for the statistics.
    pub fn count(&mut self, depth: &DepthMap, lens: &DepthCoc) {
        *self = Self::default();
        let (width, height) = (depth.width as usize, depth.height as usize);
        let step = (width / SAMPLES_ACROSS).max(1);
        for row in depth.metres.chunks_exact(width.max(1)).take(height).step_by(step) {
            for &metres in row.iter().step_by(step) {
                let coc_px = lens.coc_px(metres);
                let bucket = (coc_px.abs().to_bits() >> BUCKET_SHIFT).wrapping_sub(FIRST);
                if bucket < 1 << 16 {
                    self.sides[usize::from(coc_px < 0.0)][(bucket as usize).min(BUCKETS - 1)] += 1;
                }
                self.samples += 1;
            }
        }
    }

    /// The pieces of one side, from the focal plane outwards: at most as many as the rung has bins. Returns the largest
    /// radius of what is left to the bin in focus. In front that has everything up to `near_from_px`.
    pub fn pieces(&self, near: bool, rung: &Rung, near_from_px: f32, pieces: &mut Vec<Piece>) -> f32 {
        pieces.clear();
        let side = &self.sides[usize::from(near)];
        let bins = (rung.bins_per_side as usize).min(MAX_PIECES);
        let Some(last) = side.iter().rposition(|&n| n > 0) else { return FOCUS_BORDER_PX };
        // A nose is not a layer of its own: what is hardly out of focus in front belongs to the subject.
        let first = if near { near_from_px.log2() * PER_OCTAVE as f32 } else { 0.0 } as usize;
        if last < first {
            return edge_px(last + 1);
        }
        // Sums of counts, of counts times ln |c| and of counts times its square, up to each bucket.
        let mut sums = [[0.0f64; 3]; BUCKETS + 1];
        for (k, &n) in side.iter().enumerate() {
            let (n, at) = (f64::from(n) / f64::from(self.samples), (f64::from(edge_px(k)) * 1.04).ln());
            sums[k + 1] = [sums[k][0] + n, sums[k][1] + n * at, sums[k][2] + n * at * at];
        }
        let spread = |from: usize, to: usize| {
            let [n, a, b] = std::array::from_fn(|p| sums[to][p] - sums[from][p]);
            if n > 0.0 { (b - a * a / n).max(0.0) } else { 0.0 }
        };
        // best[j][to]: least cost of buckets first..to in j + 1 pieces, and where the last of them begins.
        let mut best = [[(f64::INFINITY, 0usize); BUCKETS + 1]; MAX_PIECES];
        for (to, best) in best[0].iter_mut().enumerate().take(last + 2).skip(first + 1) {
            *best = (spread(first, to), first);
        }
        for j in 1..bins {
            for to in first + j + 1..=last + 1 {
                for from in first + j..to {
                    // Bins at full scale are dear: only the first ones may be.
                    if side[from] == 0 || j >= rung.fine_bins() && edge_px(from) < rung.scale_from_px[1] {
                        continue;
                    }
                    let cost = best[j - 1][from].0 + spread(from, to) + BIN_COST;
                    if cost < best[j][to].0 {
                        best[j][to] = (cost, from);
                    }
                }
            }
        }
        let count = (0..bins).min_by(|&a, &b| best[a][last + 1].0.total_cmp(&best[b][last + 1].0)).unwrap_or(0);
        let mut to = last + 1;
        for j in (0..=count).rev() {
            let from = best[j][to].1;
            pieces.push(self.piece(side, from, to));
            to = from;
        }
        pieces.reverse();
        pieces.first().map_or(FOCUS_BORDER_PX, |piece| piece.border_px)
    }

    /// The piece of buckets `from..to`.
    fn piece(&self, side: &[u32; BUCKETS], from: usize, to: usize) -> Piece {
        let total: u32 = side[from..to].iter().sum();
        let first = (from..to).find(|&k| side[k] > 0).unwrap_or(from);
        let mut strays = (STRAY * total as f32) as u32;
        let low = (from..to).find(|&k| {
            let within = side[k] <= strays;
            strays = strays.saturating_sub(side[k]);
            !within
        });
        let high = (from..to).rposition(|k| side[k] > 0).map_or(from, |k| from + k);
        let before = (0..first).rev().find(|&k| side[k] > 0).map_or(0, |k| k + 1);
        Piece {
            border_px: (edge_px(before) * edge_px(first)).sqrt().min(2.5 * edge_px(before)),
            low_px: edge_px(low.unwrap_or(first)),
            high_px: edge_px(high + 1),
        }
    }
}

/// Most pieces of a side.
pub const MAX_PIECES: usize = 6;

/// Lower edge of a bucket, in pixels.
fn edge_px(bucket: usize) -> f32 {
    f32::from_bits((FIRST + bucket as u32) << BUCKET_SHIFT)
}
