//! 8-bit RGB to planar Y'CbCr 4:2:0 in limited range (Y 16..235, Cb and Cr 16..240), chroma sited in the middle of its
//! 2 x 2 pixels, as the y4m tag `C420jpeg` says.

use crate::frame::ColorImage;

/// Which luma weights a picture uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matrix {
    /// Standard definition.
    Bt601,
    /// High definition.
    Bt709,
}

impl Matrix {
    /// What players assume of a picture that does not say: BT.709 from 720 rows on.
    pub fn for_height(height: u32) -> Self {
        if height >= 720 { Self::Bt709 } else { Self::Bt601 }
    }

    /// Luma weights of red and blue.
    pub fn weights(self) -> (f64, f64) {
        match self {
            Self::Bt601 => (0.299, 0.114),
            Self::Bt709 => (0.2126, 0.0722),
        }
    }
}

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
        let (red, blue) = matrix.weights();
        let green = 1.0 - red - blue;
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
        planes.reserve(width * height + 2 * width.div_ceil(2) * height.div_ceil(2));
        planes.extend(image.rgb.chunks_exact(3).map(|pixel| {
            let [r, g, b] = [pixel[0], pixel[1], pixel[2]].map(i32::from);
            let y = self.luma[0] * r + self.luma[1] * g + self.luma[2] * b;
            (16 + ((y + (1 << (BITS - 1))) >> BITS)) as u8
        }));
        for chroma in [&self.cb, &self.cr] {
            for y in (0..height).step_by(2) {
                let rows = [y, (y + 1).min(height - 1)].map(|row| &image.rgb[row * width * 3..][..width * 3]);
                let value = |x: usize, step: usize| -> u8 {
                    let mut sum = 0;
                    for row in rows {
                        for at in [x * 3, (x + step) * 3] {
                            for channel in 0..3 {
                                sum += chroma[channel] * i32::from(row[at + channel]);
                            }
                        }
                    }
                    (128 + ((sum + (1 << (BITS + 1))) >> (BITS + 2))) as u8
                };
                planes.extend((0..width / 2).map(|half| value(2 * half, 1)));
                if width % 2 == 1 {
                    planes.push(value(width - 1, 0));
                }
            }
        }
    }
}
