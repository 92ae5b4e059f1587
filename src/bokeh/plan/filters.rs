//! How the content of a bin is filtered: by which kernels, how far they reach, and whether it is steadied in time.

use super::{Bin, CELL, Plan, SEGMENT, compensated_radius_px};
use crate::bokeh::disc::{self, DiscBank};

/// Smallest radius of bins that are steadied, in pixels.
const MIN_STEADY_RADIUS_PX: f32 = 5.0;
/// Largest ratio of the radii of a bin whose discs are summed.
const MAX_DISC_RATIO: f32 = 1.12;
impl Plan {
    /// Returns the aperture as discs, if a bin may be summed instead of filtered: if its radii are large enough, and hardly
    /// differ, as discs of whole pixels change in steps.
    pub fn discs(&self, bin: &Bin) -> Option<&DiscBank> {
        let min_px = compensated_radius_px(bin.min_radius_px, bin.scale);
        let is_even = min_px * MAX_DISC_RATIO >= bin.max_radius_px;
        let is_round = min_px >= disc::MIN_RADIUS_PX;
        self.ladder.discs.as_ref().filter(|_| is_even && is_round)
    }

    /// Whether a bin's content is steadied in time: detail that a smaller blur lets through would lag behind, and near
    /// objects move most.
    pub fn is_steadied(&self, bin: &Bin) -> bool {
        self.reuse && !bin.near && bin.scale > 1 && bin.min_radius_px >= MIN_STEADY_RADIUS_PX
    }

    /// Whether truncation makes a bin's filters overshoot visibly. Small filters keep nearly all of their terms: a
    /// symmetric kernel has `half_width + 1`, any other `2 half_width + 1`.
    pub fn has_overshoot(&self, bin: &Bin) -> bool {
        let half_width = self.bin_half_width(bin);
        self.bank.terms < if self.bank.is_symmetric { half_width } else { 2 * half_width }
    }

    /// Returns the outermost tap of a bin's filters, in bin pixels.
    pub fn bin_half_width(&self, bin: &Bin) -> usize {
        self.bank.node_half_width[self.bank.nearest_node(bin.max_radius_px)] as usize
    }

    /// Returns the radius of the neighbourhood of a cell, in cells: the filter support and one segment, for which a
    /// radius is read.
    pub fn radius_cells(&self, bin: &Bin) -> usize {
        (self.bin_half_width(bin) + SEGMENT).div_ceil(CELL)
    }

    /// Returns the radius in bin pixels for a CoC radius in pixels of the picture.
    #[inline(always)]
    pub fn bin_radius_px(&self, bin: &Bin, coc_px: f32) -> f32 {
        compensated_radius_px(coc_px, bin.scale).min(bin.max_radius_px)
    }
}
