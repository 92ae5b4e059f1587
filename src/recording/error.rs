//! What can be wrong with a recording or a picture: what, where, and what to do about it, in one line.

use std::io;
use std::path::{Path, PathBuf};

use super::MAX_SIDE_PX;
use crate::calibration::CalibrationError;

/// Why a recording or a picture could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The folder holds no list that any known layout starts from.
    #[error(
        "{}: not a recording: looked for {looked_for}, and found none of these; \
         name the folder that holds them", dir.display()
    )]
    NotARecording {
        /// The folder.
        dir: PathBuf,
        /// The files that would have made it a recording.
        looked_for: String,
    },
    /// The layout is known, and a list that it needs is missing.
    #[error("{}: the list {missing} is missing beside {present}; restore it (lines of `time file`)", dir.display())]
    MissingList {
        /// The folder.
        dir: PathBuf,
        /// The list that is needed.
        missing: &'static str,
        /// The list that is there.
        present: &'static str,
    },
    /// A list has no entry.
    #[error("{}: the list names no picture; add lines of `time file`, or remove the list", list.display())]
    EmptyList {
        /// The list.
        list: PathBuf,
    },
    /// A folder that is a list of its own has no picture.
    #[error("{}: no picture here has a number as its name, such as 000000.png; restore the pictures", folder.display())]
    EmptyFolder {
        /// The folder.
        folder: PathBuf,
    },
    /// One eye is there alone.
    #[error("{}: {missing} is missing beside {present}; restore the pictures of the other eye", dir.display())]
    MissingEye {
        /// The folder.
        dir: PathBuf,
        /// The folder that is needed.
        missing: &'static str,
        /// The folder that is there.
        present: &'static str,
    },
    /// A picture of one eye has none of the other eye beside it.
    #[error("{}: no picture of this name in {other}; restore it, remove this one, or keep going", path.display())]
    NoPartner {
        /// The picture.
        path: PathBuf,
        /// The folder of the other eye.
        other: &'static str,
    },
    /// There are pictures beyond the end of the list of times.
    #[error("{}: {times} times, and none for {picture}; complete the list, remove it, or keep going", list.display())]
    TooFewTimes {
        /// The list.
        list: PathBuf,
        /// How many times it has.
        times: usize,
        /// The first picture without one.
        picture: String,
    },
    /// The calibration of a rectified pair cannot be used.
    #[error("{}{}: {fault}", file.display(), line.map(|line| format!(":{line}")).unwrap_or_default())]
    Geometry {
        /// The calibration.
        file: PathBuf,
        /// Line number, from 1, where one line is at fault.
        line: Option<u32>,
        /// What is wrong with it.
        fault: GeometryFault,
    },
    /// The calibration of a raw pair cannot be used.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// A line of a list is wrong.
    #[error("{}:{line}: {fault}", list.display())]
    Line {
        /// The list.
        list: PathBuf,
        /// Line number, from 1.
        line: u32,
        /// What is wrong with it.
        fault: LineFault,
    },
    /// Both columns of the associations hold the same kind of picture, or none can be read.
    #[error(
        "{}: cannot tell colour from depth: no line has a readable colour picture beside a 16-bit grey PNG; \
         add rgb.txt or depth.txt, or restore the pictures", list.display()
    )]
    Columns {
        /// The list.
        list: PathBuf,
    },
    /// No depth map lies near any colour picture in time.
    #[error(
        "{}: no depth map lies within {} ms of any colour picture; raise the pairing tolerance, \
         or remove depth.txt to use the colour alone", dir.display(), *tolerance_ns as f64 / 1e6
    )]
    NoPairs {
        /// The folder.
        dir: PathBuf,
        /// Largest difference in time that makes a pair.
        tolerance_ns: u64,
    },
    /// No picture of the right eye lies near any of the left one in time.
    #[error(
        "{}: no picture of the right camera lies within {} ms of one of the left; are the lists of one recording?",
        dir.display(), *tolerance_ns as f64 / 1e6
    )]
    NoEyePairs {
        /// The folder.
        dir: PathBuf,
        /// Largest difference in time that makes a pair.
        tolerance_ns: u64,
    },
    /// A picture that a list names is missing or wrong.
    #[error("{}:{line}: {}: {fault}", list.display(), file.display())]
    Listed {
        /// The list.
        list: PathBuf,
        /// Line number, from 1.
        line: u32,
        /// The file as the list names it.
        file: PathBuf,
        /// What is wrong with it.
        fault: PictureFault,
    },
    /// A picture is missing or wrong.
    #[error("{}: {fault}", path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        fault: PictureFault,
    },
    /// The recording has no depth, and it was asked for.
    #[error("{}: the recording has no depth; use an effect that needs none, or another source of depth", dir.display())]
    NoDepth {
        /// The folder.
        dir: PathBuf,
    },
    /// The recording has one eye, and the right one was asked for.
    #[error("{}: the recording has one eye, and stereo needs two; use another source of depth", dir.display())]
    NoRight {
        /// The folder.
        dir: PathBuf,
    },
    /// A frame number beyond the end.
    #[error("frame {index} was asked for, and the recording has {len}, numbered from 0")]
    NoSuchFrame {
        /// What was asked for.
        index: usize,
        /// How many there are.
        len: usize,
    },
    /// The depth scale is not a number of units per metre.
    #[error("the depth scale is {0}; give units per metre, greater than 0, such as 5000 or 1000")]
    DepthScale(f32),
    /// Something is already where the output should go.
    #[error("{}: already there; choose another name, or ask for it to be overwritten", path.display())]
    Exists {
        /// The file or folder.
        path: PathBuf,
    },
    /// A frame cannot become part of the recording that is being written.
    #[error("frame {index} cannot be recorded: {reason}")]
    Unrecordable {
        /// Number of the frame, from 0.
        index: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// A recording was finished before its first frame.
    #[error("{}: nothing was recorded: no frame came in; check the source", dir.display())]
    NothingRecorded {
        /// The folder.
        dir: PathBuf,
    },
    /// The operating system refused.
    #[error("cannot {action} {}: {cause}", path.display())]
    Io {
        /// What was being done.
        action: &'static str,
        /// To which file or folder.
        path: PathBuf,
        /// Why not.
        cause: io::Error,
    },
}

