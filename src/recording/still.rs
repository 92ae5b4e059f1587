//! Single pictures: colour, depth, disparity and grey, to and from files.
//!
//! What is written appears whole or not at all, and replaces nothing unless `force` says so.

use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, ImageBuffer, ImageError, Luma, RgbImage, imageops};

use super::decode::{self, DepthUnits, Scratch};
use super::error::RecordingError;
use super::fault::PictureFault;
use super::{check_depth_scale, depth_covers, encode, pfm, whole};
use crate::frame::{ColorImage, DepthMap, DisparityMap};

/// Reads a PNG or JPEG (told by the content) as 8-bit RGB, upright where it says how it was held. Grey is repeated,
/// transparency ignored, 16 bits rounded to 8. At most 8192 x 8192 pixels.
///
/// # Errors
/// The file is missing, no PNG or JPEG, too large, cut short or damaged.
pub fn read_color(path: &Path) -> Result<ColorImage, RecordingError> {
    let (mut scratch, mut image) = (Scratch::default(), ColorImage::default());
    decode::color(path, None, &mut scratch, &mut image).map_err(RecordingError::picture(path))?;

    let orientation = scratch.orientation();
    let (width, height) = image.size();
    let rgb = RgbImage::from_raw(width, height, image.rgb).unwrap_or_default();
    let mut upright = DynamicImage::ImageRgb8(rgb);
    upright.apply_orientation(orientation);
    Ok(ColorImage { width: upright.width(), height: upright.height(), rgb: upright.into_bytes() })
}

/// Reads a depth map in metres from a 16-bit grey PNG of `depth_scale` units per metre, where 0 and `invalid` mean
/// unknown, upright where it says how it was held, or from a `.pfm` of metres, for which both are ignored. At most 8192 x 8192 pixels.
///
/// # Errors
/// The file is missing, of another kind (8-bit grey has too few steps for depth), too large, cut short or damaged;
/// the scale is not a number > 0.
pub fn read_depth(path: &Path, depth_scale: f32, invalid: Option<u16>) -> Result<DepthMap, RecordingError> {
    check_depth_scale(depth_scale)?;
    if pfm::is_named(path) {
        return pfm::read(path).map_err(RecordingError::picture(path));
    }
    let (mut scratch, mut depth) = (Scratch::default(), DepthMap::default());
    let units = DepthUnits { scale: depth_scale, invalid };
    decode::depth(path, units, None, &mut scratch, &mut depth).map_err(RecordingError::picture(path))?;
    Ok(upright(depth, scratch.orientation()))
}

/// Whether the depth map `path` of `depth` pixels (columns, rows) is that of a picture of `color` pixels, seen alike.
///
/// # Errors
/// It is larger, or of another aspect.
pub fn check_depth_size(path: &Path, depth: (u32, u32), color: (u32, u32)) -> Result<(), RecordingError> {
    match depth_covers(depth, color) {
        true => Ok(()),
        false => Err(RecordingError::picture(path)(PictureFault::DepthSize { found: depth, color })),
    }
}

/// A map turned as its file says.
fn upright(map: DepthMap, orientation: Orientation) -> DepthMap {
    let DepthMap { width, height, metres } = map;
    let image: ImageBuffer<Luma<f32>, _> = ImageBuffer::from_raw(width, height, metres).unwrap_or_default();
    let image = match orientation {
        Orientation::NoTransforms => image,
        Orientation::Rotate90 => imageops::rotate90(&image),
        Orientation::Rotate180 => imageops::rotate180(&image),
        Orientation::Rotate270 => imageops::rotate270(&image),
        Orientation::FlipHorizontal => imageops::flip_horizontal(&image),
        Orientation::FlipVertical => imageops::flip_vertical(&image),
        Orientation::Rotate90FlipH => imageops::flip_horizontal(&imageops::rotate90(&image)),
        Orientation::Rotate270FlipH => imageops::flip_horizontal(&imageops::rotate270(&image)),
    };
    DepthMap { width: image.width(), height: image.height(), metres: image.into_raw() }
}

