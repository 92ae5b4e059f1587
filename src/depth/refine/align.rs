//! Edge alignment, guided by colour: depth edges, moved onto the edges of the colour picture.
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

use super::planes::{Planes, SetDepths};
use super::votes::{self, REACH_LANES, Votes, Weights, jump_at};

/// How far from a jump a depth may be wrong, in pixels.
const BAND_PX: usize = 4;
/// Weight of a depth that may be wrong itself, and of one that nobody measured.
const UNSURE: f32 = 0.12;
const MADE_UP: f32 = 0.02;
/// Rounds; each can move an edge by up to [`BAND_PX`].
const ROUNDS: usize = 2;

/// Aligns maps of inverse depth; owns the memory for it.
#[derive(Debug)]
pub struct Aligner {
    planes: Planes,
    /// Both sides of every jump, and what lies within [`BAND_PX`] of one.
    edge: Vec<bool>,
    band: Vec<bool>,
    scratch: Vec<bool>,
    /// How much each depth counts as a vote, 0 to 1.
    confidence: Vec<f32>,
    /// Weight of votes by distance.
    nearby: Weights,
    /// Pixels to ask, in order: first those at an edge, then the neighbours of those that changed.
    front: Vec<u32>,
    /// All that were asked in the first round.
    asked: Vec<u32>,
    /// Pixels that changed in the last round.
    moved: Vec<u32>,
}

impl Default for Aligner {
    fn default() -> Self {
        Self {
            planes: Planes::default(),
            edge: Vec::new(),
            band: Vec::new(),
            scratch: Vec::new(),
            confidence: Vec::new(),
            nearby: votes::weights_by_distance(),
            front: Vec::new(),
            asked: Vec::new(),
            moved: Vec::new(),
        }
    }
}

impl Aligner {
    /// Moves the edges of `inverse` onto those of the picture `rgb`. Steps of inverse depth above `jump` are edges;
    /// depths that are `unknown` were made up.
    pub fn align(&mut self, arch: Arch, inverse: &mut [f32], unknown: &[bool], rgb: &[u8], width: usize, jump: f32) {
        let height = inverse.len().checked_div(width).unwrap_or(0);
        self.moved.clear();
        self.asked.clear();
        for round in 0..ROUNDS {
            let Self { planes, edge, band, scratch, confidence, nearby, front, asked, moved } = self;
            confidence.resize(inverse.len(), 0.0);
            arch.dispatch(FindBand { inverse, width, jump, edge, band, scratch });
            // Only what moved in the round before can move its neighbours now.
            front.clear();
            if round == 0 {
                front.extend((0..).zip(&*edge).filter(|(_, edge)| **edge).map(|(k, _)| k));
            } else {
                front.extend(moved.iter().filter(|&&k| band[k as usize]));
            }
            if front.is_empty() {
                break;
            }
            if round == 0 {
                planes.set_colors(rgb, width, height, REACH_LANES);
            }
            for ((confidence, &band), &unknown) in confidence.iter_mut().zip(&*band).zip(unknown) {
                *confidence = if unknown {
                    MADE_UP
                } else if band {
                    UNSURE
                } else {
                    1.0
                };
            }
            arch.dispatch(SetDepths { planes, inverse, confidence });
            moved.clear();
            arch.dispatch(Vote { planes, band, nearby, inverse, jump, front, moved });
            if round == 0 {
                std::mem::swap(front, asked);
            }
        }
        decide(&self.asked, inverse, rgb, width, jump);
    }
}

/// Gives those pixels that are left between two surfaces, as where a ramp was an edge, the one of both whose colour beside them
/// is more like theirs.
fn decide(asked: &[u32], inverse: &mut [f32], rgb: &[u8], width: usize, jump: f32) {
    let color = |k: usize| [0, 1, 2].map(|p| i32::from(rgb[3 * k + p]));
    let height = inverse.len() / width;
    for k in asked.iter().map(|&k| k as usize) {
        let (x, y, here) = (k % width, k / width, inverse[k]);
        let pairs = [(x > 0 && x + 1 < width, 1), (y > 0 && y + 1 < height, width)];
        let mut ends = pairs.into_iter().filter(|(inside, _)| *inside).map(|(_, step)| (k - step, k + step));
        let is_between = |&(a, b): &(usize, usize)| {
            let (low, high) = (inverse[a].min(inverse[b]), inverse[a].max(inverse[b]));
            here - low > jump_at(jump, here) && high - here > jump_at(jump, high)
        };
        if let Some((a, b)) = ends.rfind(is_between) {
            let apart = |of: usize| color(of).into_iter().zip(color(k)).map(|(a, b)| (a - b).pow(2)).sum::<i32>();
            inverse[k] = inverse[if apart(a) <= apart(b) { a } else { b }];
        }
    }
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
            // The same along the row; its ends have one neighbour.
            for (out, three) in out[1.min(width)..].iter_mut().zip(row.windows(3)) {
                *out |= is_jump(three[1], three[0], jump) | is_jump(three[1], three[2], jump);
            }
            if width > 1 {
                out[0] |= is_jump(row[0], row[1], jump);
                out[width - 1] |= is_jump(row[width - 1], row[width - 2], jump);
            }
        }
        // The edge pixel itself is the first of the band. Along rows, then down the columns.
        const REST_PX: usize = BAND_PX - 1;
        for (row, out) in edge.chunks_exact(width).zip(scratch.chunks_exact_mut(width)) {
            out.copy_from_slice(row);
            for px in 1..=REST_PX.min(width - 1) {
                or_assign(&mut out[px..], &row[..width - px]);
                or_assign(&mut out[..width - px], &row[px..]);
            }
        }
        for (y, out) in band.chunks_exact_mut(width).enumerate() {
            for other in y.saturating_sub(REST_PX)..(y + BAND_PX).min(height) {
                or_assign(out, &scratch[other * width..][..width]);
            }
        }
    }
}

#[inline(always)]
fn or_assign(to: &mut [bool], from: &[bool]) {
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
    /// Where depths may change. A pixel leaves it when it joins the front, so that it is asked once.
    band: &'a mut [bool],
    nearby: &'a Weights,
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
        let mut votes = Votes::default();
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
            // Below the last row `k + width` lies beyond the band.
            for (inside, beside) in beside {
                if inside && beside < band.len() && band[beside] {
                    band[beside] = false;
                    front.push(beside as u32);
                }
            }
        }
    }
}
