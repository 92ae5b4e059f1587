//! Pictures in foreign memory, such as arrays of other languages: blurred on the CPU from slice to slice, without a
//! copy, optionally with the radius of every pixel.

use std::ops::ControlFlow;

use super::cpu::BandedBokeh;
pub use super::cpu::{Pixels, Radii, Sample};
use super::plan::Plan;
use super::{BokehError, Settings};
use crate::optics::CocField;

/// CPU executor for slices of pictures of one size; allocates nothing per picture, unless it is blurred in bands.
pub struct SliceBlur {
    size: (u32, u32),
    cpu: BandedBokeh,
}

impl SliceBlur {
    /// Creates an executor for pictures of `size` (width, height) on `threads` threads, all cores when `None`.
    ///
    /// # Errors
    /// The blur is too wide, or the picture too large ([`Settings::check`]).
    pub fn new(settings: &Settings, size: (u32, u32), threads: Option<usize>) -> Result<Self, BokehError> {
        settings.check(size)?;
        Ok(Self { size, cpu: BandedBokeh::new(Plan::new(settings, size.0, size.1), threads) })
    }

    /// Blurs a picture into `out`. Both have `height * width * 3` samples, 8-bit or 16-bit sRGB, or linear light
    /// ([`Pixels`]), in which highlights are not recovered. [`Radii::Each`] needs settings whose
    /// [`CocKind`](crate::optics::CocKind) is `Depth`. Calls `check_stop` after each pass, a few times per picture; on
    /// `Break` it stops, and `out` is unspecified.
    ///
    /// # Errors
    /// [`BokehError::NoDepth`], or [`BokehError::Lengths`] if the lengths of slices do not match the picture.
    pub fn blur<T: Sample>(
        &mut self,
        pixels: &[T],
        coc: Radii<'_>,
        out: &mut [T],
        mut check_stop: impl FnMut() -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, BokehError> {
        let count = self.size.0 as usize * self.size.1 as usize;
        let radii = match coc {
            Radii::Field(CocField::Depth(_), None) => return Err(BokehError::NoDepth),
            Radii::Field(..) => count,
            Radii::Each(coc_px) => coc_px.len(),
        };
        let lengths = [pixels.len(), out.len(), radii];
        if lengths != [count * 3, count * 3, count] {
            return Err(BokehError::Lengths { size: self.size, lengths });
        }
        Ok(self.cpu.blur_pixels(pixels, coc, out, |_| check_stop()))
    }
}
