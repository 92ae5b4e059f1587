//! From pixels to PNG and JPEG.

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageResult};

use crate::frame::{ColorImage, DepthMap, DisparityMap};

/// High enough that the blur, not the file format, decides what is seen.
const JPEG_QUALITY: u8 = 95;

/// As small as choosing a filter for each row, in half the time (measured on 640x480 colour and depth).
const FILTER: FilterType = FilterType::Paeth;

/// Units of a 16-bit disparity picture per pixel, as in the KITTI benchmark.
pub(super) const DISPARITY_SCALE: f32 = 256.0;

/// Appends `image` to `file` as PNG, with the fast compression that keeps up with a camera.
pub(super) fn color_png(image: &ColorImage, file: &mut Vec<u8>) -> ImageResult<()> {
    PngEncoder::new_with_quality(file, CompressionType::Fast, FILTER).write_image(
        &image.rgb,
        image.width,
        image.height,
        ExtendedColorType::Rgb8,
    )
}

/// Appends `image` to `file` as JPEG.
pub(super) fn color_jpeg(image: &ColorImage, file: &mut Vec<u8>) -> ImageResult<()> {
    JpegEncoder::new_with_quality(file, JPEG_QUALITY).write_image(
        &image.rgb,
        image.width,
        image.height,
        ExtendedColorType::Rgb8,
    )
}

/// Appends `depth` to `file` as 16-bit grey PNG of `depth_scale` units per metre; `units` is working memory.
pub(super) fn depth_png(
    depth: &DepthMap,
    depth_scale: f32,
    units: &mut Vec<u8>,
    file: &mut Vec<u8>,
) -> ImageResult<()> {
    wide_png(depth.size(), &depth.metres, depth_scale, units, file)
}

/// Appends `disparity` to `file` as 16-bit grey PNG of [`DISPARITY_SCALE`] units per pixel.
pub(super) fn disparity_png(disparity: &DisparityMap, file: &mut Vec<u8>) -> ImageResult<()> {
    wide_png(disparity.size(), &disparity.px, DISPARITY_SCALE, &mut Vec::new(), file)
}

fn wide_png(
    (width, height): (u32, u32),
    values: &[f32],
    scale: f32,
    units: &mut Vec<u8>,
    file: &mut Vec<u8>,
) -> ImageResult<()> {
    units.clear();
    units.extend(values.iter().flat_map(|&value| in_units(value, scale).to_ne_bytes()));
    PngEncoder::new_with_quality(file, CompressionType::Fast, FILTER).write_image(
        units,
        width,
        height,
        ExtendedColorType::L16,
    )
}

/// The nearest unit, 1 to 65535, or 0 for unknown. What lies beyond the range becomes unknown rather than a wrong
/// value; what is known and less than one unit stays known.
fn in_units(value: f32, scale: f32) -> u16 {
    let units = (value * scale).round();
    if DepthMap::is_known(value) && units <= f32::from(u16::MAX) { units.max(1.0) as u16 } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::in_units;

    #[test]
    fn depth_is_rounded_and_what_does_not_fit_is_unknown() {
        assert_eq!(in_units(1.0, 5000.0), 5000);
        assert_eq!(in_units(1.00011, 5000.0), 5001);
        assert_eq!(in_units(13.107, 5000.0), 65535);
        assert_eq!(in_units(1e-6, 5000.0), 1);
        for unknown in [0.0, -1.0, f32::NAN, f32::INFINITY, 13.2, 1e30] {
            assert_eq!(in_units(unknown, 5000.0), 0, "{unknown} m");
        }
    }
}
