//! The numbers of a map as stored, whatever the format.

use image::metadata::Orientation;

use crate::recording::coded::EncodedPicture;
use crate::recording::fault::PictureFault;
use crate::recording::photo_metadata::PhotoMetadata;
use crate::recording::role::Role;
use crate::recording::samples::{GREY_TOLERANCE, MAX_COLORED};
use crate::recording::unit::{self, MapUnit};
use crate::recording::upright::upright;

/// The numbers of a map, top row first.
#[derive(Debug, Default)]
pub(super) struct Values {
    /// Columns and rows.
    pub size: (u32, u32),
    /// Row by row; NaN where the picture is transparent.
    pub numbers: Vec<f32>,
    /// What kind of numbers they are.
    pub samples: Samples,
    /// The unit that the file states.
    pub stated: Option<MapUnit>,
    /// What the name says that they are, of their array or else of their file.
    pub role: Role,
    /// A number that means unknown, as what stands beside the file states.
    pub invalid: Option<f32>,
    /// What was assumed about them, a line each.
    pub notes: Vec<String>,
}

/// The kind of numbers in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Samples {
    /// Codes of a picture with 8 bits.
    Eight,
    /// Codes of a PNG with 16 bits, as depth cameras write them.
    Sixteen,
    /// Whole numbers of an array or a TIFF, with any unit.
    Whole,
    /// Floats.
    #[default]
    Float,
}

impl Samples {
    /// Returns the largest code; 1 for floats.
    pub fn white(self) -> f32 {
        match self {
            Self::Eight => 255.0,
            Self::Sixteen | Self::Whole => 65535.0,
            Self::Float => 1.0,
        }
    }
}

impl Values {
    /// Returns the number of units per pixel if the numbers are disparities.
    pub fn disparities_per_px(&self) -> f32 {
        if self.samples == Samples::Sixteen { unit::DISPARITY_SCALE } else { 1.0 }
    }

    /// Returns the map turned as an orientation tag says.
    pub fn turned(self, orientation: Orientation) -> Self {
        let transform = upright(orientation);
        if transform.is_identity() {
            return self;
        }
        let numbers = transform.apply_to_pixels(&self.numbers, self.size);
        Self { size: transform.rotated_size(self.size), numbers, ..self }
    }
}

/// Decodes the codes of a picture as stored.
pub(super) fn decode_codes(coded: EncodedPicture) -> Result<(Values, PhotoMetadata), PictureFault> {
    let ((width, height), format) = (coded.size(), coded.samples());
    let mut numbers = vec![0.0; width as usize * height as usize];
    let sample = |pixel: &[u8], channel: usize| f32::from(format.code(pixel, channel));
    let samples = if format.is_16bit { Samples::Sixteen } else { Samples::Eight };
    let mut colors = ColorCount::new(samples.white());
    let metadata = coded.decode_runs(&mut Vec::new(), |first, row| {
        for (number, pixel) in numbers[first..].iter_mut().zip(row.chunks_exact(format.bytes_per_pixel())) {
            *number = sample(pixel, 0);
            if format.has_alpha() && sample(pixel, format.channels - 1) == 0.0 {
                *number = f32::NAN;
            } else if format.has_color() {
                let rgb = [*number, sample(pixel, 1), sample(pixel, 2)];
                colors.add(rgb);
                *number = rgb[1];
            }
        }
    })?;
    colors.check(numbers.len())?;
    Ok((Values { size: (width, height), numbers, samples, ..Values::default() }, metadata))
}

/// Counts the pixels of an RGB picture that are not grey.
pub(super) struct ColorCount {
    tolerance: f32,
    count: usize,
}

impl ColorCount {
    pub fn new(white: f32) -> Self {
        Self { tolerance: GREY_TOLERANCE * white, count: 0 }
    }

    #[inline]
    pub fn add(&mut self, [r, g, b]: [f32; 3]) {
        // NaN in all three is no colour.
        self.count += usize::from((r - g).abs().max((b - g).abs()) > self.tolerance);
    }

    /// # Errors
    /// The picture has colours.
    pub fn check(&self, pixels: usize) -> Result<(), PictureFault> {
        let is_colored = self.count as f32 > MAX_COLORED * pixels as f32;
        if is_colored { Err(PictureFault::ColoredDepth) } else { Ok(()) }
    }
}

/// Returns whether pixels of 8-bit RGB are in colours, so that they are no depth.
pub fn has_colors(rgb: &[u8]) -> bool {
    let mut colors = ColorCount::new(Samples::Eight.white());
    rgb.as_chunks::<3>().0.iter().for_each(|rgb| colors.add(rgb.map(f32::from)));
    colors.check(rgb.len() / 3).is_err()
}
