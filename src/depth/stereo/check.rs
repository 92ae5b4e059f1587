//! The epipolar check: whether two pictures are a rectified pair, with the same point in the same row, further to the
//! left in the right picture.
//!
//! Distinctive points (Shi and Tomasi, *Good features to track*, CVPR 1994) of the left picture are looked for in the
//! right one by normalised correlation, in rows above and below and on both sides: first at half resolution, then to
//! parts of a pixel at the full one. Only points that match in one place, and in both directions, count.

mod search;

use std::fmt;

use pulp::Arch;

use super::MatchError;
use crate::frame::GrayImage;
use search::{Coarse, Search, corners, halved, refined};

/// Fewer matches tell nothing.
const LEAST_MATCHES: u32 = 12;
/// Rows of a rectified pair agree this well in the median, in pixels.
const MOST_OFF_PX: f32 = 0.75;
/// Six of ten points of a rectified pair lie this near to that median, in pixels.
const MOST_SPREAD_PX: f32 = 1.0;
/// Disparities of what is far are around 0; those beyond this count as negative.
const NEGATIVE_PX: f32 = -1.0;
/// A disparity has so many points, and so large a share of all, at it or above.
const SOME_POINTS: usize = 4;
const SOME_SHARE: f32 = 0.015;
/// With more negative disparities than this share, the eyes are exchanged.
const MOST_NEGATIVE: f32 = 0.7;

/// What the points that were found in both pictures say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PairCheck {
    /// Points found in both pictures.
    pub matches: u32,
    /// Row in the right picture less that in the left one, in pixels: the median.
    pub vertical_px: f32,
    /// Distance from that median within which six of ten points lie, in pixels.
    pub vertical_spread_px: f32,
    /// Share of points with a negative disparity: further to the right in the right picture.
    pub negative_share: f32,
    /// The largest disparity that some points have, in pixels; 0 where there are none.
    pub largest_px: f32,
    /// Whether both pictures are one.
    pub is_one: bool,
}

/// What a pair is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Rows agree, and the left picture is that of the left eye.
    Rectified,
    /// Rows do not agree.
    RowsOff {
        /// Distance of the rows within which most points lie, in pixels.
        px: f32,
    },
    /// Rows agree, and the left picture is that of the right eye.
    Swapped,
    /// One picture was given for both eyes.
    Same,
    /// Too little was found to tell.
    Unclear {
        /// Points found in both pictures.
        matches: u32,
    },
}

impl PairCheck {
    /// What this makes the pair.
    pub fn verdict(&self) -> Verdict {
        let Self { matches, vertical_px, vertical_spread_px, negative_share, is_one, .. } = *self;
        if matches < LEAST_MATCHES {
            Verdict::Unclear { matches }
        } else if is_one {
            Verdict::Same
        } else if vertical_px.abs() > MOST_OFF_PX || vertical_spread_px > MOST_SPREAD_PX {
            Verdict::RowsOff { px: vertical_px.abs() + vertical_spread_px }
        } else if negative_share > MOST_NEGATIVE {
            Verdict::Swapped
        } else {
            Verdict::Rectified
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rectified => write!(f, "the pair is rectified"),
            Self::RowsOff { px } => write!(f, "the pair is not rectified: rows are off by up to {px:.1} px"),
            Self::Swapped => write!(f, "left and right are exchanged: disparities are negative; exchange the pictures"),
            Self::Same => {
                write!(f, "left and right are one picture, so that nothing has a distance; give what the two eyes saw")
            }
            Self::Unclear { matches } => write!(
                f,
                "too little texture to tell whether the pair is rectified: {matches} points were found in both \
                 pictures, and {LEAST_MATCHES} are needed"
            ),
        }
    }
}

/// Looks for points of `left` in `right`, at disparities from `-disparities` to `disparities` and in rows up to 24
/// pixels away. For once a run: it allocates.
///
/// # Errors
/// The pictures are not of one size.
pub fn check(left: &GrayImage, right: &GrayImage, disparities: u32) -> Result<PairCheck, MatchError> {
    if left.size() != right.size() {
        return Err(MatchError::Sizes { left: left.size(), right: right.size() });
    }
    let halves = [halved(left), halved(right)];
    let coarse = halves.each_ref().map(|half| Coarse::new(half, disparities.min(left.width) as i32 / 2));
    let arch = Arch::new();
    let mut scores = Vec::new();
    let mut search = |from: usize, at| {
        arch.dispatch(Search { from: &halves[from], into: &coarse[1 - from], at, scores: &mut scores })
    };
    let mut moved_px: Vec<(f32, f32)> = Vec::new();
    for (x, y) in corners(&halves[0]) {
        let Some((dx, dy)) = search(0, (x, y)) else { continue };
        let Some((back_dx, back_dy)) = search(1, (x + dx, y + dy)) else { continue };
        // Only mutual best matches, within a pixel of the half size.
        if (dx + back_dx).abs() <= 1 && (dy + back_dy).abs() <= 1 {
            moved_px.extend(refined(left, right, (2 * x, 2 * y), (2 * dx, 2 * dy)));
        }
    }
    // Where nothing can be matched nothing is known of them either.
    Ok(PairCheck { is_one: !moved_px.is_empty() && left.luma == right.luma, ..summary(&moved_px) })
}

/// Statistics of the moves (across, down) of all matched points, from left to right picture.
fn summary(moved_px: &[(f32, f32)]) -> PairCheck {
    if moved_px.is_empty() {
        return PairCheck::default();
    }
    let quantile = |values: &mut Vec<f32>, share: f32| {
        let at = (values.len() as f32 * share) as usize;
        *values.select_nth_unstable_by(at, f32::total_cmp).1
    };
    let mut down_px: Vec<f32> = moved_px.iter().map(|&(_, down_px)| down_px).collect();
    let vertical_px = quantile(&mut down_px, 0.5);
    down_px.iter_mut().for_each(|down_px| *down_px = (*down_px - vertical_px).abs());
    // A disparity is a move to the left: the negated move across.
    let negative = moved_px.iter().filter(|&&(across_px, _)| -across_px < NEGATIVE_PX).count();
    let mut disparities_px: Vec<f32> = moved_px.iter().map(|&(across_px, _)| -across_px).collect();
    disparities_px.sort_unstable_by(|a, b| b.total_cmp(a));
    let some = SOME_POINTS.max((SOME_SHARE * moved_px.len() as f32) as usize);
    PairCheck {
        largest_px: disparities_px.get(some - 1).map_or(0.0, |largest_px| largest_px.max(0.0)),
        matches: moved_px.len() as u32,
        vertical_px,
        vertical_spread_px: quantile(&mut down_px, 0.6),
        negative_share: negative as f32 / moved_px.len() as f32,
        is_one: false,
    }
}
