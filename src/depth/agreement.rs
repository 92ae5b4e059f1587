//! Checks whether the depth edges of a map coincide with the edges of its picture: they do not if the depth was
//! estimated and objects are too wide, or if depth and colour are not registered or not synchronous.
//!
//! Along rows and columns, the change of luma is averaged around depth discontinuities, relative to its surroundings
//! and from the near side to the far one. If the depth fits, this profile peaks in the middle; if it belongs to another
//! picture, there is no peak.

use super::fill::HoleFiller;
use crate::frame::{ColorImage, DepthMap, GrayImage};

/// Radius in pixels of the profile around a discontinuity, in a picture downsampled to at most [`MAX_COLUMNS`].
const RADIUS: usize = 12;
const MAX_COLUMNS: usize = 640;
/// Radius in pixels of a discontinuity: estimated depth is smooth. At its ends the change is below this fraction of the
/// steepest one, or it is a slope.
const STEP_RADIUS: usize = 10;
const END_FRACTION: f32 = 0.3;
/// Mean width in pixels from which outlines are soft.
const SOFT_PX: f32 = 4.0;
/// Minimum step of a discontinuity, relative to the inverse depth of near objects (95th percentile).
const MIN_STEP: f32 = 0.1;
/// Minimum mean change of luma per pixel (of 255): below it the picture shows no edge.
const MIN_CHANGE: f32 = 1.5;
/// Minimum number of discontinuities for a conclusion.
const MIN_EDGES: u32 = 150;
/// Minimum ratio of a peak to the mean of the profile.
const MIN_PEAK: f32 = 1.35;
/// Maximum of a flat profile.
const MAX_FLAT_PEAK: f32 = 1.25;
/// EdgeProfile are misaligned if the middle is below this fraction of the peak.
const MIDDLE_FRACTION: f32 = 0.8;

/// How the depth edges of a map and the edges of its picture are aligned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EdgeAlignment {
    /// There are too few discontinuities for a conclusion.
    Unknown,
    /// They coincide.
    Aligned,
    /// The picture's edges lie beside the depth edges.
    Shifted {
        /// Mean distance from the depth edges, in pixels of the picture, rounded, not 0: positive outwards, seen from
        /// the nearer surface; negative if near objects are too wide in depth.
        distance_px: i32,
    },
    /// They coincide, but the depth edges are blurred.
    Soft {
        /// Mean width of a depth edge in pixels of the picture.
        width_px: u32,
    },
    /// The picture does not have more edges near the depth edges than elsewhere.
    Unrelated,
}

/// A picture and its depth, downsampled.
struct DownsampledPair {
    width: usize,
    height: usize,
    luma: Vec<f32>,
    /// Inverse depth in 1/m; holes are filled from the background.
    inverse: Vec<f32>,
    known: Vec<bool>,
}

impl EdgeAlignment {
    /// Compares the depth `map`, of any size, with the picture `color`, of the same aspect.
    pub fn measure(map: &DepthMap, color: &ColorImage) -> Self {
        if map.metres.is_empty() || color.rgb.is_empty() {
            return Self::Unknown;
        }
        let lines = DownsampledPair::new(map, color);
        let mut near = lines.inverse.clone();
        let at = near.len() * 19 / 20;
        let min_step = MIN_STEP * *near.select_nth_unstable_by(at, f32::total_cmp).1;
        let (mut all, mut measured) = (EdgeProfile::default(), EdgeProfile::default());
        for y in (0..lines.height).step_by(2) {
            lines.scan_line((y * lines.width, 1, lines.width), min_step, [&mut all, &mut measured]);
        }
        for x in (0..lines.width).step_by(2) {
            lines.scan_line((x, lines.width, lines.height), min_step, [&mut all, &mut measured]);
        }
        // Pixels of the picture per downsampled pixel.
        let scale = color.width as f32 / lines.width as f32;
        match (all.find_peak(), measured.find_peak()) {
            (Some((_, _, peak)), _) if peak < MAX_FLAT_PEAK => Self::Unrelated,
            (_, Some((at_px, middle, peak))) if peak >= MIN_PEAK && middle < MIDDLE_FRACTION * peak => {
                Self::Shifted { distance_px: ((at_px * scale).abs().ceil() * at_px.signum()) as i32 }
            }
            (_, Some(_)) => match measured.widths_px / measured.edges as f32 {
                width_px if width_px >= SOFT_PX => Self::Soft { width_px: (width_px * scale).round() as u32 },
                _ => Self::Aligned,
            },
            (Some(_), None) => Self::Aligned,
            (None, None) => Self::Unknown,
        }
    }
}

