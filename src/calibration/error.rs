//! Errors of calibrations: what is wrong, where, and what to do about it, in one line.

use std::fmt;
use std::path::{Path, PathBuf};

/// Error of reading or using a calibration.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The file cannot be read.
    #[error("cannot read the calibration {}: {why}", path.display())]
    Io { path: PathBuf, why: String },
    /// The format of the file is unknown.
    #[error("{}: not a stereo calibration that is read{hint}; the formats are {formats}", path.display())]
    Unknown {
        path: PathBuf,
        /// What the most similar format has and the file lacks, if there is one.
        hint: String,
        formats: String,
    },
    /// The format is read after a conversion.
    #[error("{}: {format} is not read; \"Convert a calibration\" in docs/recordings.md has the lines for it", path.display())]
    Unconverted {
        path: PathBuf,
        /// The format, as the subject of a sentence.
        format: &'static str,
    },
    /// The number of files is wrong.
    #[error("a calibration consists of one or two files, but {0} were given")]
    Files(usize),
    /// The format has a file per camera, and one was given.
    #[error("{}: this is the {format} of one camera; give those of both cameras, the left one first", path.display())]
    OneCamera { path: PathBuf, format: &'static str },
    /// An entry of a file is wrong.
    #[error("{}: {fault}", Location(path, *line))]
    File {
        path: PathBuf,
        /// Line, from 1; 0 for the whole file.
        line: usize,
        fault: Fault,
    },
    /// Numbers that did not come from a file are wrong.
    #[error("calibration: {0}")]
    Numbers(#[from] Fault),
    /// The calibration is for pictures of another aspect.
    #[error(
        "the calibration is for pictures of {}x{}, but these are {}x{}, with another aspect ratio; calibrate at this \
         size, or record at that one", calibrated.0, calibrated.1, found.0, found.1
    )]
    AspectRatio { calibrated: (u32, u32), found: (u32, u32) },
    /// The calibration does not state its picture size, and does not fit the pictures.
    #[error(
        "the calibration states no picture size, and its principal point ({:.0}, {:.0}) is not near the middle of \
         {}x{}; add `image_size: [WIDTH, HEIGHT]` to it", center_px.0, center_px.1, found.0, found.1
    )]
    NoSize { center_px: (f64, f64), found: (u32, u32) },
    /// The pictures are too small for bilinear interpolation, or larger than any map.
    #[error("pictures of {}x{} cannot be rectified: each side needs 2 to 16384 pixels", .0.0, .0.1)]
    Size((u32, u32)),
    /// The cameras are not side by side.
    #[error(
        "the cameras stand {0} each other: only cameras side by side can be matched; turn the rig, or its pictures and \
         the calibration"
    )]
    NotSideBySide(&'static str),
    /// Left and right are exchanged.
    #[error("the calibration's left camera stands on the right; swap the two pictures and the two cameras")]
    Swapped,
    /// The views of the cameras overlap too little.
    #[error("the cameras look in too different directions: their pictures overlap too little")]
    LittleOverlap,
}

/// Fault of an entry.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Fault {
    /// The file does not have its format's syntax.
    #[error("not readable as {format}: {what}")]
    Syntax { format: &'static str, what: String },
    /// A key is missing.
    #[error("{key} is missing; {hint}")]
    Missing { key: String, hint: &'static str },
    /// The entry is of the wrong kind.
    #[error("{key} must be {expected}")]
    Kind { key: String, expected: &'static str },
    /// The entry is not a finite number.
    #[error("{key} has {text:?} instead of a finite number; calibrate again")]
    NotFinite { key: String, text: String },
    /// A matrix has the wrong size.
    #[error("{key} is {}x{}, and must be {expected}", found.0, found.1)]
    Dimensions { key: String, found: (usize, usize), expected: &'static str },
    /// The data of a matrix does not fill its rows and columns.
    #[error("{key} says {}x{}, but has {found} numbers", said.0, said.1)]
    Data { key: String, said: (usize, usize), found: usize },
    /// The numbers are invalid for their purpose.
    #[error("{key} {what}; calibrate again")]
    Impossible { key: String, what: &'static str },
    /// The model of camera or lens is not supported.
    #[error("{key} {found:?} is not supported; use {known}")]
    Model { key: String, found: String, known: &'static str },
}

/// A file and an optional line, for messages.
struct Location<'a>(&'a Path, usize);

impl fmt::Display for Location<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let &Self(path, line) = self;
        write!(f, "{}", path.display())?;
        if line > 0 { write!(f, ":{line}") } else { Ok(()) }
    }
}
