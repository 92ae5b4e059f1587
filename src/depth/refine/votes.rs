//! Joint bilateral votes: the depths of a window vote, weighted by distance and colour, for the surface of one pixel.
//!
//! `w = confidence exp(-|p - q|^2 / (2 SPATIAL_SIGMA_PX^2)) (exp(-|I_p - I_q|^2 / (2 COLOR_SIGMA^2)) +
//! MIN_SIMILARITY)`; the mode is found by bisection (Min, Lu, Do, *Depth video enhancement based on weighted mode
//! filtering*, 2012).
//!
//! twin: shaders/refine/window.wgsl, shaders/refine/vote.wgsl

use super::planes::{LANES, Planes};

/// Radius of the window in pixels, and the spacing of the votes along rows and columns.
const RADIUS_PX: usize = 12;
const STEP_PX: usize = 2;
const ROW_STEP_PX: usize = 3;
/// Votes in a row and in a column of the window.
const COLUMNS: usize = 2 * RADIUS_PX / STEP_PX + 1;
const ROWS: usize = 2 * RADIUS_PX / ROW_STEP_PX + 1;
/// Standard deviation of the spatial weight, in pixels.
const SPATIAL_SIGMA_PX: f32 = 8.0;
/// Standard deviation of the colour weight, in steps of 8-bit sRGB.
const COLOR_SIGMA: f32 = 12.0;
/// A quarter of the `t` of that weight, exp(-t), for a difference of 1.
pub const QUARTER_T: f32 = 1.0 / (8.0 * COLOR_SIGMA * COLOR_SIGMA);
/// Minimum depth step relative to the inverse depth.
pub const RELATIVE_DEPTH_STEP: f32 = 0.05;
/// Weight of a vote of an entirely different colour: decides where no colour is similar.
pub const MIN_SIMILARITY: f32 = 0.003;
/// Hysteresis: the votes of another surface must outweigh those of the pixel's current one by this factor.
pub const HYSTERESIS: f32 = 1.15;
/// Added to [`HYSTERESIS`] where all votes have the pixel's colour: colour does not separate the surfaces then, and a
/// mere majority would round corners off.
pub const LOW_CONTRAST_HYSTERESIS: f32 = 6.0;
/// Lanes (columns of the pixel's parity) from the start of a window to its centre.
pub const RADIUS_LANES: usize = RADIUS_PX / STEP_PX;

/// Weights of a window, row by row; lanes beyond its last column are 0.
pub type Weights = [[f32; LANES]; ROWS];

/// Returns the spatial weight of each vote of a window: a Gaussian, cut to a disc.
pub fn compute_spatial_weights() -> Weights {
    let squared_px = |k: usize, step_px: usize| ((k * step_px) as f32 - RADIUS_PX as f32).powi(2);
    // R (R + 1) is the square of a radius of about R + 1/2: a rounder disc on the pixel grid than R gives.
    let weight = |squared_px: f32| match squared_px <= ((RADIUS_PX + 1) * RADIUS_PX) as f32 {
        true => (-squared_px / (2.0 * SPATIAL_SIGMA_PX * SPATIAL_SIGMA_PX)).exp(),
        false => 0.0,
    };
    let at = |x, y| weight(squared_px(x, STEP_PX) + squared_px(y, ROW_STEP_PX));
    let row = |y| std::array::from_fn(|x| if x < COLUMNS { at(x, y) } else { 0.0 });
    std::array::from_fn(row)
}

/// Returns the depth step that is an edge near the inverse depth `v`: `depth_step`, but at least
/// [`RELATIVE_DEPTH_STEP`] of `v`.
#[inline(always)]
pub fn depth_step_at(depth_step: f32, v: f32) -> f32 {
    let relative = RELATIVE_DEPTH_STEP * v;
    if relative > depth_step { relative } else { depth_step }
}

/// The votes for one pixel.
#[derive(Debug, Default)]
pub struct Votes {
    /// The inverse depths of the votes, laid out like their weights.
    depth: Weights,
    weight: Weights,
    /// Smallest and largest inverse depth that has a vote.
    range: (f32, f32),
    /// Factor for the votes of the pixel's current surface.
    hysteresis: f32,
}

impl Votes {
    /// Collects the votes of the window around column `x` and row `y`; `spatial_weights` has their spatial weights.
    #[inline(always)]
    pub fn collect_window(&mut self, planes: &Planes, spatial_weights: &Weights, x: usize, y: usize) {
        // exp(-t) with t = apart / (2 COLOR_SIGMA^2) is approximated by (1 - t/4)^4, clamped where that would rise
        // again.
        let center = planes.color(x, y);
        let (mut low, mut high) = ([f32::MAX; LANES], [0.0_f32; LANES]);
        let (mut total, mut similar_total) = ([0.0_f32; LANES], [0.0_f32; LANES]);
        for k in 0..ROWS {
            let (depth, weight, spatial_weights) = (&mut self.depth[k], &mut self.weight[k], &spatial_weights[k]);
            let row = (y + k * ROW_STEP_PX).wrapping_sub(RADIUS_PX);
            if row >= planes.height {
                *weight = [0.0; LANES];
                continue;
            }
            let ([from_depth, confidence], [red, green, blue]) = planes.window(x, row);
            for lane in 0..LANES {
                let of = |plane: &[u8; LANES], p: usize| f32::from(plane[lane]) - center[p];
                let (red, green, blue) = (of(red, 0), of(green, 1), of(blue, 2));
                let apart = red * red + green * green + blue * blue;
                let similarity = 1.0 - apart * QUARTER_T;
                let similarity = if similarity > 0.0 { similarity } else { 0.0 };
                let similarity = similarity * similarity;
                let w_without_color = confidence[lane] * spatial_weights[lane];
                let w = w_without_color * (similarity * similarity + MIN_SIMILARITY);
                total[lane] += w_without_color;
                similar_total[lane] += w;
                let v = from_depth[lane];
                weight[lane] = w;
                depth[lane] = v;
                let lower = if v < low[lane] { v } else { low[lane] };
                let higher = if v > high[lane] { v } else { high[lane] };
                low[lane] = if w > 0.0 { lower } else { low[lane] };
                high[lane] = if w > 0.0 { higher } else { high[lane] };
            }
        }
        self.range = (min_lane(low), max_lane(high));
        // The high power makes this count only if nearly the whole window has one colour.
        let similar_fraction = sum_lanes(similar_total) / sum_lanes(total);
        self.hysteresis = HYSTERESIS + LOW_CONTRAST_HYSTERESIS * similar_fraction.powi(8);
    }

