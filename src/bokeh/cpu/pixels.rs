//! Sample types of pictures in memory, and their circles of confusion.

use std::ops::Range;

use pulp::Simd;

use super::encode::{CHUNK, Encoder, code_of, interleave};
use super::tiles::TILE_W;
use crate::bokeh::plan::Plan;
use crate::color::ToneCurves;
use crate::compute::simd::round_to_integer;
use crate::frame::DepthMap;
use crate::optics::CocField;

/// Pixels of a picture: interleaved R, G, B, row-major, no padding.
#[derive(Clone, Copy, Debug)]
pub enum Pixels<'a> {
    /// 8-bit sRGB.
    Srgb(&'a [u8]),
    /// 16-bit codes with these tone curves.
    Codes16(&'a [u16], &'a ToneCurves),
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

impl Radii<'_> {
    /// Splits them into the bins of `plan`.
    pub(super) fn split(self, plan: &mut Plan) {
        match self {
            Self::Field(field, depth) => plan.split_by_depth(depth, field),
            Self::Each(coc_px) => plan.split_by_radii(coc_px),
        }
    }
}

/// Type of a colour sample.
pub trait Sample: Default + Copy + Send + Sync {
    /// Wraps samples as pixels of their kind, which the encoder belongs to.
    fn as_pixels<'a>(samples: &'a [Self], encoder: &'a Encoder) -> Pixels<'a>;

    /// Returns samples as 8-bit sRGB codes, if they are.
    fn as_codes(samples: &mut [Self]) -> Option<&mut [u8]>;

    /// Writes linear light of some `columns` of a chunk as samples.
    fn write<S: Simd>(color: &[[f32; CHUNK]; 3], columns: Range<usize>, encoder: &Encoder, out: &mut [Self]);
}

impl Sample for u8 {
    fn as_pixels<'a>(samples: &'a [u8], _: &'a Encoder) -> Pixels<'a> {
        Pixels::Srgb(samples)
    }

    fn as_codes(samples: &mut [u8]) -> Option<&mut [u8]> {
        Some(samples)
    }

    #[inline(always)]
    fn write<S: Simd>(color: &[[f32; CHUNK]; 3], columns: Range<usize>, _: &Encoder, out: &mut [u8]) {
        let mut codes = [[0; CHUNK]; 3];
        // Whole tiles, because arrays of fixed size vectorise.
        for first in (columns.start - columns.start % TILE_W..columns.end).step_by(TILE_W) {
            for (codes, color) in codes.iter_mut().zip(color) {
                for (code, &light) in codes[first..first + TILE_W].iter_mut().zip(&color[first..first + TILE_W]) {
                    *code = round_to_integer(code_of::<S>(light)) as u8;
                }
            }
        }
        interleave(codes.each_ref().map(|plane| &plane[columns.clone()]), out);
    }
}

impl Sample for u16 {
    fn as_pixels<'a>(samples: &'a [u16], encoder: &'a Encoder) -> Pixels<'a> {
        Pixels::Codes16(samples, encoder.curves())
    }

    fn as_codes(_: &mut [u16]) -> Option<&mut [u8]> {
        None
    }

    #[inline(always)]
    fn write<S: Simd>(color: &[[f32; CHUNK]; 3], columns: Range<usize>, encoder: &Encoder, out: &mut [u16]) {
        let curves = encoder.curves();
        for (x, pixel) in columns.zip(out.as_chunks_mut::<3>().0) {
            *pixel = std::array::from_fn(|channel| curves.0[channel].encode(color[channel][x]));
        }
    }
}

impl Sample for f32 {
    fn as_pixels<'a>(samples: &'a [f32], _: &'a Encoder) -> Pixels<'a> {
        Pixels::Linear(samples)
    }

    fn as_codes(_: &mut [f32]) -> Option<&mut [u8]> {
        None
    }

    #[inline(always)]
    fn write<S: Simd>(color: &[[f32; CHUNK]; 3], columns: Range<usize>, _: &Encoder, out: &mut [f32]) {
        // Next to very bright light, filters of few terms may sum to less than 0.
        for (x, pixel) in columns.zip(out.as_chunks_mut::<3>().0) {
            *pixel =
                [Pixels::clamp_light(color[0][x]), Pixels::clamp_light(color[1][x]), Pixels::clamp_light(color[2][x])];
        }
    }
}
