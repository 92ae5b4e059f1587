//! Faults in lines of lists, in calibrations, and in pictures, without their location.

use std::io::{self, ErrorKind};
use std::path::PathBuf;

use image::ImageError;

use super::{MAX_PIXELS, MAX_SIDE_PX, RecordingError};

/// A fault in a line of a list.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineFault {
    /// The line is not UTF-8.
    #[error("the line is not UTF-8 text; save the list as UTF-8")]
    NotUtf8,
    /// Columns are missing, or there are too many.
    #[error("expected `{expected}`, found {found} column(s); correct or remove the line")]
    Columns { expected: &'static str, found: usize },
    /// The text is not a time in nanoseconds.
    #[error("{0:?} is not a time; write nanoseconds as a whole number, such as 1403715276262142976")]
    Nanoseconds(String),
    #[error("{0:?} is not a time; write seconds >= 0 as a decimal number, such as 1305031102.175304")]
    Time(String),
    /// The text is not a date and time.
    #[error("{0:?} is not a date and time; write it as 2011-09-26 13:02:25.964389445")]
    Date(String),
    /// The time is repeated or decreases.
    #[error("the time is out of order or repeated; sort the list by time, and name each time once")]
    OutOfOrder,
    /// The time is too far from the others.
    #[error("the time is more than ten years from most of the others; correct or remove the line")]
    TooFar,
    /// The path leads outside the recording.
    #[error("{} points outside the recording; name a file inside its folder", .0.display())]
    Outside(PathBuf),
    /// The file name is invalid.
    #[error("the file name {0:?} has control characters; rename the file")]
    FileName(String),
}

/// A fault in the calibration of a rectified pair.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeometryFault {
    /// The format is unknown.
    #[error("neither a Middlebury calibration (`cam0=[f 0 cx; 0 f cy; 0 0 1]`) nor a KITTI one (`P0: 12 numbers`)")]
    Unknown,
    /// A required key is missing.
    #[error("the key {0} is missing; add its line")]
    Missing(String),
    /// A value is invalid.
    #[error("{key}: {found:?} is not {expected}; correct the line")]
    Value { key: String, expected: &'static str, found: String },
    /// The baseline is 0, which gives no depth.
    #[error("the baseline is 0: both cameras are in the same place; give the calibration of both cameras")]
    NoBaseline,
    /// The right camera is left of the left one.
    #[error("the right camera stands {0} m to the left of the left one; swap the cameras")]
    Swapped(f64),
    /// The focal lengths differ, unlike those of rectified pictures.
    #[error("the left focal length is {0} px and the right one {1} px; give the calibration of rectified pictures")]
    UnequalFocal(f64, f64),
    /// The calibration is for pictures of another aspect ratio.
    #[error(
        "made for pictures of {}x{}, but these are {}x{}, with another aspect ratio; give the calibration of these \
         pictures",
        of.0, of.1, pictures.0, pictures.1
    )]
    Size { of: (u32, u32), pictures: (u32, u32) },
}

/// Result of reading a picture.
pub(super) type ReadResult<T = ()> = Result<T, PictureFault>;

