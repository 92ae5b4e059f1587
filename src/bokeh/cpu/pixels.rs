//! What pictures are made of, and their circles of confusion, as they lie in memory.

use super::encode::{CHUNK, EncodeTable};
use crate::frame::DepthMap;
use crate::optics::CocField;

/// The pixels of a picture: R, G, B after each other, row-major, no padding.
#[derive(Clone, Copy, Debug)]
pub enum Pixels<'a> {
    /// 8-bit sRGB.
    Srgb(&'a [u8]),
    /// Linear light, 1 = white of sRGB, with its primaries. What is below 0 counts as 0 where it is blurred, what is above
    /// [`Pixels::MOST_LIGHT`] as that.
    Linear(&'a [f32]),
}

impl Pixels<'_> {
    /// The brightest light: the largest half float. Filters sum products, which stay finite.
    pub const MOST_LIGHT: f32 = 65_504.0;

    /// Linear light as it is blurred.
    #[inline(always)]
    pub fn light(value: f32) -> f32 {
        let value = if value > 0.0 { value } else { 0.0 };
        if value < Self::MOST_LIGHT { value } else { Self::MOST_LIGHT }
    }
}

/// The circle of confusion of every pixel: a signed radius in pixels, positive behind the focal plane.
#[derive(Clone, Copy, Debug)]
pub enum Radii<'a> {
    /// By a rule, over depth of any size where it follows depth.
    Field(&'a CocField, Option<&'a DepthMap>),
    /// Each given, row-major; finite.
    Each(&'a [f32]),
}

/// What pixels are made of.
pub trait Sample: Copy + Send + Sync {
    /// The pixels as one of the two kinds.
    fn pixels(samples: &[Self]) -> Pixels<'_>;

    /// Writes a chunk of linear light; `out` may be shorter.
    fn write(color: &[[f32; CHUNK]; 3], encode: &EncodeTable, out: &mut [Self]);
}

impl Sample for u8 {
    fn pixels(samples: &[u8]) -> Pixels<'_> {
        Pixels::Srgb(samples)
    }

    #[inline(always)]
    fn write(color: &[[f32; CHUNK]; 3], encode: &EncodeTable, out: &mut [u8]) {
        encode.encode(color, out);
    }
}

impl Sample for f32 {
    fn pixels(samples: &[f32]) -> Pixels<'_> {
        Pixels::Linear(samples)
    }

    #[inline(always)]
    fn write(color: &[[f32; CHUNK]; 3], _: &EncodeTable, out: &mut [f32]) {
        // Beside the brightest light, few terms of a filter sum up to less than nothing.
        for (x, pixel) in out.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            *pixel = [Pixels::light(color[0][x]), Pixels::light(color[1][x]), Pixels::light(color[2][x])];
        }
    }
}
