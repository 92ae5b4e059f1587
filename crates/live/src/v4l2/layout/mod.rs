//! Conversion of V4L2 formats to [`Layout`]s.

mod color;
#[cfg(test)]
mod tests;

use v4l::v4l_sys as sys;

use crate::layout::{Family, FourCc, Layout, LayoutError, MAX_PLANES, Plane};

/// The fields shared by the kernel's single- and multi-planar structures, unchecked.
struct RawFormat {
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

/// Reads the layout from the driver's answer to `VIDIOC_G_FMT` or `VIDIOC_S_FMT`, single- or multi-planar. Colour
/// properties that the driver leaves open, or that are unknown, take V4L2's defaults.
///
/// # Errors
/// Pictures of this format cannot be read.
pub fn from_format(format: &sys::v4l2_format) -> Result<Layout, LayoutError> {
    let raw = match format.type_ {
        sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE | sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_OUTPUT => {
            // SAFETY: the type says that this member of the union was written; every bit pattern of it is valid.
            #[allow(unsafe_code)]
            RawFormat::from_single_planar(unsafe { &format.fmt.pix })
        }
        sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE
        | sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_OUTPUT_MPLANE => {
            // SAFETY: as above.
            #[allow(unsafe_code)]
            RawFormat::from_multi_planar(unsafe { &format.fmt.pix_mp })
        }
        other => return Err(LayoutError::BufferType(other)),
    };
    raw.into_layout()
}

impl RawFormat {
    /// Reads the format of a single-planar queue.
    fn from_single_planar(pix: &sys::v4l2_pix_format) -> Self {
        // Without this magic number, the fields after it were never written.
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

    /// Reads the format of a multi-planar queue.
    fn from_multi_planar(pix: &sys::v4l2_pix_format_mplane) -> Self {
        // The structure is packed, so its fields are copied before they are referenced.
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

    /// Validates the driver's values and builds the layout.
    fn into_layout(self) -> Result<Layout, LayoutError> {
        let Self { fourcc, field, plane_count, .. } = self;
        if !matches!(field, sys::v4l2_field_V4L2_FIELD_ANY | sys::v4l2_field_V4L2_FIELD_NONE) {
            return Err(LayoutError::Interlaced(field));
        }
        let planes = self.planes.get(..plane_count);
        let expected = fourcc.family().map_or(1, Family::memory_plane_count);
        let planes = planes.ok_or(LayoutError::Planes { fourcc, found: plane_count, expected })?;
        let colors = fourcc.family().map(|family| {
            color::resolve_colors(family, self.colorspace, self.ycbcr_encoding, self.quantization, self.transfer)
        });
        Layout::new(fourcc, (self.width, self.height), planes, colors)
    }
}
