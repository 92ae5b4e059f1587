//! The memory layout of a picture: format, planes and colour encoding.

mod color;
mod fourcc;

use bokehcam::color::YcbcrMatrix;
pub use bokehcam_video::MAX_SIDE_PX;
pub use color::{ColorEncoding, Range, Transfer};
pub use fourcc::{Content, Family, FourCc, FourCcError};

/// Maximum number of memory planes and components of a supported format.
pub const MAX_PLANES: usize = 3;

/// The layout of a picture in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The pixel format, a supported one.
    pub fourcc: FourCc,
    /// Columns, 1 to [`MAX_SIDE_PX`].
    pub width: u32,
    /// Rows, 1 to [`MAX_SIDE_PX`].
    pub height: u32,
    /// The luma weights.
    pub matrix: YcbcrMatrix,
    /// The quantisation range.
    pub range: Range,
    /// The transfer function.
    pub transfer: Transfer,
    planes: [Plane; MAX_PLANES],
    plane_count: usize,
}

/// A memory plane of a picture: a separate buffer in a multi-planar queue, otherwise the only buffer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Plane {
    /// Bytes from row to row of its first component; 0 for compressed formats.
    pub stride_bytes: usize,
    /// Size in bytes; may exceed the need, and is an upper bound for compressed formats.
    pub size_bytes: usize,
}

/// The rows of one component (luma, chroma, or packed pixels) within a picture's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Component {
    /// Index of the memory plane.
    pub plane: usize,
    /// Offset of the first row in it.
    pub offset_bytes: usize,
    /// Bytes from row to row.
    pub stride_bytes: usize,
    /// Bytes per row that hold samples.
    pub row_bytes: usize,
    /// Number of rows.
    pub rows: usize,
}

impl Component {
    /// Returns the bytes of its plane up to the end of the last row, which may be unpadded.
    fn end_bytes(&self) -> usize {
        self.offset_bytes + self.stride_bytes * (self.rows - 1) + self.row_bytes
    }
}

/// An invalid layout.
#[allow(missing_docs)] // The messages say what the fields are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayoutError {
    /// The queue type does not capture pictures.
    #[error("buffer type {0} does not hold captured pictures")]
    BufferType(u32),
    /// The pixel format is not supported.
    #[error("pixel format {0} is not supported")]
    FourCc(FourCc),
    /// The size is out of range.
    #[error("the device gives pictures of {width} x {height} pixels, but 1 to {MAX_SIDE_PX} per side are supported")]
    Size { width: u32, height: u32 },
    #[error("the device reports {stride_bytes} bytes a row, but {width} pixels of {fourcc} need {min_size_bytes}")]
    Stride { fourcc: FourCc, width: u32, stride_bytes: usize, min_size_bytes: usize },
    /// The buffer is too small for the picture.
    #[error(
        "the device reports {size_bytes} bytes a picture, but {width} x {height} pixels of {fourcc} need {min_size_bytes}"
    )]
    Short { fourcc: FourCc, width: u32, height: u32, size_bytes: usize, min_size_bytes: usize },
    /// The number of memory planes does not fit the format.
    #[error("the device gives {fourcc} in {found} memory planes instead of {expected}")]
    Planes { fourcc: FourCc, found: usize, expected: usize },
    #[error(
        "the device gives interlaced pictures (field order {0}), which are not supported; choose a progressive mode"
    )]
    Interlaced(u32),
}

impl Layout {
    /// Creates the layout of a picture without padding, with V4L2's default colours, for formats that no driver
    /// describes.
    ///
    /// # Errors
    /// The format or size is not supported.
    pub fn packed(fourcc: FourCc, width: u32, height: u32) -> Result<Self, LayoutError> {
        Self::with_stride(fourcc, width, height, 0)
    }

    /// Does the same with `stride_bytes` from row to row of each plane's first component; 0 is without padding.
    ///
    /// # Errors
    /// The format, size or stride is not supported.
    pub fn with_stride(fourcc: FourCc, width: u32, height: u32, stride_bytes: usize) -> Result<Self, LayoutError> {
        let plane_count = fourcc.family().map_or(1, Family::memory_plane_count);
        Self::new(fourcc, (width, height), &[Plane { stride_bytes, size_bytes: 0 }; MAX_PLANES][..plane_count], None)
    }

