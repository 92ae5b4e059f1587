//! Whether the outlines of a depth map lie where the picture has its edges: not, where depth was estimated and its
//! outlines are fat, and nowhere, where depth and colour are not registered or not of the same moment.
//!
//! Along lines across the picture, the change of luma is averaged around jumps of inverse depth, each relative to its
//! surroundings and from the near side to the far one. Depth that fits has a peak in the middle of that profile; depth
//! that is not of this picture has none.

use super::fill::Filler;
use crate::color::luminance;
use crate::frame::{ColorImage, DepthMap};

/// Pixels to either side of a jump that are looked at, in a picture that is reduced to at most [`MOST_COLUMNS`].
const REACH: usize = 12;
const MOST_COLUMNS: usize = 640;
/// A jump is spread over at most so many pixels to either side: estimated depth is smooth.
const SPREAD: usize = 5;
/// Least step of a jump, as a share of the inverse depth of near things.
const JUMP: f32 = 0.1;
/// Where luma changes less than this from pixel to pixel (of 255), there is nothing to be seen.
const LEAST_CHANGE: f32 = 1.5;
/// Fewer jumps tell nothing.
const LEAST_JUMPS: u32 = 150;
/// A peak: so many times the mean around.
const PEAK: f32 = 1.35;
/// A flat profile has no place above this.
const FLAT: f32 = 1.25;
/// Outlines are off where the middle has less than this share of the peak.
const OFF: f32 = 0.8;

/// How the outlines of a depth map and the edges of its picture lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Agreement {
    /// There are too few outlines to tell.
    Unknown,
    /// They meet.
    Meets,
    /// The picture's edges lie so many pixels of the picture beside the depth's, on average.
    Beside {
        /// At least one, rounded.
        distance_px: u32,
    },
    /// Nowhere near the depth's outlines has the picture more edges than elsewhere.
    Unrelated,
}

/// A picture and its depth, reduced.
struct Lines {
    width: usize,
    height: usize,
    luma: Vec<f32>,
    /// One over the depth in metres; where none was measured, as if the farther surface beside it went on.
    inverse: Vec<f32>,
}

impl Agreement {
    /// Compares the depth `map`, of any size, with the picture `color`, of the same aspect.
    pub fn of(map: &DepthMap, color: &ColorImage) -> Self {
        if map.metres.is_empty() || color.rgb.is_empty() {
            return Self::Unknown;
        }
        let lines = Lines::of(map, color);
        let mut near = lines.inverse.clone();
        let at = near.len() * 19 / 20;
        let jump = JUMP * *near.select_nth_unstable_by(at, f32::total_cmp).1;
        let (mut profile, mut jumps) = ([0.0; 2 * REACH + 1], 0);
        for y in (0..lines.height).step_by(2) {
            lines.scan((y * lines.width, 1, lines.width), jump, &mut profile, &mut jumps);
        }
        for x in (0..lines.width).step_by(2) {
            lines.scan((x, lines.width, lines.height), jump, &mut profile, &mut jumps);
        }
        if jumps < LEAST_JUMPS {
            return Self::Unknown;
        }
        // Over three places, as edges are.
        let smooth = |at: usize| (profile[at - 1] + profile[at] + profile[at + 1]) / (3 * jumps) as f32;
        let best = (1..2 * REACH).max_by(|&a, &b| smooth(a).total_cmp(&smooth(b))).unwrap_or(REACH);
        let distance_px = best.abs_diff(REACH) as f32 * color.width as f32 / lines.width as f32;
        match (smooth(REACH), smooth(best)) {
            (_, peak) if peak < FLAT => Self::Unrelated,
            (middle, peak) if peak >= PEAK && middle < OFF * peak => {
                Self::Beside { distance_px: (distance_px.round() as u32).max(1) }
            }
            _ => Self::Meets,
        }
    }
}

impl Lines {
    /// The mean luma of each pixel of a picture that is reduced to the columns of the map, or to fewer, and its depth.
    fn of(map: &DepthMap, color: &ColorImage) -> Self {
        let (from_width, from_height) = (color.width as usize, color.height as usize);
        let width = from_width.min(map.width as usize).min(MOST_COLUMNS);
        let height = (from_height * width / from_width).max(1);
        let mut luma = Vec::with_capacity(width * height);
        let mut reduced = DepthMap { width: width as u32, height: height as u32, ..DepthMap::default() };
        let place = |at: usize, to: usize, of: usize| at * of / to..((at + 1) * of / to).max(at * of / to + 1);
        let middle = |at: usize, to: usize, of: usize| ((2 * at + 1) * of / (2 * to)).min(of - 1);
        for y in 0..height {
            let rows = place(y, height, from_height);
            let depth = middle(y, height, map.height as usize) * map.width as usize;
            for x in 0..width {
                let columns = place(x, width, from_width);
                let mut sum = 0.0;
                for row in rows.clone() {
                    let pixels = &color.rgb[3 * row * from_width..][3 * columns.start..3 * columns.end];
                    sum += pixels.as_chunks::<3>().0.iter().map(|p| luma_of(*p)).sum::<f32>();
                }
                luma.push(sum / (rows.len() * columns.len()) as f32);
                reduced.metres.push(map.metres[depth + middle(x, width, map.width as usize)]);
            }
        }
        Filler::new().fill(&mut reduced);
        let inverse_of = |&z_m: &f32| if DepthMap::is_known(z_m) { z_m.recip() } else { 0.0 };
        let inverse = reduced.metres.iter().map(inverse_of).collect();
        Self { width, height, luma, inverse }
    }

    /// Adds the jumps of a line of `len` pixels, `step` apart, to the profile.
    fn scan(
        &self,
        (first, step, len): (usize, usize, usize),
        jump: f32,
        profile: &mut [f32; 2 * REACH + 1],
        jumps: &mut u32,
    ) {
        let change = |at: usize| (self.inverse[first + (at + 1) * step] - self.inverse[first + at * step]).abs();
        let mut at = REACH;
        while at + REACH + 1 < len {
            let here = at;
            at += 1;
            let [before, after] = [here - SPREAD, here + SPREAD + 1].map(|at| self.inverse[first + at * step]);
            if (after - before).abs() < jump || change(here) == 0.0 {
                continue;
            }
            let around = here - SPREAD..here + SPREAD + 1;
            if around.clone().any(|at| change(at) > change(here)) {
                continue;
            }
            let mut changes = [0.0; 2 * REACH + 1];
            for (k, value) in changes.iter_mut().enumerate() {
                let at = first + (here - REACH + k) * step;
                *value = (self.luma[at + step] - self.luma[at]).abs();
            }
            let mean = changes.iter().sum::<f32>() / changes.len() as f32;
            if mean < LEAST_CHANGE {
                continue;
            }
            if after > before {
                changes.reverse();
            }
            profile.iter_mut().zip(&changes).for_each(|(sum, change)| *sum += change / mean);
            *jumps += 1;
            at = here + SPREAD;
        }
    }
}

fn luma_of(rgb: [u8; 3]) -> f32 {
    let [red, green, blue] = rgb.map(f32::from);
    luminance(red, green, blue)
}
