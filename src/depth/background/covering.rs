//! Tracks the surfaces in front of the remembered background.
//!
//! Behind the first surface that covers it, the background stays valid. If a second surface appears in front of the
//! first, the background behind it is the first one: the remembered one was not seen last, and is forgotten at once.

use pulp::{Arch, WithSimd};

use super::{BackgroundMemory, SURFACE_STEP_PX};
use crate::compute::bands::Bands;
use crate::compute::thread_pool::{MAX_ITEMS, ThreadPool};
use crate::frame::{ColorImage, DepthMap};
use crate::optics::DepthCoc;

impl BackgroundMemory {
    /// Updates the covering surfaces, in every frame before the background is used, and forgets pixels that are no
    /// longer directly behind their covering surface.
    pub fn update_covering(
        &mut self,
        workers: &mut ThreadPool,
        (map, color): (&DepthMap, &ColorImage),
        lens: &DepthCoc,
    ) {
        if map.size() != color.size() || !self.is_usable_for(color) {
            return;
        }
        let (width, surface_step) = (self.size.0, lens.inverse_depth_step(SURFACE_STEP_PX));
        let bands = Bands::new(self.size.1, 1, workers);
        let mut forgets = [false; MAX_ITEMS];
        let Self { inverse, rounds, covering, .. } = self;
        let planes = bands.split(rounds, width).zip(bands.split(covering, width));
        workers.run_each(bands.rows().zip(planes).zip(&mut forgets), &|((rows, (rounds, covering)), forgets)| {
            let pixels = rows.start * width..rows.end * width;
            let (metres, inverse) = (&map.metres[pixels.clone()], &inverse[pixels]);
            *forgets = Arch::new().dispatch(UpdateCovering { metres, inverse, rounds, covering, surface_step });
        });
        if forgets.contains(&true) {
            self.assign_rounds_revision();
            self.classify_cells(workers, map, surface_step);
            self.check_outlines(map, color, surface_step, 0, 1);
        }
    }
}

/// Updates some pixels. Returns whether any was forgotten.
struct UpdateCovering<'a> {
    metres: &'a [f32],
    /// Inverse depth of the background, in 1/m.
    inverse: &'a [f32],
    rounds: &'a mut [u8],
    /// Inverse depth of the covering surface, in 1/m; 0 without one.
    covering: &'a mut [f32],
    surface_step: f32,
}

impl WithSimd for UpdateCovering<'_> {
    type Output = bool;
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> bool {
        let Self { metres, inverse, rounds, covering, surface_step } = self;
        let mut forgets = 0;
        let remembered = inverse.iter().zip(rounds).zip(covering);
        for (&z_m, ((&inverse, rounds), covering)) in metres.iter().zip(remembered) {
            let own = DepthMap::inverse_depth(z_m);
            let is_hidden = (*rounds > 0) & (own - inverse > surface_step);
            // The covering surface may approach gradually, or leave: the one behind it then covers the background.
            let is_nearer = is_hidden & (*covering > 0.0) & (own - *covering > surface_step);
            *covering = if is_hidden & !is_nearer { own } else { 0.0 };
            *rounds = if is_nearer { 0 } else { *rounds };
            forgets |= u32::from(is_nearer);
        }
        forgets != 0
    }
}
