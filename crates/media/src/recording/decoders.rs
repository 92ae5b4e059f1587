//! Decoders of other crates: created within limits, and run behind a guard.

use std::fs::File;
use std::io::{BufRead, BufReader, Seek};

use image::{ColorType, ImageDecoder, ImageFormat, ImageReader};

use super::fault::{PictureFault, decoder_fault, png_fault};
use super::file_kind::{self, FileKind};
use super::samples::SampleFormat;
use super::tiff_directory::is_raw_tiff;
use super::tiff_file::{TiffPhotoDecoder, Undecoded};
use super::tiff_form::{SAVE_PHOTO, TiffForm};
use super::{MAX_PIXELS, MAX_SIDE_PX};
use bokehcam::compute::catch_panic;

/// What a message names where no picture is found.
pub(super) const PICTURES: &str = "PNG, JPEG, TIFF, WebP, BMP, PNM or GIF";

/// Memory limit for a PNG's texts and profiles, which are not shown.
const MAX_METADATA_BYTES: usize = 64 << 20;

/// Memory limit for other files with their pixels: enough for [`MAX_PIXELS`] of four 16-bit channels.
const MAX_DECODER_BYTES: u64 = 8 * MAX_PIXELS + (64 << 20);

/// Rejects a size beyond the limits, before memory is allocated for it.
pub(super) fn check_size(width: u32, height: u32) -> Result<(), PictureFault> {
    let pixels = u64::from(width) * u64::from(height);
    if width > MAX_SIDE_PX || height > MAX_SIDE_PX || pixels > MAX_PIXELS {
        Err(PictureFault::TooLarge { width, height })
    } else if width == 0 || height == 0 {
        Err(PictureFault::NoPixel { width, height })
    } else {
        Ok(())
    }
}

/// Runs a decoder: if it panics, the file is damaged. What it was decoding into is then unspecified.
pub(super) fn guard<T>(decode: impl FnOnce() -> Result<T, PictureFault>) -> Result<T, PictureFault> {
    guard_as(PictureFault::Damaged, decode)
}

/// Does the same for another kind of fault, which `to_fault` makes of the reason.
pub(super) fn guard_as<T, E>(to_fault: fn(String) -> E, decode: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
    catch_panic(decode).unwrap_or_else(|| Err(to_fault("it makes the decoder fail".to_owned())))
}

/// Creates a decoder of 8 or 16 bits for a file, whose size is checked.
pub(super) fn create_decoder(mut file: File, format: ImageFormat) -> Result<Box<dyn ImageDecoder>, PictureFault> {
    if format != ImageFormat::Tiff {
        return decode_with(BufReader::new(file), format);
    }
    if is_raw_tiff(&mut file)? {
        return Err(FileKind::fault(Some(file_kind::RAW), PICTURES));
    }
    let form = TiffForm::read(&mut file)?;
    form.check_compression(SAVE_PHOTO)?;
    let undecoded = Undecoded::read(&mut file);
    file.rewind()?;
    let decoder = decode_with(BufReader::new(file), format).map_err(|fault| match fault {
        PictureFault::Unsupported(_) => form.samples_fault(SAVE_PHOTO),
        fault => fault,
    })?;
    Ok(Box::new(TiffPhotoDecoder { decoder, undecoded }))
}

/// Creates a decoder for a JPEG that begins as one, whose size is checked.
pub(super) fn create_jpeg_decoder<'a>(file: &'a [u8]) -> Result<Box<dyn ImageDecoder + 'a>, PictureFault> {
    // The decoder would fill missing data with grey.
    if !bokehcam_jpeg::is_complete(file) {
        return Err(PictureFault::Truncated);
    }
    let decoder = bokehcam_jpeg::StrictJpeg::new(file).map_err(decoder_fault)?;
    check_size(decoder.dimensions().0, decoder.dimensions().1)?;
    Ok(Box::new(decoder))
}

/// Creates a decoder of 8 or 16 bits, whose size is checked.
pub(super) fn decode_with<'a>(
    reader: impl BufRead + Seek + 'a,
    format: ImageFormat,
) -> Result<Box<dyn ImageDecoder + 'a>, PictureFault> {
    let mut reader = ImageReader::with_format(reader, format);
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(MAX_DECODER_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(decoder_fault)?;
    check_size(decoder.dimensions().0, decoder.dimensions().1)?;
    match sample_format(decoder.color_type()).bytes_per_pixel() == usize::from(decoder.color_type().bytes_per_pixel()) {
        true => Ok(Box::new(decoder)),
        false => Err(PictureFault::Unsupported("floating-point samples".into())),
    }
}

/// Returns the samples of decoded pixels.
pub(super) fn sample_format(color: ColorType) -> SampleFormat {
    let is_16bit = matches!(color, ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16);
    SampleFormat { channels: usize::from(color.channel_count()), is_16bit }
}

/// Creates a decoder for a PNG, whose size is checked.
pub(super) fn create_png_decoder(file: File) -> Result<png::Decoder<BufReader<File>>, PictureFault> {
    let mut decoder = png::Decoder::new_with_limits(BufReader::new(file), png::Limits { bytes: MAX_METADATA_BYTES });
    // Expands palettes and samples of fewer than 8 bits.
    decoder.set_transformations(png::Transformations::EXPAND);
    // Check the size before memory is allocated for a row.
    let (width, height) = decoder.read_header_info().map_err(png_fault)?.size();
    check_size(width, height)?;
    Ok(decoder)
}
