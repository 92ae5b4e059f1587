//! Encodes pixels as PNG, JPEG and WebP.

use std::borrow::Cow;

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageError, ImageResult};
use png::chunk::ChunkType;
use png::text_metadata::ITXtChunk;

use super::photo_metadata::PhotoMetadata;
use super::unit::{self, MapUnit};
use super::{image_resources, xmp};
use bokehcam::color::round_to_8bit;
use bokehcam::frame::{ColorImage, DepthMap};

/// High enough that compression artefacts stay invisible.
const JPEG_QUALITY: u8 = 95;

/// Compresses as well as a filter chosen per row, in half the time (measured on 640x480 colour and depth).
const PNG_FILTER: png::Filter = png::Filter::Paeth;

/// Pixels to encode: RGB, or RGBA with straight alpha.
pub(super) struct Raster<'a> {
    pub(super) size: (u32, u32),
    pub(super) samples: Samples<'a>,
    pub(super) has_alpha: bool,
}

/// Interleaved samples.
pub(super) enum Samples<'a> {
    Bits8(Cow<'a, [u8]>),
    Bits16(Vec<u16>),
}

impl<'a> From<&'a ColorImage> for Raster<'a> {
    fn from(image: &'a ColorImage) -> Self {
        Self { size: image.size(), samples: Samples::Bits8(Cow::Borrowed(&image.rgb)), has_alpha: false }
    }
}

impl Raster<'static> {
    /// Joins 8-bit RGB, and alpha of every pixel (65535 is opaque).
    pub(super) fn from_8bit(size: (u32, u32), rgb: Vec<u8>, alpha: Option<&[u16]>) -> Self {
        let samples = match alpha {
            None => rgb,
            Some(alpha) => {
                let pixels = rgb.as_chunks().0.iter().zip(alpha);
                pixels.flat_map(|(&[r, g, b], &alpha)| [r, g, b, round_to_8bit(alpha)]).collect()
            }
        };
        Self { size, samples: Samples::Bits8(Cow::Owned(samples)), has_alpha: alpha.is_some() }
    }

    /// Joins 16-bit RGB, and alpha of every pixel.
    pub(super) fn from_16bit(size: (u32, u32), rgb: Vec<u16>, alpha: Option<&[u16]>) -> Self {
        let samples = match alpha {
            None => rgb,
            Some(alpha) => {
                rgb.as_chunks().0.iter().zip(alpha).flat_map(|(&[r, g, b], &alpha)| [r, g, b, alpha]).collect()
            }
        };
        Self { size, samples: Samples::Bits16(samples), has_alpha: alpha.is_some() }
    }
}

impl Raster<'_> {
    /// Returns samples of 8 bits and their format.
    fn to_8bit(&self) -> (Cow<'_, [u8]>, ExtendedColorType) {
        let samples = match &self.samples {
            Samples::Bits8(samples) => Cow::Borrowed(&**samples),
            Samples::Bits16(samples) => samples.iter().map(|&code| round_to_8bit(code)).collect(),
        };
        (samples, if self.has_alpha { ExtendedColorType::Rgba8 } else { ExtendedColorType::Rgb8 })
    }
}

/// Appends `image` to `file` as PNG, with a fast compression that keeps up with a camera.
pub(super) fn encode_color_png(image: &ColorImage, file: &mut Vec<u8>) -> Result<(), png::EncodingError> {
    encode_photo_png(&image.into(), &PhotoMetadata::default(), file)
}

/// Appends a picture to `file` as PNG, with its colour profile, EXIF and XMP.
pub(super) fn encode_photo_png(
    raster: &Raster,
    metadata: &PhotoMetadata,
    file: &mut Vec<u8>,
) -> Result<(), png::EncodingError> {
    let mut info = png::Info::with_size(raster.size.0, raster.size.1);
    info.icc_profile = metadata.icc_profile.as_deref().map(Cow::Borrowed);
    info.exif_metadata = metadata.exif.as_deref().map(Cow::Borrowed);
    info.utf8_text.extend(metadata.xmp.as_ref().map(|packet| ITXtChunk::new(xmp::PNG_KEYWORD, packet)));
    let mut encoder = png::Encoder::with_info(file, info)?;
    encoder.set_color(if raster.has_alpha { png::ColorType::Rgba } else { png::ColorType::Rgb });
    let (depth, bytes) = match &raster.samples {
        Samples::Bits8(samples) => (png::BitDepth::Eight, Cow::Borrowed(&**samples)),
        Samples::Bits16(samples) => {
            (png::BitDepth::Sixteen, samples.iter().flat_map(|code| code.to_be_bytes()).collect())
        }
    };
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(PNG_FILTER);
    let mut writer = encoder.write_header()?;
    metadata.png_chunks.iter().try_for_each(|(name, data)| writer.write_chunk(ChunkType(*name), data))?;
    writer.write_image_data(&bytes)?;
    writer.finish()
}

