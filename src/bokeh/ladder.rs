//! The quality levels of an executor: the filters of each, and the maxima that size its shared memory. Changing the
//! level allocates nothing.

mod factors;

use std::sync::Arc;

use super::bank::FilterBank;
use super::quality_level::{MAX_FULL_RADIUS_PX, QUALITY_LEVELS, QualityLevel, SCALES};
use super::{Rank, Settings};
use crate::budget::Quality;
use crate::optics::CocKind;
use factors::ApertureFactors;

/// How the blurred bins are combined into one picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compositing {
    /// A pixel belongs to the bin of its own CoC; bins are stacked front to back.
    Layers,
    /// Every bin holds the whole picture; each pixel is read from the bin of its own CoC (no depth discontinuities).
    Select,
    /// One bin at full scale; every pixel uses exactly its own radius.
    Gather,
}

/// A quality level and its filters.
#[derive(Clone, Debug)]
pub struct LadderLevel {
    pub quality: Quality,
    pub level: QualityLevel,
    /// Index of its filters in [`QualityLadder::banks`].
    pub bank: usize,
}

/// Quality levels of an executor, cheapest first, and their filters.
#[derive(Clone, Debug)]
pub struct QualityLadder {
    levels: Vec<LadderLevel>,
    /// Filter banks, in bin pixels; levels share equal banks.
    pub banks: Vec<Arc<FilterBank>>,
}

impl QualityLadder {
    /// Makes the filters of all levels if the settings are adaptive, else those of [`Settings::quality`] alone.
    pub fn new(settings: &Settings, compositing: Compositing) -> Self {
        let max_px = settings.far_max_px.max(settings.near_max_px);
        let coarsest = SCALES[SCALES.len() - 1] as f32;
        let factors = ApertureFactors::from_cache(&settings.aperture, settings.rim);
        let mut bank_keys: Vec<(Rank, f32)> = Vec::new();
        let mut banks = Vec::new();
        let wanted = |quality: &Quality| settings.adaptive || *quality == settings.quality;
        let levels = Quality::ALL.into_iter().filter(wanted).map(|quality| {
            let level = QUALITY_LEVELS[quality as usize];
            let terms = if settings.coc == CocKind::Uniform { level.uniform_rank } else { level.rank };
            let rank = settings.rank.unwrap_or(Rank::Terms(terms));
            // Largest radius in bin pixels: bins are reduced until it is below a limit, as far as the scales go.
            let bank_px = match settings.coc {
                // Gathering is at full scale.
                _ if compositing == Compositing::Gather => max_px,
                _ if settings.rank == Some(Rank::Full) => max_px.min((max_px / coarsest).max(MAX_FULL_RADIUS_PX)),
                CocKind::Uniform => max_px / level.scale(max_px, max_px) as f32,
                _ => max_px.min((max_px / coarsest).max(level.max_bin_radius_px)),
            };
            let bank = bank_keys.iter().position(|&key| key == (rank, bank_px)).unwrap_or_else(|| {
                bank_keys.push((rank, bank_px));
                // Gathers are at full scale. With all terms only large radii are not, beside which tents hardly blur.
                let with_reduced = compositing != Compositing::Gather && rank != Rank::Full;
                let ApertureFactors { svd, mask } = &*factors;
                banks.push(Arc::new(FilterBank::from_decomposition(svd, mask, rank, bank_px, with_reduced)));
                banks.len() - 1
            });
            LadderLevel { quality, level, bank }
        });
        let levels = levels.collect();
        Self { levels, banks }
    }

    /// Returns the level of a quality, or the nearest one.
    pub fn nearest_level(&self, quality: Quality) -> &LadderLevel {
        let apart = |level: &&LadderLevel| (level.quality as usize).abs_diff(quality as usize);
        self.levels.iter().min_by_key(apart).expect("there is at least one rung")
    }

    /// Returns all levels, cheapest first.
    pub fn iter(&self) -> impl Iterator<Item = &LadderLevel> {
        self.levels.iter()
    }

    /// Returns the largest number of separable terms of any level.
    pub fn max_terms(&self) -> usize {
        self.banks.iter().map(|bank| bank.terms).max().unwrap_or(0)
    }

    /// Returns the largest filter half-width of any level, in bin pixels.
    pub fn max_half_width(&self) -> usize {
        self.banks.iter().map(|bank| bank.half_width).max().unwrap_or(0)
    }

    /// Returns the largest number of bins on one side of the focal plane.
    pub fn max_bins_per_side(&self) -> usize {
        self.levels.iter().map(|level| level.level.bins_per_side as usize).max().unwrap_or(0)
    }

    /// Returns the largest number of bins per side that may be at full scale.
    pub fn max_fine_bins(&self) -> usize {
        self.levels.iter().map(|level| level.level.fine_bins).max().unwrap_or(0)
    }
}
