//! Photos, and the depth files next to them.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::options::Depth;
use super::{DepthChoice, DepthOrigin, Findings, OpenRequest, Options, Source, SourceError, SourceName};
use bokehcam::depth::FrameInput;
use bokehcam::depth::focus::FocusRule;
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam::look::Look;
use bokehcam_files::place;
use bokehcam_media::recording::depth_file::{self, DepthFile, DepthInside, Distances, EXTENSIONS};
use bokehcam_media::recording::embedded::Focus;
use bokehcam_media::recording::pictures::{self, MAP_SUFFIXES};
use bokehcam_media::recording::{mask_file, snapshot, still};

/// Suffix of a snapshot's picture before the blur.
const COLOR: &str = "-color";

/// Extensions of photos that may have a mask.
const PHOTOS: [&str; 10] = ["jpg", "jpeg", "png", "webp", "tif", "tiff", "heic", "heif", "bmp", "gif"];

/// Returns whether a file belongs to a photo beside it: a depth map by its name (`NAME-depth`, `NAME.depth` or
/// `NAME_depth`, of any format) or another [companion](pictures::is_companion), the mask of a photo that is there (`NAME-mask`, `NAME.mask` or `NAME_mask`), or the picture of a snapshot before the blur.
pub fn is_companion(path: &Path) -> bool {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let is_original = || {
        let snapshot = stem.strip_suffix(COLOR).map(|stem| path.with_file_name(format!("{stem}.png")));
        snapshot.is_some_and(|snapshot| snapshot::source_paths(&snapshot).0 == path && snapshot.is_file())
    };
    let is_mask = || {
        mask_file::picture_stem(&stem).is_some_and(|photo| {
            let has = |extension: &str| path.with_file_name(format!("{photo}.{extension}")).is_file();
            PHOTOS.iter().any(|extension| has(extension) || has(&extension.to_uppercase()))
        })
    };
    pictures::is_companion(path) || is_mask() || is_original()
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
    /// Whether it comes from a file, not from a network.
    pub measured: bool,
    /// A short description of its source.
    pub by: String,
    /// The photo's sharp original inside it, which is then the picture of the map.
    pub original: Option<ColorImage>,
    /// The focus that the photo was taken with, which replaces `auto`.
    pub focus: Option<FocusRule>,
}

/// Returns the default depth of the photo at `path` with the decoded picture `color`, as [`Source::open`] finds it; and
/// what was assumed or is wrong about it, a line each.
///
/// # Errors
/// Same as for [`Source::open`].
pub fn read_default_depth(
    path: &Path,
    color: &Arc<ColorImage>,
    options: &Options,
    look: &Look,
) -> Result<(Option<PhotoDepth>, Vec<String>), SourceError> {
    // A turned picture has to be read again: its depth is of the picture in the file.
    let is_own = options.frames.orientation.transform().is_identity();
    let request = OpenRequest { options, look: Some(look), photo: is_own.then(|| Arc::clone(color)) };
    let mut source = Source::open_requested(&SourceName::Photo(path.to_owned()), &request)?;
    let measured = !source.depth_from.is_replaceable();
    let Findings { notes, depth_by, focus, original, .. } = std::mem::take(&mut source.findings);
    let Source { depth: Some(depth), depth_from: from, networks, .. } = &mut source else { return Ok((None, notes)) };
    let mut map = DepthMap::default();
    let color = original.as_ref().unwrap_or(color);
    depth
        .read(FrameInput { stamp: Stamp { index: 0, time_ns: 0, captured_ns: None }, color, right: None }, &mut map)?;
    let (by, from) = (networks.take().or(depth_by).unwrap_or_default(), *from);
    // The source shares the original.
    drop(source);
    let original = original.map(Arc::unwrap_or_clone);
    Ok((Some(PhotoDepth { map, from, measured, by, original, focus }), notes))
}

/// Returns the files to read for a photo: the picture, and its depth file if there is one.
pub fn photo_files(path: &Path) -> impl Iterator<Item = PathBuf> {
    let original = original_path(path);
    let depth = find_depth_file(&original);
    [original].into_iter().chain(depth)
}

/// A photo, and its depth, if there is any.
pub(super) struct ReadPhoto {
    pub color: Arc<ColorImage>,
    pub depth: Option<DepthMap>,
    pub depth_from: DepthOrigin,
    pub findings: Findings,
}

