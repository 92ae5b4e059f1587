//! The quality levels of the blur, with their cost and parameters.

use crate::budget::Quality;

/// Scales of a bin: pixels of the picture per bin pixel and axis.
pub const SCALES: [usize; 4] = [1, 2, 4, 8];
/// Largest radius at which a bin of full rank stays at full scale, in pixels: the memory of its filters then does not
/// grow with the blur.
pub const MAX_FULL_RADIUS_PX: f32 = 128.0;

/// The smallest CoC at which a bin of its own begins, in pixels.
pub const FOCUS_BORDER_PX: f32 = 1.0;

/// Radius in front of the focal plane below which everything belongs to the bin in focus, in pixels, and as a fraction
/// of the largest radius behind; the larger one applies, so that a nose is no layer of its own.
pub const NEAR_FROM_PX: f32 = 2.0;
pub const NEAR_FROM_FRACTION: f32 = 0.07;

/// Parameters of a quality level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QualityLevel {
    /// Time of a frame relative to the default level, measured on scenes of a person before walls. Other pictures and
    /// machines differ: this is a first estimate, from which the governor learns.
    pub cost: f64,
    /// Separable terms of each bin's filters.
    pub rank: u32,
    /// Number of bins behind the focal plane, and in front of it.
    pub bins_per_side: u32,
    /// Number of bins of a side, the first ones, that may be at full scale, where filters cost most; the others begin
    /// only where half scale does, so that few of them divide a slope whose radii are all below that.
    pub fine_bins: usize,
    /// Smallest radius in a bin, in pixels of the picture, from which each of [`SCALES`] is used.
    pub scale_from_px: [f32; SCALES.len()],
    /// Largest radius in bin pixels: a bin is reduced until its radii fit, so that the cost of a filter does not grow
    /// with the blur.
    pub max_bin_radius_px: f32,
    /// Separable terms for a uniform radius: more, because missing terms would be visible at every pixel.
    pub uniform_rank: u32,
}

/// Quality levels, cheapest first, in the order of [`Quality::ALL`].
pub const QUALITY_LEVELS: [QualityLevel; Quality::ALL.len()] = [
    QualityLevel {
        cost: 0.8,
        rank: 2,
        bins_per_side: 2,
        fine_bins: 1,
        scale_from_px: [0.0, 2.5, 15.0, 30.0],
        max_bin_radius_px: 14.0,
        uniform_rank: 2,
    },
    QualityLevel {
        cost: 1.0,
        rank: 3,
        bins_per_side: 4,
        fine_bins: 1,
        scale_from_px: [0.0, 4.0, 15.0, 30.0],
        max_bin_radius_px: 14.0,
        uniform_rank: 4,
    },
    QualityLevel {
        cost: 2.2,
        rank: 4,
        bins_per_side: 5,
        fine_bins: 3,
        scale_from_px: [0.0, 12.0, 48.0, 96.0],
        max_bin_radius_px: 28.0,
        uniform_rank: 6,
    },
];

/// [`QualityLevel::cost`] of all levels, as the governor takes them.
pub const COSTS: [f64; QUALITY_LEVELS.len()] = {
    let [draft, balanced, best] = QUALITY_LEVELS;
    [draft.cost, balanced.cost, best.cost]
};

/// Returns the finest scale at which a radius has at most `max_px` bin pixels, or the coarsest scale.
pub fn scale_within(radius_px: f32, max_px: f32) -> usize {
    let fits = SCALES.into_iter().find(|&scale| radius_px <= max_px * scale as f32);
    fits.unwrap_or(SCALES[SCALES.len() - 1])
}

impl QualityLevel {
    /// Returns the scale of a bin with radii from `low_px` to `high_px`: the coarsest at which the small ones keep
    /// their shape, or a coarser one that keeps the large ones cheap.
    pub fn scale(&self, low_px: f32, high_px: f32) -> usize {
        let fits = SCALES.into_iter().zip(self.scale_from_px).rev().find(|&(_, from_px)| low_px >= from_px);
        fits.map_or(1, |(scale, _)| scale).max(scale_within(high_px, self.max_bin_radius_px))
    }
}
