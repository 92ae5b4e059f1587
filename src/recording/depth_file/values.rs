//! The numbers of a map as stored, whatever the format.

use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

use image::metadata::Orientation;

use super::{FORMATS, exr, npy, tiff};
use crate::files::input;
use crate::recording::MAX_PIXELS;
use crate::recording::coded::{self, EncodedPicture};
use crate::recording::decoders::guard;
use crate::recording::fault::{PictureFault, open_fault};
use crate::recording::pfm;
use crate::recording::photo_metadata::PhotoMetadata;
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
    /// What was assumed to find them in the file.
    pub note: Option<String>,
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
}

/// Largest file of floats: 8 bytes per pixel, and room for a header.
const MAX_FLOATS_BYTES: u64 = 8 * MAX_PIXELS + (1 << 20);

/// Reads a map; the first bytes decide its format.
pub(super) fn read(path: &Path) -> Result<Values, PictureFault> {
    let mut file = input::open(path).map_err(open_fault)?;
    let mut start = [0; 8];
    let mut length = 0;
    while let read @ 1.. = file.read(&mut start[length..])? {
        length += read;
    }
    file.rewind()?;
    match &start[..length] {
        [b'P', b'f' | b'F', space, ..] if space.is_ascii_whitespace() => {
            let mut values = Values::default();
            (values.size, values.stated) = pfm::parse(&read_whole(file)?, &mut values.numbers)?;
            Ok(values)
        }
        [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => npy::parse(&read_whole(file)?),
        [b'P', b'K', 3, 4, ..] => guard(|| npy::read_archive(file, MAX_FLOATS_BYTES)),
        // 43 is BigTIFF.
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => guard(|| tiff::read(file)),
        [0x76, 0x2f, 0x31, 0x01, ..] => guard(|| exr::read(file)),
        [] => Err(PictureFault::Truncated),
        _ => read_codes(path),
    }
}

fn read_whole(file: File) -> Result<Vec<u8>, PictureFault> {
    let bytes = file.metadata()?.len();
    if bytes > MAX_FLOATS_BYTES {
        return Err(PictureFault::FileSize { bytes, max_bytes: MAX_FLOATS_BYTES });
    }
    let mut content = Vec::with_capacity(bytes as usize);
    file.take(MAX_FLOATS_BYTES).read_to_end(&mut content)?;
    Ok(content)
}

/// Reads the codes of a picture, upright by its orientation tag.
fn read_codes(path: &Path) -> Result<Values, PictureFault> {
    let mut memory = Vec::new();
    let coded = EncodedPicture::open(path, &mut memory).map_err(|fault| match fault {
        PictureFault::Format(_) => PictureFault::Format(FORMATS),
        fault => fault,
    })?;
    let (values, mut metadata) = decode_codes(coded)?;
    Ok(Values { stated: read_stated_unit(path), ..values }.turned(metadata.take_orientation()))
}

/// Decodes the codes of a picture as stored.
pub(super) fn decode_codes(coded: EncodedPicture) -> Result<(Values, PhotoMetadata), PictureFault> {
    let ((width, height), format) = (coded.size(), coded.samples());
    let mut numbers = vec![0.0; width as usize * height as usize];
    let sample = |pixel: &[u8], channel: usize| match format.is_16bit {
        true => f32::from(u16::from_be_bytes([pixel[2 * channel], pixel[2 * channel + 1]])),
        false => f32::from(pixel[channel]),
    };
    let samples = if format.is_16bit { Samples::Sixteen } else { Samples::Eight };
    let mut colors = ColorCount::new(samples.white());
    let metadata = coded.decode_runs(&mut Vec::new(), |run, row| {
        let places = numbers[run.first..].iter_mut().step_by(run.step);
        for (number, pixel) in places.zip(row.chunks_exact(format.bytes_per_pixel())) {
            *number = sample(pixel, 0);
            if format.has_color() {
                let rgb = [*number, sample(pixel, 1), sample(pixel, 2)];
                colors.add(rgb);
                *number = rgb[1];
            }
            if format.has_alpha() && sample(pixel, format.channels - 1) == 0.0 {
                *number = f32::NAN;
            }
        }
    })?;
    colors.check(numbers.len())?;
    Ok((Values { size: (width, height), numbers, samples, ..Values::default() }, metadata))
}

/// Reads the unit that a PNG of ours states.
fn read_stated_unit(path: &Path) -> Option<MapUnit> {
    let info = coded::read_png_info(path).ok()?;
    let chunk = info.uncompressed_latin1_text.iter().find(|chunk| chunk.keyword == unit::KEYWORD)?;
    MapUnit::from_text(&chunk.text)
}

/// Counts the pixels of an RGB picture that are not grey.
pub(super) struct ColorCount {
    tolerance: f32,
    count: usize,
}

impl ColorCount {
    /// Tolerance of a channel, as a share of white: lossy compression changes grey by a few codes.
    const TOLERANCE: f32 = 8.0 / 255.0;
    /// Share of coloured pixels above which a picture is not grey.
    const MAX_SHARE: f32 = 0.005;

    pub fn new(white: f32) -> Self {
        Self { tolerance: Self::TOLERANCE * white, count: 0 }
    }

    #[inline]
    pub fn add(&mut self, [r, g, b]: [f32; 3]) {
        // NaN in all three is no colour.
        self.count += usize::from((r - g).abs().max((b - g).abs()) > self.tolerance);
    }

    /// # Errors
    /// The picture has colours.
    pub fn check(&self, pixels: usize) -> Result<(), PictureFault> {
        let is_colored = self.count as f32 > Self::MAX_SHARE * pixels as f32;
        if is_colored { Err(PictureFault::ColoredDepth) } else { Ok(()) }
    }
}

impl Values {
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
