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

use std::iter;
use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::planes::{Planes, SetColors, SetDepths};
use super::tiles::Tiles;
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
    tiles: Tiles,
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
            tiles: Tiles::default(),
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
        self.moved.clear();
        self.asked.clear();
        for round in 0..ROUNDS {
            let Self { planes, edge, band, scratch, tiles, nearby, front, asked, moved } = self;
            if round == 0 {
                for mask in [&mut *edge, &mut *band, &mut *scratch] {
                    mask.clear();
                    mask.resize(inverse.len(), false);
                }
                arch.dispatch(FindEdges { inverse, width, jump, columns: |_| iter::once(0..width), edge });
                tiles.find(edge, width);
                front.clear();
                tiles.find_all(edge, front);
            } else {
                // Only what moved in the round before can have moved edges, and can move its neighbours now.
                arch.dispatch(FindEdges { inverse, width, jump, columns: |y| tiles.columns(y), edge });
            }
            arch.dispatch(FindBand { tiles, width, edge, band, scratch });
            if round > 0 {
                front.clear();
                front.extend(moved.iter().filter(|&&k| band[k as usize]));
            }
            if front.is_empty() {
                break;
            }
            if round == 0 {
                planes.resize(width, inverse.len() / width, REACH_LANES);
                arch.dispatch(SetColors { planes, tiles, rgb });
            }
            let (flags, weights) = ([unknown, &**band], [MADE_UP, UNSURE]);
            arch.dispatch(SetDepths { planes, tiles, inverse, flags, weights });
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

/// Marks both sides of every jump, in some columns of each row.
struct FindEdges<'a, C> {
    inverse: &'a [f32],
    width: usize,
    jump: f32,
    columns: C,
    edge: &'a mut [bool],
}

impl<I: Iterator<Item = Range<usize>>, C: Fn(usize) -> I> WithSimd for FindEdges<'_, C> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { inverse, width, jump, columns, edge } = self;
        let height = inverse.len() / width;
        for y in 0..height {
            let row = &inverse[y * width..][..width];
            let above = &inverse[y.saturating_sub(1) * width..][..width];
            let below = &inverse[(y + 1).min(height - 1) * width..][..width];
            let edge = &mut edge[y * width..][..width];
            for columns in columns(y) {
                let Range { start, end } = columns;
                // At the ends of the row a pixel is its own neighbour.
                for x in [start, end - 1] {
                    let around = [above[x], below[x], row[x.saturating_sub(1)], row[(x + 1).min(width - 1)]];
                    edge[x] = around.into_iter().any(|beside| is_jump(row[x], beside, jump));
                }
                if end - start <= 2 {
                    continue;
                }
                let (from, len) = (start + 1, end - start - 2);
                let [above, left, here, right, below] =
                    [&above[from..], &row[start..], &row[from..], &row[from + 1..], &below[from..]]
                        .map(|row| &row[..len]);
                for (k, edge) in edge[from..][..len].iter_mut().enumerate() {
                    let is = |beside: f32| is_jump(here[k], beside, jump);
                    *edge = is(above[k]) | is(below[k]) | is(left[k]) | is(right[k]);
                }
            }
        }
    }
}

/// Marks what lies within [`BAND_PX`] of an edge.
struct FindBand<'a> {
    tiles: &'a Tiles,
    width: usize,
    edge: &'a [bool],
    band: &'a mut [bool],
    scratch: &'a mut [bool],
}

impl WithSimd for FindBand<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { tiles, width, edge, band, scratch } = self;
        let height = edge.len() / width;
        // The edge pixel itself is the first of the band. Along rows, then down the columns.
        const REST_PX: usize = BAND_PX - 1;
        for y in 0..height {
            for columns in tiles.columns(y) {
                let row = &edge[y * width..][..width];
                let out = &mut scratch[y * width..][..width];
                out[columns.clone()].copy_from_slice(&row[columns.clone()]);
                for px in 1..=REST_PX {
                    let Range { start, end } = columns;
                    // What has no neighbour so far to the left, or to the right, is left out.
                    let (after, before) = (start.max(px), end.min(width.saturating_sub(px)));
                    if after < end {
                        or_assign(&mut out[after..end], &row[after - px..end - px]);
                    }
                    if start < before {
                        or_assign(&mut out[start..before], &row[start + px..before + px]);
                    }
                }
            }
        }
        for y in 0..height {
            for columns in tiles.columns(y) {
                let out = &mut band[y * width..][columns.clone()];
                out.fill(false);
                for other in y.saturating_sub(REST_PX)..(y + BAND_PX).min(height) {
                    or_assign(out, &scratch[other * width..][columns.clone()]);
                }
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
