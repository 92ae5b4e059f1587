//! The quality ladder of the blur: what each level trades for time.

use super::plan::FOCUS_BORDER_PX;
use crate::budget::Quality;

/// Pixels of the picture that a bin pixel may cover, each way.
pub const SCALES: [usize; 4] = [1, 2, 4, 8];
/// A bin is reduced until no radius has more bin pixels than this: the cost of a filter does not grow with the blur.
pub const MOST_RADIUS_PX: f32 = 14.0;
/// With every term that an aperture has, a bin stays at full scale up to this radius: what its filters take in memory
/// does not grow with the blur.
pub const MOST_FULL_RADIUS_PX: f32 = 128.0;

/// What a quality level trades.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rung {
    pub rank: u32,
    /// Bins behind the focal plane, and as many in front.
    pub bins_per_side: u32,
    /// Radius in front of the focal plane below which everything belongs to the bin in focus.
    pub near_from_px: f32,
    /// The same as a share of the largest radius behind, where that is more: a nose is no layer of its own.
    pub near_from_share: f32,
    /// Smallest radius in a bin, in pixels of the picture, from which it is filtered at each of [`SCALES`].
    pub scale_from_px: [f32; SCALES.len()],
    /// Whether what near objects hide is filled in.
    pub fill: bool,
    /// Separable terms where one radius holds for the whole picture: there every pixel shows what is left out.
    pub even_rank: u32,
    /// There, the picture is reduced until the radius has no more bin pixels than this.
    pub even_radius_px: f32,
}

/// The time that each quality level takes beside the default one, the cheapest first: as measured for a person before a
/// room, on two cores. Other pictures and machines differ; whoever asks for more had better learn.
pub const COSTS: [f64; Quality::ALL.len()] = [0.68, 0.70, 1.0, 1.3, 1.93];

/// The rung of a quality level.
pub fn rung(quality: Quality) -> Rung {
    let rung =
        |rank, bins_per_side, near_from_px, [half, quarter, eighth]: [f32; 3], fill, (even_rank, even_radius_px)| {
            Rung {
                rank,
                bins_per_side,
                near_from_px,
                near_from_share: if near_from_px > FOCUS_BORDER_PX { 0.07 } else { 0.0 },
                scale_from_px: [0.0, half, quarter, eighth],
                fill,
                even_rank,
                even_radius_px,
            }
        };
    match quality {
        Quality::Draft => rung(2, 2, 2.5, [3.0, 8.0, 20.0], false, (2, 6.0)),
        Quality::Fast => rung(2, 2, 2.5, [3.0, 8.0, 20.0], true, (3, 9.0)),
        Quality::Balanced => rung(3, 3, 2.0, [3.5, 18.0, 40.0], true, (4, 36.0)),
        Quality::High => rung(4, 4, 1.5, [5.0, 20.0, 48.0], true, (4, 48.0)),
        Quality::Best => rung(4, 6, 1.0, [8.0, 32.0, 80.0], true, (6, 96.0)),
    }
}

/// The finest scale at which a radius has at most so many bin pixels, or the coarsest there is.
pub fn scale_within(radius_px: f32, most_px: f32) -> usize {
    let fits = SCALES.into_iter().find(|&scale| radius_px <= most_px * scale as f32);
    fits.unwrap_or(SCALES[SCALES.len() - 1])
}

impl Rung {
    /// Bins of a side that may be at full scale.
    pub fn fine_bins(&self) -> usize {
        (self.bins_per_side as usize + 1) / 3
    }

    /// The coarsest scale at which radii from `low_px` on keep their shape and those up to `high_px` stay cheap.
    pub fn scale(&self, low_px: f32, high_px: f32) -> usize {
        let fits = SCALES.into_iter().zip(self.scale_from_px).rev().find(|&(_, from_px)| low_px >= from_px);
        fits.map_or(1, |(scale, _)| scale).max(scale_within(high_px, MOST_RADIUS_PX))
    }

    /// The scale for a picture that is blurred by one radius all over.
    pub fn even_scale(&self, radius_px: f32) -> usize {
        scale_within(radius_px, self.even_radius_px)
    }
}