/// Statistics of the discontinuities.
#[derive(Default)]
struct EdgeProfile {
    /// Sum of the profiles: changes of luma relative to their mean, from the near side to the far one.
    profile: [f32; 2 * RADIUS + 1],
    edges: u32,
    /// Sum of the widths of the discontinuities: their heights over their steepest changes.
    widths_px: f32,
}

impl EdgeProfile {
    /// Returns the position of the profile's peak in pixels from the discontinuity towards the far side, the value in
    /// the middle, and the peak; both values are means of three places, as edges are wide. `None` with too few
    /// discontinuities.
    fn find_peak(&self) -> Option<(f32, f32, f32)> {
        let smooth = |at: usize| self.profile[at - 1..=at + 1].iter().sum::<f32>() / (3 * self.edges) as f32;
        let best = (1..2 * RADIUS).max_by(|&a, &b| smooth(a).total_cmp(&smooth(b)))?;
        let enough = self.edges >= MIN_EDGES;
        enough.then(|| (best as f32 - RADIUS as f32, smooth(RADIUS), smooth(best)))
    }
}

impl DownsampledPair {
    /// Downsamples luma by averaging and depth by picking samples, to the columns of the map or fewer.
    fn new(map: &DepthMap, color: &ColorImage) -> Self {
        let (from_width, from_height) = (color.width as usize, color.height as usize);
        let width = from_width.min(map.width as usize).min(MAX_COLUMNS);
        let height = (from_height * width / from_width).max(1);
        let mut gray = GrayImage::default();
        gray.set_luma_from(color);
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
        HoleFiller::new().fill(&mut reduced);
        let inverse = reduced.metres.iter().map(|&z_m| DepthMap::inverse_depth(z_m)).collect();
        Self { width, height, luma, inverse, known }
    }

    /// Adds the discontinuities of at least `min_step` of a line of `len` pixels, `step` apart: all to the first, and
    /// to the second those without holes. In a hole, which every sensor has beside near objects, the position of the
    /// edge is unknown.
    fn scan_line(
        &self,
        (first, step, len): (usize, usize, usize),
        min_step: f32,
        [all, measured]: [&mut EdgeProfile; 2],
    ) {
        let inverse = |at: usize| self.inverse[first + at * step];
        let change = |at: usize| (inverse(at + 1) - inverse(at)).abs();
        let mut at = RADIUS;
        while at + RADIUS + 1 < len {
            let here = at;
            at += 1;
            let (before, after) = (inverse(here - STEP_RADIUS), inverse(here + STEP_RADIUS + 1));
            let (height, steepest) = ((after - before).abs(), change(here));
            // A discontinuity is the steepest place within its radius, and flat at both ends.
            let is_slope = || change(here - STEP_RADIUS).max(change(here + STEP_RADIUS)) > END_FRACTION * steepest;
            if height < min_step
                || height == 0.0
                || (here - STEP_RADIUS..=here + STEP_RADIUS).any(|at| change(at) > steepest)
                || is_slope()
            {
                continue;
            }
            let mut changes = [0.0; 2 * RADIUS + 1];
            for (k, value) in changes.iter_mut().enumerate() {
                let at = first + (here - RADIUS + k) * step;
                *value = (self.luma[at + step] - self.luma[at]).abs();
            }
            let mean = changes.iter().sum::<f32>() / changes.len() as f32;
            if mean < MIN_CHANGE {
                continue;
            }
            // Profiles run from the near side to the far one.
            if after > before {
                changes.reverse();
            }
            let is_measured = (here - STEP_RADIUS..=here + STEP_RADIUS + 1).all(|at| self.known[first + at * step]);
            for profiles in [Some(&mut *all), is_measured.then_some(&mut *measured)].into_iter().flatten() {
                profiles.profile.iter_mut().zip(&changes).for_each(|(sum, change)| *sum += change / mean);
                profiles.edges += 1;
                profiles.widths_px += height / steepest;
            }
            at = here + STEP_RADIUS;
        }
    }
}
