//! Crops: a part of a picture, enlarged to the picture's size.

use super::ColorImage;
use super::scale::RowScaler;

/// A part of a picture with the picture's aspect ratio, in fractions of its width and height, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crop {
    /// Centre of the part.
    pub center: [f32; 2],
    /// Magnification, at least 1: the part's side is the reciprocal.
    pub zoom: f32,
}

impl Crop {
    /// The whole picture.
    pub const WHOLE: Self = Self { center: [0.5; 2], zoom: 1.0 };

    /// Returns the crop, moved inside the picture.
    pub fn clamp_inside(self) -> Self {
        let zoom = self.zoom.max(1.0);
        let half = 0.5 / zoom;
        Self { center: self.center.map(|center| center.clamp(half, 1.0 - half)), zoom }
    }

    /// Returns start and length of the part along an axis of `side` pixels.
    fn span(&self, axis: usize, side: u32) -> (f64, f64) {
        let (side, length) = (f64::from(side), f64::from(side) / f64::from(self.zoom));
        let begin = f64::from(self.center[axis]) * side - 0.5 * length;
        (begin.clamp(0.0, side - length), length)
    }
}

/// Enlarges crops of pictures; owns the scratch memory.
#[derive(Debug, Default)]
pub struct Cropper {
    scale: RowScaler,
    row: Vec<u16>,
}

impl Cropper {
    /// Writes a crop of `from` to `into`, as large as `from`: bilinear, at subpixel positions, so that a moving crop is
    /// smooth.
    pub fn crop(&mut self, from: &ColorImage, crop: &Crop, into: &mut ColorImage) {
        into.resize(from.width, from.height);
        let (width, height) = (from.width as usize, from.height as usize);
        if from.rgb.is_empty() {
            return;
        }
        let parts = [crop.span(0, from.width), crop.span(1, from.height)];
        self.scale.set_crop((width, height), parts, (width, height));
        for (y, row) in into.rgb.chunks_exact_mut(3 * width).enumerate() {
            self.scale.scale_row(&from.rgb, y, 0..width, &mut self.row, row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Red increases to the right and green downwards, by one code every two pixels.
    fn ramp(width: u32, height: u32) -> ColorImage {
        let pixel = |at: u32| [(at % width / 2) as u8, (at / width / 2) as u8, 77];
        ColorImage { width, height, rgb: (0..width * height).flat_map(pixel).collect() }
    }

    #[test]
    fn the_whole_is_the_picture_to_the_bit() {
        let (from, mut into) = (ramp(90, 50), ColorImage::default());
        Cropper::default().crop(&from, &Crop::WHOLE, &mut into);
        assert_eq!(into, from);
    }

    #[test]
    fn a_part_is_where_it_was_and_as_much_larger_as_was_said() {
        let (from, mut into) = (ramp(320, 200), ColorImage::default());
        let mut cropper = Cropper::default();
        for (center, zoom) in [([0.5, 0.5], 2.0), ([0.25, 0.75], 2.0), ([0.4, 0.6], 1.25), ([0.613, 0.5], 1.7)] {
            cropper.crop(&from, &Crop { center, zoom }, &mut into);
            for (x, y) in [(5, 5), (160, 100), (300, 30), (12, 190)] {
                let pixel = into.rgb.as_chunks::<3>().0[y * 320 + x];
                let due = [(x, 320.0, center[0]), (y, 200.0, center[1])]
                    .map(|(at, side, center)| ((at as f32 + 0.5 - side / 2.0) / zoom + center * side - 0.5) / 2.0);
                for (code, due) in pixel.iter().zip(due) {
                    assert!((f32::from(*code) - due).abs() <= 1.0, "{code} not {due} at {x}, {y}, {zoom} times");
                }
            }
        }
    }

    #[test]
    fn a_part_beyond_the_border_is_moved_inside() {
        let inside = Crop { center: [0.9, -3.0], zoom: 2.0 }.clamp_inside();
        assert_eq!(inside, Crop { center: [0.75, 0.25], zoom: 2.0 });
        assert_eq!(Crop { center: [0.9, 0.1], zoom: 0.5 }.clamp_inside(), Crop::WHOLE);
    }
}
