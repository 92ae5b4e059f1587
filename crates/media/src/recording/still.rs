//! Reads and writes single pictures: colour, depth, disparity and grey.
//!
//! Files are written atomically, and replace existing ones only with `force`.

use std::fmt::Display;
use std::io::ErrorKind;
use std::path::Path;

use image::ImageFormat;

use super::depth_file::{self, Distances};
use super::encode::Raster;
use super::error::{RecordingError, Result};
use super::fault::PictureFault;
use super::file_kind::{self, FileKind};
pub use super::photo_metadata::PhotoFormat;
use super::photo_metadata::PhotoMetadata;
use super::unit::{DISPARITY_SCALE, MapUnit};
use super::{check_depth_scale, coded, decode, depth_covers, encode, luma, pfm, tiff_file};
use bokehcam::frame::{ColorImage, DepthMap, DisparityMap};
use bokehcam::optics::StereoRig;
use bokehcam_files::atomic_file;

/// Reads a PNG or JPEG (detected by content) as it is shown, in 8-bit sRGB, rotated upright by its orientation tag.
/// Grey is repeated, what is transparent is in front of white, 16 bits are rounded to 8. At most 16384 pixels a side, and 120 megapixels.
///
/// # Errors
/// The file is missing, not a PNG or JPEG, too large, truncated or damaged.
pub fn read_color(path: &Path) -> Result<ColorImage> {
    read_photo(path).map(|(image, _)| image)
}

/// Does the same as [`read_color`], and returns the metadata, whose orientation is then upright.
///
/// # Errors
/// Same as for [`read_color`].
pub fn read_photo(path: &Path) -> Result<(ColorImage, PhotoMetadata)> {
    decode::read_photo(path).map_err(RecordingError::picture(path))
}

/// Reads columns and rows of a PNG or JPEG from its header only, before its orientation tag turns it.
///
/// # Errors
/// The file is missing, not a PNG or JPEG, or too large.
pub fn read_size(path: &Path) -> Result<(u32, u32)> {
    coded::read_header(path).map(|(size, _)| size).map_err(RecordingError::picture(path))
}

/// Checks that the depth map `path` of `depth` (columns, rows) pixels covers a picture of `color` pixels.
///
/// # Errors
/// The map is larger, or of another aspect ratio.
pub fn check_depth_size(path: &Path, depth: (u32, u32), color: (u32, u32)) -> Result<()> {
    let fault = (!depth_covers(depth, color)).then_some(PictureFault::DepthSize { found: depth, color });
    fault.map_or(Ok(()), |fault| Err(RecordingError::picture(path)(fault)))
}

/// Reads a depth map in metres in its own size, in a format of [`depth_file::read`]. `depth_scale` is for whole numbers,
/// in units per metre.
///
/// # Errors
/// The file is missing, of another kind, too large, truncated or damaged; its distances are only relative; the scale is
/// not a number > 0.
pub fn read_depth(path: &Path, depth_scale: f32, invalid: Option<u16>) -> Result<DepthMap> {
    check_depth_scale(depth_scale)?;
    let (scale, invalid) = (Some(depth_scale), invalid.map(f32::from));
    let options = depth_file::Options { scale, invalid, ..depth_file::Options::default() };
    let read = depth_file::read_unfitted(path, &options).and_then(|file| match file.distances {
        Distances::Relative => Err(PictureFault::NotDepth("disparity")),
        Distances::Scaled | Distances::Metres => Ok(file.map),
    });
    read.map_err(RecordingError::picture(path))
}

/// Reads a disparity map in pixels from a file of floats, or from a 16-bit grey PNG of 256 units per pixel, where 0 is
/// unknown (KITTI). At most 16384 pixels a side, and 120 megapixels.
///
/// # Errors
/// Same as for [`read_depth`].
pub fn read_disparity(path: &Path) -> Result<DisparityMap> {
    depth_file::read_disparity(path).map_err(RecordingError::picture(path))
}

/// Reads a PNG or JPEG as width, height and grey values, row-major, 0 to 1 as stored (not linearised): luma for a
/// colour picture, multiplied by alpha. At most 16384 pixels a side, and 120 megapixels.
///
/// # Errors
/// Same as for [`read_color`].
pub fn read_grey(path: &Path) -> Result<(u32, u32, Vec<f32>)> {
    luma::read_grey(path).map_err(RecordingError::picture(path))
}

/// Reads the picture of an aperture, as [`read_grey`].
///
/// # Errors
/// Same as for [`read_color`]; or the picture is black.
pub fn read_aperture(path: &Path) -> Result<(u32, u32, Vec<f32>)> {
    let picture = read_grey(path)?;
    // An all-zero kernel cannot be normalised.
    let is_dark = picture.2.iter().all(|value| *value <= 0.0);
    if is_dark { Err(RecordingError::picture(path)(PictureFault::Dark)) } else { Ok(picture) }
}

/// Writes a `.png`, `.jpg`, `.jpeg`, `.tif`, `.tiff` or `.webp` file.
///
/// # Errors
/// The extension is another one; the file exists and `force` is not set; the file cannot be written.
pub fn write_color(path: &Path, image: &ColorImage, force: bool) -> Result<()> {
    write_photo(path, image, &PhotoMetadata::default(), force)
}

/// Does the same as [`write_color`], with metadata.
///
/// # Errors
/// Same as for [`write_color`].
pub fn write_photo(path: &Path, image: &ColorImage, metadata: &PhotoMetadata, force: bool) -> Result<()> {
    write_raster(path, &Raster::from(image), metadata, force)
}

