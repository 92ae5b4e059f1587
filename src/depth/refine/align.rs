//! Depth edges, moved onto the edges of the colour picture.
//!
//! In a band around the jumps of depth each pixel asks the pixels around it: which depth do those have that look like
//! you? Depths far from any jump are sure and count in full; those in the band, which may be the error, count little.
//! The answer is one of the surfaces around, never a depth between them: the votes are split at the middle of their
//! range, the heavier half is kept, and so on until what is left is one surface (a weighted mode, found by bisection).
//! What already agrees with its answer is not touched, so that exact depth stays exact.
//!
//! The idea of letting colour weigh depth is the joint bilateral filter's (Kopf et al., *Joint bilateral upsampling*,
//! 2007); its mean would invent depths at edges, the mode does not (Min, Lu, Do, *Depth video enhancement based on
//! weighted mode filtering*, 2012).

use pulp::{Arch, WithSimd};

use super::planes::{LANES, Planes, SetDepths};

/// How far from a jump a depth may be wrong, in pixels.
const BAND_PX: usize = 4;
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
/// Weight of a depth that may be wrong itself, and of one that nobody measured.
const UNSURE: f32 = 0.12;
const MADE_UP: f32 = 0.02;
/// By how much the votes of the other side must outweigh those of the pixel's own.
const LOYALTY: f32 = 1.15;
/// The same, in addition, where all that votes looks like the pixel: colour does not tell the sides apart, and the mere
/// majority would round corners off.
const CLUELESS: f32 = 6.0;
/// Rounds; each can move an edge by up to [`BAND_PX`].
const ROUNDS: usize = 2;

/// Aligns maps of inverse depth; owns the memory for it.
#[derive(Debug)]
pub struct Aligner {
    planes: Planes,
    edge: Vec<bool>,
    band: Vec<bool>,
    scratch: Vec<bool>,
    /// How much each depth weighs.
    sure: Vec<f32>,
    /// Weight by distance, row by row; the lanes beyond [`COLUMNS`] weigh nothing.
    nearby: [[f32; LANES]; ROWS],
    /// Pixels to ask, in order: first those at an edge, then the neighbours of those that changed.
    front: Vec<u32>,
    /// Pixels that changed in the last round.
    moved: Vec<u32>,
}

impl Default for Aligner {
    fn default() -> Self {
        let squared_px = |k: usize, step_px: usize| ((k * step_px) as f32 - REACH_PX as f32).powi(2);
        let weight = |squared_px: f32| match squared_px <= ((REACH_PX + 1) * REACH_PX) as f32 {
            true => (-squared_px / (2.0 * NEARBY_PX * NEARBY_PX)).exp(),
            false => 0.0,
        };
        let at = |x, y| weight(squared_px(x, STEP_PX) + squared_px(y, ROW_STEP_PX));
        let row = |y| std::array::from_fn(|x| if x < COLUMNS { at(x, y) } else { 0.0 });
        Self {
            planes: Planes::default(),
            edge: Vec::new(),
            band: Vec::new(),
            scratch: Vec::new(),
            sure: Vec::new(),
            nearby: std::array::from_fn(row),
            front: Vec::new(),
            moved: Vec::new(),
        }
    }
}

impl Aligner {
    /// Aligns `inverse` (1/m) to the picture `rgb`. Steps of inverse depth above `jump` (1/m) are edges; depths that
    /// are `unknown` were made up.
    pub fn align(&mut self, arch: Arch, inverse: &mut [f32], unknown: &[bool], rgb: &[u8], width: usize, jump: f32) {
        let height = inverse.len().checked_div(width).unwrap_or(0);
        self.moved.clear();
        for round in 0..ROUNDS {
            let Self { planes, edge, band, scratch, sure, nearby, front, moved } = self;
            sure.resize(inverse.len(), 0.0);
            arch.dispatch(FindBand { inverse, width, jump, edge, band, scratch });
            front.clear();
            if round == 0 {
                front.extend((0..).zip(&*edge).filter(|(_, edge)| **edge).map(|(k, _)| k));
            } else {
                front.extend(moved.iter().filter(|&&k| band[k as usize]));
            }
            if front.is_empty() {
                return;
            }
            if round == 0 {
                planes.set_colors(rgb, width, height, REACH_PX / STEP_PX);
            }
            for ((sure, &band), &unknown) in sure.iter_mut().zip(&*band).zip(unknown) {
                *sure = if unknown {
                    MADE_UP
                } else if band {
                    UNSURE
                } else {
                    1.0
                };
            }
            arch.dispatch(SetDepths { planes, inverse, sure });
            moved.clear();
            arch.dispatch(Vote { planes, band, nearby, inverse, jump, front, moved });
        }
    }
}

/// The larger of what counts as a jump anywhere (1/m) and what does so near an inverse depth of `v`: a twentieth.
#[inline(always)]
fn jump_at(jump: f32, v: f32) -> f32 {
    let relative = 0.05 * v;
    if relative > jump { relative } else { jump }
}

