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
use super::tiles::{self, Tiles};
use super::votes::{self, REACH_LANES, Votes, Weights, jump_at};
use crate::compute::bands::{self, Bands};
use crate::compute::thread_pool::ThreadPool;

/// How far from a jump a depth may be wrong, in pixels.
pub const BAND_PX: usize = 4;
/// Weight of a depth that may be wrong itself, and of one that nobody measured.
pub const UNSURE: f32 = 0.12;
pub const MADE_UP: f32 = 0.02;
/// Neighbours on the two sides of a jump differ by at least this share of one: an edge may be spread over some pixels.
pub const EDGE_SHARE: f32 = 0.25;
/// Rounds; each can move an edge by up to [`BAND_PX`].
pub const ROUNDS: usize = 2;
/// Fewer pixels are not worth another thread.
const LEAST_ASKED: usize = 64;

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
    /// What those that are asked at once answer.
    answers: Vec<f32>,
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
            answers: Vec::new(),
            asked: Vec::new(),
            moved: Vec::new(),
        }
    }
}

impl Aligner {
    /// Moves the edges of `inverse` onto those of the picture `rgb`. Steps of inverse depth above `jump` are edges;
    /// depths that are `unknown` were made up.
    pub fn align(
        &mut self,
        (arch, workers): (Arch, &mut ThreadPool),
        inverse: &mut [f32],
        unknown: &[bool],
        rgb: &[u8],
        width: usize,
        jump: f32,
    ) {
        let height = inverse.len() / width;
        let bands = Bands::new(height, tiles::ROWS, workers);
        self.moved.clear();
        self.asked.clear();
        for round in 0..ROUNDS {
            let Self { planes, edge, band, scratch, tiles, nearby, front, answers, asked, moved } = self;
            if round == 0 {
                for mask in [&mut *edge, &mut *band, &mut *scratch] {
                    mask.clear();
                    mask.resize(inverse.len(), false);
                }
                tiles.clear(width, height);
                let parts = bands.rows().zip(bands.split(edge, width)).zip(tiles.split(bands));
                workers.run_each(parts, &|((rows, edge), has_edge)| {
                    let columns = |_| iter::once(0..width);
                    arch.dispatch(FindEdges { inverse, width, jump, columns, rows, edge: &mut *edge });
                    tiles::mark(has_edge, edge, width);
                });
                tiles.find_near();
                front.clear();
                tiles.find_all(edge, front);
                planes.resize(width, height, REACH_LANES);
            } else {
                // Only what moved in the round before can have moved edges, and can move its neighbours now.
                workers.run_each(bands.rows().zip(bands.split(edge, width)), &|(rows, edge)| {
                    arch.dispatch(FindEdges { inverse, width, jump, columns: |y| tiles.columns(y), rows, edge });
                });
            }
            workers.run_each(bands.rows().zip(bands.split(scratch, width)), &|(rows, out)| {
                arch.dispatch(SpreadAlong { tiles, width, edge, rows, out });
            });
            let parts = planes.split(bands).zip(bands.split(band, width));
            workers.run_each(parts, &|(mut planes, band)| {
                let rows = planes.rows.clone();
                arch.dispatch(SpreadAcross { tiles, width, along: scratch, rows, out: band });
                let planes = &mut planes;
                if round == 0 {
                    arch.dispatch(SetColors { planes, tiles, rgb });
                }
                arch.dispatch(SetDepths { planes, tiles, inverse, unknown, band, weights: [MADE_UP, UNSURE] });
            });
            if round > 0 {
                front.clear();
                front.extend(moved.iter().filter(|&&k| band[k as usize]));
            }
            moved.clear();
            vote((arch, workers), (planes, nearby, jump), (inverse, band), (front, answers, moved));
            if round == 0 {
                std::mem::swap(front, asked);
            }
        }
        decide(&self.asked, inverse, rgb, width, jump);
    }
}

