//! The common form of all layouts: frames whose pictures are still on disk.

use std::collections::{HashMap, HashSet};
use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::coded::EncodedPicture;
use super::decode::{self, DepthUnits, Scratch};
use super::decoders::check_size;
use super::error::RecordingError;
use super::fault::{LineFault, PictureFault, ReadResult};
use super::raw_image::{self, RawImage};
use super::slow_search::SlowSearch;
use super::{DepthUnit, Options, StereoGeometry, Unpaired};
use bokehcam::calibration::registration::RgbdCalibration;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::optics::StereoRig;

/// A recording layout: its detection and its reader.
pub(super) struct Layout {
    /// The name for users, such as `TUM RGB-D`.
    pub(super) name: &'static str,
    /// The files that identify it, for messages.
    pub(super) expected_files: &'static str,
    /// Whether a folder or file has this layout.
    pub(super) matches: fn(&Path) -> bool,
    /// Reads its lists and calibrations.
    pub(super) open: fn(&RecordingFolder, &Options) -> Result<Contents, RecordingError>,
}

impl Layout {
    /// Returns the files that identify it, and its name, for messages.
    pub(super) fn describe_files(&self) -> String {
        format!("{} ({})", self.expected_files, self.name)
    }
}

/// The content of a recording.
#[derive(Debug, Default)]
pub(super) struct Contents {
    pub(super) frames: Vec<ListedFrame>,
    pub(super) depth: Option<DepthFormat>,
    /// For depth of another camera's view.
    pub(super) depth_calibration: Option<RgbdCalibration>,
    pub(super) stereo_geometry: Option<StereoGeometry>,
    /// Number of disparities to search, from 0, if stated: a multiple of 16.
    pub(super) disparity_count: Option<u32>,
    pub(super) unpaired: Unpaired,
    /// Whether times are recorded; otherwise [`Options::period_ns`] counts.
    pub(super) has_times: bool,
    /// Whether colour pictures are photos, turned upright by their orientation tags.
    pub(super) are_photos: bool,
    /// Whether these are scenes that [`Options::size`] has chosen.
    pub(super) is_chosen_by_size: bool,
    /// A folder of depth maps outside the recording's, with all links resolved.
    pub(super) maps_root: Option<PathBuf>,
    /// The pictures of a recording in a single file; those of the frames then only have names for messages.
    pub(super) container: Option<Box<dyn Container>>,
}

/// The pictures of a recording in a single file, by the number of their frame, which must exist. Several threads may
/// read at once.
pub(super) trait Container: Debug + Send + Sync {
    /// Reads a colour picture as it is stored, into `bytes`.
    fn read_stored_color<'a>(&self, frame: usize, bytes: &'a mut Vec<u8>) -> ReadResult<StoredColor<'a>>;

    /// Reads depth in metres, 0 = unknown, of the view of a picture of `size`: that of the colour camera, or of the depth
    /// camera if there is a calibration. Its own size is any.
    fn read_depth(&self, frame: usize, size: (u32, u32), scratch: &mut Scratch, into: &mut DepthMap) -> ReadResult;

    /// Reads width and height of a colour picture.
    fn read_size(&self, frame: usize) -> ReadResult<(u32, u32)> {
        let size = match self.read_stored_color(frame, &mut Vec::new())? {
            StoredColor::Encoded(data) => EncodedPicture::open_bytes(data)?.size(),
            StoredColor::Raw(image) | StoredColor::Nv12(image) => image.size,
        };
        check_size(size.0, size.1).map(|()| size)
    }

    /// Reads a colour picture. Rejects one whose size is not `expected`.
    fn read_color(
        &self,
        frame: usize,
        expected: (u32, u32),
        scratch: &mut Scratch,
        into: &mut ColorImage,
    ) -> ReadResult {
        match self.read_stored_color(frame, &mut scratch.file)? {
            StoredColor::Encoded(data) => {
                let coded = EncodedPicture::open_bytes(data)?;
                decode::decode_color(coded, Some(expected), &mut scratch.pixels, into).map(drop)
            }
            StoredColor::Raw(image) => {
                decode::check_color_size(image.size, expected)?;
                raw_image::decode_color(&image, into)
            }
            StoredColor::Nv12(image) => raw_image::decode_nv12(&image, into),
        }
    }
}

