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
/// Pictures of up to so many pixels are not checked: the estimate leaves out what does not grow with the picture.
const UNCHECKED_PIXELS: u64 = 16 << 20;

impl Settings {
    /// The largest CoC radius that makes a difference to pictures of `size` (width, height), in pixels: their diagonal,
    /// or the method's limit where that is lower.
    pub fn most_radius_px(&self, size: (u32, u32)) -> f32 {
        let diagonal_px = (size.0 as f32).hypot(size.1 as f32).ceil();
        diagonal_px.min(match (self.coc, self.method, self.rank) {
            (CocKind::Depth, Method::Gather, Some(Rank::Full)) => MOST_EXACT_PX,
            (CocKind::Depth, Method::Gather, _) => MOST_GATHERED_PX,
            _ => f32::INFINITY,
        })
    }

    /// These settings, with radii clamped to [`Settings::most_radius_px`].
    pub(super) fn within(&self, size: (u32, u32)) -> Self {
        let most_px = self.most_radius_px(size);
        // `max` turns NaN into 0.
        let clamped = |radius_px: f32| radius_px.max(0.0).min(most_px);
        Self { far_max_px: clamped(self.far_max_px), near_max_px: clamped(self.near_max_px), ..self.clone() }
    }

    /// Whether there is room for blurring pictures of `size` (width, height), and beside it for so many bytes a pixel.
    ///
    /// # Errors
    /// [`BokehError::Memory`].
    pub(crate) fn check_room(size: (u32, u32), beside_per_pixel: u64) -> Result<(), BokehError> {
        let pixels = u64::from(size.0) * u64::from(size.1);
        let needed = pixels * (BYTES_PER_PIXEL + beside_per_pixel);
        match memory::free_bytes().filter(|&free| pixels > UNCHECKED_PIXELS && needed > free) {
            Some(free) => Err(BokehError::Memory { size, needed_mb: needed >> 20, free_mb: free >> 20 }),
            None => Ok(()),
        }
    }

    /// Whether pictures of `size` (width, height) can be blurred with these settings.
    ///
    /// # Errors
    /// [`BokehError::Memory`], [`BokehError::TooWide`].
    pub fn check(&self, size: (u32, u32)) -> Result<(), BokehError> {
        Self::check_room(size, 0)?;
        let most_px = self.most_radius_px(size);
        // NaN is refused, too.
        let is_beyond = |radius_px: &f32| radius_px.partial_cmp(&most_px).is_none_or(|order| order.is_gt());
        let Some(radius_px) = [self.far_max_px, self.near_max_px].into_iter().find(is_beyond) else { return Ok(()) };
        let by_method = (self.coc, self.method) == (CocKind::Depth, Method::Gather);
        Err(BokehError::TooWide { radius_px, most_px, size, by_method })
    }
}
