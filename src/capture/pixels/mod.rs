//! From the bytes that a driver gives to 8-bit sRGB.
//!
//! - **Chroma** of 4:2:2 and 4:2:0 is interpolated linearly. Across, it is taken to lie on the left one of its two
//!   pixels, and down, midway between its two rows, as in MPEG-2 and as V4L2 has it. In JPEG it lies midway both ways.
//! - **Curves**: numbers on the curve of BT.709 are taken as sRGB, as they are. BT.709 defines what a camera records;
//!   what a screen makes of it is close to sRGB's curve, and players and browsers show either alike. Converting by
//!   the camera's curve would wash pictures out, and drivers name either curve for the same pixels.
//!   Linear numbers and plain powers are converted by a table.
//! - **Primaries** are not converted: a camera that says BT.2020 or DCI-P3 shows slightly less saturated colours.

mod jpeg;
mod raw;
#[cfg(test)]
mod tests;
mod transfer;
mod ycc;

use crate::frame::ColorImage;
use crate::layout::{Content, Family, FourCc, Layout, Transfer};

/// Decodes the pictures of one layout. Owns the memory for it.
#[derive(Debug)]
pub struct Decoder {
    layout: Layout,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Raw(Box<raw::Raw>),
    Jpeg(jpeg::Jpeg),
}

/// A format in which there are no colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} holds depth, not colours: use it with --depth")]
pub struct NoColor(pub FourCc);

/// Why a picture cannot be decoded. The next one may be good.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PixelError {
    /// Memory planes lack, or there are too many.
    #[error("the picture has {found} memory planes instead of {expected}")]
    Planes {
        /// As given.
        found: usize,
        /// As the layout has.
        expected: usize,
    },
    /// It is cut short.
    #[error("the picture is cut short: {found_bytes} of {needed_bytes} bytes")]
    Short {
        /// As given.
        found_bytes: usize,
        /// What the layout needs.
        needed_bytes: usize,
    },
    /// The JPEG is cut short or damaged.
    #[error("damaged JPEG: {0}")]
    Jpeg(String),
    /// The JPEG's size is not the one that was agreed upon.
    #[error("the JPEG has {} x {} pixels instead of {} x {}", found.0, found.1, expected.0, expected.1)]
    Size {
        /// Columns and rows of the JPEG.
        found: (usize, usize),
        /// Columns and rows of the layout.
        expected: (usize, usize),
    },
}

impl Decoder {
    /// A decoder for pictures of this layout.
    ///
    /// # Errors
    /// They have no colours.
    pub fn new(layout: &Layout) -> Result<Self, NoColor> {
        if layout.fourcc.content() != Some(Content::Color) {
            return Err(NoColor(layout.fourcc));
        }
        if layout.transfer == Transfer::Pq {
            tracing::warn!(
                "the camera gives high dynamic range (SMPTE 2084), which is shown as if it were not: too dark"
            );
        }
        let kind = match layout.family() {
            Family::Jpeg => Kind::Jpeg(jpeg::Jpeg::default()),
            _ => Kind::Raw(Box::new(raw::Raw::new(layout))),
        };
        Ok(Self { layout: *layout, kind })
    }

    /// The layout that it decodes.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Decodes a picture, given as the used bytes of each memory plane, into `out` (resized to fit). Raw formats
    /// allocate nothing once `out` has its size; the library behind JPEG allocates a few rows of pixels and its tables.
    ///
    /// # Errors
    /// The picture is cut short or damaged; the content of `out` is then unspecified.
    pub fn decode(&mut self, planes: &[&[u8]], out: &mut ColorImage) -> Result<(), PixelError> {
        let expected = self.layout.planes().len();
        if planes.len() != expected {
            return Err(PixelError::Planes { found: planes.len(), expected });
        }
        match &mut self.kind {
            Kind::Raw(raw) => raw.decode(&self.layout, planes, out),
            Kind::Jpeg(jpeg) => jpeg.decode(&self.layout, planes[0], out),
        }
    }
}
