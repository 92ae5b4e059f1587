//! The rungs that an executor is made for: the filters of each, and the maxima that size the memory they share.
//! Nothing is allocated when the rung changes.

mod factors;

use std::sync::Arc;

use super::bank::Bank;
use super::rung::{LADDER, MOST_FULL_RADIUS_PX, Rung, SCALES};
use super::{Rank, Settings};
use crate::budget::Quality;
use crate::optics::CocKind;
use factors::Factors;

/// How the blurred bins become one picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compositing {
    /// A pixel belongs to the bin of its own CoC; bins are stacked front to back.
    Layers,
    /// Every bin holds the whole picture; a pixel takes the bin of its own CoC (no depth edges to respect).
    Select,
    /// One bin at full scale, every pixel with exactly its own radius.
    Gather,
}

/// A rung, and its filters.
#[derive(Clone, Debug)]
pub struct Step {
    pub quality: Quality,
    pub rung: Rung,
    /// Which of [`Ladder::banks`] has its filters.
    pub bank: usize,
}

/// The rungs of an executor, cheapest first, and their filters.
#[derive(Clone, Debug)]
pub struct Ladder {
    steps: Vec<Step>,
    /// The filters, in units of bin pixels; rungs share them where they can.
    pub banks: Vec<Arc<Bank>>,
}

impl Ladder {
    /// Makes the filters of all rungs where the settings are adaptive, else of [`Settings::quality`] alone.
    pub fn new(settings: &Settings, compositing: Compositing) -> Self {
        let max_px = settings.far_max_px.max(settings.near_max_px);
        let coarsest = SCALES[SCALES.len() - 1] as f32;
        let factors = Factors::of(&settings.aperture, settings.rim);
        let mut bank_keys: Vec<(Rank, f32)> = Vec::new();
        let mut banks = Vec::new();
        let wanted = |quality: &Quality| settings.adaptive || *quality == settings.quality;
        let steps = Quality::ALL.into_iter().filter(wanted).map(|quality| {
            let rung = LADDER[quality as usize];
            let terms = if settings.coc == CocKind::Uniform { rung.even_rank } else { rung.rank };
            let rank = settings.rank.unwrap_or(Rank::Terms(terms));
            // The largest radius in bin pixels: bins are reduced until it is below a limit, as far as scales go.
            let bank_px = match settings.coc {
                // At full scale.
                _ if compositing == Compositing::Gather => max_px,
                _ if settings.rank == Some(Rank::Full) => max_px.min((max_px / coarsest).max(MOST_FULL_RADIUS_PX)),
                CocKind::Uniform => max_px / rung.even_scale(max_px) as f32,
                _ => max_px.min((max_px / coarsest).max(rung.most_radius_px)),
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

    /// The rung of a quality, or the nearest one there is.
    pub fn nearest(&self, quality: Quality) -> &Step {
        let apart = |step: &&Step| (step.quality as usize).abs_diff(quality as usize);
        self.steps.iter().min_by_key(apart).expect("there is at least one rung")
    }

    /// All rungs, cheapest first.
    pub fn iter(&self) -> impl Iterator<Item = &Step> {
        self.steps.iter()
    }

    /// Most separable terms of any rung.
    pub fn most_terms(&self) -> usize {
        self.banks.iter().map(|bank| bank.terms).max().unwrap_or(0)
    }

    /// The largest reach of any rung's filters, in bin pixels.
    pub fn most_reach(&self) -> usize {
        self.banks.iter().map(|bank| bank.reach).max().unwrap_or(0)
    }

    /// Most bins on one side of the focal plane.
    pub fn most_bins_per_side(&self) -> usize {
        self.steps.iter().map(|step| step.rung.bins_per_side as usize).max().unwrap_or(0)
    }

    /// Most bins of a side that may be at full scale.
    pub fn most_fine_bins(&self) -> usize {
        self.steps.iter().map(|step| step.rung.fine_bins()).max().unwrap_or(0)
    }
}