/// Writes pixels in the format of the file name.
pub(super) fn write_raster(path: &Path, raster: &Raster, metadata: &PhotoMetadata, force: bool) -> Result<()> {
    let mut file = Vec::new();
    let encoded = match photo_format(path)? {
        PhotoFormat::Png => encode::encode_photo_png(raster, metadata, &mut file).map_err(|error| error.to_string()),
        PhotoFormat::Jpeg => encode::encode_photo_jpeg(raster, metadata, &mut file).map_err(|error| error.to_string()),
        PhotoFormat::Tiff => tiff_file::encode_photo(raster, metadata, &mut file).map_err(|error| error.to_string()),
        PhotoFormat::WebP => encode::encode_photo_webp(raster, metadata, &mut file).map_err(|error| error.to_string()),
    };
    write(path, encoded, &file, force)
}

/// Returns the picture format for a file name.
///
/// # Errors
/// The extension is not `.png`, `.jpg`, `.jpeg`, `.tif`, `.tiff` or `.webp`.
pub fn photo_format(path: &Path) -> Result<PhotoFormat> {
    match path.extension().unwrap_or_default().to_ascii_lowercase().to_str() {
        Some("png") => Ok(PhotoFormat::Png),
        Some("jpg" | "jpeg") => Ok(PhotoFormat::Jpeg),
        Some("tif" | "tiff") => Ok(PhotoFormat::Tiff),
        Some("webp") => Ok(PhotoFormat::WebP),
        _ => Err(RecordingError::picture(path)(PictureFault::Extension("`.png`, `.jpg`, `.tif` or `.webp`"))),
    }
}

/// Returns the format that suits the result of a picture, by the first bytes of its file: JPEG for JPEG and HEIC, else
/// PNG; `None` if it is no picture that is read.
pub fn result_format(path: &Path) -> Option<PhotoFormat> {
    match coded::read_kind(path)? {
        FileKind::Jpeg | file_kind::HEIC => Some(PhotoFormat::Jpeg),
        FileKind::Png | FileKind::Other(_) => Some(PhotoFormat::Png),
        FileKind::Pfm | FileKind::Foreign(..) => None,
    }
}

/// Returns whether a file is a photo, by its first bytes. A GIF is a video.
pub fn is_photo(path: &Path) -> bool {
    match coded::read_kind(path) {
        Some(FileKind::Other(format)) => format != ImageFormat::Gif,
        kind => matches!(kind, Some(FileKind::Png | FileKind::Jpeg | file_kind::HEIC)),
    }
}

/// Returns whether a file is a GIF, by its first bytes.
pub fn is_gif(path: &Path) -> bool {
    coded::read_kind(path) == Some(FileKind::Other(ImageFormat::Gif))
}

/// Writes a 16-bit grey `.png` of `depth_scale` units per metre, where 0 is unknown, as is depth beyond 65535 units; or
/// a `.pfm` in metres. The metadata of either file states that it holds depth (and the scale of a `.png`), so it can be
/// read back without options.
///
/// # Errors
/// Same as for [`write_color`]; or the scale is not a number > 0.
pub fn write_depth(path: &Path, depth: &DepthMap, depth_scale: f32, force: bool) -> Result<()> {
    check_depth_scale(depth_scale)?;
    let map_unit = MapUnit::Depth { per_m: depth_scale };
    write_map(path, depth.size(), &depth.metres, depth_scale, map_unit, force)
}

/// Writes a 16-bit grey `.png` of 256 units per pixel, where 0 is unknown, as is disparity beyond 65535 units (KITTI);
/// or a `.pfm` in pixels, where infinity is unknown (Middlebury). The metadata of either file states that it holds
/// disparity; that of a `.png` also has focal length and baseline if `rig` is given.
///
/// # Errors
/// Same as for [`write_color`].
pub fn write_disparity(path: &Path, disparity: &DisparityMap, rig: Option<StereoRig>, force: bool) -> Result<()> {
    let or_infinity = |&px: &f32| if DepthMap::is_known(px) { px } else { f32::INFINITY };
    let px: Vec<f32> = disparity.px.iter().map(or_infinity).collect();
    write_map(path, disparity.size(), &px, DISPARITY_SCALE, MapUnit::Disparity { rig }, force)
}

/// Writes numbers, of which a PNG has `scale` units per 1.0.
fn write_map(path: &Path, size: (u32, u32), numbers: &[f32], scale: f32, map_unit: MapUnit, force: bool) -> Result<()> {
    let mut file = Vec::new();
    let encoded = match map_format(path)? {
        MapFormat::Pfm => {
            pfm::encode_pfm(size, numbers, map_unit, &mut file);
            Ok(())
        }
        MapFormat::Png => encode::encode_png_16bit(size, numbers, scale, Some(map_unit), &mut Vec::new(), &mut file),
    };
    write(path, encoded, &file, force)
}

/// A file format for depth and disparity maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapFormat {
    /// 16-bit grey.
    Png,
    /// 32-bit floats.
    Pfm,
}

/// Returns the map format for a file name.
///
/// # Errors
/// The extension is not `.png` or `.pfm`.
pub fn map_format(path: &Path) -> Result<MapFormat> {
    match path.extension().unwrap_or_default().to_ascii_lowercase().to_str() {
        Some("pfm") => Ok(MapFormat::Pfm),
        Some("png") => Ok(MapFormat::Png),
        _ => Err(RecordingError::picture(path)(PictureFault::Extension("`.png` or `.pfm`"))),
    }
}

fn write<E: Display>(path: &Path, encoded: Result<(), E>, file: &[u8], force: bool) -> Result<()> {
    encoded.map_err(|error| RecordingError::picture(path)(PictureFault::Encoding(error.to_string())))?;
    atomic_file::write(path, file, force).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists if !force => RecordingError::Exists { path: path.to_owned() },
        _ => RecordingError::io("write", path)(error),
    })
}
