//! What a picture looks like in memory: its format, where its planes lie, and what its numbers mean as colours.

mod color;
mod fourcc;

use crate::color::Matrix;
pub use color::{Colors, Range, Transfer};
pub use fourcc::{Content, Family, FourCc, FourCcError};

/// Widest and highest picture that is accepted, in pixels: what a driver says is believed only so far.
pub const MAX_SIDE_PX: u32 = 8192;

/// Most memory planes and most components of a supported format.
pub(crate) const MAX_PLANES: usize = 3;

/// A picture in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The format; a supported one.
    pub fourcc: FourCc,
    /// Columns, 1 to [`MAX_SIDE_PX`].
    pub width: u32,
    /// Rows, 1 to [`MAX_SIDE_PX`].
    pub height: u32,
    /// Which weights make luma of red, green and blue.
    pub matrix: Matrix,
    /// Which numbers stand for black and white.
    pub range: Range,
    /// How numbers grow with light.
    pub transfer: Transfer,
    planes: [Plane; MAX_PLANES],
    plane_count: usize,
}

/// One piece of memory of a picture: a buffer of its own in a multi-planar queue, otherwise the only one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Plane {
    /// Bytes from row to row of its first component; 0 in compressed formats.
    pub stride_bytes: usize,
    /// As the driver says; may be more than the picture needs, and is the largest picture of compressed formats.
    pub size_bytes: usize,
}

/// The rows of one component (luma, chroma, or the packed pixels) within the memory of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Component {
    /// Number of the memory plane.
    pub plane: usize,
    /// Where the first row starts in it.
    pub offset_bytes: usize,
    /// Bytes from row to row.
    pub stride_bytes: usize,
    /// Those of each row that hold samples.
    pub row_bytes: usize,
    /// Number of rows.
    pub rows: usize,
}

impl Component {
    /// Bytes of its plane up to the end of its last row, which need not be padded.
    pub fn end_bytes(&self) -> usize {
        self.offset_bytes + self.stride_bytes * (self.rows - 1) + self.row_bytes
    }
}

/// Why a format cannot be used.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayoutError {
    /// No picture is captured through such a queue.
    #[error("buffer type {0} does not hold captured pictures")]
    BufferType(u32),
    /// Not one of the formats that can be read.
    #[error("pixel format {0} is not supported")]
    FourCc(FourCc),
    /// No picture has this size.
    #[error("the device gives pictures of {width} x {height} pixels, and 1 to {MAX_SIDE_PX} a side can be used")]
    Size { width: u32, height: u32 },
    #[error("the device says {stride_bytes} bytes a row, and {width} pixels of {fourcc} need {needed_bytes}")]
    Stride {
        fourcc: FourCc,
        width: u32,
        /// As the device says.
        stride_bytes: usize,
        needed_bytes: usize,
    },
    /// A buffer that cannot hold the picture.
    #[error(
        "the device says {size_bytes} bytes a picture, and {width} x {height} pixels of {fourcc} need {needed_bytes}"
    )]
    Short {
        fourcc: FourCc,
        width: u32,
        height: u32,
        /// As the device says.
        size_bytes: usize,
        needed_bytes: usize,
    },
    /// Memory planes that do not fit the format.
    #[error("the device gives {fourcc} in {found} memory planes instead of {expected}")]
    Planes {
        fourcc: FourCc,
        /// As the device says.
        found: usize,
        /// As the format has.
        expected: usize,
    },
    #[error(
        "the device gives interlaced pictures (field order {0}), which are not supported; choose a progressive mode"
    )]
    Interlaced(u32),
}

impl Layout {
    /// The layout of a picture without padding, as V4L2's defaults have it: for formats that no driver describes.
    ///
    /// # Errors
    /// Such pictures cannot be read.
    pub fn packed(fourcc: FourCc, width: u32, height: u32) -> Result<Self, LayoutError> {
        Self::strided(fourcc, width, height, 0)
    }

    /// The same with `stride_bytes` from row to row of each plane's first component; 0 is without padding.
    ///
    /// # Errors
    /// Such pictures cannot be read.
    pub fn strided(fourcc: FourCc, width: u32, height: u32, stride_bytes: usize) -> Result<Self, LayoutError> {
        let plane_count = fourcc.family().map_or(1, Family::memory_planes);
        Self::new(fourcc, (width, height), &[Plane { stride_bytes, size_bytes: 0 }; MAX_PLANES][..plane_count], None)
    }