/// Reads a disparity map in pixels from a `.pfm`, where what is not finite or not above 0 is unknown, or from a 16-bit
/// grey PNG of 256 units per pixel, where 0 is unknown (KITTI). At most 8192 x 8192 pixels.
///
/// # Errors
/// As [`read_depth`].
pub fn read_disparity(path: &Path) -> Result<DisparityMap, RecordingError> {
    if pfm::is_named(path) {
        return pfm::read_disparity(path).map_err(RecordingError::picture(path));
    }
    let (mut scratch, mut map) = (Scratch::default(), DepthMap::default());
    let units = DepthUnits { scale: encode::DISPARITY_SCALE, invalid: None };
    decode::depth(path, units, None, &mut scratch, &mut map).map_err(RecordingError::picture(path))?;
    Ok(DisparityMap { width: map.width, height: map.height, px: map.metres })
}

/// Reads a PNG or JPEG as columns, rows and grey values, row-major, 0 to 1 as stored (not linearised): the luma of a
/// colour, and darker as it is more transparent. At most 8192 x 8192 pixels.
///
/// # Errors
/// As [`read_color`].
pub fn read_grey(path: &Path) -> Result<(u32, u32, Vec<f32>), RecordingError> {
    decode::grey(path).map_err(RecordingError::picture(path))
}

/// Writes a `.png`, `.jpg` or `.jpeg`.
///
/// # Errors
/// Another extension; the file exists and `force` is not set; it cannot be written.
pub fn write_color(path: &Path, image: &ColorImage, force: bool) -> Result<(), RecordingError> {
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    let mut file = Vec::new();
    let encoded = match extension.to_str() {
        Some("png") => encode::color_png(image, &mut file),
        Some("jpg" | "jpeg") => encode::color_jpeg(image, &mut file),
        _ => return Err(RecordingError::picture(path)(PictureFault::Extension("`.png` or `.jpg`"))),
    };
    write(path, encoded, &file, force)
}

/// Writes a 16-bit grey `.png` of `depth_scale` units per metre, where 0 is unknown and so is what lies beyond 65535
/// units; or a `.pfm` of metres as they are.
///
/// # Errors
/// As [`write_color`]; the scale is not a number > 0.
pub fn write_depth(path: &Path, depth: &DepthMap, depth_scale: f32, force: bool) -> Result<(), RecordingError> {
    check_depth_scale(depth_scale)?;
    let mut file = Vec::new();
    let encoded = match map_format(path)? {
        MapFormat::Pfm => {
            pfm::write(depth.width, depth.height, &depth.metres, &mut file);
            Ok(())
        }
        MapFormat::Png => encode::depth_png(depth, depth_scale, &mut Vec::new(), &mut file),
    };
    write(path, encoded, &file, force)
}

/// Writes a 16-bit grey `.png` of 256 units per pixel, where 0 is unknown and so is what lies beyond 65535 units
/// (KITTI); or a `.pfm` of pixels, where infinity is unknown (Middlebury).
///
/// # Errors
/// As [`write_color`].
pub fn write_disparity(path: &Path, disparity: &DisparityMap, force: bool) -> Result<(), RecordingError> {
    let mut file = Vec::new();
    let encoded = match map_format(path)? {
        MapFormat::Pfm => {
            let or_infinity = |&px: &f32| if DepthMap::is_known(px) { px } else { f32::INFINITY };
            let px: Vec<f32> = disparity.px.iter().map(or_infinity).collect();
            pfm::write(disparity.width, disparity.height, &px, &mut file);
            Ok(())
        }
        MapFormat::Png => encode::disparity_png(disparity, &mut file),
    };
    write(path, encoded, &file, force)
}

/// What depth and disparity maps are written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapFormat {
    /// 16-bit grey.
    Png,
    /// Floats.
    Pfm,
}

/// The format of a depth or disparity map of this name.
///
/// # Errors
/// It ends with something else than `.png` or `.pfm`.
pub fn map_format(path: &Path) -> Result<MapFormat, RecordingError> {
    if pfm::is_named(path) {
        Ok(MapFormat::Pfm)
    } else if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
        Ok(MapFormat::Png)
    } else {
        Err(RecordingError::picture(path)(PictureFault::Extension("`.png` or `.pfm`")))
    }
}

fn write(path: &Path, encoded: Result<(), ImageError>, file: &[u8], force: bool) -> Result<(), RecordingError> {
    encoded.map_err(|error| RecordingError::picture(path)(PictureFault::Encoding(error.to_string())))?;
    if !force && path.symlink_metadata().is_ok() {
        return Err(RecordingError::Exists { path: path.to_owned() });
    }
    whole::write(path, file)
}
