//! What can be wrong with a line of a list, a calibration or a picture, whichever it is.

use std::io;
use std::path::PathBuf;

use super::MAX_SIDE_PX;

/// What is wrong with a line of a list.
#[allow(missing_docs)] // The messages say what the fields are.
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
    #[error("{0:?} is not a time; write seconds >= 0 as a decimal number, such as 1305031102.175304")]
    Time(String),
    /// The time repeats, or goes back.
    #[error("the time is out of order or repeated; sort the list by time, and name each time once")]
    OutOfOrder,
    /// The time is from another age.
    #[error("the time is more than ten years from most of the others; correct or remove the line")]
    TooFar,
    /// The path leaves the folder of the recording.
    #[error("{} points outside the recording; name a file inside its folder", .0.display())]
    Outside(PathBuf),
    /// The path cannot be one.
    #[error("the file name {0:?} has control characters; rename the file")]
    FileName(String),
}

/// What is wrong with the calibration of a rectified pair.
#[allow(missing_docs)] // The messages say what the fields are.
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
        key: String,
        /// What a value of it is.
        expected: &'static str,
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
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Debug, thiserror::Error)]
pub enum PictureFault {
    /// There is no such file.
    #[error("{}", crate::files::input::NO_FILE)]
    Missing,
    /// A picture of an aperture that is closed.
    #[error(
        "it is black all over, and an aperture lets light through where its picture is bright; give another picture"
    )]
    Dark,
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
    TooLarge { width: u32, height: u32 },
    /// The file is larger than any picture that is read here.
    #[error("the file has {bytes} bytes, and at most {most_bytes} are read; convert it")]
    FileSize {
        /// Size of the file.
        bytes: u64,
        /// Size of the largest that is read.
        most_bytes: u64,
    },
    /// The picture has no pixel.
    #[error("the picture has no pixel ({width}x{height}); export it again")]
    NoPixel { width: u32, height: u32 },
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
    /// The same of a mask.
    #[error(
        "the mask is {}x{}, which does not cover a picture of {}x{}; export it at that size, or smaller with the same aspect",
        found.0, found.1, color.0, color.1
    )]
    MaskSize {
        /// Columns and rows of the mask.
        found: (u32, u32),
        /// Columns and rows of the picture.
        color: (u32, u32),
    },
    /// No picture can be written under this name.
    #[error("no format is known for this name; end it with {0}")]
    Extension(&'static str),
    /// The pixels do not make a picture.
    #[error("cannot be encoded: {0}")]
    Encoding(String),
    /// A picture that does not say how it was made.
    #[error("no snapshot: it has no settings of bokehcam in it; name one, or give the settings themselves")]
    NoSettings,
    /// 256 steps, and no telling which end is near.
    #[error(
        "an 8-bit grey picture has too few steps for depth; export it with 16 bits: dark is near there, and 0 unknown. \
         Where white is near (inverse depth, as networks and phones make it) --depth-unit inverse reads it"
    )]
    CoarseDepth,
    /// A picture that holds something else than depth.
    #[error(
        "{0} is not depth; export depth as a 16-bit grey PNG; inverse depth, where white is near, is read by --depth-unit inverse"
    )]
    NotDepth(&'static str),
}
