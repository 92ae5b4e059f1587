//! Conversion of raw and JPEG pictures to 8-bit sRGB.
//!
//! - **Chroma** of 4:2:2 and 4:2:0 is upsampled by linear interpolation. Horizontally, it is co-sited with the left
//!   pixel of each pair, and vertically, midway between its two rows, as in MPEG-2 and in V4L2. In JPEG it lies midway
//!   in both directions.
//! - **Transfer**: values on the curve of BT.709 are treated as sRGB, unchanged. BT.709 defines what a camera records;
//!   a screen's response to it is close to sRGB's curve, and players and browsers show both alike. Converting by the
//!   camera's curve would wash pictures out, and drivers report either curve for the same pixels. Linear values and
//!   pure powers are converted by a table.
//! - **Primaries** are not converted: pictures of a camera that reports BT.2020 or DCI-P3 look slightly less saturated.

mod jpeg;
mod raw;
#[cfg(test)]
mod tests;
mod transfer;
mod ycc;

use crate::layout::{Content, Family, FourCc, Layout, Transfer};
use bokehcam::frame::ColorImage;

/// Decodes the pictures of one layout, with its own buffers.
#[derive(Debug)]
pub struct Decoder {
    layout: Layout,
    backend: Backend,
}

#[derive(Debug)]
enum Backend {
    Raw(Box<raw::RawDecoder>),
    Jpeg(jpeg::MotionJpeg),
}

/// The format contains no colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} holds depth, not colours: use it with --depth")]
pub struct NoColor(pub FourCc);

/// Why a picture cannot be decoded. The next one may be good.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PixelError {
    /// The number of memory planes is wrong.
    #[error("the picture has {found} memory planes instead of {expected}")]
    Planes { found: usize, expected: usize },
    /// The picture is truncated.
    #[error("the picture is cut short: {found_bytes} of {min_size_bytes} bytes")]
    Short { found_bytes: usize, min_size_bytes: usize },
    /// The JPEG is truncated or damaged.
    #[error("damaged JPEG: {0}")]
    Jpeg(String),
    /// The JPEG's size differs from the negotiated one.
    #[error("the JPEG has {} x {} pixels instead of {} x {}", found.0, found.1, expected.0, expected.1)]
    Size { found: (usize, usize), expected: (usize, usize) },
}

impl Decoder {
    /// Creates a decoder for pictures of this layout.
    ///
    /// # Errors
    /// The layout contains no colours.
    pub fn new(layout: &Layout) -> Result<Self, NoColor> {
        if layout.fourcc.content() != Some(Content::Color) {
            return Err(NoColor(layout.fourcc));
        }
        if layout.transfer == Transfer::Pq {
            tracing::warn!(
                "the camera gives high dynamic range (SMPTE 2084), which is not converted: pictures are too dark"
            );
        }
        let backend = match layout.family() {
            Family::Jpeg => Backend::Jpeg(jpeg::MotionJpeg::default()),
            _ => Backend::Raw(Box::new(raw::RawDecoder::new(layout))),
        };
        Ok(Self { layout: *layout, backend })
    }

    /// The layout of the pictures to decode.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Decodes a picture, passed as the used bytes of each memory plane, into `out` (resized to fit). Raw formats
    /// allocate nothing once `out` has its size; the JPEG library allocates a few rows of pixels and its tables.
    ///
    /// # Errors
    /// The picture is truncated or damaged; the content of `out` is then unspecified.
    pub fn decode(&mut self, planes: &[&[u8]], out: &mut ColorImage) -> Result<(), PixelError> {
        let expected = self.layout.planes().len();
        if planes.len() != expected {
            return Err(PixelError::Planes { found: planes.len(), expected });
        }
        match &mut self.backend {
            Backend::Raw(raw) => raw.decode(&self.layout, planes, out),
            Backend::Jpeg(jpeg) => jpeg.decode(&self.layout, planes[0], out),
        }
    }
}
