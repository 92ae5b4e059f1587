//! A joint bilateral vote: the depths of a window vote, weighted by distance and colour, for the surface that one pixel
//! lies on.

use super::planes::{LANES, Planes};

/// How far the votes come from, in pixels, and the steps between them along rows and columns.
const REACH_PX: usize = 12;
const STEP_PX: usize = 2;
const ROW_STEP_PX: usize = 3;
/// Votes in a row and in a column of the window.
const COLUMNS: usize = 2 * REACH_PX / STEP_PX + 1;
const ROWS: usize = 2 * REACH_PX / ROW_STEP_PX + 1;
/// Standard deviation in pixels of the weight by distance.
const NEARBY_PX: f32 = 8.0;
/// Standard deviation, in steps of 8-bit sRGB, of the weight by colour.
const ALIKE: f32 = 12.0;
/// A quarter of the `t` of that weight, exp(-t), of a difference of 1.
pub const QUARTER_T: f32 = 1.0 / (8.0 * ALIKE * ALIKE);
/// The share of an inverse depth that is a jump at least.
pub const JUMP_SHARE: f32 = 0.05;
/// Weight of a vote whose colour is altogether different: decides where no colour is alike.
pub const UNLIKE: f32 = 0.003;
/// The votes of the other side must outweigh those of the pixel's present side this many times.
pub const LOYALTY: f32 = 1.15;
/// Added to [`LOYALTY`] where all votes have the pixel's colour: colour does not tell the sides apart then, and the
/// mere majority would round corners off.
pub const LOYALTY_WITHOUT_CONTRAST: f32 = 6.0;
/// Lanes (columns of the pixel's parity) from the start of a window to its own pixel.
pub const REACH_LANES: usize = REACH_PX / STEP_PX;

/// Weights of a window, row by row; the lanes beyond its last column weigh nothing.
pub type Weights = [[f32; LANES]; ROWS];

/// The weight of each vote of a window by its distance: a Gaussian, cut to a disc.
pub fn weights_by_distance() -> Weights {
    let squared_px = |k: usize, step_px: usize| ((k * step_px) as f32 - REACH_PX as f32).powi(2);
    // R (R + 1) is the square of a radius of about R + 1/2: a rounder disc on the pixel grid than R gives.
    let weight = |squared_px: f32| match squared_px <= ((REACH_PX + 1) * REACH_PX) as f32 {
        true => (-squared_px / (2.0 * NEARBY_PX * NEARBY_PX)).exp(),
        false => 0.0,
    };
    let at = |x, y| weight(squared_px(x, STEP_PX) + squared_px(y, ROW_STEP_PX));
    let row = |y| std::array::from_fn(|x| if x < COLUMNS { at(x, y) } else { 0.0 });
    std::array::from_fn(row)
}

/// The step of inverse depth that is an edge near the inverse depth `v`: `jump`, but at least [`JUMP_SHARE`] of `v`.
#[inline(always)]
pub fn jump_at(jump: f32, v: f32) -> f32 {
    let relative = JUMP_SHARE * v;
    if relative > jump { relative } else { jump }
}

/// The votes for one pixel.
#[derive(Debug, Default)]
pub struct Votes {
    /// The inverse depths voted for, laid out as their weights.
    depth: Weights,
    weight: Weights,
    /// Least and largest inverse depth that has a vote.
    range: (f32, f32),
    /// How many times the votes of the pixel's present side count.
    loyalty: f32,
}

