//! Errors of recordings and pictures: what is wrong, where, and what to do, in one line.

use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

use super::fault::{GeometryFault, LineFault, PictureFault};
use bokehcam::calibration::CalibrationError;
use bokehcam::depth::DepthError;
use bokehcam_files::folder::FolderError;

/// Result of reading or writing a recording or a picture.
pub type Result<T, E = RecordingError> = std::result::Result<T, E>;

/// An error in reading or writing a recording or a picture.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The folder contains no list of a known layout.
    #[error(
        "{}: not a recording: looked for {expected_files}, and found none of these; give the folder that contains \
         them", dir.display()
    )]
    NotARecording { dir: PathBuf, expected_files: String },
    /// A list that the layout needs is missing.
    #[error("{}: the list {missing} is missing beside {present}; restore it (lines of `time file`)", dir.display())]
    MissingList { dir: PathBuf, missing: &'static str, present: &'static str },
    /// Several lists pair colour with depth, and none has a usual name.
    #[error(
        "{}: {} and {} both pair pictures; rename the right one to associations.txt", dir.display(), lists[0], lists[1]
    )]
    TwoLists { dir: PathBuf, lists: [String; 2] },
    /// A list has no entries.
    #[error("{}: the list names no picture; add lines of `time file`, or remove the list", list.display())]
    EmptyList { list: PathBuf },
    /// A list is too long.
    #[error("{}: the list has more than {most} lines; split the recording", list.display())]
    LongList { list: PathBuf, most: usize },
    /// A folder that serves as a list has no pictures.
    #[error("{}: no picture here has a number as its name, such as 000000.png; restore the pictures", folder.display())]
    EmptyFolder { folder: PathBuf },
    /// A folder has too many files.
    #[error("{}: the folder has more than {most} pictures; split it", folder.display())]
    CrowdedFolder { folder: PathBuf, most: usize },
    /// No picture has a name of the pattern.
    #[error("{}: no picture has a name like {pattern}; correct the pattern, or give the folder", folder.display())]
    NoMatch { folder: PathBuf, pattern: String },
    /// Two pictures of one kind have the same name or number.
    #[error("{}: its name or number is also that of {other}; remove or rename one of them", path.display())]
    SameNumber { path: PathBuf, other: String },
    /// No depth map has the name or number of a colour picture.
    #[error(
        "{}: no depth map in {depth} has the name or number of a colour picture in {color}; number both alike, or pair \
         them in associations.txt (lines of `time file time file`)", dir.display()
    )]
    NoNumberPairs { dir: PathBuf, color: String, depth: String },
    /// A folder of depth maps does not belong to the pictures.
    #[error(
        "{}: {maps} depth maps for {pictures} pictures or more; export one for each, numbered or named alike",
        dir.display()
    )]
    MapCount { dir: PathBuf, maps: u64, pictures: u64 },
    /// A film must be converted first.
    #[error(
        "{0}/rgb.mp4: split it into pictures first, and give the folder again: mkdir '{0}/rgb' && ffmpeg -i \
         '{0}/rgb.mp4' -fps_mode passthrough -start_number 0 '{0}/rgb/%06d.png'", dir.display()
    )]
    Film { dir: PathBuf },
    /// A recording in a single file cannot be played.
    #[error("{}: {what}", path.display())]
    File {
        path: PathBuf,
        /// The fault, and what to do.
        what: String,
    },
    /// The file that states the depth scale is invalid.
    #[error("{}: {what}; correct it, or give the units per metre with --depth-scale", file.display())]
    StatedScale { file: PathBuf, what: String },
    /// One camera of a pair is missing.
    #[error("{}: {missing} is missing beside {present}; restore the pictures of the other camera", dir.display())]
    MissingEye { dir: PathBuf, missing: &'static str, present: &'static str },
    /// A picture of one camera has no counterpart of the other.
    #[error("{}: no picture of this name in {other}; restore it, remove this one, or use --keep-going", path.display())]
    NoPartner { path: PathBuf, other: &'static str },
    /// There are more pictures than times in the list.
    #[error("{}: the list has {times} times, but none for {picture}; complete the list, remove it, or use \
             --keep-going", list.display())]
    TooFewTimes { list: PathBuf, times: usize, picture: String },
    /// The calibration of a rectified pair is invalid.
    #[error("{}{}: {fault}", file.display(), line.map(|line| format!(":{line}")).unwrap_or_default())]
    Geometry {
        file: PathBuf,
        /// Line number, from 1, if a single line is at fault.
        line: Option<u32>,
        fault: GeometryFault,
    },
    /// The calibration of a raw pair is invalid.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// The calibration of the depth camera does not belong to the recording.
    #[error("{}: depth camera: {what}", dir.display())]
    DepthCalibration { dir: PathBuf, what: String },
    /// A line of a list is invalid.
    #[error("{}:{line}: {fault}", list.display())]
    Line {
        list: PathBuf,
        /// Line number, from 1.
        line: u32,
        fault: LineFault,
    },
    /// Both columns of the associations hold the same kind of picture, or none is readable.
    #[error(
        "{}: cannot tell colour from depth: no line has a readable colour picture beside a 16-bit grey PNG; \
         add rgb.txt or depth.txt, or restore the pictures", list.display()
    )]
    Columns { list: PathBuf },
    /// No depth map is close in time to a colour picture.
    #[error(
        "{}: no depth map lies within {} ms of any colour picture: are the lists of one recording, with times of one \
         clock? Correct the times, or remove depth.txt to use the colour alone", dir.display(), *tolerance_ns as f64 / 1e6
    )]
    NoPairs { dir: PathBuf, tolerance_ns: u64 },
    /// No picture of the right camera is close in time to one of the left camera.
    #[error(
        "{}: no picture of the right camera lies within {} ms of one of the left; are the lists of one recording?",
        dir.display(), *tolerance_ns as f64 / 1e6
    )]
    NoStereoPairs { dir: PathBuf, tolerance_ns: u64 },
    /// A picture in a list is missing or invalid.
    #[error(
        "{}:{line}: {}: {fault}{}", list.display(), file.display(),
        if matches!(fault, PictureFault::Missing) { "; restore it, or remove its line" } else { "" }
    )]
    Listed {
        list: PathBuf,
        /// Line number, from 1.
        line: u32,
        file: PathBuf,
        fault: PictureFault,
    },
    /// A picture is missing or invalid.
    #[error("{}: {fault}", path.display())]
    Picture { path: PathBuf, fault: PictureFault },
    /// Depth was requested, and the recording has none.
    #[error("{}: the recording has no depth; use an effect that needs none, or another source of depth", dir.display())]
    NoDepth { dir: PathBuf },
    /// A right picture was requested, and the recording has only one camera.
    #[error("{}: the recording has one camera, and stereo needs two; use another source of depth", dir.display())]
    NoRight { dir: PathBuf },
    /// The frame number is beyond the end.
    #[error("frame {index} was requested, but the recording has {len} frames, numbered from 0")]
    NoSuchFrame { index: usize, len: usize },
    /// The depth scale is not a number of units per metre.
    #[error("the depth scale is {0}; give units per metre, greater than 0, such as 5000 or 1000")]
    DepthScale(f32),
    /// The output exists already.
    #[error("{}: exists already; choose another name, or allow overwriting", path.display())]
    Exists { path: PathBuf },
    /// A frame cannot be added to the recording.
    #[error("frame {index} cannot be recorded: {reason}")]
    Unrecordable {
        /// Number of the frame, from 0.
        index: usize,
        reason: String,
    },
    /// A recording was finished without any frame.
    #[error("{}: nothing was recorded: no frame came in; check the source", dir.display())]
    NothingRecorded { dir: PathBuf },
    /// The output folder cannot be written.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// An operating system error.
    #[error("cannot {action} {}: {cause}", path.display())]
    Io { action: &'static str, path: PathBuf, cause: io::Error },
}

impl RecordingError {
    /// Returns a closure for `map_err` that creates [`RecordingError::Io`] for an action on `path`.
    pub(super) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |cause| Self::Io { action, path: path.to_owned(), cause }
    }

    /// Returns a closure for `map_err` that creates [`RecordingError::Unrecordable`] for frame `index`.
    pub(super) fn unrecordable<E: Display>(index: usize) -> impl FnOnce(E) -> Self {
        move |reason| Self::Unrecordable { index, reason: reason.to_string() }
    }

    /// Returns a closure for `map_err` that creates [`RecordingError::Picture`] for `path`.
    pub(super) fn picture(path: &Path) -> impl FnOnce(PictureFault) -> Self {
        move |fault| Self::Picture { path: path.to_owned(), fault }
    }
}

impl From<RecordingError> for DepthError {
    fn from(error: RecordingError) -> Self {
        Self::File(error.into())
    }
}