/// Appends a picture to `file`, which must be empty, as JPEG, with its colour profile, EXIF, XMP and IPTC. It has no alpha.
pub(super) fn encode_photo_jpeg(raster: &Raster, metadata: &PhotoMetadata, file: &mut Vec<u8>) -> ImageResult<()> {
    let set_metadata = |encoder: &mut JpegEncoder<&mut Vec<u8>>| {
        if let Some(profile) = &metadata.icc_profile {
            encoder.set_icc_profile(profile.clone()).map_err(ImageError::Unsupported)?;
        }
        if let Some(exif) = &metadata.exif {
            encoder.set_exif_metadata(exif.clone()).map_err(ImageError::Unsupported)?;
        }
        Ok(())
    };
    let (rgb, _) = raster.to_8bit();
    bokehcam_jpeg::encode(&rgb, raster.size, JPEG_QUALITY, set_metadata, file)?;
    // Each goes before those inserted earlier.
    for part in metadata.image_resources.iter().flat_map(|all| all.rchunks(image_resources::MAX_SEGMENT_BYTES)) {
        bokehcam_jpeg::insert_application_segment(file, 13, &[image_resources::JPEG_NAME, part].concat());
    }
    if let Some(packet) = &metadata.xmp {
        bokehcam_jpeg::insert_application_segment(file, 1, &[xmp::JPEG_NAME, packet.as_bytes()].concat());
    }
    Ok(())
}

/// Appends a picture to `file` as lossless WebP of 8 bits, with its colour profile, EXIF and XMP.
pub(super) fn encode_photo_webp(
    raster: &Raster,
    metadata: &PhotoMetadata,
    file: &mut Vec<u8>,
) -> Result<(), image_webp::EncodingError> {
    let mut encoder = image_webp::WebPEncoder::new(file);
    metadata.icc_profile.iter().for_each(|profile| encoder.set_icc_profile(profile.clone()));
    metadata.exif.iter().for_each(|exif| encoder.set_exif_metadata(exif.clone()));
    metadata.xmp.iter().for_each(|packet| encoder.set_xmp_metadata(packet.clone().into_bytes()));
    let color = if raster.has_alpha { image_webp::ColorType::Rgba8 } else { image_webp::ColorType::Rgb8 };
    encoder.encode(&raster.to_8bit().0, raster.size.0, raster.size.1, color)
}

/// Appends `values` (`height` x `width`, row-major) to `file` as 16-bit grey PNG of `scale` units per 1.0, 0 = unknown,
/// which states what they are if `map_unit` does; `units` is working memory.
pub(super) fn encode_png_16bit(
    (width, height): (u32, u32),
    values: &[f32],
    scale: f32,
    map_unit: Option<MapUnit>,
    units: &mut Vec<u8>,
    file: &mut Vec<u8>,
) -> Result<(), png::EncodingError> {
    units.clear();
    units.extend(values.iter().flat_map(|&value| quantize(value, scale).to_be_bytes()));
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(PNG_FILTER);
    if let Some(map_unit) = map_unit {
        encoder.add_text_chunk(unit::KEYWORD.to_owned(), map_unit.text())?;
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(units)?;
    writer.finish()
}

/// Quantises to the nearest unit, 1 to 65535, or 0 for unknown. A value beyond the range becomes unknown, not clamped;
/// a known value below one unit stays known.
fn quantize(value: f32, scale: f32) -> u16 {
    let units = (value * scale).round();
    if DepthMap::is_known(value) && value <= max_value(scale) { units.clamp(1.0, MAX_SAMPLE) as u16 } else { 0 }
}

const MAX_SAMPLE: f32 = u16::MAX as f32;

/// Returns the largest value that can be written at `scale` units per 1.0: it still rounds to 65535.
pub(super) fn max_value(scale: f32) -> f32 {
    (MAX_SAMPLE + 0.499) / scale
}

#[cfg(test)]
mod tests {
    use super::quantize;

    #[test]
    fn depth_is_rounded_and_what_does_not_fit_is_unknown() {
        assert_eq!(quantize(1.0, 5000.0), 5000);
        assert_eq!(quantize(1.00011, 5000.0), 5001);
        assert_eq!(quantize(13.107, 5000.0), 65535);
        assert_eq!(quantize(1e-6, 5000.0), 1);
        for unknown in [0.0, -1.0, f32::NAN, f32::INFINITY, 13.2, 1e11, 1e-9] {
            assert_eq!(quantize(unknown, 5000.0), 0, "{unknown} m");
        }
    }
}
