//! Conversion of linear light to codes: 8-bit sRGB, or 16 bits with any tone curves.
//!
//! twin: shaders/blur/composite.wgsl (`code_of`)

use pulp::Simd;

use crate::color::ToneCurves;
use crate::compute::simd::madd;

/// Pixels composited at once.
pub const CHUNK: usize = 128;

/// Encodes linear light as codes.
pub struct Encoder {
    /// Tone curves of 16-bit codes; `None` is sRGB.
    pub curves: Option<ToneCurves>,
}

impl Encoder {
    /// Returns the tone curves of 16-bit codes.
    pub fn curves(&self) -> &ToneCurves {
        self.curves.as_ref().unwrap_or_else(|| ToneCurves::srgb())
    }
}

/// Returns the sRGB code of linear light, 0 to 255 with its fraction: a polynomial in the root of slightly less, off by
/// 0.021 of a code at most, which vectors can evaluate.
#[inline(always)]
pub fn code_of<S: Simd>(light: f32) -> f32 {
    const CURVE: [f32; 5] = [-195.067_61, 279.328_12, -236.610_03, 358.314_6, -7.425_408];
    let light = if light > 0.0 { light } else { 0.0 };
    let light = if light < 1.0 { light } else { 1.0 };
    let root = (light - 0.000_52).sqrt();
    let mut code = 56.539_38;
    for factor in CURVE {
        code = madd::<S>(code, root, factor);
    }
    if light <= 0.003_130_8 { light * (12.92 * 255.0) } else { code }
}

/// Writes pixels of r, g, b.
#[inline(always)]
pub fn interleave([red, green, blue]: [&[u8]; 3], out: &mut [u8]) {
    for (((pixel, &r), &g), &b) in out.as_chunks_mut::<3>().0.iter_mut().zip(red).zip(green).zip(blue) {
        *pixel = [r, g, b];
    }
}

#[cfg(test)]
mod tests {
    use super::super::unpack::decode_srgb;
    use super::*;

    #[test]
    fn decoding_and_encoding_is_the_identity() {
        for code in 0..=255u8 {
            let encoded = code_of::<pulp::Scalar>(decode_srgb::<pulp::Scalar>(code));
            assert!((encoded - f32::from(code)).abs() < 0.03, "{code}: {encoded}");
        }
    }
}
