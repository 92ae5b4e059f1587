//! Conversion of linear light to codes: 8-bit sRGB, or 16 bits with any tone curves.
//!
//! twin: shaders/blur/composite.wgsl (`code_of`)

#![allow(clippy::needless_range_loop)] // Columns index several arrays at once.

use pulp::Simd;

use crate::color::{ToneCurves, encode_srgb};
use crate::compute::simd::{madd, round_to_integer};

/// Pixels composited at once.
pub const CHUNK: usize = 128;
/// Entries of one half of the table: small enough for the nearest cache, fine enough that decoding and encoding is the
/// identity.
const ENCODE_STEPS: usize = 1 << 12;
/// Light below this has its own half with finer steps, because the curve is steep there.
const DARK: f32 = 1.0 / 16.0;
/// Entries of the table: two halves of `ENCODE_STEPS + 1`, rounded up to a power of two so that an index is masked.
const ENCODE_SIZE: usize = 4 * ENCODE_STEPS;

/// Encodes linear light as codes.
pub struct Encoder {
    /// For 8-bit sRGB.
    pub table: EncodeTable,
    /// For 16-bit codes; `None` is sRGB.
    pub curves: Option<ToneCurves>,
}

impl Encoder {
    /// Returns the tone curves of 16-bit codes.
    pub fn curves(&self) -> &ToneCurves {
        self.curves.as_ref().unwrap_or_else(|| ToneCurves::srgb())
    }
}

/// Table from linear light to 8-bit sRGB: light up to [`DARK`] in `ENCODE_STEPS` steps, then the whole range.
pub struct EncodeTable(Box<[u8; ENCODE_SIZE]>);

impl EncodeTable {
    pub fn new() -> Self {
        let mut codes = Box::new([255; ENCODE_SIZE]);
        let half = |most: f32| (0..=ENCODE_STEPS).map(move |k| k as f32 / ENCODE_STEPS as f32 * most);
        for (code, light) in codes.iter_mut().zip(half(DARK).chain(half(1.0))) {
            *code = encode_srgb(light);
        }
        Self(codes)
    }

    /// Converts up to [`CHUNK`] pixels to 8-bit sRGB by table lookup.
    #[inline(always)]
    pub fn encode(&self, color: [&[f32]; 3], out: &mut [u8]) {
        let mut index = [[0u32; CHUNK]; 3];
        for (index, color) in index.iter_mut().zip(color) {
            for (index, &light) in index.iter_mut().zip(color) {
                let light = if light > 0.0 { light } else { 0.0 };
                let light = if light < 1.0 { light } else { 1.0 };
                let steps = ENCODE_STEPS as f32;
                let (scale, first) = if light < DARK { (steps / DARK, 0.0) } else { (steps, steps + 1.0) };
                *index = round_to_integer(light * scale + first);
            }
        }
        for (x, pixel) in out.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            for (p, byte) in pixel.iter_mut().enumerate() {
                *byte = self.0[index[p][x] as usize % ENCODE_SIZE];
            }
        }
    }
}

/// Returns the sRGB code of linear light, 0 to 255 with its fraction: a polynomial in the fourth root, off by less than
/// a hundredth of a code, which vectors can evaluate.
#[inline(always)]
pub fn codes_of<S: Simd>(light: f32) -> f32 {
    const CURVE: [f32; 4] = [-85.547_77, 286.277_98, 50.017_304, -16.476_35];
    let light = if light > 0.0 { light } else { 0.0 };
    let light = if light < 1.0 { light } else { 1.0 };
    let root = light.sqrt().sqrt();
    let mut code = 20.737_632;
    for factor in CURVE {
        code = madd::<S>(code, root, factor);
    }
    if light <= 0.003_130_8 { light * (12.92 * 255.0) } else { code }
}

#[cfg(test)]
mod tests {
    use super::super::unpack::decode_srgb;
    use super::*;

    #[test]
    fn decoding_and_encoding_is_the_identity() {
        let table = EncodeTable::new();
        for code in 0..=255u8 {
            let mut out = [0u8; 6];
            table.encode([&[decode_srgb::<pulp::Scalar>(code); 2]; 3], &mut out);
            assert_eq!(out, [code; 6]);
        }
    }
}
