//! A joint bilateral vote: the votes of a window for one pixel: which of the surfaces around is it on?

use super::planes::{LANES, Planes};

/// How far the votes come from, in pixels, and the steps between them along rows and columns.
const REACH_PX: usize = 12;
const STEP_PX: usize = 2;
const ROW_STEP_PX: usize = 3;
/// Votes along the two sides of the window.
const COLUMNS: usize = 2 * REACH_PX / STEP_PX + 1;
const ROWS: usize = 2 * REACH_PX / ROW_STEP_PX + 1;
/// Standard deviation in pixels of the weight by distance.
const NEARBY_PX: f32 = 8.0;
/// Standard deviation, in steps of 8-bit sRGB, of the weight by colour.
const ALIKE: f32 = 12.0;
/// Weight of a vote that looks altogether different: decides where nothing looks alike.
const UNLIKE: f32 = 0.003;
/// By how much the votes of the other side must outweigh those of the pixel's own.
const LOYALTY: f32 = 1.15;
/// The same, in addition, where all that votes looks like the pixel: colour does not tell the sides apart, and the mere
/// majority would round corners off.
const CLUELESS: f32 = 6.0;
/// Pixels of one parity that a window begins before its own.
pub const BEFORE: usize = REACH_PX / STEP_PX;

/// Weights of a window, row by row; the lanes beyond its last column weigh nothing.
pub type Weights = [[f32; LANES]; ROWS];

/// What each vote of a window weighs by its distance.
pub fn weights_by_distance() -> Weights {
    let squared_px = |k: usize, step_px: usize| ((k * step_px) as f32 - REACH_PX as f32).powi(2);
    let weight = |squared_px: f32| match squared_px <= ((REACH_PX + 1) * REACH_PX) as f32 {
        true => (-squared_px / (2.0 * NEARBY_PX * NEARBY_PX)).exp(),
        false => 0.0,
    };
    let at = |x, y| weight(squared_px(x, STEP_PX) + squared_px(y, ROW_STEP_PX));
    let row = |y| std::array::from_fn(|x| if x < COLUMNS { at(x, y) } else { 0.0 });
    std::array::from_fn(row)
}

/// The larger of what counts as a jump anywhere and what does so near an inverse depth of `v`: a twentieth.
#[inline(always)]
pub fn jump_at(jump: f32, v: f32) -> f32 {
    let relative = 0.05 * v;
    if relative > jump { relative } else { jump }
}

/// The votes for one pixel.
#[derive(Debug, Default)]
pub struct Votes {
    depth: Weights,
    weight: Weights,
    /// Least and largest inverse depth that has a vote.
    range: (f32, f32),
    /// How many times the own side's votes count.
    loyalty: f32,
}

impl Votes {
    /// Takes the votes for the pixel at column `x` and row `y`.
    #[inline(always)]
    pub fn gather(&mut self, planes: &Planes, nearby: &Weights, x: usize, y: usize) {
        const FALL: f32 = 1.0 / (8.0 * ALIKE * ALIKE);
        let own = planes.color(x, y);
        let (mut low, mut high) = ([f32::MAX; LANES], [0.0_f32; LANES]);
        let (mut total, mut alike_total) = ([0.0_f32; LANES], [0.0_f32; LANES]);
        for k in 0..ROWS {
            let (depth, weight, nearby) = (&mut self.depth[k], &mut self.weight[k], &nearby[k]);
            let row = (y + k * ROW_STEP_PX).wrapping_sub(REACH_PX);
            if row >= planes.height {
                *weight = [0.0; LANES];
                continue;
            }
            let [from_depth, sure, red, green, blue] = planes.window(x, row);
            for lane in 0..LANES {
                let (red, green, blue) = (red[lane] - own[0], green[lane] - own[1], blue[lane] - own[2]);
                let apart = red * red + green * green + blue * blue;
                // (1 - t/4)^4 for exp(-t), cut where it would rise again.
                let alike = 1.0 - apart * FALL;
                let alike = if alike > 0.0 { alike } else { 0.0 };
                let alike = alike * alike;
                let any = sure[lane] * nearby[lane];
                let w = any * (alike * alike + UNLIKE);
                total[lane] += any;
                alike_total[lane] += w;
                let v = from_depth[lane];
                weight[lane] = w;
                depth[lane] = v;
                let least = if v < low[lane] { v } else { low[lane] };
                let largest = if v > high[lane] { v } else { high[lane] };
                low[lane] = if w > 0.0 { least } else { low[lane] };
                high[lane] = if w > 0.0 { largest } else { high[lane] };
            }
        }
        self.range = (least(low), largest(high));
        let share = sum(alike_total) / sum(total);
        self.loyalty = LOYALTY + CLUELESS * share.powi(8);
    }

    /// The inverse depth of the surface with most votes; `own` where that lies on it.
    #[inline(always)]
    pub fn surface(&self, own: f32, jump: f32) -> f32 {
        let (mut low, mut high) = self.range;
        let mut mean = own;
        while high - low > jump_at(jump, high) {
            let middle = 0.5 * (low + high);
            let halves = self.halves(low, middle, high);
            let own_is_near = (own > middle) & (own <= high);
            let own_is_far = (own <= middle) & (own >= low);
            let near = halves.near * if own_is_near { self.loyalty } else { 1.0 };
            let far = halves.far * if own_is_far { self.loyalty } else { 1.0 };
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
        let near_enough = 0.5 * jump_at(jump, own);
        let on_it = (own >= low - near_enough) & (own <= high + near_enough) & ((own - mean).abs() < near_enough);
        if on_it { own } else { mean }
    }

    #[inline(always)]
    fn halves(&self, low: f32, middle: f32, high: f32) -> Halves {
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

/// Votes above and below the middle of a range, their first moments, and where in the range they begin and end.
struct Halves {
    near: f32,
    far: f32,
    near_moment: f32,
    far_moment: f32,
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

/// All lanes combined, in halves.
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
