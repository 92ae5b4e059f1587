//! Sample types of pictures in memory, and their circles of confusion.

use super::encode::{CHUNK, EncodeTable};
use crate::frame::DepthMap;
use crate::optics::CocField;

/// Pixels of a picture: interleaved R, G, B, row-major, no padding.
#[derive(Clone, Copy, Debug)]
pub enum Pixels<'a> {
    /// 8-bit sRGB.
    Srgb(&'a [u8]),
    /// Linear light, 1 = sRGB white, with the primaries of sRGB. Before blurring, values are clamped to the range from
    /// 0 to [`Pixels::MAX_LIGHT`].
    Linear(&'a [f32]),
}

impl Pixels<'_> {
    /// The brightest light: the largest half float. Sums of products in the filters stay finite.
    pub const MAX_LIGHT: f32 = 65_504.0;

    /// Clamps linear light to the range that can be blurred.
    #[inline(always)]
    pub fn clamp_light(value: f32) -> f32 {
        let value = if value > 0.0 { value } else { 0.0 };
        if value < Self::MAX_LIGHT { value } else { Self::MAX_LIGHT }
    }
}

/// The circle of confusion of every pixel: a signed radius in pixels, positive behind the focal plane.
#[derive(Clone, Copy, Debug)]
pub enum Radii<'a> {
    /// Computed by a rule, from a depth map of any size if it follows depth.
    Field(&'a CocField, Option<&'a DepthMap>),
    /// Given per pixel, row-major; finite.
    Each(&'a [f32]),
}

/// Type of a colour sample.
pub trait Sample: Copy + Send + Sync {
    /// Wraps samples as pixels of their kind.
    fn as_pixels(samples: &[Self]) -> Pixels<'_>;

    /// Returns samples as 8-bit codes, if they are.
    fn as_codes(samples: &mut [Self]) -> Option<&mut [u8]>;

    /// Writes a chunk of linear light as samples; `out` may be shorter.
    fn write(color: &[[f32; CHUNK]; 3], encode: &EncodeTable, out: &mut [Self]);
}

impl Sample for u8 {
    fn as_pixels(samples: &[u8]) -> Pixels<'_> {
        Pixels::Srgb(samples)
    }

    fn as_codes(samples: &mut [u8]) -> Option<&mut [u8]> {
        Some(samples)
    }

    #[inline(always)]
    fn write(color: &[[f32; CHUNK]; 3], encode: &EncodeTable, out: &mut [u8]) {
        encode.encode(color, out);
    }
}

impl Sample for f32 {
    fn as_pixels(samples: &[f32]) -> Pixels<'_> {
        Pixels::Linear(samples)
    }

    fn as_codes(_: &mut [f32]) -> Option<&mut [u8]> {
        None
    }

    #[inline(always)]
    fn write(color: &[[f32; CHUNK]; 3], _: &EncodeTable, out: &mut [f32]) {
        // Next to very bright light, filters of few terms may sum to less than 0.
        for (x, pixel) in out.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            *pixel =
                [Pixels::clamp_light(color[0][x]), Pixels::clamp_light(color[1][x]), Pixels::clamp_light(color[2][x])];
        }
    }
}
