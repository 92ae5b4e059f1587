//! Pixel formats by their four-character codes.

use std::fmt;
use std::str::FromStr;

/// A four-character code of a pixel format, as in V4L2.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FourCc(pub [u8; 4]);

/// The content of a format's pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Colour or luma.
    Color,
    /// Depth.
    Depth,
}

/// A family of formats that differ only in the order of their samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Two pixels in four bytes with shared chroma; the fields are byte offsets.
    Packed422 {
        /// Offset of the first luma, 0 or 1; the second is two bytes further.
        luma: usize,
        /// Offset of Cb.
        cb: usize,
        /// Offset of Cr.
        cr: usize,
    },
    /// A plane of luma, then a plane of interleaved chroma, one pair per 2 x 2 pixels.
    SemiPlanar420 {
        /// Whether Cr comes before Cb.
        swapped: bool,
        /// Whether each plane has its own memory.
        apart: bool,
    },
    /// A plane of luma, then two planes of chroma, one sample per 2 x 2 pixels.
    Planar420 {
        /// Whether Cr comes before Cb.
        swapped: bool,
        /// Whether each plane has its own memory.
        apart: bool,
    },
    /// Three bytes per pixel.
    Rgb24 {
        /// Whether blue comes first.
        swapped: bool,
    },
    /// One byte of luma per pixel.
    Grey,
    /// 16 bits per pixel, little-endian.
    Depth16,
    /// A JPEG file per picture.
    Jpeg,
}

/// The supported formats, in order of preference if bandwidth is no limit.
const TABLE: [(FourCc, Family); 19] = [
    (FourCc::NV12, Family::SemiPlanar420 { swapped: false, apart: false }),
    (FourCc(*b"NM12"), Family::SemiPlanar420 { swapped: false, apart: true }),
    (FourCc(*b"NV21"), Family::SemiPlanar420 { swapped: true, apart: false }),
    (FourCc(*b"NM21"), Family::SemiPlanar420 { swapped: true, apart: true }),
    (FourCc::YU12, Family::Planar420 { swapped: false, apart: false }),
    (FourCc(*b"YM12"), Family::Planar420 { swapped: false, apart: true }),
    (FourCc(*b"YV12"), Family::Planar420 { swapped: true, apart: false }),
    (FourCc(*b"YM21"), Family::Planar420 { swapped: true, apart: true }),
    (FourCc::YUYV, Family::Packed422 { luma: 0, cb: 1, cr: 3 }),
    (FourCc::UYVY, Family::Packed422 { luma: 1, cb: 0, cr: 2 }),
    (FourCc(*b"YVYU"), Family::Packed422 { luma: 0, cb: 3, cr: 1 }),
    (FourCc(*b"VYUY"), Family::Packed422 { luma: 1, cb: 2, cr: 0 }),
    (FourCc::RGB3, Family::Rgb24 { swapped: false }),
    (FourCc::BGR3, Family::Rgb24 { swapped: true }),
    (FourCc::MJPG, Family::Jpeg),
    (FourCc::JPEG, Family::Jpeg),
    (FourCc::GREY, Family::Grey),
    (FourCc::Z16, Family::Depth16),
    (FourCc::Y16, Family::Depth16),
];

impl FourCc {
    /// A JPEG per picture as cameras send it: without Huffman tables.
    pub const MJPG: Self = Self(*b"MJPG");
    /// A complete JPEG per picture.
    pub const JPEG: Self = Self(*b"JPEG");
    /// Packed 4:2:2, luma first.
    pub const YUYV: Self = Self(*b"YUYV");
    /// Packed 4:2:2, chroma first.
    pub const UYVY: Self = Self(*b"UYVY");
    /// 4:2:0 with interleaved chroma.
    pub const NV12: Self = Self(*b"NV12");
    /// 4:2:0 in three planes.
    pub const YU12: Self = Self(*b"YU12");
    /// Red, green, blue.
    pub const RGB3: Self = Self(*b"RGB3");
    /// Blue, green, red.
    pub const BGR3: Self = Self(*b"BGR3");
    /// Luma only.
    pub const GREY: Self = Self(*b"GREY");
    /// 16-bit depth.
    pub const Z16: Self = Self(*b"Z16 ");
    /// 16-bit luma, which some cameras use for depth.
    pub const Y16: Self = Self(*b"Y16 ");

    /// Returns all supported formats.
    pub fn supported_formats() -> impl Iterator<Item = Self> {
        TABLE.iter().map(|&(fourcc, _)| fourcc)
    }