/// Warns that a recording's file has faults.
pub(super) fn warn_of_damage(name: &str, damage: Option<&str>) {
    if let Some(damage) = damage {
        tracing::warn!("{name}: damaged: {damage}; the intact part is played");
    }
}

/// A colour picture in a recording's file.
pub(super) enum StoredColor<'a> {
    /// A PNG or JPEG.
    Encoded(&'a [u8]),
    Raw(RawImage<'a>),
    /// [`raw_image::decode_nv12`] decodes it.
    Nv12(RawImage<'a>),
}

/// A frame of a list. Known times increase strictly.
#[derive(Debug)]
pub(super) struct ListedFrame {
    pub(super) time_ns: Option<u64>,
    pub(super) color: PictureSource,
    pub(super) right: Option<PictureSource>,
    pub(super) depth: Option<PictureSource>,
}

/// The encoding of depth.
#[derive(Clone, Copy, Debug)]
pub(super) enum DepthFormat {
    Units(DepthUnits),
    /// The same, in units that the layout states.
    StatedUnits(DepthUnits),
    /// Relative inverse depth in grey pictures: black is the farthest and white the nearest, or the other way round.
    Inverse {
        white_is_far: bool,
        /// A code that means unknown.
        invalid: Option<u16>,
    },
    /// Disparities in a PFM; the rig belongs to the colour pictures at their size.
    Disparity(StereoRig),
}

impl DepthFormat {
    /// Returns the format of depth pictures that are read with `options`, and have `scale` units per metre by default.
    pub(super) fn of_pictures(options: &Options, scale: f32) -> Self {
        match options.depth_unit {
            DepthUnit::Inverse => Self::Inverse {
                white_is_far: options.depth_invert,
                // 0 is the farthest or the nearest.
                invalid: options.depth_invalid.filter(|&invalid| invalid != 0),
            },
            unit => {
                let scale = unit.units_per_m().or(options.depth_scale).unwrap_or(scale);
                Self::Units(DepthUnits { scale, invalid: options.depth_invalid })
            }
        }
    }
}

/// The folder of a recording.
#[derive(Debug)]
pub(super) struct RecordingFolder {
    /// The path as given, for messages.
    pub(super) dir: PathBuf,
    /// The path with all links resolved: no picture may lie outside it, unless links are followed.
    pub(super) root: PathBuf,
    /// The same for a folder of depth maps outside, if there is one.
    pub(super) maps_root: Option<PathBuf>,
    /// Whether links may lead outside.
    pub(super) follow_links: bool,
}

/// A line of a list, for messages.
#[derive(Clone, Debug)]
pub(super) struct ListPosition {
    /// Its file, relative to the recording's folder; shared by all lines.
    pub(super) list: Arc<str>,
    pub(super) line: u32,
}

/// A picture, and the line that names it.
#[derive(Clone, Debug)]
pub(super) struct PictureSource {
    /// `None` if it was found in its folder instead of a list.
    pub(super) position: Option<ListPosition>,
    /// Path relative to the recording's folder. Only a picture with a `position` can have a fault.
    pub(super) file: Result<PathBuf, LineFault>,
}

impl RecordingFolder {
    /// Returns the path of a picture with all links resolved.
    pub(super) fn locate(&self, source: &PictureSource) -> Result<PathBuf, RecordingError> {
        let path = self.root.join(source.file(&self.dir)?);
        // A path that cannot be resolved cannot be read either, and the reader reports why.
        self.within(path.canonicalize().unwrap_or(path), source)
    }

    fn within(&self, path: PathBuf, source: &PictureSource) -> Result<PathBuf, RecordingError> {
        let is_inside =
            [Some(&self.root), self.maps_root.as_ref()].into_iter().flatten().any(|root| path.starts_with(root));
        match self.follow_links || is_inside {
            true => Ok(path),
            false => Err(source.error(&self.dir, PictureFault::Outside)),
        }
    }
}

/// Number of folders that a [`Locator`] caches.
const MAX_FOLDERS: usize = 64;

/// Locates the pictures of long lists: caches resolved folders, and warns if it takes long.
pub(super) struct Locator<'a> {
    folder: &'a RecordingFolder,
    resolved: HashMap<PathBuf, PathBuf>,
    search: SlowSearch,
}

impl<'a> Locator<'a> {
    pub(super) fn new(folder: &'a RecordingFolder) -> Self {
        Self { folder, resolved: HashMap::new(), search: SlowSearch::begin() }
    }

    /// Same as [`RecordingFolder::locate`].
    pub(super) fn locate(&mut self, source: &PictureSource) -> Result<PathBuf, RecordingError> {
        self.search.warn_if_slow(self.folder.dir.display(), "searching the pictures for a readable one");
        let path = self.folder.root.join(source.file(&self.folder.dir)?);
        let (Some(parent), Some(name)) = (path.parent(), path.file_name()) else { return self.folder.locate(source) };
        if self.resolved.len() > MAX_FOLDERS {
            self.resolved.clear();
        }
        let resolve = || parent.canonicalize().unwrap_or_else(|_| parent.to_owned());
        let there = self.resolved.entry(parent.to_owned()).or_insert_with(resolve).join(name);
        // The picture itself may be a link.
        if there.is_symlink() { self.folder.locate(source) } else { self.folder.within(there, source) }
    }
}

impl PictureSource {
    /// Creates a source for a picture that is in no list.
    pub(super) fn from_path(file: PathBuf) -> Self {
        Self { position: None, file: Ok(file) }
    }

    /// Returns the file, or the fault of the line that should name it.
    pub(super) fn file(&self, dir: &Path) -> Result<&Path, RecordingError> {
        self.file.as_deref().map_err(|fault| {
            let (list, line) = self.position.as_ref().map_or((dir.to_owned(), 0), |at| (dir.join(&*at.list), at.line));
            RecordingError::Line { list, line, fault: fault.clone() }
        })
    }

    /// Returns the error for a picture with `fault`, with the line that names it.
    pub(super) fn error(&self, dir: &Path, fault: PictureFault) -> RecordingError {
        let file = self.file.clone().unwrap_or_default();
        match &self.position {
            Some(ListPosition { list, line }) => {
                RecordingError::Listed { list: dir.join(&**list), line: *line, file, fault }
            }
            None => RecordingError::Picture { path: dir.join(file), fault },
        }
    }
}

/// Returns the size of the first colour picture with a readable header, or else the error of the first one. `colors`
/// names the colour pictures of all frames.
pub(super) fn read_first_size<'a>(
    folder: &RecordingFolder,
    container: Option<&dyn Container>,
    colors: impl Iterator<Item = &'a PictureSource>,
    read_size: fn(&Path) -> ReadResult<(u32, u32)>,
) -> Result<(u32, u32), RecordingError> {
    let (mut first_error, mut locator) = (None, Locator::new(folder));
    // A list may name an unreadable file many times: open it once.
    let mut unreadable = HashSet::new();
    for (frame, source) in colors.enumerate() {
        let fault = |fault| source.error(&folder.dir, fault);
        let size = match container {
            Some(container) => container.read_size(frame).map(Some).map_err(fault),
            None => locator.locate(source).and_then(|path| {
                if unreadable.contains(&path) {
                    return Ok(None);
                }
                let size = read_size(&path).map_err(fault);
                unreadable.insert(path);
                size.map(Some)
            }),
        };
        match size {
            Ok(Some(size)) => return Ok(size),
            Ok(None) => {}
            Err(error) => first_error = first_error.or(Some(error)),
        }
    }
    Err(first_error.unwrap_or_else(|| RecordingError::EmptyList { list: folder.dir.clone() }))
}
