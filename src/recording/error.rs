//! What can be wrong with a recording or a picture: what, where, and what to do about it, in one line.

use std::io;
use std::path::{Path, PathBuf};

use super::fault::{GeometryFault, LineFault, PictureFault};
use crate::calibration::CalibrationError;
use crate::files::folder::FolderError;

/// Why a recording or a picture could not be read or written.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The folder holds no list that any known layout starts from.
    #[error(
        "{}: not a recording: looked for {looked_for}, and found none of these; \
         name the folder that holds them", dir.display()
    )]
    NotARecording {
        dir: PathBuf,
        /// The files that would have made it a recording.
        looked_for: String,
    },
    /// The layout is known, and a list that it needs is missing.
    #[error("{}: the list {missing} is missing beside {present}; restore it (lines of `time file`)", dir.display())]
    MissingList {
        dir: PathBuf,
        /// The list that is needed.
        missing: &'static str,
        /// The list that is there.
        present: &'static str,
    },
    /// A list has no entry.
    #[error("{}: the list names no picture; add lines of `time file`, or remove the list", list.display())]
    EmptyList { list: PathBuf },
    /// A list has more entries than any recording.
    #[error("{}: the list has more than {most} lines; split the recording", list.display())]
    LongList {
        list: PathBuf,
        /// How many are read.
        most: usize,
    },
    /// A folder that is a list of its own has no picture.
    #[error("{}: no picture here has a number as its name, such as 000000.png; restore the pictures", folder.display())]
    EmptyFolder { folder: PathBuf },
    /// One eye is there alone.
    #[error("{}: {missing} is missing beside {present}; restore the pictures of the other eye", dir.display())]
    MissingEye {
        dir: PathBuf,
        /// The folder that is needed.
        missing: &'static str,
        /// The folder that is there.
        present: &'static str,
    },
    /// A picture of one eye has none of the other eye beside it.
    #[error("{}: no picture of this name in {other}; restore it, remove this one, or keep going", path.display())]
    NoPartner {
        path: PathBuf,
        /// The folder of the other eye.
        other: &'static str,
    },
    /// There are pictures beyond the end of the list of times.
    #[error("{}: {times} times, and none for {picture}; complete the list, remove it, or keep going", list.display())]
    TooFewTimes {
        list: PathBuf,
        /// How many times it has.
        times: usize,
        /// The first picture without one.
        picture: String,
    },
    /// The calibration of a rectified pair cannot be used.
    #[error("{}{}: {fault}", file.display(), line.map(|line| format!(":{line}")).unwrap_or_default())]
    Geometry {
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
    Columns { list: PathBuf },
    /// No depth map lies near any colour picture in time.
    #[error(
        "{}: no depth map lies within {} ms of any colour picture: are the lists of one recording, with times of one \
         clock? Correct the times, or remove depth.txt to use the colour alone", dir.display(), *tolerance_ns as f64 / 1e6
    )]
    NoPairs {
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
        dir: PathBuf,
        /// Largest difference in time that makes a pair.
        tolerance_ns: u64,
    },
    /// A picture that a list names is missing or wrong.
    #[error(
        "{}:{line}: {}: {fault}{}", list.display(), file.display(),
        if matches!(fault, PictureFault::Missing) { "; restore it, or remove its line" } else { "" }
    )]
    Listed {
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
        path: PathBuf,
        /// What is wrong with it.
        fault: PictureFault,
    },
    /// The recording has no depth, and it was asked for.
    #[error("{}: the recording has no depth; use an effect that needs none, or another source of depth", dir.display())]
    NoDepth { dir: PathBuf },
    /// The recording has one eye, and the right one was asked for.
    #[error("{}: the recording has one eye, and stereo needs two; use another source of depth", dir.display())]
    NoRight { dir: PathBuf },
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
    NothingRecorded { dir: PathBuf },
    /// The folder of the output cannot be written.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The operating system refused.
    #[error("cannot {action} {}: {cause}", path.display())]
    Io {
        /// What was being done.
        action: &'static str,
        /// To which file or folder.
        path: PathBuf,
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