impl Votes {
    /// Collects the votes of the window around column `x` and row `y`; `nearby` weighs them by distance.
    #[inline(always)]
    pub fn gather(&mut self, planes: &Planes, nearby: &Weights, x: usize, y: usize) {
        // exp(-t) with t = apart / (2 ALIKE^2) is computed as (1 - t/4)^4, cut where that would rise again.
        let center = planes.color(x, y);
        let (mut low, mut high) = ([f32::MAX; LANES], [0.0_f32; LANES]);
        let (mut total, mut alike_total) = ([0.0_f32; LANES], [0.0_f32; LANES]);
        for k in 0..ROWS {
            let (depth, weight, nearby) = (&mut self.depth[k], &mut self.weight[k], &nearby[k]);
            let row = (y + k * ROW_STEP_PX).wrapping_sub(REACH_PX);
            if row >= planes.height {
                *weight = [0.0; LANES];
                continue;
            }
            let ([from_depth, confidence], [red, green, blue]) = planes.window(x, row);
            for lane in 0..LANES {
                let of = |plane: &[u8; LANES], p: usize| f32::from(plane[lane]) - center[p];
                let (red, green, blue) = (of(red, 0), of(green, 1), of(blue, 2));
                let apart = red * red + green * green + blue * blue;
                let alike = 1.0 - apart * QUARTER_T;
                let alike = if alike > 0.0 { alike } else { 0.0 };
                let alike = alike * alike;
                let w_without_color = confidence[lane] * nearby[lane];
                let w = w_without_color * (alike * alike + UNLIKE);
                total[lane] += w_without_color;
                alike_total[lane] += w;
                let v = from_depth[lane];
                weight[lane] = w;
                depth[lane] = v;
                let lower = if v < low[lane] { v } else { low[lane] };
                let higher = if v > high[lane] { v } else { high[lane] };
                low[lane] = if w > 0.0 { lower } else { low[lane] };
                high[lane] = if w > 0.0 { higher } else { high[lane] };
            }
        }
        self.range = (least(low), largest(high));
        // The high power adds it only in windows in which nearly everything is alike.
        let alike_share = sum(alike_total) / sum(total);
        self.loyalty = LOYALTY + LOYALTY_WITHOUT_CONTRAST * alike_share.powi(8);
    }

    /// The inverse depth of the surface with most votes: the heavier half of their range, halved until it is no wider
    /// than a jump. `current`, the pixel's inverse depth so far, is returned as it is where it lies on that surface.
    #[inline(always)]
    pub fn surface(&self, current: f32, jump: f32) -> f32 {
        let (mut low, mut high) = self.range;
        let mut mean = current;
        while high - low > jump_at(jump, high) {
            let middle = 0.5 * (low + high);
            let halves = self.split(low, middle, high);
            let is_near = (current > middle) & (current <= high);
            let is_far = (current <= middle) & (current >= low);
            let near = halves.near * if is_near { self.loyalty } else { 1.0 };
            let far = halves.far * if is_far { self.loyalty } else { 1.0 };
            let before = (low, high);
            if near > far {
                (low, mean) = (halves.near_low, halves.near_moment / halves.near);
            } else {
                (high, mean) = (halves.far_high, halves.far_moment / halves.far);
            }
            // Rounding may leave nothing to split.
            if (low, high) == before {
                break;
            }
        }
        let slack = 0.5 * jump_at(jump, current);
        let is_on_it = (current >= low - slack) & (current <= high + slack) & ((current - mean).abs() < slack);
        if is_on_it { current } else { mean }
    }

    /// Sums up the votes from `low` to `middle` (far) and from there to `high` (near: inverse depth grows towards the
    /// eye).
    #[inline(always)]
    fn split(&self, low: f32, middle: f32, high: f32) -> Halves {
        let (mut near, mut far) = ([0.0_f32; LANES], [0.0_f32; LANES]);
        let (mut near_moment, mut far_moment) = ([0.0_f32; LANES], [0.0_f32; LANES]);
        let (mut near_low, mut far_high) = ([high; LANES], [low; LANES]);
        // Selections instead of branches, and a sum per lane: so the loop becomes vector code.
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
            near: sum(near),
            far: sum(far),
            near_moment: sum(near_moment),
            far_moment: sum(far_moment),
            near_low: least(near_low),
            far_high: largest(far_high),
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
    /// The votes nearest to the middle on either side.
    near_low: f32,
    far_high: f32,
}

#[inline(always)]
fn sum(lanes: [f32; LANES]) -> f32 {
    fold(lanes, |a, b| a + b)
}

#[inline(always)]
fn least(lanes: [f32; LANES]) -> f32 {
    fold(lanes, |a, b| if a < b { a } else { b })
}

#[inline(always)]
fn largest(lanes: [f32; LANES]) -> f32 {
    fold(lanes, |a, b| if a > b { a } else { b })
}

/// Reduces the lanes (a power of two) to one value by combining halves: vector code.
#[inline(always)]
fn fold(mut lanes: [f32; LANES], combine: impl Fn(f32, f32) -> f32) -> f32 {
    let mut half = LANES / 2;
    while half > 0 {
        for lane in 0..half {
            lanes[lane] = combine(lanes[lane], lanes[lane + half]);
        }
        half /= 2;
    }
    lanes[0]
}
