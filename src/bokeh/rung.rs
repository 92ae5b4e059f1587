//! The quality ladder of the blur: what each rung costs, and what it trades for that.

use crate::budget::Quality;

/// Pixels of the picture that a bin pixel may cover, each way.
pub const SCALES: [usize; 4] = [1, 2, 4, 8];
/// With every term that an aperture has, a bin stays at full scale up to this radius: what its filters take in memory
/// does not grow with the blur.
pub const MOST_FULL_RADIUS_PX: f32 = 128.0;

/// The smallest CoC at which a bin of its own begins, in pixels.
pub const FOCUS_BORDER_PX: f32 = 1.0;

/// What a rung trades.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rung {
    /// Time of a frame relative to the default rung's, measured on two cores with a person in a room. Other pictures
    /// and machines differ: a first estimate, from which the governor learns.
    pub cost: f64,
    /// Separable terms of each bin's filters.
    pub rank: u32,
    /// Bins behind the focal plane, and as many in front.
    pub bins_per_side: u32,
    /// Radius in front of the focal plane below which everything belongs to the bin in focus.
    pub near_from_px: f32,
    /// The same as a share of the largest radius behind; the larger holds, so that a nose is no layer of its own.
    pub near_from_share: f32,
    /// Smallest radius in a bin, in pixels of the picture, from which it is filtered at each of [`SCALES`].
    pub scale_from_px: [f32; SCALES.len()],
    /// A bin is reduced until no radius has more bin pixels than this: the cost of a filter does not grow with the blur.
    pub most_radius_px: f32,
    /// Separable terms where one radius holds for the whole picture: more, as every pixel shows the missing ones there.
    pub even_rank: u32,
    /// Where one radius holds for the whole picture, it is reduced until that has no more bin pixels than this.
    pub even_radius_px: f32,
}

/// The ladder, the cheapest rung first: that of a quality is at its place in [`Quality::ALL`].
pub const LADDER: [Rung; Quality::ALL.len()] = {
    let fast = Rung {
        cost: 0.70,
        rank: 2,
        bins_per_side: 2,
        near_from_px: 2.5,
        near_from_share: 0.07,
        scale_from_px: [0.0, 3.0, 8.0, 20.0],
        most_radius_px: 14.0,
        even_rank: 3,
        even_radius_px: 9.0,
    };
    [
        Rung { cost: 0.68, even_rank: 2, even_radius_px: 6.0, ..fast },
        fast,
        Rung {
            cost: 1.0,
            rank: 3,
            bins_per_side: 3,
            near_from_px: 2.0,
            scale_from_px: [0.0, 3.5, 18.0, 40.0],
            even_rank: 4,
            even_radius_px: 36.0,
            ..fast
        },
        Rung {
            cost: 1.3,
            rank: 4,
            bins_per_side: 4,
            near_from_px: 1.5,
            scale_from_px: [0.0, 5.0, 20.0, 48.0],
            even_rank: 4,
            even_radius_px: 48.0,
            ..fast
        },
        Rung {
            cost: 2.2,
            rank: 4,
            bins_per_side: 6,
            near_from_px: FOCUS_BORDER_PX,
            near_from_share: 0.0,
            scale_from_px: [0.0, 16.0, 48.0, 96.0],
            most_radius_px: 28.0,
            even_rank: 6,
            even_radius_px: 96.0,
        },
    ]
};

/// [`Rung::cost`] of all rungs, as a governor takes them.
pub const COSTS: [f64; LADDER.len()] = {
    let (mut costs, mut rung) = ([0.0; LADDER.len()], 0);
    while rung < LADDER.len() {
        costs[rung] = LADDER[rung].cost;
        rung += 1;
    }
    costs
};

/// The finest scale at which a radius has at most `most_px` bin pixels, or the coarsest there is.
pub fn scale_within(radius_px: f32, most_px: f32) -> usize {
    let fits = SCALES.into_iter().find(|&scale| radius_px <= most_px * scale as f32);
    fits.unwrap_or(SCALES[SCALES.len() - 1])
}

impl Rung {
    /// Bins of a side that may be at full scale, where filters cost most: about a third.
    pub fn fine_bins(&self) -> usize {
        (self.bins_per_side as usize + 1) / 3
    }

    /// The scale of a bin with radii from `low_px` to `high_px`: the coarsest at which the small ones keep their shape,
    /// or a coarser one that keeps the large ones cheap.
    pub fn scale(&self, low_px: f32, high_px: f32) -> usize {
        let fits = SCALES.into_iter().zip(self.scale_from_px).rev().find(|&(_, from_px)| low_px >= from_px);
        fits.map_or(1, |(scale, _)| scale).max(scale_within(high_px, self.most_radius_px))
    }

    /// The scale for a picture that is blurred by one radius all over.
    pub fn even_scale(&self, radius_px: f32) -> usize {
        scale_within(radius_px, self.even_radius_px)
    }
}
