//! TIFF with one channel (or three equal ones) of 8 or 16 bits, or floats.

use std::fs::File;
use std::io::{BufReader, ErrorKind};

use image::metadata::Orientation;
use tiff::TiffError;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

use super::values::{ColorCount, Samples, Values};
use crate::recording::decoders::check_size;
use crate::recording::fault::{PictureFault, damaged_fault};
use crate::recording::tiff_form::{SAVE_MAP, TiffForm};

/// Memory for the decoder besides the pixels: one strip or tile, and the lists of them.
const MAX_BUFFER_BYTES: usize = 64 << 20;

/// The number that means unknown, as text (GDAL's "TIFFTAG_GDAL_NODATA").
const NODATA: Tag = Tag::Unknown(42113);

/// Reads the first picture of a file, upright by its orientation tag.
pub(super) fn read(mut file: File) -> Result<Values, PictureFault> {
    let form = TiffForm::read(&mut file)?;
    form.check_compression(SAVE_MAP)?;
    let fault = |error| match error {
        TiffError::IoError(error) if error.kind() == ErrorKind::UnexpectedEof => PictureFault::Truncated,
        TiffError::UnsupportedError(_) => form.samples_fault(SAVE_MAP),
        other => damaged_fault(&other),
    };
    let mut decoder = Decoder::new(BufReader::new(file)).map_err(fault)?;
    let (width, height) = decoder.dimensions().map_err(fault)?;
    check_size(width, height)?;
    let pixels = width as usize * height as usize;
    let mut limits = Limits::default();
    // At most four channels of four bytes.
    limits.decoding_buffer_size = 16 * pixels;
    limits.intermediate_buffer_size = MAX_BUFFER_BYTES;
    limits.ifd_value_size = MAX_BUFFER_BYTES;
    let mut decoder = decoder.with_limits(limits);
    let tag = decoder.find_tag_unsigned::<u8>(Tag::Orientation).ok().flatten();
    let orientation = tag.and_then(Orientation::from_exif).unwrap_or(Orientation::NoTransforms);
    let extra = decoder.find_tag_unsigned_vec::<u16>(Tag::ExtraSamples).ok().flatten();
    // Some writers do not say that it is alpha; 0 says that it is not.
    let may_be_alpha = !matches!(extra.as_deref(), Some([0, ..]));
    let invalid =
        decoder.get_tag_ascii_string(NODATA).ok().and_then(|text| text.trim_matches(['\0', ' ']).parse().ok());
    // Takes the first of several channels, which must be nearly equal (grey).
    let to_values = |samples, white, stored: Vec<f32>| {
        let channels = (stored.len() / pixels).max(1);
        let mut colors = ColorCount::new(white);
        let numbers: Vec<f32> = match channels {
            1 => stored,
            _ => stored
                .chunks_exact(channels)
                .map(|pixel| match *pixel {
                    [.., alpha] if alpha == 0.0 && may_be_alpha && channels.is_multiple_of(2) => f32::NAN,
                    [r, g, b, ..] => {
                        colors.add([r, g, b]);
                        r
                    }
                    _ => pixel[0],
                })
                .collect(),
        };
        if numbers.len() != pixels {
            return Err(if form.is_packed() { form.samples_fault(SAVE_MAP) } else { PictureFault::Truncated });
        }
        colors.check(pixels)?;
        Ok(Values { size: (width, height), numbers, samples, invalid, ..Values::default() }.turned(orientation))
    };
    let floats = |stored| to_values(Samples::Float, 1.0, stored);
    let whole = |stored| to_values(Samples::Whole, 65535.0, stored);
    match decoder.read_image().map_err(fault)? {
        DecodingResult::U8(codes) => to_values(Samples::Eight, 255.0, codes.into_iter().map(f32::from).collect()),
        DecodingResult::U16(codes) => whole(codes.into_iter().map(f32::from).collect()),
        DecodingResult::U32(codes) => whole(codes.into_iter().map(|code| code as f32).collect()),
        DecodingResult::I16(codes) => whole(codes.into_iter().map(f32::from).collect()),
        DecodingResult::I32(codes) => whole(codes.into_iter().map(|code| code as f32).collect()),
        DecodingResult::F16(stored) => floats(stored.into_iter().map(f32::from).collect()),
        DecodingResult::F32(stored) => floats(stored),
        DecodingResult::F64(stored) => floats(stored.into_iter().map(|number| number as f32).collect()),
        _ => Err(PictureFault::NotAMap("a TIFF of this number format".to_owned())),
    }
}
