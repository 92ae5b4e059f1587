//! Pixel formats by their four letters.

use std::fmt;
use std::str::FromStr;

/// Four letters that name a pixel format, as V4L2 uses them.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FourCc(pub [u8; 4]);

/// What a format's pictures are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Colours, or brightness.
    Color,
    /// Distances.
    Depth,
}

/// Formats that differ in the order of their samples only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Two pixels in four bytes that share their chroma; where in them the two lumas, Cb and Cr stand.
    Packed422 {
        /// Place of the first luma, 0 or 1; the second is two bytes further.
        luma: usize,
        /// Place of Cb.
        cb: usize,
        /// Place of Cr.
        cr: usize,
    },
    /// A plane of luma, then one with a pair of chroma samples for each 2 x 2 pixels.
    SemiPlanar420 {
        /// Cr comes before Cb.
        swapped: bool,
        /// Each plane has memory of its own.
        apart: bool,
    },
    /// A plane of luma, then two of chroma, one sample for each 2 x 2 pixels.
    Planar420 {
        /// Cr comes before Cb.
        swapped: bool,
        /// Each plane has memory of its own.
        apart: bool,
    },
    /// Three bytes a pixel.
    Rgb24 {
        /// Blue comes first.
        swapped: bool,
    },
    /// A byte of luma a pixel.
    Grey,
    /// 16 bits a pixel, low byte first.
    Depth16,
    /// A JPEG file a picture.
    Jpeg,
}

/// The formats that can be read, the best first where bandwidth does not matter.
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
    /// A JPEG for each picture, as cameras give it: without its usual tables.
    pub const MJPG: Self = Self(*b"MJPG");
    /// A JPEG for each picture.
    pub const JPEG: Self = Self(*b"JPEG");
    /// Packed 4:2:2, luma first.
    pub const YUYV: Self = Self(*b"YUYV");
    /// Packed 4:2:2, chroma first.
    pub const UYVY: Self = Self(*b"UYVY");
    /// 4:2:0 with paired chroma.
    pub const NV12: Self = Self(*b"NV12");
    /// 4:2:0 in three planes.
    pub const YU12: Self = Self(*b"YU12");
    /// Red, green, blue.
    pub const RGB3: Self = Self(*b"RGB3");
    /// Blue, green, red.
    pub const BGR3: Self = Self(*b"BGR3");
    /// Luma alone.
    pub const GREY: Self = Self(*b"GREY");
    /// 16-bit depth.
    pub const Z16: Self = Self(*b"Z16 ");
    /// 16-bit brightness, in which some cameras give depth.
    pub const Y16: Self = Self(*b"Y16 ");

    /// Every format that can be read.
    pub fn supported() -> impl Iterator<Item = Self> {
        TABLE.iter().map(|&(fourcc, _)| fourcc)
    }

    /// From the number that the kernel uses.
    pub fn from_u32(code: u32) -> Self {
        Self(code.to_le_bytes())
    }

    /// The number that the kernel uses.
    pub fn to_u32(self) -> u32 {
        u32::from_le_bytes(self.0)
    }

    /// Which kind of format it is; none where it cannot be read.
    pub fn family(self) -> Option<Family> {
        TABLE.iter().find(|&&(fourcc, _)| fourcc == self).map(|&(_, family)| family)
    }

    /// Whether pictures in it can be read.
    pub fn is_supported(self) -> bool {
        self.family().is_some()
    }

    /// Whether pictures in it can be read, and every sample has its place.
    pub fn is_raw(self) -> bool {
        self.family().is_some_and(|family| family != Family::Jpeg)
    }

    /// What its pictures are; none where they cannot be read.
    pub fn content(self) -> Option<Content> {
        self.family().map(|family| if family == Family::Depth16 { Content::Depth } else { Content::Color })
    }

    /// Bits of a pixel on average; none for compressed formats and for those that cannot be read.
    pub fn bits_per_px(self) -> Option<u32> {
        Some(match self.family()? {
            Family::Packed422 { .. } | Family::Depth16 => 16,
            Family::SemiPlanar420 { .. } | Family::Planar420 { .. } => 12,
            Family::Rgb24 { .. } => 24,
            Family::Grey => 8,
            Family::Jpeg => return None,
        })
    }
}

impl Family {
    /// Buffers that a picture comes in.
    pub fn memory_planes(self) -> usize {
        match self {
            Self::SemiPlanar420 { apart: true, .. } | Self::Planar420 { apart: true, .. } => self.components(),
            _ => 1,
        }
    }

    /// Planes of samples; none in compressed formats.
    pub fn components(self) -> usize {
        match self {
            Self::Planar420 { .. } => 3,
            Self::SemiPlanar420 { .. } => 2,
            Self::Packed422 { .. } | Self::Rgb24 { .. } | Self::Grey | Self::Depth16 => 1,
            Self::Jpeg => 0,
        }
    }

    /// Bytes of a row, and number of rows, of component `index` in a picture of `width` x `height` pixels. A packed row
    /// of odd width ends in half a pair of pixels, with one of its two chroma samples.
    pub(super) fn rows(self, index: usize, width: usize, height: usize) -> (usize, usize) {
        match (self, index) {
            (Self::Jpeg, _) => (0, 0),
            (Self::Packed422 { .. } | Self::Depth16, _) => (2 * width, height),
            (Self::Rgb24 { .. }, _) => (3 * width, height),
            (Self::Grey, _) | (Self::SemiPlanar420 { .. } | Self::Planar420 { .. }, 0) => (width, height),
            (Self::SemiPlanar420 { .. }, _) => (2 * width.div_ceil(2), height.div_ceil(2)),
            (Self::Planar420 { .. }, _) => (width.div_ceil(2), height.div_ceil(2)),
        }
    }

    /// Stride of component `index`, where the first component of the same memory plane has a stride of `first_bytes`.
    pub(super) fn stride_bytes(self, index: usize, first_bytes: usize) -> usize {
        match (self, index) {
            // An odd row of luma has one chroma pair more than bytes.
            (Self::SemiPlanar420 { .. }, 1..) => first_bytes.next_multiple_of(2),
            (Self::Planar420 { .. }, 1..) => first_bytes.div_ceil(2),
            _ => first_bytes,
        }
    }
}

/// Not the name of a pixel format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a pixel format has 1 to 4 letters or digits, such as MJPG, YUYV or Z16")]
pub struct FourCcError;

impl FromStr for FourCc {
    type Err = FourCcError;

    /// Up to four visible ASCII characters; blanks fill up what lacks.
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

/// Without trailing blanks. Invisible characters are written as `\xNN`, the kernel's mark for big-endian samples as
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
        // Bit 31 of the code is the mark.
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