/// Marks both sides of every jump (`edge`) and what lies within [`BAND_PX`] of one (`band`).
struct FindBand<'a> {
    inverse: &'a [f32],
    width: usize,
    jump: f32,
    edge: &'a mut Vec<bool>,
    band: &'a mut Vec<bool>,
    scratch: &'a mut Vec<bool>,
}

impl WithSimd for FindBand<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { inverse, width, jump, edge, band, scratch } = self;
        let height = inverse.len() / width;
        for mask in [&mut *edge, &mut *band, &mut *scratch] {
            mask.clear();
            mask.resize(inverse.len(), false);
        }
        for y in 0..height {
            let row = &inverse[y * width..][..width];
            let above = &inverse[y.saturating_sub(1) * width..][..width];
            let below = &inverse[(y + 1).min(height - 1) * width..][..width];
            let out = &mut edge[y * width..][..width];
            for (((out, &here), &above), &below) in out.iter_mut().zip(row).zip(above).zip(below) {
                *out = is_jump(here, above, jump) | is_jump(here, below, jump);
            }
            for (out, three) in out[1.min(width)..].iter_mut().zip(row.windows(3)) {
                *out |= is_jump(three[1], three[0], jump) | is_jump(three[1], three[2], jump);
            }
            if width > 1 {
                out[0] |= is_jump(row[0], row[1], jump);
                out[width - 1] |= is_jump(row[width - 1], row[width - 2], jump);
            }
        }
        const REST_PX: usize = BAND_PX - 1;
        for (row, out) in edge.chunks_exact(width).zip(scratch.chunks_exact_mut(width)) {
            out.copy_from_slice(row);
            for px in 1..=REST_PX.min(width - 1) {
                spread(&row[..width - px], &mut out[px..]);
                spread(&row[px..], &mut out[..width - px]);
            }
        }
        for (y, out) in band.chunks_exact_mut(width).enumerate() {
            for near in y.saturating_sub(REST_PX)..(y + BAND_PX).min(height) {
                spread(&scratch[near * width..][..width], out);
            }
        }
    }
}

#[inline(always)]
fn spread(from: &[bool], to: &mut [bool]) {
    for (to, &from) in to.iter_mut().zip(from) {
        *to |= from;
    }
}

/// Whether two neighbours lie on the two sides of a jump, or share a quarter of one: an edge may be spread over some
/// pixels.
#[inline(always)]
fn is_jump(here: f32, beside: f32, jump: f32) -> bool {
    (here - beside).abs() > 0.25 * jump_at(jump, here)
}

/// Finds the surface of the pixels at edges, and of the neighbours of those that turn out to lie on another surface:
/// an edge moves like a front, and where it is right it costs little.
struct Vote<'a> {
    planes: &'a Planes,
    /// Where depths may change. A pixel leaves it when it is asked.
    band: &'a mut [bool],
    nearby: &'a [[f32; LANES]; ROWS],
    inverse: &'a mut [f32],
    jump: f32,
    front: &'a mut Vec<u32>,
    moved: &'a mut Vec<u32>,
}

impl WithSimd for Vote<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { planes, band, nearby, inverse, jump, front, moved } = self;
        let width = planes.width;
        let mut votes =
            Votes { depth: [[0.0; LANES]; ROWS], weight: [[0.0; LANES]; ROWS], range: (0.0, 0.0), loyalty: LOYALTY };
        for &k in &*front {
            band[k as usize] = false;
        }
        let mut next = 0;
        while let Some(&asked) = front.get(next) {
            next += 1;
            let k = asked as usize;
            let (x, y) = (k % width, k / width);
            votes.gather(planes, nearby, x, y);
            let v = votes.surface(inverse[k], jump);
            if v == inverse[k] {
                continue;
            }
            inverse[k] = v;
            moved.push(asked);
            let beside =
                [(x > 0, k.wrapping_sub(1)), (x + 1 < width, k + 1), (y > 0, k.wrapping_sub(width)), (true, k + width)];
            for (inside, beside) in beside {
                if inside && beside < band.len() && band[beside] {
                    band[beside] = false;
                    front.push(beside as u32);
                }
            }
        }
    }
}

/// The votes for one pixel.
struct Votes {
    /// Inverse depth, 1/m.
    depth: [[f32; LANES]; ROWS],
    weight: [[f32; LANES]; ROWS],
    /// Least and largest inverse depth that has a vote.
    range: (f32, f32),
    /// How many times the own side's votes count.
    loyalty: f32,
}

impl Votes {
    #[inline(always)]
    fn gather(&mut self, planes: &Planes, nearby: &[[f32; LANES]; ROWS], x: usize, y: usize) {
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
    fn surface(&self, own: f32, jump: f32) -> f32 {
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
