//! How the content of a bin is filtered: how far the kernels reach, whether they overshoot, and whether it is steadied in
//! time.

use super::{Bin, CELL, Plan, SEGMENT, compensated_radius_px};

/// Smallest radius of bins that are steadied, in pixels.
const MIN_STEADY_RADIUS_PX: f32 = 5.0;

impl Plan {
    /// Whether a bin's content is steadied in time: detail that a smaller blur lets through would lag behind, and near
    /// objects move most.
    pub fn is_steadied(&self, bin: &Bin) -> bool {
        self.reuse && !bin.near && bin.scale > 1 && bin.min_radius_px >= MIN_STEADY_RADIUS_PX
    }

    /// Whether a bin's results overshoot visibly: those at reduced scales, of sharpened cells, and of few terms. Small filters keep
    /// nearly all of their terms: a symmetric kernel has `half_width + 1`, any other `2 half_width + 1`.
    pub fn has_overshoot(&self, bin: &Bin) -> bool {
        let half_width = self.bin_half_width(bin);
        bin.scale.max(bin.decimation) > 1
            || self.bank.terms < if self.bank.is_symmetric { half_width } else { 2 * half_width }
    }

    /// Returns the outermost tap of a bin's filters, in bin pixels.
    pub fn bin_half_width(&self, bin: &Bin) -> usize {
        self.bank.node_half_width[self.bank.first_node(bin.scale) + self.bank.nearest_node(bin.max_radius_px)] as usize
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