/// Finds the surface of the pixels at edges, the `front`, and of the neighbours of those that turn out to lie on another
/// surface: an edge moves like a front, and where it is right it costs little. What a pixel is told depends on its own depth
/// alone, and on the planes: those of the front are asked at once. `band` is where depths may change; a pixel leaves it when it
/// joins the front, so that it is asked once.
fn vote(
    (arch, workers): (Arch, &mut ThreadPool),
    (planes, nearby, jump): (&Planes, &Weights, f32),
    (inverse, band): (&mut [f32], &mut [bool]),
    (front, answers, moved): (&mut Vec<u32>, &mut Vec<f32>, &mut Vec<u32>),
) {
    let width = planes.width;
    for &k in &*front {
        band[k as usize] = false;
    }
    let mut next = 0;
    while next < front.len() {
        let asked = &front[next..];
        let each = bands::share(asked.len(), LEAST_ASKED);
        answers.resize(asked.len(), 0.0);
        workers.run_each(asked.chunks(each).zip(answers.chunks_mut(each)), &|(asked, answers)| {
            arch.dispatch(Vote { planes, nearby, inverse, jump, asked, answers });
        });
        for &answer in &*answers {
            let asked = front[next];
            next += 1;
            let k = asked as usize;
            if answer == inverse[k] {
                continue;
            }
            inverse[k] = answer;
            moved.push(asked);
            let (x, y) = (k % width, k / width);
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

/// Marks both sides of every jump, in some columns of each row of a band.
struct FindEdges<'a, C> {
    inverse: &'a [f32],
    width: usize,
    jump: f32,
    columns: C,
    rows: Range<usize>,
    edge: &'a mut [bool],
}

impl<I: Iterator<Item = Range<usize>>, C: Fn(usize) -> I> WithSimd for FindEdges<'_, C> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { inverse, width, jump, columns, rows, edge } = self;
        let height = inverse.len() / width;
        for (line, y) in rows.enumerate() {
            let row = &inverse[y * width..][..width];
            let above = &inverse[y.saturating_sub(1) * width..][..width];
            let below = &inverse[(y + 1).min(height - 1) * width..][..width];
            let edge = &mut edge[line * width..][..width];
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

/// So far beside an edge the band goes: the edge pixel itself is the first of it.
const REST_PX: usize = BAND_PX - 1;

/// Marks what lies within [`BAND_PX`] of an edge along the rows of a band.
struct SpreadAlong<'a> {
    tiles: &'a Tiles,
    width: usize,
    edge: &'a [bool],
    rows: Range<usize>,
    out: &'a mut [bool],
}

impl WithSimd for SpreadAlong<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { tiles, width, edge, rows, out } = self;
        for (line, y) in rows.enumerate() {
            for columns in tiles.columns(y) {
                let row = &edge[y * width..][..width];
                let out = &mut out[line * width..][..width];
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
    }
}

/// The same down the columns, of what is marked `along` the rows.
struct SpreadAcross<'a> {
    tiles: &'a Tiles,
    width: usize,
    along: &'a [bool],
    rows: Range<usize>,
    out: &'a mut [bool],
}

impl WithSimd for SpreadAcross<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { tiles, width, along, rows, out } = self;
        let height = along.len() / width;
        for (line, y) in rows.enumerate() {
            for columns in tiles.columns(y) {
                let out = &mut out[line * width..][columns.clone()];
                out.fill(false);
                for other in y.saturating_sub(REST_PX)..(y + BAND_PX).min(height) {
                    or_assign(out, &along[other * width..][columns.clone()]);
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

/// Whether two neighbours lie on the two sides of a jump, or share enough of one.
#[inline(always)]
fn is_jump(here: f32, beside: f32, jump: f32) -> bool {
    (here - beside).abs() > EDGE_SHARE * jump_at(jump, here)
}

/// Asks pixels for their surface.
struct Vote<'a> {
    planes: &'a Planes,
    nearby: &'a Weights,
    inverse: &'a [f32],
    jump: f32,
    asked: &'a [u32],
    answers: &'a mut [f32],
}

impl WithSimd for Vote<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { planes, nearby, inverse, jump, asked, answers } = self;
        let mut votes = Votes::default();
        for (&asked, answer) in asked.iter().zip(answers) {
            let k = asked as usize;
            votes.gather(planes, nearby, k % planes.width, k / planes.width);
            *answer = votes.surface(inverse[k], jump);
        }
    }
}
