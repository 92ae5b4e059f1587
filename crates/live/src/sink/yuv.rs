//! R'G'B' to Y'CbCr conversion (ITU-R BT.601, BT.709, BT.2020) in 8 bits: planar 4:2:0 here, and the raw formats of
//! cameras in [`raw`](super::raw).

use crate::layout::Range;
use bokehcam::color::YcbcrMatrix;
use bokehcam::frame::ColorImage;

/// Fractional bits of the fixed-point coefficients; luma fits into 32 bits, and so does chroma, which sums up to eight
/// pixels and has three more bits.
const BITS: u32 = 16;

/// Converts pictures to one matrix and range.
#[derive(Clone, Copy, Debug)]
pub struct Converter {
    luma: [i32; 3],
    black: i32,
    cb: [i32; 3],
    cr: [i32; 3],
}

impl Converter {
    /// Computes the coefficients of `matrix`: limited range is Y 16..235, Cb and Cr 16..240, full range is 0..255.
    pub fn new(matrix: YcbcrMatrix, range: Range) -> Self {
        let [red, green, blue] = matrix.luma_weights();
        let (black, white, max_chroma) = match range {
            Range::Limited => (16, 219.0, 112.0),
            Range::Full => (0, 255.0, 127.5),
        };
        let fixed = |weights: [f64; 3], scale: f64| {
            weights.map(|weight| (weight * scale / 255.0 * f64::from(1 << BITS)).round() as i32)
        };
        // The green weights complete the sum to zero, so that grey stays grey whatever the rounding.
        let zero_sum = |[r, _, b]: [i32; 3]| [r, -r - b, b];
        Self {
            luma: fixed([red, green, blue], white),
            black,
            cb: zero_sum(fixed([-red, 0.0, 1.0 - blue], max_chroma / (1.0 - blue))),
            cr: zero_sum(fixed([1.0 - red, 0.0, -blue], max_chroma / (1.0 - red))),
        }
    }

    /// Returns the luma of a pixel.
    #[inline(always)]
    pub(super) fn luma(&self, rgb: [i32; 3]) -> u8 {
        (self.black + ((dot(&self.luma, rgb) + (1 << (BITS - 1))) >> BITS)) as u8
    }

    /// Returns Cb and Cr of the mean of `2^shift` pixels, at most eight, from their sum.
    #[inline(always)]
    pub(super) fn chroma(&self, sum: [i32; 3], shift: u32) -> [u8; 2] {
        // The maximum of a full range is half a code value above 255.
        [&self.cb, &self.cr]
            .map(|weights| (128 + ((dot(weights, sum) + (1 << (BITS + shift - 1))) >> (BITS + shift))).min(255) as u8)
    }

    /// Appends the planes of `image` to `planes`: Y of `height * width` bytes, then Cb and Cr of `ceil(height / 2) *
    /// ceil(width / 2)` each, sited in the centre of their 2 x 2 pixels, as the y4m tag `C420jpeg` says. At an odd edge
    /// the last column or row counts twice.
    pub fn append_planes(&self, image: &ColorImage, planes: &mut Vec<u8>) {
        let (width, height) = (image.width as usize, image.height as usize);
        let (half_width, half_height) = (width.div_ceil(2), height.div_ceil(2));
        let start = planes.len();
        planes.resize(start + width * height + 2 * half_width * half_height, 0);
        let (luma, chroma) = planes[start..].split_at_mut(width * height);
        let (cb, cr) = chroma.split_at_mut(half_width * half_height);

        for (y, pixel) in luma.iter_mut().zip(image.rgb.as_chunks::<3>().0) {
            *y = self.luma(pixel.map(i32::from));
        }
        if width == 0 {
            return;
        }
        let row_pairs = image.rgb.chunks(2 * 3 * width);
        for ((rows, cb), cr) in row_pairs.zip(cb.chunks_exact_mut(half_width)).zip(cr.chunks_exact_mut(half_width)) {
            let (upper, lower) = rows.split_at(3 * width);
            let lower = if lower.is_empty() { upper } else { lower };
            for (((upper, lower), cb), cr) in upper.chunks(6).zip(lower.chunks(6)).zip(cb).zip(cr) {
                // At an odd edge, this is the same pixel.
                let right = upper.len() - 3;
                let sum = |channel: usize| {
                    [upper[channel], upper[right + channel], lower[channel], lower[right + channel]]
                        .map(i32::from)
                        .iter()
                        .sum()
                };
                [*cb, *cr] = self.chroma([sum(0), sum(1), sum(2)], 2);
            }
        }
    }
}

#[inline(always)]
fn dot(weights: &[i32; 3], rgb: [i32; 3]) -> i32 {
    weights[0] * rgb[0] + weights[1] * rgb[1] + weights[2] * rgb[2]
}
