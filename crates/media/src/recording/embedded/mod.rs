//! Depth inside photos: phones save a depth map, and often the sharp original, in the same file as the blurred picture.
//!
//! Three kinds are read, from JPEG and PNG: `GDepth` (Google, in XMP), Dynamic Depth 1.0 (pictures after the first one,
//! listed in XMP), and Apple's (pictures of a Multi-Picture file that XMP of their own describes).
//!
//! Memory is at most four times the file, and about 10 MB for the structure of its XMP: nothing is allocated by what a
//! file merely claims.

mod apple;
mod base64;
mod dynamic_depth;
mod gdepth;
mod multi_picture;
mod packets;
mod xmp;

use std::path::Path;

use self::packets::Packets;
use self::xmp::Xmp;
use super::fault::PictureFault;
use super::{coded, file_kind, heif};
use bokehcam::frame::DepthMap;

/// Depth found inside a photo, still encoded.
#[derive(Clone, Debug, PartialEq)]
pub struct EmbeddedDepth {
    /// The kind of container, for messages: `GDepth`, `Dynamic Depth` or `Apple`.
    pub kind: &'static str,
    /// A PNG or JPEG of grey values, 8 or 16 bits, or RGB(A) with equal channels. It covers the photo as stored, before
    /// any rotation, at any size.
    pub map: Vec<u8>,
    /// The meaning of the values in `map`.
    pub meaning: Meaning,
    /// Whether the distances are in metres, as the file says; otherwise only their ratios are known.
    pub is_metric: bool,
    /// The focus that the photo was taken with.
    pub focus: Option<Focus>,
    /// A PNG or JPEG: the picture before the phone's own blur.
    pub original: Option<Vec<u8>>,
}

/// The focus of a photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Focus {
    /// A point of the picture as stored, as fractions from its left and top, 0 to 1.
    Point {
        /// From the left.
        x: f32,
        /// From the top.
        y: f32,
    },
    /// A distance in the units of the depth, > 0.
    Distance(f32),
}

/// The meaning of a stored value `v`, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)] // Both ends of each range, in units of depth or, for disparity, of its inverse.
pub enum Meaning {
    /// `far near / (far - v (far - near))`, where 0 < near <= far.
    RangeInverse { near: f32, far: f32 },
    /// `near + v (far - near)`, where 0 <= near <= far.
    RangeLinear { near: f32, far: f32 },
    /// `1 / (min + v (max - min))`, where min <= max and max > 0.
    Disparity { min: f32, max: f32 },
    /// `min + v (max - min)`, where 0 <= min <= max.
    Depth { min: f32, max: f32 },
}

impl Meaning {
    /// Returns the depth of a stored value `v` in 0 to 1; 0 is unknown. A disparity of 0 or less is as far as relative
    /// depth gets.
    pub fn to_depth(self, v: f32) -> f32 {
        match self {
            // Inverse depth is linear in the value.
            Self::RangeInverse { near, far } => 1.0 / ((1.0 - v) / near + v / far),
            Self::RangeLinear { near: min, far: max } | Self::Depth { min, max } => min + v * (max - min),
            Self::Disparity { min, max } => {
                const MIN_NEARNESS: f32 = DepthMap::SUBJECT_M / DepthMap::FAR_M;
                let floor = if min > 0.0 { min } else { max * MIN_NEARNESS };
                (1.0 / (min + v * (max - min)).max(floor)).min(DepthMap::MAX_M)
            }
        }
    }

    /// Returns the meaning of a range in XMP, whose format is `RangeInverse` or `RangeLinear` (any case).
    fn of_range(format: &str, near: f32, far: f32) -> Result<Self, String> {
        let (meaning, min_near) = match format.trim().to_ascii_lowercase().as_str() {
            "rangeinverse" => (Self::RangeInverse { near, far }, DepthMap::MIN_M),
            "rangelinear" => (Self::RangeLinear { near, far }, 0.0),
            _ => return Err(format!("its format is {format:?}, neither RangeInverse nor RangeLinear")),
        };
        match (min_near..=far).contains(&near) && far <= DepthMap::MAX_M {
            true => Ok(meaning),
            false => Err(format!("its range is {near} to {far}")),
        }
    }
}

/// What a container holds, or why it cannot be read, in words.
type Found = Result<Option<EmbeddedDepth>, String>;
/// Looks for one kind of container in a file and its XMP.
type Finder = fn(&[u8], &Xmp) -> Found;

/// Finds the depth inside a photo, given its whole file; `None` if it claims to have none, or is no JPEG or PNG.
///
/// # Errors
/// [`PictureFault::EmbeddedDepth`]: the file claims to have depth whose parts are missing, truncated, damaged or of an
/// unknown form. The photo itself may be fine: warn, and go on without depth.
pub fn find(file: &[u8]) -> Result<Option<EmbeddedDepth>, PictureFault> {
    let packets = Packets::read(file);
    let xmp = Xmp::parse(&packets);
    let containers: [(&str, Finder); 3] = [
        (dynamic_depth::KIND, dynamic_depth::find),
        (gdepth::KIND, |_, xmp| gdepth::find(xmp)),
        (apple::KIND, apple::find),
    ];
    let mut first_fault = xmp.damage().map(|what| ("XMP", what.to_owned()));
    for (kind, find) in containers {
        match find(file, &xmp) {
            Ok(None) => {}
            Ok(found) => return Ok(found),
            Err(what) => first_fault = first_fault.or(Some((kind, what))),
        }
    }
    first_fault.map_or(Ok(None), |(kind, what)| Err(PictureFault::EmbeddedDepth { kind, what }))
}

/// Does the same as [`find`] for the file `path`, which may also be HEIC if `heif-convert` is installed.
///
/// # Errors
/// The same as for [`find`]; or the file cannot be read or converted.
pub fn read(path: &Path) -> Result<Option<EmbeddedDepth>, PictureFault> {
    let (file, kind) = coded::read_whole(path)?;
    if kind != Some(file_kind::HEIC) {
        return find(&file);
    }
    of_converted(&heif::convert(path)?)
}

/// Returns whether a file has the picture of another camera.
pub fn has_other_view(path: &Path) -> Result<bool, PictureFault> {
    let (file, _) = coded::read_whole(path)?;
    Ok(multi_picture::pictures(&file).any(|listed| listed.is_other_view()))
}

/// Returns the depth of a HEIC picture.
pub(super) fn of_converted(converted: &heif::Converted) -> Result<Option<EmbeddedDepth>, PictureFault> {
    let Some(depth) = &converted.depth else { return Ok(None) };
    let (map, _) = coded::read_whole(depth)?;
    if let Some(found) = find(&map)? {
        return Ok(Some(found));
    }
    tracing::warn!("heif-convert leaves out the range of the depth: only the order of distances is known");
    let meaning = Meaning::Disparity { min: 0.0, max: 1.0 };
    Ok(Some(EmbeddedDepth { kind: "HEIC", map, meaning, is_metric: false, focus: None, original: None }))
}

/// Returns whether a file begins as a PNG or JPEG does.
fn is_picture(file: &[u8]) -> bool {
    file.starts_with(b"\x89PNG\r\n\x1a\n") || file.starts_with(b"\xFF\xD8\xFF")
}

/// Returns whether a picture inside the file is whole, as far as its structure says.
fn is_complete(picture: &[u8]) -> bool {
    match picture.starts_with(b"\xFF\xD8\xFF") {
        true => bokehcam_jpeg::is_complete(picture),
        false => is_picture(picture) && picture.windows(4).any(|name| name == b"IEND"),
    }
}
