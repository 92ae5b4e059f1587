//! 8-bit RGB to planar Y'CbCr 4:2:0 in limited range (Y 16..235, Cb and Cr 16..240), chroma sited in the middle of its
//! 2 x 2 pixels, as the y4m tag `C420jpeg` says.

use crate::color::Matrix;
use crate::frame::ColorImage;

/// Fixed-point fractional bits of the coefficients; luma keeps within 32 bits, chroma sums four pixels and has two
/// more.
const BITS: u32 = 16;

/// Converts pictures of one matrix.
pub struct Converter {
    luma: [i32; 3],
    cb: [i32; 3],
    cr: [i32; 3],
}

impl Converter {
    /// Coefficients of `matrix`.
    pub fn new(matrix: Matrix) -> Self {
        let [red, green, blue] = matrix.weights();
        let fixed = |weights: [f64; 3], scale: f64| {
            weights.map(|weight| (weight * scale / 255.0 * f64::from(1 << BITS)).round() as i32)
        };
        // Greens make up the sum, so that grey stays grey whatever the rounding.
        let grey = |[r, _, b]: [i32; 3]| [r, -r - b, b];
        Self {
            luma: fixed([red, green, blue], 219.0),
            cb: grey(fixed([-red, 0.0, 1.0 - blue], 112.0 / (1.0 - blue))),
            cr: grey(fixed([1.0 - red, 0.0, -blue], 112.0 / (1.0 - red))),
        }
    }

    /// Appends the planes of `image` to `planes`: Y of `height * width` bytes, then Cb and Cr of
    /// `ceil(height / 2) * ceil(width / 2)` each. At an odd edge the last column or row counts twice.
    pub fn append(&self, image: &ColorImage, planes: &mut Vec<u8>) {
        let (width, height) = (image.width as usize, image.height as usize);
        let (half_width, half_height) = (width.div_ceil(2), height.div_ceil(2));
        let start = planes.len();
        planes.resize(start + width * height + 2 * half_width * half_height, 0);
        let (luma, chroma) = planes[start..].split_at_mut(width * height);
        let (cb, cr) = chroma.split_at_mut(half_width * half_height);

        for (y, pixel) in luma.iter_mut().zip(image.rgb.as_chunks::<3>().0) {
            let sum = dot(&self.luma, pixel.map(i32::from));
            *y = (16 + ((sum + (1 << (BITS - 1))) >> BITS)) as u8;
        }
        if width == 0 {
            return;
        }
        let row_pairs = image.rgb.chunks(2 * 3 * width);
        for ((rows, cb), cr) in row_pairs.zip(cb.chunks_exact_mut(half_width)).zip(cr.chunks_exact_mut(half_width)) {
            let (upper, lower) = rows.split_at(3 * width);
            let lower = if lower.is_empty() { upper } else { lower };
            for (((upper, lower), cb), cr) in upper.chunks(6).zip(lower.chunks(6)).zip(cb).zip(cr) {
                // The only pixel, at an odd edge.
                let right = upper.len() - 3;
                let sum = |channel: usize| {
                    [upper[channel], upper[right + channel], lower[channel], lower[right + channel]]
                        .map(i32::from)
                        .iter()
                        .sum()
                };
                let four = [sum(0), sum(1), sum(2)];
                let mean = |weights| (128 + ((dot(weights, four) + (1 << (BITS + 1))) >> (BITS + 2))) as u8;
                (*cb, *cr) = (mean(&self.cb), mean(&self.cr));
            }
        }
    }
}

fn dot(weights: &[i32; 3], rgb: [i32; 3]) -> i32 {
    weights[0] * rgb[0] + weights[1] * rgb[1] + weights[2] * rgb[2]
}
