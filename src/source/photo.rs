//! Photos, and the depth files next to them.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::{DepthChoice, DepthOrigin, Options, Source, SourceError, SourceName};
use crate::depth::FrameInput;
use crate::files::input;
use crate::frame::{ColorImage, DepthMap, Stamp};
use crate::look::Look;
use crate::optics::StereoRig;
use crate::recording::still::{self, Map, PhotoFormat};
use crate::recording::{DepthUnit, snapshot};

/// Suffixes of depth files, after the photo's stem. The first is that of snapshots.
const DEPTH: [&str; 4] = ["-depth.pfm", "-depth.png", ".depth.pfm", ".depth.png"];
/// Suffix of a snapshot's picture before the blur.
const COLOR: &str = "-color";

/// Returns whether a file is a PNG or JPEG, by its first bytes.
pub fn is_photo(path: &Path) -> bool {
    read_format(path).is_some()
}

/// Returns the format of a picture by its first bytes; `None` if it is another one, or cannot be read.
pub fn read_format(path: &Path) -> Option<PhotoFormat> {
    let mut first = [0; 8];
    input::open(path).ok()?.read_exact(&mut first).ok()?;
    match first {
        [0xff, 0xd8, 0xff, ..] => Some(PhotoFormat::Jpeg),
        _ => (first == *b"\x89PNG\r\n\x1a\n").then_some(PhotoFormat::Png),
    }
}

/// Returns whether a file belongs to a photo beside it: a depth map by its name (`NAME-depth` or `NAME.depth`, of any
/// format), or the picture of a snapshot before the blur.
pub fn is_companion(path: &Path) -> bool {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let is_original = || {
        let snapshot = stem.strip_suffix(COLOR).map(|stem| path.with_file_name(format!("{stem}.png")));
        snapshot.is_some_and(|snapshot| snapshot::source_paths(&snapshot).0 == path && snapshot.is_file())
    };
    stem.ends_with("-depth") || stem.ends_with(".depth") || is_original()
}

/// Returns the picture to use for a photo: for a snapshot, its picture before the blur.
pub fn original_path(path: &Path) -> PathBuf {
    let before = snapshot::source_paths(path).0;
    if before.is_file() { before } else { path.to_owned() }
}

/// The depth of a photo.
pub struct PhotoDepth {
    /// The map, as measured or finished around a subject.
    pub map: DepthMap,
    /// Its origin.
    pub from: DepthOrigin,
    /// Whether refinement improves it.
    pub measured: bool,
    /// A short description of its source.
    pub by: String,
}

/// Returns the default depth of the photo at `path` with the colours `color`, as [`Source::open`] finds it.
///
/// # Errors
/// Same as for [`Source::open`].
pub fn read_default_depth(
    path: &Path,
    color: &ColorImage,
    options: &Options,
    look: &Look,
) -> Result<Option<PhotoDepth>, SourceError> {
    let mut source = Source::open(&SourceName::Photo(path.to_owned()), options, Some(look))?;
    let measured = source.is_measured();
    let Source { depth: Some(depth), depth_from: from, networks, .. } = &mut source else { return Ok(None) };
    let mut map = DepthMap::default();
    depth
        .read(FrameInput { stamp: Stamp { index: 0, time_ns: 0, captured_ns: None }, color, right: None }, &mut map)?;
    let describe_file = || find_depth_file(path).map(|file| format!("{}, beside it", file.display()));
    let by = networks.take().or_else(describe_file).unwrap_or_default();
    Ok(Some(PhotoDepth { map, from: *from, measured, by }))
}

/// Returns the files to read for a photo: the picture, and its depth file if there is one.
pub fn photo_files(path: &Path) -> impl Iterator<Item = PathBuf> {
    let original = original_path(path);
    let depth = find_depth_file(&original);
    [original].into_iter().chain(depth)
}

/// A photo, its depth if there is any, and the origin of the depth.
pub(super) type Photo = (ColorImage, Option<DepthMap>, DepthOrigin);

/// Reads a photo, rotated upright; for a snapshot, its picture before the blur. Its depth is the `.pfm` or `.png` file
/// `NAME-depth` or `NAME.depth` next to it, unless the options request another origin.
///
/// # Errors
/// The photo or its depth file is unreadable, or the depth has another size.
pub(super) fn read_photo(path: &Path, options: &Options) -> Result<Photo, SourceError> {
    let path = &original_path(path);
    let color = still::read_color(path)?;
    let is_wanted = matches!(options.depth_choice, DepthChoice::Auto | DepthChoice::Recorded);
    let Some(file) = find_depth_file(path).filter(|_| is_wanted) else {
        return Ok((color, None, DepthOrigin::Nothing));
    };
    let depth = &options.depth;
    let (map, from) = match depth.file_unit() {
        DepthUnit::Inverse { white_is_far } => {
            (still::read_inverse_depth(&file, white_is_far, color.size())?, DepthOrigin::Relative)
        }
        DepthUnit::Metres => {
            let (map, from) = match still::read_map(&file, depth.depth_scale, Some(depth.depth_invalid))? {
                Map::Depth(map) => (map, DepthOrigin::Units),
                Map::Disparity(map, Some(rig)) => (map.to_depth_map(|px| rig.depth_m(px)), DepthOrigin::Metres),
                Map::Disparity(map, None) => {
                    let rig = StereoRig::default_for_width(map.width);
                    (map.to_depth_map(|px| rig.depth_m(px)), DepthOrigin::Relative)
                }
            };
            still::check_depth_size(&file, map.size(), color.size())?;
            (map, from)
        }
    };
    Ok((color, Some(map), from))
}

/// Returns the depth file next to a photo.
fn find_depth_file(photo: &Path) -> Option<PathBuf> {
    let stem = photo.file_stem()?.to_str()?;
    let stem = stem.strip_suffix(COLOR).unwrap_or(stem);
    DEPTH.iter().map(|ending| photo.with_file_name(format!("{stem}{ending}"))).find(|file| file.is_file())
}
