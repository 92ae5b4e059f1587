//! Interpretation of V4L2's colour codes.

use v4l::v4l_sys as sys;

use crate::layout::{ColorEncoding, Family, Range, Transfer};
use bokehcam::color::YcbcrMatrix;

/// Resolves a format's colour codes; a code that is 0 or unknown takes V4L2's default for the colour space. SMPTE 240M,
/// an early HD standard, counts as BT.709.
pub(super) fn resolve_colors(
    family: Family,
    colorspace: u32,
    ycbcr_encoding: u32,
    quantization: u32,
    transfer: u32,
) -> ColorEncoding {
    // JPEG files define their own colours.
    if family == Family::Jpeg {
        return (YcbcrMatrix::Bt601, Range::Full, Transfer::Display);
    }
    let matrix = match ycbcr_encoding {
        sys::v4l2_ycbcr_encoding_V4L2_YCBCR_ENC_601
        | sys::v4l2_ycbcr_encoding_V4L2_YCBCR_ENC_XV601
        | sys::v4l2_ycbcr_encoding_V4L2_YCBCR_ENC_SYCC => YcbcrMatrix::Bt601,
        sys::v4l2_ycbcr_encoding_V4L2_YCBCR_ENC_709
        | sys::v4l2_ycbcr_encoding_V4L2_YCBCR_ENC_XV709
        | sys::v4l2_ycbcr_encoding_V4L2_YCBCR_ENC_SMPTE240M => YcbcrMatrix::Bt709,
        sys::v4l2_ycbcr_encoding_V4L2_YCBCR_ENC_BT2020 | sys::v4l2_ycbcr_encoding_V4L2_YCBCR_ENC_BT2020_CONST_LUM => {
            YcbcrMatrix::Bt2020
        }
        _ => match colorspace {
            sys::v4l2_colorspace_V4L2_COLORSPACE_REC709
            | sys::v4l2_colorspace_V4L2_COLORSPACE_DCI_P3
            | sys::v4l2_colorspace_V4L2_COLORSPACE_SMPTE240M => YcbcrMatrix::Bt709,
            sys::v4l2_colorspace_V4L2_COLORSPACE_BT2020 => YcbcrMatrix::Bt2020,
            _ => YcbcrMatrix::Bt601,
        },
    };
    let range = match quantization {
        sys::v4l2_quantization_V4L2_QUANTIZATION_FULL_RANGE => Range::Full,
        sys::v4l2_quantization_V4L2_QUANTIZATION_LIM_RANGE => Range::Limited,
        // Grey is not Y'CbCr: sensors deliver it in full range.
        _ if matches!(family, Family::Rgb24 { .. } | Family::Grey | Family::Depth16) => Range::Full,
        _ if colorspace == sys::v4l2_colorspace_V4L2_COLORSPACE_JPEG => Range::Full,
        _ => Range::Limited,
    };
    let transfer = match transfer {
        sys::v4l2_xfer_func_V4L2_XFER_FUNC_709
        | sys::v4l2_xfer_func_V4L2_XFER_FUNC_SRGB
        | sys::v4l2_xfer_func_V4L2_XFER_FUNC_SMPTE240M => Transfer::Display,
        sys::v4l2_xfer_func_V4L2_XFER_FUNC_OPRGB => Transfer::Gamma(22),
        sys::v4l2_xfer_func_V4L2_XFER_FUNC_NONE => Transfer::Linear,
        sys::v4l2_xfer_func_V4L2_XFER_FUNC_DCI_P3 => Transfer::Gamma(26),
        sys::v4l2_xfer_func_V4L2_XFER_FUNC_SMPTE2084 => Transfer::Pq,
        _ => match colorspace {
            sys::v4l2_colorspace_V4L2_COLORSPACE_OPRGB => Transfer::Gamma(22),
            sys::v4l2_colorspace_V4L2_COLORSPACE_RAW => Transfer::Linear,
            sys::v4l2_colorspace_V4L2_COLORSPACE_DCI_P3 => Transfer::Gamma(26),
            _ => Transfer::Display,
        },
    };
    (matrix, range, transfer)
}