impl RecordingError {
    /// For `map_err`: a [`RecordingError::Io`] that says what was being done to `path`.
    pub(super) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |cause| Self::Io { action, path: path.to_owned(), cause }
    }

    /// For `map_err`: what is wrong with the picture at `path`.
    pub(super) fn picture(path: &Path) -> impl FnOnce(PictureFault) -> Self {
        move |fault| Self::Picture { path: path.to_owned(), fault }
    }
}

/// What is wrong with a line of a list.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineFault {
    /// The bytes are not text.
    #[error("the line is not UTF-8 text; save the list as UTF-8")]
    NotUtf8,
    /// Columns are missing or too many.
    #[error("expected `{expected}`, found {found} column(s); correct or remove the line")]
    Columns {
        /// The columns that the list has.
        expected: &'static str,
        /// How many the line has.
        found: usize,
    },
    /// Not a time in nanoseconds.
    #[error("{0:?} is not a time; write nanoseconds as a whole number, such as 1403715276262142976")]
    Nanoseconds(String),
    /// Not a time.
    #[error("{0:?} is not a time; write seconds >= 0 as a decimal number, such as 1305031102.175304")]
    Time(String),
    /// The time repeats, or goes back.
    #[error("the time is out of order or repeated; sort the list by time, and name each time once")]
    OutOfOrder,
    /// The path leaves the folder of the recording.
    #[error("{} points outside the recording; name a file inside its folder", .0.display())]
    Outside(PathBuf),
    /// The path cannot be one.
    #[error("the file name {0:?} has control characters; rename the file")]
    FileName(String),
}

