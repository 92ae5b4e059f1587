//! Whether the outlines of a depth map lie where the picture has its edges: not, where depth was estimated and its
//! outlines are fat, and nowhere, where depth and colour are not registered or not of the same moment.
//!
//! Along lines across the picture, the change of luma is averaged around jumps of inverse depth, each relative to its
//! surroundings and from the near side to the far one. Depth that fits has a peak in the middle of that profile; depth
//! that is not of this picture has none.

use super::fill::Filler;
use crate::frame::{ColorImage, DepthMap, GrayImage};

/// Pixels to either side of a jump that are looked at, in a picture that is reduced to at most [`MOST_COLUMNS`].
const REACH: usize = 12;
const MOST_COLUMNS: usize = 640;
/// A jump is spread over at most so many pixels to either side: estimated depth is smooth. At its ends there is less than
/// this share of its steepest change, or it is a slope.
const SPREAD: usize = 10;
const END: f32 = 0.3;
/// From this mean width on, in pixels, outlines are soft.
const SOFT_PX: f32 = 4.0;
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
    /// The picture's edges lie beside the depth's.
    Beside {
        /// How far outside the depth's, seen from the nearer surface, on average; negative, inside: near things are fat. In
        /// pixels of the picture, rounded, not 0.
        distance_px: i32,
    },
    /// They meet, but the depth goes from one surface to the other over so many pixels of the picture, on average.
    Soft {
        /// Several.
        width_px: u32,
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
    known: Vec<bool>,
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
        let (mut all, mut measured) = (Outlines::default(), Outlines::default());
        for y in (0..lines.height).step_by(2) {
            lines.scan((y * lines.width, 1, lines.width), jump, [&mut all, &mut measured]);
        }
        for x in (0..lines.width).step_by(2) {
            lines.scan((x, lines.width, lines.height), jump, [&mut all, &mut measured]);
        }
        // One pixel of the reduced picture, in pixels of the picture.
        let scale = color.width as f32 / lines.width as f32;
        match (all.peak(), measured.peak()) {
            (Some((_, _, peak)), _) if peak < FLAT => Self::Unrelated,
            (_, Some((at_px, middle, peak))) if peak >= PEAK && middle < OFF * peak => {
                Self::Beside { distance_px: ((at_px * scale).abs().ceil() * at_px.signum()) as i32 }
            }
            (_, Some(_)) => match measured.widths_px / measured.jumps as f32 {
                width_px if width_px >= SOFT_PX => Self::Soft { width_px: (width_px * scale).round() as u32 },
                _ => Self::Meets,
            },
            (Some(_), None) => Self::Meets,
            (None, None) => Self::Unknown,
        }
    }
}

/// What was found at the jumps.
#[derive(Default)]
struct Outlines {
    /// Sum of the changes of luma around a jump, each relative to the mean there, from its near side to its far one.
    profile: [f32; 2 * REACH + 1],
    jumps: u32,
    /// Sum of the widths of the jumps: their heights over their steepest changes.
    widths_px: f32,
}

impl Outlines {
    /// Where the profile has its peak, in pixels from the jump towards the far side; its middle, and that peak, both over
    /// three places, as edges are. `None` if there are too few jumps to tell.
    fn peak(&self) -> Option<(f32, f32, f32)> {
        let smooth = |at: usize| self.profile[at - 1..=at + 1].iter().sum::<f32>() / (3 * self.jumps) as f32;
        let best = (1..2 * REACH).max_by(|&a, &b| smooth(a).total_cmp(&smooth(b)))?;
        let enough = self.jumps >= LEAST_JUMPS;
        enough.then(|| (best as f32 - REACH as f32, smooth(REACH), smooth(best)))
    }
}

impl Lines {
    /// The mean luma of each pixel of a picture that is reduced to the columns of the map, or to fewer, and its depth.
    fn of(map: &DepthMap, color: &ColorImage) -> Self {
        let (from_width, from_height) = (color.width as usize, color.height as usize);
        let width = from_width.min(map.width as usize).min(MOST_COLUMNS);
        let height = (from_height * width / from_width).max(1);
        let mut gray = GrayImage::default();
        gray.set_luma_of(color);
        let mut luma = Vec::with_capacity(width * height);
        let mut reduced = DepthMap { width: width as u32, height: height as u32, ..DepthMap::default() };
        let place = |at: usize, to: usize, of: usize| at * of / to..((at + 1) * of / to).max(at * of / to + 1);
        let middle = |at: usize, to: usize, of: usize| ((2 * at + 1) * of / (2 * to)).min(of - 1);
        for y in 0..height {
            let rows = place(y, height, from_height);
            let depth = middle(y, height, map.height as usize) * map.width as usize;
            for x in 0..width {
                let columns = place(x, width, from_width);
                let of_row =
                    |row: usize| gray.luma[row * from_width..][columns.clone()].iter().map(|&luma| f32::from(luma));
                luma.push(rows.clone().flat_map(of_row).sum::<f32>() / (rows.len() * columns.len()) as f32);
                reduced.metres.push(map.metres[depth + middle(x, width, map.width as usize)]);
            }
        }
        let known = reduced.metres.iter().map(|&z_m| DepthMap::is_known(z_m)).collect();
        Filler::new().fill(&mut reduced);
        let inverse = reduced.metres.iter().map(|&z_m| DepthMap::inverse_of(z_m)).collect();
        Self { width, height, luma, inverse, known }
    }

    /// Adds the jumps of a line of `len` pixels, `step` apart, that are at least `jump` high: to the first all, to the second
    /// those that were measured. In a hole, which every sensor has beside a near thing, the jump is where nobody knows.
    fn scan(&self, (first, step, len): (usize, usize, usize), jump: f32, [all, measured]: [&mut Outlines; 2]) {
        let inverse = |at: usize| self.inverse[first + at * step];
        let change = |at: usize| (inverse(at + 1) - inverse(at)).abs();
        let mut at = REACH;
        while at + REACH + 1 < len {
            let here = at;
            at += 1;
            let (before, after) = (inverse(here - SPREAD), inverse(here + SPREAD + 1));
            let (height, steepest) = ((after - before).abs(), change(here));
            let is_slope = || change(here - SPREAD).max(change(here + SPREAD)) > END * steepest;
            if height < jump
                || height == 0.0
                || (here - SPREAD..=here + SPREAD).any(|at| change(at) > steepest)
                || is_slope()
            {
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
            let is_measured = (here - SPREAD..=here + SPREAD + 1).all(|at| self.known[first + at * step]);
            for outlines in [Some(&mut *all), is_measured.then_some(&mut *measured)].into_iter().flatten() {
                outlines.profile.iter_mut().zip(&changes).for_each(|(sum, change)| *sum += change / mean);
                outlines.jumps += 1;
                outlines.widths_px += height / steepest;
            }
            at = here + SPREAD;
        }
    }
}