    /// Creates the layout of a picture of `width` x `height` pixels in these memory planes. Strides and sizes of 0 are
    /// computed. `None` for `colors` uses V4L2's defaults.
    ///
    /// # Errors
    /// The format, size, stride or buffer size is not supported.
    pub fn new(
        fourcc: FourCc,
        (width, height): (u32, u32),
        given: &[Plane],
        colors: Option<ColorEncoding>,
    ) -> Result<Self, LayoutError> {
        let family = fourcc.family().ok_or(LayoutError::FourCc(fourcc))?;
        if !(1..=MAX_SIDE_PX).contains(&width) || !(1..=MAX_SIDE_PX).contains(&height) {
            return Err(LayoutError::Size { width, height });
        }
        let plane_count = family.memory_plane_count();
        if given.len() != plane_count {
            return Err(LayoutError::Planes { fourcc, found: given.len(), expected: plane_count });
        }
        let (matrix, range, transfer) = colors.unwrap_or_else(|| color::default_encoding(family));
        let mut planes = [Plane::default(); MAX_PLANES];
        planes[..plane_count].copy_from_slice(given);
        let mut layout = Self { fourcc, width, height, matrix, range, transfer, planes, plane_count };
        if family == Family::Jpeg {
            layout.planes[0].stride_bytes = 0;
            return Ok(layout);
        }
        for (index, plane) in layout.planes[..plane_count].iter_mut().enumerate() {
            let min_size_bytes = family.component_rows(index, width as usize, height as usize).0;
            if plane.stride_bytes == 0 {
                plane.stride_bytes = min_size_bytes;
            }
            // The bound keeps every sum below within 64 bits, whatever the driver reports.
            if plane.stride_bytes < min_size_bytes || plane.stride_bytes > 1 << 28 {
                let stride_bytes = plane.stride_bytes;
                return Err(LayoutError::Stride { fourcc, width, stride_bytes, min_size_bytes });
            }
        }
        // Chroma strides derive from luma's: half of an odd stride must still hold a chroma row.
        for component in layout.components() {
            if component.stride_bytes < component.row_bytes {
                let stride_bytes = layout.planes[component.plane].stride_bytes;
                return Err(LayoutError::Stride {
                    fourcc,
                    width,
                    stride_bytes,
                    min_size_bytes: 2 * component.row_bytes,
                });
            }
        }
        for index in 0..plane_count {
            let min_size_bytes = layout.min_size_bytes(index);
            let size_bytes = &mut layout.planes[index].size_bytes;
            if *size_bytes == 0 {
                *size_bytes = min_size_bytes;
            }
            if *size_bytes < min_size_bytes {
                return Err(LayoutError::Short { fourcc, width, height, size_bytes: *size_bytes, min_size_bytes });
            }
        }
        Ok(layout)
    }

    /// Adds `extra_bytes` between rows.
    #[doc(hidden)]
    #[must_use]
    pub fn with_row_padding(mut self, extra_bytes: usize) -> Self {
        for index in 0..self.plane_count {
            self.planes[index].stride_bytes += extra_bytes;
        }
        for index in 0..self.plane_count {
            self.planes[index].size_bytes = self.min_size_bytes(index) + extra_bytes;
        }
        self
    }

    /// Returns the format's family.
    pub fn family(&self) -> Family {
        // Layouts are created for supported formats only, but the field is public.
        self.fourcc.family().unwrap_or(Family::Jpeg)
    }

    /// Returns the memory planes, 1 to 3.
    pub fn planes(&self) -> &[Plane] {
        &self.planes[..self.plane_count]
    }

    /// Returns the components of a raw picture in memory order: luma, first chroma, second chroma. Empty for a
    /// compressed one.
    pub fn components(&self) -> impl Iterator<Item = Component> {
        let family = self.family();
        let apart = self.plane_count > 1;
        let mut next = Component { plane: 0, offset_bytes: 0, stride_bytes: 0, row_bytes: 0, rows: 0 };
        (0..family.component_count()).map(move |index| {
            if apart {
                (next.plane, next.offset_bytes) = (index, 0);
            } else {
                next.offset_bytes += next.stride_bytes * next.rows;
            }
            (next.row_bytes, next.rows) = family.component_rows(index, self.width as usize, self.height as usize);
            let first_bytes = self.planes[next.plane].stride_bytes;
            next.stride_bytes = if apart { first_bytes } else { family.component_stride_bytes(index, first_bytes) };
            next
        })
    }

    /// Returns the minimum size of memory plane `plane`: a raw picture with fewer bytes is truncated. 1 for compressed
    /// formats.
    pub fn min_size_bytes(&self, plane: usize) -> usize {
        self.components().filter(|component| component.plane == plane).map(|c| c.end_bytes()).max().unwrap_or(1)
    }
}
