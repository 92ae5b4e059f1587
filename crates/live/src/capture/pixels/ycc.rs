//! Y'CbCr to R'G'B' conversion of pixel rows, in 16-bit fixed point; the loops auto-vectorize for every instruction
//! set.
//!
//! With the weights Kr, Kg and Kb of ITU-R BT.601, BT.709 or BT.2020: R = Y + 2 (1 - Kr) Cr, B = Y + 2 (1 - Kb) Cb, G =
//! Y - 2 Kb (1 - Kb) / Kg Cb - 2 Kr (1 - Kr) / Kg Cr.
//!
//! Chroma comes in with 8 fractional bits, colours go out with 5, so that every product fits and a colour is within one
//! code value of the exact one.

use crate::layout::Range;
use bokehcam::color::YcbcrMatrix;

/// Fractional bits of colours before rounding.
const COLOR_BITS: u32 = 5;

/// Contributions of luma and chroma to red, green and blue.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coefficients {
    luma: i16,
    /// Subtracts the black level and adds the rounding term, in colours of [`COLOR_BITS`] fractional bits.
    offset: i16,
    cr_to_red: i16,
    cb_to_green: i16,
    cr_to_green: i16,
    cb_to_blue: i16,
}

impl Coefficients {
    /// Computes the coefficients of [`ycc_to_rgb`] for this matrix and range.
    pub(super) fn new(matrix: YcbcrMatrix, range: Range) -> Self {
        let [red, green, blue] = matrix.luma_weights();
        let (black, luma_scale, chroma_scale) = match range {
            Range::Limited => (16.0, 255.0 / 219.0, 255.0 / 224.0),
            Range::Full => (0.0, 1.0, 1.0),
        };
        let color = f64::from(1 << COLOR_BITS);
        // A product loses its lower 16 bits; luma is multiplied by 128, and chroma by 256.
        let luma = |weight: f64| (weight * color * 512.0).round() as i16;
        let chroma = |weight: f64| (weight * chroma_scale * color * 256.0).round() as i16;
        // Half a code value, and the half units that the two or three truncated products lose on average.
        let round = f64::from(1 << (COLOR_BITS - 1)) + 1.0;
        Self {
            luma: luma(luma_scale),
            offset: (round - black * luma_scale * color).round() as i16,
            cr_to_red: chroma(2.0 * (1.0 - red)),
            cb_to_green: chroma(-2.0 * blue * (1.0 - blue) / green),
            cr_to_green: chroma(-2.0 * red * (1.0 - red) / green),
            cb_to_blue: chroma(2.0 * (1.0 - blue)),
        }
    }
}

/// Returns the upper 16 bits of a product.
#[inline(always)]
fn mul_high(a: i16, b: i16) -> i16 {
    ((i32::from(a) * i32::from(b)) >> 16) as i16
}

#[inline(always)]
fn to_byte(color: i16) -> u8 {
    (color >> COLOR_BITS).clamp(0, 255) as u8
}

/// Converts a row of pixels. All slices are as long as `luma`; chroma is relative to grey, times 256.
#[inline(always)]
pub(super) fn ycc_to_rgb(
    coefficients: &Coefficients,
    luma: &[u8],
    [cb, cr]: [&[i16]; 2],
    [red, green, blue]: [&mut [u8]; 3],
) {
    let coefficients = *coefficients;
    let pixels = luma.iter().zip(cb).zip(cr).zip(red).zip(green).zip(blue);
    for (((((&luma, &cb), &cr), red), green), blue) in pixels {
        let grey = mul_high(i16::from(luma) << 7, coefficients.luma) + coefficients.offset;
        *red = to_byte(grey + mul_high(cr, coefficients.cr_to_red));
        *green = to_byte(grey + mul_high(cb, coefficients.cb_to_green) + mul_high(cr, coefficients.cr_to_green));
        *blue = to_byte(grey + mul_high(cb, coefficients.cb_to_blue));
    }
}

/// Interleaves rows of red, green and blue into pixels.
#[inline(always)]
pub(super) fn interleave_rgb([red, green, blue]: [&[u8]; 3], rgb: &mut [u8]) {
    for (((pixel, &red), &green), &blue) in rgb.as_chunks_mut::<3>().0.iter_mut().zip(red).zip(green).zip(blue) {
        *pixel = [red, green, blue];
    }
}

/// Deinterleaves pairs into their first and second bytes.
#[inline(always)]
pub(super) fn deinterleave_pairs(pairs: &[u8], first: &mut [u8], second: &mut [u8]) {
    for ((pair, first), second) in pairs.as_chunks::<2>().0.iter().zip(first).zip(second) {
        let pair = u16::from_le_bytes(*pair);
        (*first, *second) = (pair as u8, (pair >> 8) as u8);
    }
}

/// Interpolates a quarter of the way from the row `near` to `far`: samples times 4.
#[inline(always)]
pub(super) fn interpolate_quarter(near: &[u8], far: &[u8], out: &mut [u16]) {
    for ((out, &near), &far) in out.iter_mut().zip(near).zip(far) {
        *out = 3 * u16::from(near) + u16::from(far);
    }
}

/// Upsamples chroma from one sample per pair of pixels (times 4, and one extra at the end), co-sited with the left
/// pixel, to one per pixel: relative to grey, times 256.
#[inline(always)]
pub(super) fn upsample_chroma(half: &[u16], full: &mut [i16]) {
    for ((pair, &left), &right) in full.as_chunks_mut::<2>().0.iter_mut().zip(half).zip(&half[1..]) {
        // Grey is 128, times 4.
        let (left, right) = (left as i16 - 512, right as i16 - 512);
        *pair = [left << 6, (left + right) << 5];
    }
}
