//! The quality levels of an executor: the filters of each, and the maxima that size its shared memory. Changing the
//! level allocates nothing.

mod factors;

use std::sync::Arc;

use super::bank::Bank;
use super::rung::{LADDER, MAX_FULL_RADIUS_PX, QualityLevel, SCALES};
use super::{Rank, Settings};
use crate::budget::Quality;
use crate::optics::CocKind;
use factors::Factors;

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
pub struct Step {
    pub quality: Quality,
    pub rung: QualityLevel,
    /// Index of its filters in [`Ladder::banks`].
    pub bank: usize,
}

/// Quality levels of an executor, cheapest first, and their filters.
#[derive(Clone, Debug)]
pub struct Ladder {
    steps: Vec<Step>,
    /// Filter banks, in bin pixels; levels share equal banks.
    pub banks: Vec<Arc<Bank>>,
}

impl Ladder {
    /// Makes the filters of all levels if the settings are adaptive, else those of [`Settings::quality`] alone.
    pub fn new(settings: &Settings, compositing: Compositing) -> Self {
        let max_px = settings.far_max_px.max(settings.near_max_px);
        let coarsest = SCALES[SCALES.len() - 1] as f32;
        let factors = Factors::cached(&settings.aperture, settings.rim);
        let mut bank_keys: Vec<(Rank, f32)> = Vec::new();
        let mut banks = Vec::new();
        let wanted = |quality: &Quality| settings.adaptive || *quality == settings.quality;
        let steps = Quality::ALL.into_iter().filter(wanted).map(|quality| {
            let rung = LADDER[quality as usize];
            let terms = if settings.coc == CocKind::Uniform { rung.uniform_rank } else { rung.rank };
            let rank = settings.rank.unwrap_or(Rank::Terms(terms));
            // Largest radius in bin pixels: bins are reduced until it is below a limit, as far as the scales go.
            let bank_px = match settings.coc {
                // Gathering is at full scale.
                _ if compositing == Compositing::Gather => max_px,
                _ if settings.rank == Some(Rank::Full) => max_px.min((max_px / coarsest).max(MAX_FULL_RADIUS_PX)),
                CocKind::Uniform => max_px / rung.uniform_scale(max_px) as f32,
                _ => max_px.min((max_px / coarsest).max(rung.max_bin_radius_px)),
            };
            let bank = bank_keys.iter().position(|&key| key == (rank, bank_px)).unwrap_or_else(|| {
                bank_keys.push((rank, bank_px));
                banks.push(Arc::new(Bank::of(&factors.svd, &factors.mask, rank, bank_px)));
                banks.len() - 1
            });
            Step { quality, rung, bank }
        });
        Self { steps: steps.collect(), banks }
    }

    /// Returns the level of a quality, or the nearest one.
    pub fn nearest(&self, quality: Quality) -> &Step {
        let apart = |step: &&Step| (step.quality as usize).abs_diff(quality as usize);
        self.steps.iter().min_by_key(apart).expect("there is at least one rung")
    }

    /// Returns all levels, cheapest first.
    pub fn iter(&self) -> impl Iterator<Item = &Step> {
        self.steps.iter()
    }

    /// Returns the largest number of separable terms of any level.
    pub fn max_terms(&self) -> usize {
        self.banks.iter().map(|bank| bank.terms).max().unwrap_or(0)
    }

    /// Returns the largest filter half-width of any level, in bin pixels.
    pub fn max_reach(&self) -> usize {
        self.banks.iter().map(|bank| bank.reach).max().unwrap_or(0)
    }

    /// Returns the largest number of bins on one side of the focal plane.
    pub fn max_bins_per_side(&self) -> usize {
        self.steps.iter().map(|step| step.rung.bins_per_side as usize).max().unwrap_or(0)
    }

    /// Returns the largest number of bins per side that may be at full scale.
    pub fn max_fine_bins(&self) -> usize {
        self.steps.iter().map(|step| step.rung.fine_bins()).max().unwrap_or(0)
    }
}
