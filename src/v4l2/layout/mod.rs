//! What a picture looks like in the memory that a driver fills: its format, where its planes lie, and what its
//! numbers mean as colours.

mod color;
mod fourcc;
#[cfg(test)]
mod tests;

use crate::color::Matrix;
pub use color::{Range, Transfer};
pub use fourcc::{Content, Family, FourCc, FourCcError};

use v4l::v4l_sys as sys;

/// Widest and highest picture that is accepted, in pixels: what a driver says is believed only so far.
pub const MAX_SIDE_PX: u32 = 8192;

/// Most memory planes and most components of a supported format.
const MAX_PLANES: usize = 3;

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
    pub rows: usize,
}

impl Component {
    /// Bytes of its plane up to the end of its last row, which need not be padded.
    pub fn end_bytes(&self) -> usize {
        self.offset_bytes + self.stride_bytes * (self.rows - 1) + self.row_bytes
    }
}

/// Why a format cannot be used.
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

/// What the kernel's single- and multi-planar structure have in common, not checked yet.
struct Raw {
    fourcc: FourCc,
    width: u32,
    height: u32,
    field: u32,
    colorspace: u32,
    ycbcr_encoding: u32,
    quantization: u32,
    transfer: u32,
    planes: [Plane; MAX_PLANES],
    plane_count: usize,
}

impl Layout {
    /// The layout in the driver's answer to `VIDIOC_G_FMT` or `VIDIOC_S_FMT`, single- or multi-planar. Where the driver
    /// leaves the colours open, V4L2's defaults hold; values that are not known count as open.
    ///
    /// # Errors
    /// Such pictures cannot be read.
    pub fn from_format(format: &sys::v4l2_format) -> Result<Self, LayoutError> {
        let raw = match format.type_ {
            sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE | sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_OUTPUT => {
                // SAFETY: the type says that this part of the union was written; every bit pattern of it is valid.
                #[allow(unsafe_code)]
                Raw::single(unsafe { &format.fmt.pix })
            }
            sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE
            | sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_OUTPUT_MPLANE => {
                // SAFETY: as above.
                #[allow(unsafe_code)]
                Raw::multi(unsafe { &format.fmt.pix_mp })
            }
            other => return Err(LayoutError::BufferType(other)),
        };
        raw.into_layout()
    }

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
        let plane_count = fourcc.family().map_or(1, |family| family.memory_planes());
        // Strides and sizes of 0 are computed, colour codes of 0 stand for V4L2's defaults.
        let (planes, defaults) = ([Plane { stride_bytes, size_bytes: 0 }; MAX_PLANES], 0);
        Raw {
            fourcc,
            width,
            height,
            field: sys::v4l2_field_V4L2_FIELD_NONE,
            colorspace: defaults,
            ycbcr_encoding: defaults,
            quantization: defaults,
            transfer: defaults,
            planes,
            plane_count,
        }
        .into_layout()
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

impl Raw {
    /// From the format of a single-planar queue.
    fn single(pix: &sys::v4l2_pix_format) -> Self {
        // Without this mark the fields after it were never written.
        let extended = pix.priv_ == sys::V4L2_PIX_FMT_PRIV_MAGIC;
        let if_extended = |value| if extended { value } else { 0 };
        // SAFETY: two names of one number.
        #[allow(unsafe_code)]
        let ycbcr_encoding = unsafe { pix.__bindgen_anon_1.ycbcr_enc };
        let mut planes = [Plane::default(); MAX_PLANES];
        planes[0] = Plane { stride_bytes: pix.bytesperline as usize, size_bytes: pix.sizeimage as usize };
        Self {
            fourcc: FourCc::from_u32(pix.pixelformat),
            width: pix.width,
            height: pix.height,
            field: pix.field,
            colorspace: pix.colorspace,
            ycbcr_encoding: if_extended(ycbcr_encoding),
            quantization: if_extended(pix.quantization),
            transfer: if_extended(pix.xfer_func),
            planes,
            plane_count: 1,
        }
    }

    /// From the format of a multi-planar queue.
    fn multi(pix: &sys::v4l2_pix_format_mplane) -> Self {
        // The structure is packed, so its fields are copied before they are looked at.
        let formats = pix.plane_fmt;
        let mut planes = [Plane::default(); MAX_PLANES];
        for (plane, format) in planes.iter_mut().zip(formats) {
            *plane = Plane { stride_bytes: format.bytesperline as usize, size_bytes: format.sizeimage as usize };
        }
        // SAFETY: two names of one number.
        #[allow(unsafe_code)]
        let ycbcr_encoding = unsafe { pix.__bindgen_anon_1.ycbcr_enc };
        Self {
            fourcc: FourCc::from_u32(pix.pixelformat),
            width: pix.width,
            height: pix.height,
            field: pix.field,
            colorspace: pix.colorspace,
            ycbcr_encoding: ycbcr_encoding.into(),
            quantization: pix.quantization.into(),
            transfer: pix.xfer_func.into(),
            planes,
            plane_count: pix.num_planes.into(),
        }
    }

    /// Checks the driver's values against the format, and computes the strides and sizes that it left 0.
    fn into_layout(self) -> Result<Layout, LayoutError> {
        let Self { fourcc, width, height, field, .. } = self;
        let family = fourcc.family().ok_or(LayoutError::FourCc(fourcc))?;
        if !(1..=MAX_SIDE_PX).contains(&width) || !(1..=MAX_SIDE_PX).contains(&height) {
            return Err(LayoutError::Size { width, height });
        }
        if !matches!(field, sys::v4l2_field_V4L2_FIELD_ANY | sys::v4l2_field_V4L2_FIELD_NONE) {
            return Err(LayoutError::Interlaced(field));
        }
        let expected = family.memory_planes();
        if self.plane_count != expected {
            return Err(LayoutError::Planes { fourcc, found: self.plane_count, expected });
        }
        let (matrix, range, transfer) =
            color::resolve(family, self.colorspace, self.ycbcr_encoding, self.quantization, self.transfer);
        let (planes, plane_count) = (self.planes, self.plane_count);
        let mut layout = Layout { fourcc, width, height, matrix, range, transfer, planes, plane_count };
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
}
