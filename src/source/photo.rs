//! Photos, and the files beside them that have their depth.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::{DepthChoice, DepthFrom, Options, Source, SourceError, SourceName};
use crate::depth::Seen;
use crate::frame::{ColorImage, DepthMap, Stamp};
use crate::look::Look;
use crate::optics::StereoRig;
use crate::recording::{DepthUnit, snapshot, still, still::Map};

/// What follows the name of a photo in that of its depth. The first is that of a snapshot.
const DEPTH: [&str; 4] = ["-depth.pfm", "-depth.png", ".depth.pfm", ".depth.png"];
/// What follows the name of a snapshot in that of the picture before the blur.
const COLOR: &str = "-color";

/// Whether a file is a picture that can be read, by its first bytes: PNG or JPEG.
pub fn is_photo(path: &Path) -> bool {
    let mut first = [0; 8];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut first));
    read.is_ok() && (first == *b"\x89PNG\r\n\x1a\n" || first.starts_with(&[0xff, 0xd8, 0xff]))
}

/// The picture that a photo stands for: of a snapshot, the one that it was made of.
pub fn original(path: &Path) -> PathBuf {
    let before = snapshot::sources(path).0;
    if before.is_file() { before } else { path.to_owned() }
}

/// The depth of a photo.
pub struct PhotoDepth {
    /// As it was measured, or finished around a subject.
    pub map: DepthMap,
    /// What it comes from.
    pub from: DepthFrom,
    /// Whether refinement improves it.
    pub measured: bool,
    /// What gives it, in a few words.
    pub by: String,
}

/// The depth that the photo at `path`, of the colours `color`, has where nothing else was said: as for [`Source::open`].
///
/// # Errors
/// As for [`Source::open`].
pub fn depth_of(
    path: &Path,
    color: &ColorImage,
    options: &Options,
    look: &Look,
) -> Result<Option<PhotoDepth>, SourceError> {
    let mut source = Source::open(&SourceName::Photo(path.to_owned()), options, Some(look))?;
    let measured = source.is_measured();
    let Source { depth: Some(depth), depth_from: from, networks, .. } = &mut source else { return Ok(None) };
    let mut map = DepthMap::default();
    depth.read(Seen { stamp: Stamp { index: 0, time_ns: 0, captured_ns: None }, color, right: None }, &mut map)?;
    let beside = || depth_file(path).map(|file| format!("{}, beside it", file.display()));
    let by = networks.take().or_else(beside).unwrap_or_default();
    Ok(Some(PhotoDepth { map, from: *from, measured, by }))
}

/// The files that are read for a photo: what it stands for, and its depth beside it.
pub fn files_of(path: &Path) -> impl Iterator<Item = PathBuf> {
    let original = original(path);
    let depth = depth_file(&original);
    [original].into_iter().chain(depth)
}

/// A photo, its depth if there is any beside it, and what that depth is.
pub(super) type Photo = (ColorImage, Option<DepthMap>, DepthFrom);

/// Reads a photo upright; of a snapshot, the picture that it was made of. Its depth is the file `NAME-depth` or `NAME.depth`
/// beside it, a `.pfm` or `.png`, unless another is asked for.
///
/// # Errors
/// It cannot be read, or what is named as its depth cannot, or is of another size.
pub(super) fn read(path: &Path, options: &Options) -> Result<Photo, SourceError> {
    let path = &original(path);
    let color = still::read_color(path)?;
    let is_wanted = matches!(options.depth_choice, DepthChoice::Auto | DepthChoice::Recorded);
    let Some(file) = depth_file(path).filter(|_| is_wanted) else { return Ok((color, None, DepthFrom::Nothing)) };
    let depth = &options.depth;
    let (map, from) = match depth.file_unit() {
        DepthUnit::Inverse { white_is_far } => {
            (still::read_inverse_depth(&file, white_is_far, color.size())?, DepthFrom::Relative)
        }
        DepthUnit::Metres => {
            let (map, from) = match still::read_map(&file, depth.depth_scale, Some(depth.depth_invalid))? {
                Map::Depth(map) => (map, DepthFrom::Units),
                Map::Disparity(map, Some(rig)) => (map.depth(|px| rig.depth_m(px)), DepthFrom::Metres),
                Map::Disparity(map, None) => {
                    let rig = StereoRig::assumed(map.width);
                    (map.depth(|px| rig.depth_m(px)), DepthFrom::Relative)
                }
            };
            still::check_depth_size(&file, map.size(), color.size())?;
            (map, from)
        }
    };
    Ok((color, Some(map), from))
}

/// The file beside a photo that has its depth.
fn depth_file(photo: &Path) -> Option<PathBuf> {
    let stem = photo.file_stem()?.to_str()?;
    let stem = stem.strip_suffix(COLOR).unwrap_or(stem);
    DEPTH.iter().map(|ending| photo.with_file_name(format!("{stem}{ending}"))).find(|file| file.is_file())
}