    /// Creates the code from the kernel's number.
    pub fn from_u32(code: u32) -> Self {
        Self(code.to_le_bytes())
    }

    /// Returns the kernel's number.
    pub fn to_u32(self) -> u32 {
        u32::from_le_bytes(self.0)
    }

    /// Returns the family; `None` if the format is not supported.
    pub fn family(self) -> Option<Family> {
        TABLE.iter().find(|&&(fourcc, _)| fourcc == self).map(|&(_, family)| family)
    }

    /// Returns whether the format is supported and uncompressed.
    pub fn is_raw(self) -> bool {
        self.family().is_some_and(|family| family != Family::Jpeg)
    }

    /// Returns the content of its pictures; `None` if the format is not supported.
    pub fn content(self) -> Option<Content> {
        self.family().map(|family| if family == Family::Depth16 { Content::Depth } else { Content::Color })
    }
}

impl Family {
    /// Returns the number of buffers per picture.
    pub fn memory_plane_count(self) -> usize {
        match self {
            Self::SemiPlanar420 { apart: true, .. } | Self::Planar420 { apart: true, .. } => self.component_count(),
            _ => 1,
        }
    }

    /// Returns the number of planes of samples; 0 for compressed formats.
    pub fn component_count(self) -> usize {
        match self {
            Self::Planar420 { .. } => 3,
            Self::SemiPlanar420 { .. } => 2,
            Self::Packed422 { .. } | Self::Rgb24 { .. } | Self::Grey | Self::Depth16 => 1,
            Self::Jpeg => 0,
        }
    }

    /// Returns the bytes per row and the number of rows of component `index` in a picture of `width` x `height` pixels.
    /// A packed row of odd width ends with half a pair of pixels, which has one of the two chroma samples.
    pub(super) fn component_rows(self, index: usize, width: usize, height: usize) -> (usize, usize) {
        match (self, index) {
            (Self::Jpeg, _) => (0, 0),
            (Self::Packed422 { .. } | Self::Depth16, _) => (2 * width, height),
            (Self::Rgb24 { .. }, _) => (3 * width, height),
            (Self::Grey, _) | (Self::SemiPlanar420 { .. } | Self::Planar420 { .. }, 0) => (width, height),
            (Self::SemiPlanar420 { .. }, _) => (2 * width.div_ceil(2), height.div_ceil(2)),
            (Self::Planar420 { .. }, _) => (width.div_ceil(2), height.div_ceil(2)),
        }
    }

    /// Returns the stride of component `index` if the first component of its memory plane has a stride of
    /// `first_bytes`.
    pub(super) fn component_stride_bytes(self, index: usize, first_bytes: usize) -> usize {
        match (self, index) {
            // An odd row of luma has one byte less than its chroma pairs.
            (Self::SemiPlanar420 { .. }, 1..) => first_bytes.next_multiple_of(2),
            (Self::Planar420 { .. }, 1..) => first_bytes.div_ceil(2),
            _ => first_bytes,
        }
    }
}

/// The text is not a pixel format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a pixel format has 1 to 4 letters or digits, such as MJPG, YUYV or Z16")]
pub struct FourCcError;

impl FromStr for FourCc {
    type Err = FourCcError;

    /// Parses up to four visible ASCII characters; pads with blanks.
    fn from_str(text: &str) -> Result<Self, FourCcError> {
        let text = text.trim_end_matches(' ');
        if !(1..=4).contains(&text.len()) || !text.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err(FourCcError);
        }
        let mut code = [b' '; 4];
        code[..text.len()].copy_from_slice(text.as_bytes());
        Ok(Self(code))
    }
}

/// Writes the code without trailing blanks; invisible characters as `\xNN`, the kernel's flag for big-endian samples as
/// `-BE`.
impl fmt::Display for FourCc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [first @ .., last] = self.0;
        let letters = [first[0], first[1], first[2], last & 0x7F];
        let end = letters.iter().rposition(|&letter| letter != b' ').map_or(0, |end| end + 1);
        let mut name = String::with_capacity(8);
        for &letter in &letters[..end] {
            match letter {
                b' ' | b'!'..=b'~' => name.push(letter.into()),
                other => name.push_str(&format!("\\x{other:02x}")),
            }
        }
        // Bit 31 is the big-endian flag.
        if last & 0x80 != 0 {
            name.push_str("-BE");
        }
        f.pad(&name)
    }
}

impl fmt::Debug for FourCc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}
