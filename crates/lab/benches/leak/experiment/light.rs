//! Pictures in linear light.

use bokehcam::color::{linear_to_srgb, srgb_to_linear};
use bokehcam::frame::ColorImage;

/// Weights of red, green and blue in the luminance of sRGB's primaries.
const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Luminance of every pixel in linear light, row-major; 1 is white.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Light {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `height * width` values.
    pub values: Vec<f32>,
}

impl Light {
    /// Decodes an 8-bit sRGB picture.
    pub fn from_picture(picture: &ColorImage) -> Self {
        let table: Vec<f32> = (0..256).map(|code| srgb_to_linear(code as f32 / 255.0)).collect();
        let luminance = |rgb: &[u8]| rgb.iter().zip(LUMINANCE).map(|(&code, w)| w * table[usize::from(code)]).sum();
        let values = picture.rgb.chunks_exact(3).map(luminance).collect();
        Self { width: picture.width as usize, height: picture.height as usize, values }
    }

    /// Encodes it as a grey 8-bit sRGB picture, clipped at black and white.
    pub fn to_picture(&self) -> ColorImage {
        let code = |&light: &f32| (linear_to_srgb(light.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8;
        let rgb = self.values.iter().map(code).flat_map(|code| [code; 3]).collect();
        ColorImage { width: self.width as u32, height: self.height as u32, rgb }
    }

    /// Repeats in each row the value before the column `right` from there on.
    pub fn continue_from(&mut self, right: usize) {
        for row in self.values.chunks_exact_mut(self.width.max(1)) {
            let last = row[right.clamp(1, row.len()) - 1];
            row.iter_mut().skip(right).for_each(|value| *value = last);
        }
    }

    /// Returns the values of a row in the columns from `left` to before `right`.
    pub fn row(&self, y: usize, left: usize, right: usize) -> &[f32] {
        &self.values[y * self.width + left..y * self.width + right]
    }
}