/// A fault in a picture file.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum PictureFault {
    /// The file does not exist.
    #[error("{}", bokehcam_files::input::NO_FILE)]
    Missing,
    /// An aperture's picture is black, so no light would pass.
    #[error(
        "it is black all over, but an aperture lets light through where its picture is bright; give another picture"
    )]
    Dark,
    /// A link leads outside the recording.
    #[error("a link leads outside the recording; add --follow-links if you trust it, or put the file itself there")]
    Outside,
    /// A folder, a pipe or a device.
    #[error("not a regular file; name a picture file")]
    NotAFile,
    /// An operating system error.
    #[error("cannot be read: {0}")]
    Io(#[from] io::Error),
    /// The format is not the expected one.
    #[error("not a {0} file; convert it")]
    Format(&'static str),
    /// A known kind of file that is not read.
    #[error("it is {kind}, which is not read; {remedy}")]
    Foreign {
        /// The kind of file, such as `a HEIC picture`.
        kind: &'static str,
        /// What to do, with a command.
        remedy: &'static str,
    },
    /// A form of a known kind that is not read.
    #[error("it has a form that is not read ({0}); convert it to PNG")]
    Unsupported(String),
    /// A form of TIFF that is not read.
    #[error("it is a TIFF with {form}, which is not read; {remedy}")]
    TiffForm {
        /// Its compression or samples, in words.
        form: String,
        remedy: &'static str,
    },
    /// The header states more pixels than are supported.
    #[error(
        "its header claims {width}x{height} pixels, and at most {MAX_SIDE_PX} a side and {} megapixels are read; scale it \
         down", MAX_PIXELS / 1_000_000
    )]
    TooLarge { width: u32, height: u32 },
    /// The file is larger than any supported picture.
    #[error("the file has {bytes} bytes, and at most {max_bytes} are read; convert it")]
    FileSize { bytes: u64, max_bytes: u64 },
    /// The picture has no pixels.
    #[error("the picture has no pixel ({width}x{height}); export it again")]
    NoPixel { width: u32, height: u32 },
    /// The data is truncated.
    #[error("the file ends before the picture does; copy or export it again")]
    Truncated,
    /// The data is corrupt.
    #[error("damaged ({0}); copy or export it again")]
    Damaged(String),
    /// The size differs from that of the first colour picture.
    #[error(
        "the picture is {}x{}, and the recording began with {}x{}; all its colour pictures need the same size",
        found.0, found.1, expected.0, expected.1
    )]
    Size { found: (u32, u32), expected: (u32, u32) },
    /// The size of a right picture differs from that of the left ones.
    #[error(
        "the right picture is {}x{}, and the left one {}x{}; both need the same size",
        found.0, found.1, left.0, left.1
    )]
    EyeSize { found: (u32, u32), left: (u32, u32) },
    /// A depth map does not cover its colour picture.
    #[error(
        "the depth map is {}x{}, which does not cover a colour picture of {}x{}; if both show the same view, add \
         --depth-fit stretch, and if the picture is the middle of the map, --depth-fit crop",
        found.0, found.1, color.0, color.1
    )]
    DepthSize { found: (u32, u32), color: (u32, u32) },
    /// A depth map has another size than its calibration.
    #[error(
        "the depth map is {}x{}, and the depth camera is calibrated for {}x{}; correct the calibration",
        found.0, found.1, calibrated.0, calibrated.1
    )]
    CalibratedSize { found: (u32, u32), calibrated: (u32, u32) },
    /// The view of a depth camera, without a calibration that says where the colour camera is.
    #[error(
        "the depth map is {}x{}, of another view than the picture, and the file {reason}; give a calibration with \
         --depth-calibration, or use --depth none",
        found.0, found.1
    )]
    Uncalibrated { found: (u32, u32), reason: String },
    /// A mask has another aspect ratio than its picture.
    #[error(
        "the mask is {}x{}, of another aspect ratio than the picture's {}x{}; export it in the picture's, in any size",
        found.0, found.1, color.0, color.1
    )]
    MaskSize { found: (u32, u32), color: (u32, u32) },
    /// The file name has no supported extension.
    #[error("no format is known for this name; end it with {0}")]
    Extension(&'static str),
    /// The pixels cannot be encoded.
    #[error("cannot be encoded: {0}")]
    Encoding(String),
    /// The picture contains no settings.
    #[error("not a snapshot: it contains no settings of bokehcam; give a snapshot, or the settings themselves")]
    NoSettings,
    /// An 8-bit grey picture: its polarity and unit are unknown.
    #[error(
        "an 8-bit grey picture does not say what its 256 steps mean; add --depth-unit inverse if white is near (networks, \
         phones), --depth-unit inverse --depth-invert if black is near, or --depth-unit scale:N for distances of N steps \
         a metre"
    )]
    CoarseDepth,
    /// The numbers may be distances or nearness.
    #[error(
        "it has {0}; add --depth-unit inverse if large values (white) are near, --depth-unit inverse --depth-invert if \
         they are far, or for distances --depth-unit metres, millimetres or scale:N"
    )]
    UnclearDepth(&'static str),
    /// Nothing in the depth map is usable.
    #[error("{0}; export the depth map again")]
    NoDepth(&'static str),
    /// The file does not hold one number per pixel.
    #[error("{0} is not a map; export one number per pixel")]
    NotAMap(String),
    /// Colours stand for depth.
    #[error(
        "a picture in colours is not depth, as colours have no order; export grey or numbers from the depth tool (such as \
         --grayscale, --pred-only, cmap=\"gray\", or .npy)"
    )]
    ColoredDepth,
    /// Colours of a known colour map stand for depth.
    #[error(
        "it has the colours of {name}; add --depth-unit inverse if {} is near, or --depth-unit inverse \
         --depth-invert if {} is near", ends[0], ends[1]
    )]
    ColorMapped { name: &'static str, ends: Box<[&'static str; 2]> },
    /// What states the scale of a depth map is faulty.
    #[error("{0}")]
    Scale(Box<RecordingError>),
    /// The picture is not a depth map.
    #[error(
        "{0} is not depth; export depth as a 16-bit grey PNG; for inverse depth, where white is near, use --depth-unit \
         inverse"
    )]
    NotDepth(&'static str),
    /// The photo claims to have depth inside, which cannot be read; the photo itself may be fine.
    #[error(
        "the depth inside ({kind}) cannot be read: {what}; use the file as the phone saved it, or give a depth map"
    )]
    EmbeddedDepth {
        /// The kind of container, such as `GDepth`.
        kind: &'static str,
        what: String,
    },
}

/// Returns the fault of a file that cannot be opened.
pub(super) fn open_fault(error: io::Error) -> PictureFault {
    match error.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory => PictureFault::Missing,
        ErrorKind::InvalidInput => PictureFault::NotAFile,
        _ => PictureFault::Io(error),
    }
}

pub(super) fn png_fault(error: png::DecodingError) -> PictureFault {
    match error {
        png::DecodingError::IoError(error) if error.kind() == ErrorKind::UnexpectedEof => PictureFault::Truncated,
        other => damaged_fault(&other),
    }
}

pub(super) fn decoder_fault(error: ImageError) -> PictureFault {
    match error {
        ImageError::Unsupported(error) => PictureFault::Unsupported(error.to_string().replace('\n', " ")),
        ImageError::IoError(error) if error.kind() == ErrorKind::UnexpectedEof => PictureFault::Truncated,
        other => damaged_fault(&other),
    }
}

pub(super) fn damaged_fault(error: &dyn std::error::Error) -> PictureFault {
    PictureFault::Damaged(error.to_string().replace('\n', " "))
}