    /// Returns the inverse depth of the surface with most votes: the heavier half of their range, halved until it is no
    /// wider than a depth step. If `current`, the pixel's inverse depth, lies on that surface, it is returned
    /// unchanged.
    #[inline(always)]
    pub fn winning_surface(&self, current: f32, depth_step: f32) -> f32 {
        let (mut low, mut high) = self.range;
        let mut mean = current;
        while high - low > depth_step_at(depth_step, high) {
            let middle = 0.5 * (low + high);
            let halves = self.split_range(low, middle, high);
            let is_near = (current > middle) & (current <= high);
            let is_far = (current <= middle) & (current >= low);
            let near = halves.near * if is_near { self.hysteresis } else { 1.0 };
            let far = halves.far * if is_far { self.hysteresis } else { 1.0 };
            let before = (low, high);
            if near > far {
                (low, mean) = (halves.near_low, halves.near_moment / halves.near);
            } else {
                (high, mean) = (halves.far_high, halves.far_moment / halves.far);
            }
            // Rounding may leave an unchanged range.
            if (low, high) == before {
                break;
            }
        }
        let slack = 0.5 * depth_step_at(depth_step, current);
        let is_on_it = (current >= low - slack) & (current <= high + slack) & ((current - mean).abs() < slack);
        if is_on_it { current } else { mean }
    }

    /// Sums the votes from `low` to `middle` (far) and from there to `high` (near: inverse depth grows towards the
    /// camera).
    #[inline(always)]
    fn split_range(&self, low: f32, middle: f32, high: f32) -> Halves {
        let (mut near, mut far) = ([0.0_f32; LANES], [0.0_f32; LANES]);
        let (mut near_moment, mut far_moment) = ([0.0_f32; LANES], [0.0_f32; LANES]);
        let (mut near_low, mut far_high) = ([high; LANES], [low; LANES]);
        // Selections instead of branches, and a sum per lane, so that the loop becomes vector code.
        for k in 0..ROWS {
            let (depth, weight) = (&self.depth[k], &self.weight[k]);
            for lane in 0..LANES {
                let (v, w) = (depth[lane], weight[lane]);
                let is_near = (v > middle) & (v <= high) & (w > 0.0);
                let is_far = (v <= middle) & (v >= low) & (w > 0.0);
                let (w_near, w_far) = (if is_near { w } else { 0.0 }, if is_far { w } else { 0.0 });
                near[lane] += w_near;
                far[lane] += w_far;
                near_moment[lane] += w_near * v;
                far_moment[lane] += w_far * v;
                near_low[lane] = if is_near & (v < near_low[lane]) { v } else { near_low[lane] };
                far_high[lane] = if is_far & (v > far_high[lane]) { v } else { far_high[lane] };
            }
        }
        Halves {
            near: sum_lanes(near),
            far: sum_lanes(far),
            near_moment: sum_lanes(near_moment),
            far_moment: sum_lanes(far_moment),
            near_low: min_lane(near_low),
            far_high: max_lane(far_high),
        }
    }
}

/// The votes of the near and of the far half of a range of inverse depths.
struct Halves {
    /// Sums of the weights.
    near: f32,
    far: f32,
    /// Sums of weight times inverse depth.
    near_moment: f32,
    far_moment: f32,
    /// The votes next to the middle on either side.
    near_low: f32,
    far_high: f32,
}

#[inline(always)]
fn sum_lanes(lanes: [f32; LANES]) -> f32 {
    reduce_lanes(lanes, |a, b| a + b)
}

#[inline(always)]
fn min_lane(lanes: [f32; LANES]) -> f32 {
    reduce_lanes(lanes, |a, b| if a < b { a } else { b })
}

#[inline(always)]
fn max_lane(lanes: [f32; LANES]) -> f32 {
    reduce_lanes(lanes, |a, b| if a > b { a } else { b })
}

/// Reduces the lanes (a power of two) to one value by combining halves, which is vector code.
#[inline(always)]
fn reduce_lanes(mut lanes: [f32; LANES], combine: impl Fn(f32, f32) -> f32) -> f32 {
    let mut half = LANES / 2;
    while half > 0 {
        for lane in 0..half {
            lanes[lane] = combine(lanes[lane], lanes[lane + half]);
        }
        half /= 2;
    }
    lanes[0]
}
