//! The slots of a plan: the executor's buffers, of which each bin uses one.

use super::{Compositing, Plan};
use crate::optics::CocKind;

impl Plan {
    /// Returns the finest scale of any bin in this slot, over all levels: layers far from focus are always reduced.
    pub fn min_scale(&self, slot: usize) -> usize {
        let side = self.ladder.max_bins_per_side();
        let fine = slot == 0 || (slot - 1) % side.max(1) < self.ladder.max_fine_bins();
        if self.full_scale || fine || self.compositing != Compositing::Layers { 1 } else { 2 }
    }

    /// Returns the number of bin slots that an executor needs, over all levels.
    pub fn slot_count(&self) -> usize {
        match self.coc {
            CocKind::Depth if self.compositing == Compositing::Gather => 1,
            CocKind::Depth => 1 + 2 * self.ladder.max_bins_per_side(),
            CocKind::Ramp if self.ranges[0].is_empty() => 1,
            CocKind::Ramp => 1 + self.ladder.max_bins_per_side(),
            // The only bin is in slot 1.
            CocKind::Uniform => 2,
        }
    }

    /// Returns the index of the bin in a slot, in this frame.
    pub fn bin_in_slot(&self, slot: usize) -> Option<usize> {
        self.bins.iter().position(|bin| bin.slot == slot)
    }
}
