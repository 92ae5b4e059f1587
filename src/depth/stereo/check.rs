//! The epipolar check: whether two pictures are a rectified pair, with the same point in the same row, further to the
//! left in the right picture.
//!
//! Distinctive points (Shi and Tomasi, *Good features to track*, CVPR 1994) of the left picture are searched in the
//! right one by normalised cross-correlation, in rows above and below and on both sides: first at half resolution, then
//! with subpixel accuracy at full resolution. Only unique and mutual matches count.

mod search;

use std::fmt;

use pulp::Arch;

use super::MatchError;
use crate::frame::GrayImage;
use search::{MatchSearch, SearchPicture, find_corners, halve_picture, refine_subpixel};

/// With fewer matches the verdict is unclear.
const MIN_MATCHES: u32 = 12;
/// Largest median row offset of a rectified pair, in pixels.
const MAX_ROW_OFFSET_PX: f32 = 0.75;
/// Largest deviation from that median of six of ten points of a rectified pair, in pixels.
const MAX_ROW_SPREAD_PX: f32 = 1.0;
/// Disparities of distant points are around 0; those below this count as negative.
const NEGATIVE_PX: f32 = -1.0;
/// Minimum support of the largest disparity: number and fraction of the points that have or exceed it.
const MIN_DISPARITY_POINTS: usize = 4;
const MIN_DISPARITY_FRACTION: f32 = 0.015;
/// With a larger fraction of negative disparities, left and right are swapped.
const MAX_NEGATIVE_FRACTION: f32 = 0.7;

/// Statistics of the points found in both pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PairCheck {
    /// Points found in both pictures.
    pub matches: u32,
    /// Median of the row in the right picture minus that in the left one, in pixels.
    pub vertical_px: f32,
    /// Deviation from that median within which six of ten points lie, in pixels.
    pub vertical_spread_px: f32,
    /// Fraction of points with a negative disparity: further to the right in the right picture.
    pub negative_fraction: f32,
    /// The largest disparity that several points have, in pixels; 0 without points.
    pub largest_px: f32,
    /// Whether both pictures are identical.
    pub is_identical: bool,
}

/// Verdict on a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Rows match, and left and right are not swapped.
    Rectified,
    /// Rows do not match.
    Misaligned {
        /// Row offset within which most points lie, in pixels.
        px: f32,
    },
    /// Rows match, but left and right are swapped.
    Swapped,
    /// Both pictures are identical.
    Identical,
    /// Too few points were found.
    Unclear {
        /// Points found in both pictures.
        matches: u32,
    },
}

impl PairCheck {
    /// Derives the verdict from the statistics.
    pub fn verdict(&self) -> Verdict {
        let Self { matches, vertical_px, vertical_spread_px, negative_fraction, is_identical, .. } = *self;
        if matches < MIN_MATCHES {
            Verdict::Unclear { matches }
        } else if is_identical {
            Verdict::Identical
        } else if vertical_px.abs() > MAX_ROW_OFFSET_PX || vertical_spread_px > MAX_ROW_SPREAD_PX {
            Verdict::Misaligned { px: vertical_px.abs() + vertical_spread_px }
        } else if negative_fraction > MAX_NEGATIVE_FRACTION {
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
            Self::Misaligned { px } => write!(f, "the pair is not rectified: rows are off by up to {px:.1} px"),
            Self::Swapped => write!(f, "left and right are swapped: disparities are negative; swap the pictures"),
            Self::Identical => {
                write!(
                    f,
                    "left and right are the same picture, so nothing has a distance; give the pictures of the \
                           left and the right camera"
                )
            }
            Self::Unclear { matches } => write!(
                f,
                "too little texture to tell whether the pair is rectified: {matches} points were found in both \
                 pictures, and {MIN_MATCHES} are needed"
            ),
        }
    }
}

/// Searches for points of `left` in `right`, at disparities from `-disparities` to `disparities` and in rows up to 24
/// pixels away. It allocates: call it once a run, not per frame.
///
/// # Errors
/// Fails if the pictures differ in size.
pub fn check_pair(left: &GrayImage, right: &GrayImage, disparities: u32) -> Result<PairCheck, MatchError> {
    if left.size() != right.size() {
        return Err(MatchError::Sizes { left: left.size(), right: right.size() });
    }
    let halves = [halve_picture(left), halve_picture(right)];
    let search_pictures =
        halves.each_ref().map(|half| SearchPicture::new(half, disparities.min(left.width) as i32 / 2));
    let arch = Arch::new();
    let mut scores = Vec::new();
    let mut search = |from: usize, at| {
        arch.dispatch(MatchSearch { from: &halves[from], into: &search_pictures[1 - from], at, scores: &mut scores })
    };
    let mut displacements_px: Vec<(f32, f32)> = Vec::new();
    for (x, y) in find_corners(&halves[0]) {
        let Some((dx, dy)) = search(0, (x, y)) else { continue };
        let Some((back_dx, back_dy)) = search(1, (x + dx, y + dy)) else { continue };
        // Only mutual best matches, within a pixel at half resolution.
        if (dx + back_dx).abs() <= 1 && (dy + back_dy).abs() <= 1 {
            displacements_px.extend(refine_subpixel(left, right, (2 * x, 2 * y), (2 * dx, 2 * dy)));
        }
    }
    // Without matches the verdict is unclear even for identical pictures.
    Ok(PairCheck {
        is_identical: !displacements_px.is_empty() && left.luma == right.luma,
        ..compute_statistics(&displacements_px)
    })
}

/// Computes statistics of the displacements (across, down) of all matched points, from left to right picture.
fn compute_statistics(displacements_px: &[(f32, f32)]) -> PairCheck {
    if displacements_px.is_empty() {
        return PairCheck::default();
    }
    let quantile = |values: &mut Vec<f32>, fraction: f32| {
        let at = (values.len() as f32 * fraction) as usize;
        *values.select_nth_unstable_by(at, f32::total_cmp).1
    };
    let mut down_px: Vec<f32> = displacements_px.iter().map(|&(_, down_px)| down_px).collect();
    let vertical_px = quantile(&mut down_px, 0.5);
    down_px.iter_mut().for_each(|down_px| *down_px = (*down_px - vertical_px).abs());
    // A disparity is a displacement to the left, hence the sign.
    let negative = displacements_px.iter().filter(|&&(across_px, _)| -across_px < NEGATIVE_PX).count();
    let mut disparities_px: Vec<f32> = displacements_px.iter().map(|&(across_px, _)| -across_px).collect();
    disparities_px.sort_unstable_by(|a, b| b.total_cmp(a));
    let rank = MIN_DISPARITY_POINTS.max((MIN_DISPARITY_FRACTION * displacements_px.len() as f32) as usize);
    PairCheck {
        largest_px: disparities_px.get(rank - 1).map_or(0.0, |largest_px| largest_px.max(0.0)),
        matches: displacements_px.len() as u32,
        vertical_px,
        vertical_spread_px: quantile(&mut down_px, 0.6),
        negative_fraction: negative as f32 / displacements_px.len() as f32,
        is_identical: false,
    }
}
