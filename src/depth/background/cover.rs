//! What stands before what is remembered.
//!
//! Behind the thing that was put before it first, what is remembered goes on. Behind a second one, nearer, is the first: what
//! is remembered is then not what was seen last, and is forgotten at once.

use pulp::{Arch, WithSimd};

use super::{Background, OTHER_PX};
use crate::compute::bands::Bands;
use crate::compute::thread_pool::{MOST_ITEMS, ThreadPool};
use crate::frame::{ColorImage, DepthMap};
use crate::optics::DepthCoc;

impl Background {
    /// Looks at what stands before what is remembered, in every frame, before that is used: what is not behind it any more is
    /// forgotten.
    pub fn cover(&mut self, workers: &mut ThreadPool, (map, color): (&DepthMap, &ColorImage), lens: &DepthCoc) {
        if map.size() != color.size() || !self.knows(color) {
            return;
        }
        let (width, other) = (self.size.0, lens.inverse_depth_of_px(OTHER_PX));
        let bands = Bands::new(self.size.1, 1, workers);
        let mut forgets = [false; MOST_ITEMS];
        let Self { inverse, rounds, cover, .. } = self;
        let planes = bands.split(rounds, width).zip(bands.split(cover, width));
        workers.run_each(bands.rows().zip(planes).zip(&mut forgets), &|((rows, (rounds, cover)), forgets)| {
            let pixels = rows.start * width..rows.end * width;
            let (metres, inverse) = (&map.metres[pixels.clone()], &inverse[pixels]);
            *forgets = Arch::new().dispatch(Cover { metres, inverse, rounds, cover, other });
        });
        if forgets.contains(&true) {
            self.revise();
            self.doubt(map, color, other);
        }
    }
}

/// Looks at some pixels; whether anything is forgotten.
struct Cover<'a> {
    metres: &'a [f32],
    /// What is remembered.
    inverse: &'a [f32],
    rounds: &'a mut [u8],
    /// Inverse depth of what hides it, in 1/m; 0 where nothing does.
    cover: &'a mut [f32],
    other: f32,
}

impl WithSimd for Cover<'_> {
    type Output = bool;
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> bool {
        let Self { metres, inverse, rounds, cover, other } = self;
        let mut forgets = 0;
        let remembered = inverse.iter().zip(rounds).zip(cover);
        for (&z_m, ((&inverse, rounds), cover)) in metres.iter().zip(remembered) {
            let own = DepthMap::inverse_of(z_m);
            let is_hidden = (*rounds > 0) & (own - inverse > other);
            // What hides it may come nearer, step by step, and may go: what is behind that hides it, too.
            let is_nearer = is_hidden & (*cover > 0.0) & (own - *cover > other);
            *cover = if is_hidden & !is_nearer { own } else { 0.0 };
            *rounds = if is_nearer { 0 } else { *rounds };
            forgets |= u32::from(is_nearer);
        }
        forgets != 0
    }
}
