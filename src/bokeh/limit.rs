//! Limits of the blur radius and of the picture size.

use super::cpu::MAX_WHOLE_PIXELS;
use super::plan::Plan;
use super::{BokehError, Method, Rank, Settings};
use crate::compute::memory;
use crate::frame::DepthMap;
use crate::optics::{CocField, CocKind};

/// Largest radius of [`Method::Gather`], in pixels: it filters at full scale.
const MAX_GATHERED_PX: f32 = 512.0;
/// Largest radius of [`Method::Gather`] with [`Rank::Full`], in pixels: it gathers in two dimensions, with kernels that
/// grow with the square of the radius.
const MAX_EXACT_PX: f32 = 128.0;
/// Peak memory per pixel of preparing and blurring a picture, at the finest quality with refined depth (measured:
/// `docs/reliability.md`): as a whole, and of one that is blurred in bands.
const BYTES_PER_PIXEL: u64 = 90;
const BANDED_BYTES_PER_PIXEL: u64 = 32;

impl Settings {
    /// Returns the largest CoC radius that makes a difference to pictures of `size` (width, height), in pixels: their
    /// diagonal, or the method's limit if that is lower.
    pub fn max_radius_px(&self, size: (u32, u32)) -> f32 {
        let diagonal_px = (size.0 as f32).hypot(size.1 as f32).ceil();
        diagonal_px.min(match (self.coc, self.method, self.rank) {
            (CocKind::Depth, Method::Gather, Some(Rank::Full)) => MAX_EXACT_PX,
            (CocKind::Depth, Method::Gather, _) => MAX_GATHERED_PX,
            _ => f32::INFINITY,
        })
    }

    /// Returns these settings with radii clamped to [`Settings::max_radius_px`].
    pub(super) fn with_clamped_radii(&self, size: (u32, u32)) -> Self {
        let max_px = self.max_radius_px(size);
        // `max` turns NaN into 0.
        let clamped = |radius_px: f32| radius_px.max(0.0).min(max_px);
        Self { far_max_px: clamped(self.far_max_px), near_max_px: clamped(self.near_max_px), ..self.clone() }
    }

    /// Checks that there is memory for blurring pictures of `size` (width, height), plus `extra_bytes_per_pixel` bytes
    /// per pixel.
    ///
    /// # Errors
    /// [`BokehError::Memory`].
    pub fn check_memory(size: (u32, u32), extra_bytes_per_pixel: u64) -> Result<(), BokehError> {
        let pixels = u64::from(size.0) * u64::from(size.1);
        let is_banded = pixels > MAX_WHOLE_PIXELS as u64;
        let bytes_per_pixel = if is_banded { BANDED_BYTES_PER_PIXEL } else { BYTES_PER_PIXEL };
        match memory::find_shortage_mb(size, bytes_per_pixel + extra_bytes_per_pixel) {
            Some((needed_mb, free_mb)) => Err(BokehError::Memory { size, needed_mb, free_mb }),
            None => Ok(()),
        }
    }

    /// Checks that pictures of `size` (width, height) can be blurred with these settings.
    ///
    /// # Errors
    /// [`BokehError::Memory`], [`BokehError::TooWide`].
    pub fn check(&self, size: (u32, u32)) -> Result<(), BokehError> {
        Self::check_memory(size, 0)?;
        let max_px = self.max_radius_px(size);
        // NaN is refused as well.
        let is_beyond = |radius_px: &f32| radius_px.partial_cmp(&max_px).is_none_or(|order| order.is_gt());
        let Some(radius_px) = [self.far_max_px, self.near_max_px].into_iter().find(is_beyond) else { return Ok(()) };
        let by_method = (self.coc, self.method) == (CocKind::Depth, Method::Gather);
        Err(BokehError::TooWide { radius_px, max_px, size, by_method })
    }
}

impl Plan {
    /// Refuses a picture of another size than the plan's, and one without the depth that `coc` needs.
    pub fn check_frame(&self, got: (u32, u32), depth: Option<&DepthMap>, coc: &CocField) -> Result<(), BokehError> {
        let made_for = (self.width as u32, self.height as u32);
        match (coc, depth) {
            _ if got != made_for => Err(BokehError::Size { made_for, got }),
            (CocField::Depth(_), None) => Err(BokehError::NoDepth),
            _ => Ok(()),
        }
    }
}
