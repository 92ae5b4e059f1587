//! Rows of Y'CbCr to RGB, in 16-bit integers: loops that become vector code with whatever instructions there are.
//!
//! Chroma comes with 8 fractional bits, colours leave with 5, so that every product fits and a colour is within one
//! code of the exact one.

use crate::color::Matrix;
use crate::layout::Range;

/// Fractional bits of colours before they are rounded.
const COLOR_BITS: u32 = 5;

/// What luma and chroma add to red, green and blue.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coefficients {
    luma: i16,
    /// Takes black away, and adds what rounds, in colours of [`COLOR_BITS`] fractional bits.
    offset: i16,
    cr_to_red: i16,
    cb_to_green: i16,
    cr_to_green: i16,
    cb_to_blue: i16,
}

impl Coefficients {
    /// The coefficients of [`convert`] for pictures of this matrix and range.
    pub(super) fn new(matrix: Matrix, range: Range) -> Self {
        let [red, green, blue] = matrix.weights();
        let (black, luma_scale, chroma_scale) = match range {
            Range::Limited => (16.0, 255.0 / 219.0, 255.0 / 224.0),
            Range::Full => (0.0, 1.0, 1.0),
        };
        let color = f64::from(1 << COLOR_BITS);
        // A product loses its lower 16 bits, luma is multiplied by 128, and chroma by 256.
        let luma = |weight: f64| (weight * color * 512.0).round() as i16;
        let chroma = |weight: f64| (weight * chroma_scale * color * 256.0).round() as i16;
        // Half a code, and the half units that the two or three products lose on average.
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

/// The upper half of a product.
#[inline(always)]
fn product(a: i16, b: i16) -> i16 {
    ((i32::from(a) * i32::from(b)) >> 16) as i16
}

#[inline(always)]
fn byte(color: i16) -> u8 {
    (color >> COLOR_BITS).clamp(0, 255) as u8
}

/// Converts a row of pixels. All slices are as long as `luma`; chroma is its distance from grey, times 256.
#[inline(always)]
pub(super) fn convert(by: &Coefficients, luma: &[u8], [cb, cr]: [&[i16]; 2], [red, green, blue]: [&mut [u8]; 3]) {
    let by = *by;
    let pixels = luma.iter().zip(cb).zip(cr).zip(red).zip(green).zip(blue);
    for (((((&luma, &cb), &cr), red), green), blue) in pixels {
        let grey = product(i16::from(luma) << 7, by.luma) + by.offset;
        *red = byte(grey + product(cr, by.cr_to_red));
        *green = byte(grey + product(cb, by.cb_to_green) + product(cr, by.cr_to_green));
        *blue = byte(grey + product(cb, by.cb_to_blue));
    }
}

/// Joins rows of red, green and blue to pixels.
#[inline(always)]
pub(super) fn interleave([red, green, blue]: [&[u8]; 3], rgb: &mut [u8]) {
    for (((pixel, &red), &green), &blue) in rgb.as_chunks_mut::<3>().0.iter_mut().zip(red).zip(green).zip(blue) {
        *pixel = [red, green, blue];
    }
}

/// Separates the first and the second bytes of pairs.
#[inline(always)]
pub(super) fn split(pairs: &[u8], first: &mut [u8], second: &mut [u8]) {
    for ((pair, first), second) in pairs.as_chunks::<2>().0.iter().zip(first).zip(second) {
        let pair = u16::from_le_bytes(*pair);
        (*first, *second) = (pair as u8, (pair >> 8) as u8);
    }
}

/// Interpolates a quarter of the way from the row `near` to `far`: samples times 4.
#[inline(always)]
pub(super) fn mix(near: &[u8], far: &[u8], out: &mut [u16]) {
    for ((out, &near), &far) in out.iter_mut().zip(near).zip(far) {
        *out = 3 * u16::from(near) + u16::from(far);
    }
}

/// Interpolates chroma from a sample for each pair of pixels (times 4; one more than pairs), on its left pixel, to one
/// for each pixel: its distance from grey, times 256.
#[inline(always)]
pub(super) fn widen(half: &[u16], full: &mut [i16]) {
    for ((pair, &left), &right) in full.as_chunks_mut::<2>().0.iter_mut().zip(half).zip(&half[1..]) {
        // Grey is 128, times 4.
        let (left, right) = (left as i16 - 512, right as i16 - 512);
        *pair = [left << 6, (left + right) << 5];
    }
}