    /// The layout of a picture of `width` x `height` pixels in these memory planes, whose strides and sizes are computed where
    /// they are 0. Without `colors` those are V4L2's defaults.
    ///
    /// # Errors
    /// Such pictures cannot be read.
    pub fn new(
        fourcc: FourCc,
        (width, height): (u32, u32),
        given: &[Plane],
        colors: Option<Colors>,
    ) -> Result<Self, LayoutError> {
        let family = fourcc.family().ok_or(LayoutError::FourCc(fourcc))?;
        if !(1..=MAX_SIDE_PX).contains(&width) || !(1..=MAX_SIDE_PX).contains(&height) {
            return Err(LayoutError::Size { width, height });
        }
        let plane_count = family.memory_planes();
        if given.len() != plane_count {
            return Err(LayoutError::Planes { fourcc, found: given.len(), expected: plane_count });
        }
        let (matrix, range, transfer) = colors.unwrap_or_else(|| color::usual(family));
        let mut planes = [Plane::default(); MAX_PLANES];
        planes[..plane_count].copy_from_slice(given);
        let mut layout = Self { fourcc, width, height, matrix, range, transfer, planes, plane_count };
        if family == Family::Jpeg {
            layout.planes[0].stride_bytes = 0;
            return Ok(layout);
        }
        for (index, plane) in layout.planes[..plane_count].iter_mut().enumerate() {
            let needed_bytes = family.rows(index, width as usize, height as usize).0;
            if plane.stride_bytes == 0 {
                plane.stride_bytes = needed_bytes;
            }
            // The bound keeps every sum below within 64 bits, whatever the driver says.
            if plane.stride_bytes < needed_bytes || plane.stride_bytes > 1 << 28 {
                let stride_bytes = plane.stride_bytes;
                return Err(LayoutError::Stride { fourcc, width, stride_bytes, needed_bytes });
            }
        }
        // Chroma strides follow from the luma's: half of an odd one, too, must hold a chroma row.
        for component in layout.components() {
            if component.stride_bytes < component.row_bytes {
                let stride_bytes = layout.planes[component.plane].stride_bytes;
                return Err(LayoutError::Stride { fourcc, width, stride_bytes, needed_bytes: 2 * component.row_bytes });
            }
        }
        for index in 0..plane_count {
            let needed_bytes = layout.needed_bytes(index);
            let size_bytes = &mut layout.planes[index].size_bytes;
            if *size_bytes == 0 {
                *size_bytes = needed_bytes;
            }
            if *size_bytes < needed_bytes {
                return Err(LayoutError::Short { fourcc, width, height, size_bytes: *size_bytes, needed_bytes });
            }
        }
        Ok(layout)
    }

    /// The same with `extra_bytes` between rows.
    #[cfg(test)]
    pub fn with_strides(mut self, extra_bytes: usize) -> Self {
        for index in 0..self.plane_count {
            self.planes[index].stride_bytes += extra_bytes;
        }
        for index in 0..self.plane_count {
            self.planes[index].size_bytes = self.needed_bytes(index) + extra_bytes;
        }
        self
    }

    /// Which kind of format it is.
    pub fn family(&self) -> Family {
        // Layouts are made of supported formats only, but the field is open.
        self.fourcc.family().unwrap_or(Family::Jpeg)
    }

    /// The memory planes, 1 to 3.
    pub fn planes(&self) -> &[Plane] {
        &self.planes[..self.plane_count]
    }

    /// The components of a raw picture in the order luma, first chroma, second chroma as they lie in memory; none of
    /// a compressed one.
    pub fn components(&self) -> impl Iterator<Item = Component> {
        let family = self.family();
        let apart = self.plane_count > 1;
        let mut next = Component { plane: 0, offset_bytes: 0, stride_bytes: 0, row_bytes: 0, rows: 0 };
        (0..family.components()).map(move |index| {
            if apart {
                (next.plane, next.offset_bytes) = (index, 0);
            } else {
                next.offset_bytes += next.stride_bytes * next.rows;
            }
            (next.row_bytes, next.rows) = family.rows(index, self.width as usize, self.height as usize);
            let first_bytes = self.planes[next.plane].stride_bytes;
            next.stride_bytes = if apart { first_bytes } else { family.stride_bytes(index, first_bytes) };
            next
        })
    }

    /// The fewest bytes that memory plane `plane` of a whole picture has: a raw picture with less is cut short. 1 for
    /// compressed formats.
    pub fn needed_bytes(&self, plane: usize) -> usize {
        self.components().filter(|component| component.plane == plane).map(|c| c.end_bytes()).max().unwrap_or(1)
    }
}