/// What is wrong with the calibration of a rectified pair.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeometryFault {
    /// The file is of another kind.
    #[error("neither a Middlebury calibration (`cam0=[f 0 cx; 0 f cy; 0 0 1]`) nor a KITTI one (`P0: 12 numbers`)")]
    Unknown,
    /// A key that is needed is not there.
    #[error("the key {0} is missing; add its line")]
    Missing(String),
    /// A value is not what its key needs.
    #[error("{key}: {found:?} is not {expected}; correct the line")]
    Value {
        /// The key.
        key: String,
        /// What a value of it is.
        expected: &'static str,
        /// What is there.
        found: String,
    },
    /// Both eyes in one place see no depth.
    #[error("the baseline is 0: both cameras stand in one place; give the calibration of the two eyes")]
    NoBaseline,
    /// The right eye stands on the left.
    #[error("the right camera stands {0} m to the left of the left one; swap the eyes")]
    Swapped(f64),
    /// Rectified eyes have one focal length.
    #[error("the left focal length is {0} px and the right one {1} px; give the calibration of rectified pictures")]
    UnequalFocal(f64, f64),
    /// The calibration belongs to pictures of another shape.
    #[error(
        "made for pictures of {}x{}, and these are {}x{}, of another aspect; give the calibration of these pictures",
        of.0, of.1, pictures.0, pictures.1
    )]
    Size {
        /// Columns and rows that the calibration belongs to.
        of: (u32, u32),
        /// Columns and rows of the pictures.
        pictures: (u32, u32),
    },
}

/// What is wrong with a picture file.
#[derive(Debug, thiserror::Error)]
pub enum PictureFault {
    /// There is no such file.
    #[error("there is no such file; restore it, or remove what refers to it")]
    Missing,
    /// A link leads out of the recording.
    #[error("a link leads outside the recording; put the file itself inside the folder")]
    Outside,
    /// A folder, a pipe or a device.
    #[error("not a regular file; name a picture file")]
    NotAFile,
    /// The operating system refused.
    #[error("cannot be read: {0}")]
    Io(#[from] io::Error),
    /// Another format than those that are read here.
    #[error("not a {0} file; convert it")]
    Format(&'static str),
    /// The header claims more than is decoded.
    #[error("its header claims {width}x{height} pixels, and at most {max}x{max} are read; scale it down", max = MAX_SIDE_PX)]
    TooLarge {
        /// Columns claimed.
        width: u32,
        /// Rows claimed.
        height: u32,
    },
    /// The file is larger than any picture that is read here.
    #[error("the file has {bytes} bytes, more than any picture read here; convert it")]
    FileSize {
        /// Size of the file.
        bytes: u64,
    },
    /// The picture has no pixel.
    #[error("the picture has no pixel ({width}x{height}); export it again")]
    NoPixel {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The data stops early.
    #[error("the file ends before the picture does; copy or export it again")]
    Truncated,
    /// The data makes no sense.
    #[error("damaged ({0}); copy or export it again")]
    Damaged(String),
    /// A colour picture of another size than the first one.
    #[error(
        "the picture is {}x{}, and the recording began with {}x{}; all its colour pictures need one size",
        found.0, found.1, expected.0, expected.1
    )]
    Size {
        /// Columns and rows of this picture.
        found: (u32, u32),
        /// Columns and rows of the first picture.
        expected: (u32, u32),
    },
    /// A right picture of another size than the left ones.
    #[error(
        "the right picture is {}x{}, and the left one {}x{}; both eyes need one size",
        found.0, found.1, left.0, left.1
    )]
    EyeSize {
        /// Columns and rows of this picture.
        found: (u32, u32),
        /// Columns and rows of the left pictures.
        left: (u32, u32),
    },
    /// A depth map that cannot cover the view of its colour picture.
    #[error(
        "the depth map is {}x{}, which does not cover a colour picture of {}x{}; \
         export it at that size, or smaller with the same aspect",
        found.0, found.1, color.0, color.1
    )]
    DepthSize {
        /// Columns and rows of the depth map.
        found: (u32, u32),
        /// Columns and rows of the colour pictures.
        color: (u32, u32),
    },
    /// No picture can be written under this name.
    #[error("no format is known for this name; end it with {0}")]
    Extension(&'static str),
    /// The pixels do not make a picture.
    #[error("cannot be encoded: {0}")]
    Encoding(String),
    /// A picture that holds something else than depth.
    #[error("{0} is not depth; export depth as a 16-bit grey PNG")]
    NotDepth(&'static str),
}