/// Reads a photo, rotated upright; for a snapshot, its picture before the blur. Its depth is the file `NAME-depth`,
/// `NAME.depth` or `NAME_depth` next to it, or inside it as phones save it, unless the options request another origin. A photo with depth
/// inside is its sharp original, if that is inside, too.
///
/// # Errors
/// The photo or its depth file is unreadable, or the depth does not fit it. Depth inside that cannot be read is a note.
pub(super) fn read_photo(path: &Path, request: &OpenRequest) -> Result<ReadPhoto, SourceError> {
    let (path, options) = (&original_path(path), request.options);
    let color = request.photo.clone().map_or_else(|| still::read_color(path).map(Arc::new), Ok)?;
    let depth_from = DepthOrigin::Nothing;
    let mut photo = ReadPhoto { color, depth: None, depth_from, findings: Findings::default() };
    if !matches!(options.depth_choice, DepthChoice::Auto | DepthChoice::Recorded) {
        return Ok(photo);
    }
    if let Some(file) = find_depth_file(path) {
        let read = read_depth_file(&file, &options.depth, photo.color.size())?;
        photo.findings.notes = read.notes.iter().map(|note| format!("{}: {note}", file.display())).collect();
        photo.findings.depth_by = Some(format!("{}, beside it", file.display()));
        (photo.depth_from, photo.depth) = (read.distances.into(), Some(read.map));
        return Ok(photo);
    }
    match depth_file::read_inside(path, photo.color.size()) {
        Ok(Some(inside)) => {
            photo.take_inside(path, inside);
            photo.findings.notes.extend(options.depth.describe_unused("inside the photo, which says what it is"));
        }
        Ok(None) => {}
        Err(error) => photo.findings.notes.push(error.to_string()),
    }
    Ok(photo)
}

impl ReadPhoto {
    /// Takes the depth inside the photo `path`, and notes what of it is used.
    fn take_inside(&mut self, path: &Path, inside: DepthInside) {
        let DepthInside { depth, original, original_in_srgb, focus, kind } = inside;
        let (name, findings) = (path.display(), &mut self.findings);
        findings.notes.extend(depth.notes.iter().map(|note| format!("{name}: {note}")));
        findings.depth_by = Some(format!("{name} itself ({kind})"));
        (self.depth_from, self.depth) = (depth.distances.into(), Some(depth.map));
        if let Some(original) = original {
            let ([width, height], photo) = ([original.width, original.height], self.color.size());
            let size = match original.size() == photo {
                true => String::new(),
                false => format!(": {width}x{height} pixels, where the photo has {}x{}", photo.0, photo.1),
            };
            let note = format!("{name}: the original before the phone's own blur is inside, and is used{size}");
            findings.notes.push(note);
            let original = Arc::new(original);
            self.color = original_in_srgb.map_or_else(|| Arc::clone(&original), Arc::new);
            findings.original = Some(original);
        }
        findings.focus = focus.map(|focus| match focus {
            Focus::Point { x, y } => FocusRule::Point { x: x.clamp(0.0, 1.0), y: y.clamp(0.0, 1.0) },
            Focus::Distance(distance) if self.depth_from.is_relative() => {
                let farthest = self.depth.as_ref().and_then(DepthMap::farthest_m);
                FocusRule::at_relative(distance, farthest.unwrap_or(DepthMap::FAR_M))
            }
            Focus::Distance(distance) => FocusRule::Metres(distance),
        });
        if let Some(FocusRule::Point { x, y }) = findings.focus {
            findings.notes.push(format!("{name}: the focus is that of the photo, {x:.3},{y:.3}; --focus changes it"));
        }
    }
}

/// Reads the depth map `file` for a photo of `color` (columns, rows) pixels.
///
/// # Errors
/// Same as for [`depth_file::read`].
pub fn read_depth_file(file: &Path, options: &Depth, color: (u32, u32)) -> Result<DepthFile, SourceError> {
    Ok(depth_file::read(file, &options.of_photo(), color)?)
}

impl From<Distances> for DepthOrigin {
    fn from(distances: Distances) -> Self {
        match distances {
            Distances::Scaled => Self::Units,
            Distances::Metres => Self::Metres,
            Distances::Relative => Self::Relative,
        }
    }
}

/// Returns the depth file next to a photo.
fn find_depth_file(photo: &Path) -> Option<PathBuf> {
    depth_file_paths(photo).find(|file| file.is_file())
}

/// Returns whether `file` would be found as the depth file of `photo`, if it existed.
pub fn is_depth_file_of(file: &Path, photo: &Path) -> bool {
    let file = place::resolve_links(file);
    depth_file_paths(photo).any(|path| place::resolve_links(&path) == file)
}

/// Returns the paths of the depth file of a photo, in the order of the search.
fn depth_file_paths(photo: &Path) -> impl Iterator<Item = PathBuf> {
    let stem = photo.file_stem().and_then(OsStr::to_str).map(|stem| stem.strip_suffix(COLOR).unwrap_or(stem));
    let name = move |stem: &str, ending: &str, extension| photo.with_file_name(format!("{stem}{ending}.{extension}"));
    let of_stem = move |stem| {
        MAP_SUFFIXES.iter().flat_map(move |ending| EXTENSIONS.map(|extension| name(stem, ending, extension)))
    };
    stem.into_iter().flat_map(of_stem)
}
