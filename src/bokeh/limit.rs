//! How wide a blur may be, and how large a picture.

use super::{BokehError, Method, Rank, Settings};
use crate::compute::memory;
use crate::optics::CocKind;

/// Largest radius of [`Method::Gather`], in pixels: it filters at full scale.
const MOST_GATHERED_PX: f32 = 512.0;
/// The same with [`Rank::Full`], when it gathers in two dimensions: kernels grow with the square of the radius.
const MOST_EXACT_PX: f32 = 128.0;
/// What preparing and blurring a picture takes at most, at the finest quality with refined depth
/// (`docs/reliability.md` has the measurements).
const BYTES_PER_PIXEL: u64 = 90;
/// Below this nothing is asked: the estimate leaves out what does not grow with the picture.
const SMALL_PX: u64 = 16 << 20;

impl Settings {
    /// The largest CoC radius that makes a difference to pictures of `size` (width, height), in pixels: their diagonal,
    /// or less where the method bears no more.
    pub fn most_radius_px(&self, size: (u32, u32)) -> f32 {
        let diagonal_px = (size.0 as f32).hypot(size.1 as f32).ceil();
        diagonal_px.min(match (self.coc, self.method, self.rank) {
            (CocKind::Depth, Method::Gather, Some(Rank::Full)) => MOST_EXACT_PX,
            (CocKind::Depth, Method::Gather, _) => MOST_GATHERED_PX,
            _ => f32::INFINITY,
        })
    }

    /// These settings, with radii cut to what pictures of `size` bear.
    pub(super) fn within(&self, size: (u32, u32)) -> Self {
        let most_px = self.most_radius_px(size);
        let cut = |radius_px: f32| radius_px.max(0.0).min(most_px);
        Self { far_max_px: cut(self.far_max_px), near_max_px: cut(self.near_max_px), ..self.clone() }
    }

    /// Whether pictures of `size` (width, height) can be blurred so.
    ///
    /// # Errors
    /// [`BokehError::Memory`], [`BokehError::TooWide`].
    pub fn check(&self, size: (u32, u32)) -> Result<(), BokehError> {
        let pixels = u64::from(size.0) * u64::from(size.1);
        let needed = pixels * BYTES_PER_PIXEL;
        if pixels > SMALL_PX
            && let Some(free) = memory::free_bytes()
            && needed > free
        {
            return Err(BokehError::Memory { size, needed_mb: needed >> 20, free_mb: free >> 20 });
        }
        let most_px = self.most_radius_px(size);
        // Not a number is beyond any.
        let is_beyond = |radius_px: &f32| radius_px.partial_cmp(&most_px).is_none_or(|order| order.is_gt());
        let Some(radius_px) = [self.far_max_px, self.near_max_px].into_iter().find(is_beyond) else { return Ok(()) };
        let by_method = (self.coc, self.method) == (CocKind::Depth, Method::Gather);
        Err(BokehError::TooWide { radius_px, most_px, size, by_method })
    }
}
