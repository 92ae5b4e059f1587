use super::*;
use crate::layout::{Family, FourCcError, Range, Transfer};
use crate::v4l2::device::zeroed;
use bokehcam::color::YcbcrMatrix;

/// A single-planar format as a driver fills it in.
fn single(fourcc: FourCc, width: u32, height: u32, stride_bytes: u32, size_bytes: u32) -> sys::v4l2_format {
    let mut format: sys::v4l2_format = zeroed();
    format.type_ = sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE;
    format.fmt.pix = sys::v4l2_pix_format {
        width,
        height,
        pixelformat: fourcc.to_u32(),
        field: sys::v4l2_field_V4L2_FIELD_NONE,
        bytesperline: stride_bytes,
        sizeimage: size_bytes,
        colorspace: 0,
        priv_: sys::V4L2_PIX_FMT_PRIV_MAGIC,
        flags: 0,
        __bindgen_anon_1: sys::v4l2_pix_format__bindgen_ty_1 { ycbcr_enc: 0 },
        quantization: 0,
        xfer_func: 0,
    };
    format
}

fn with_color(mut format: sys::v4l2_format, color: [u32; 4]) -> sys::v4l2_format {
    // SAFETY: `single` wrote this member of the union.
    #[allow(unsafe_code)]
    let pix = unsafe { &mut format.fmt.pix };
    pix.colorspace = color[0];
    pix.__bindgen_anon_1.ycbcr_enc = color[1];
    pix.quantization = color[2];
    pix.xfer_func = color[3];
    format
}

fn multi(fourcc: FourCc, width: u32, height: u32, planes: &[(u32, u32)]) -> sys::v4l2_format {
    let mut format: sys::v4l2_format = zeroed();
    format.type_ = sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
    // SAFETY: zero is a valid value of every field.
    #[allow(unsafe_code)]
    let pix = unsafe { &mut format.fmt.pix_mp };
    pix.width = width;
    pix.height = height;
    pix.pixelformat = fourcc.to_u32();
    pix.num_planes = planes.len() as u8;
    let mut formats = pix.plane_fmt;
    for (format, &(stride_bytes, size_bytes)) in formats.iter_mut().zip(planes) {
        *format = sys::v4l2_plane_pix_format { sizeimage: size_bytes, bytesperline: stride_bytes, reserved: [0; 6] };
    }
    pix.plane_fmt = formats;
    format
}

#[test]
fn four_letters_are_read_and_written() {
    for (text, code) in [("MJPG", 0x4750_4A4D), ("YUYV", 0x5659_5559), ("Z16", 0x2036_315A), ("Y16 ", 0x2036_3159)] {
        let fourcc: FourCc = text.parse().unwrap();
        assert_eq!((fourcc.to_u32(), FourCc::from_u32(code)), (code, fourcc));
        assert_eq!(fourcc.to_string(), text.trim_end());
        assert!(fourcc.family().is_some(), "{fourcc}");
    }
    for wrong in ["", "   ", "MJPEG", "YU\u{e9}", "a\nb", " Y16"] {
        assert_eq!(wrong.parse::<FourCc>(), Err(FourCcError), "{wrong:?}");
    }
    assert_eq!(FourCc([b'Y', b'1', b'6', b' ' | 0x80]).to_string(), "Y16-BE");
    assert_eq!(FourCc([0, b'A', 0xFF, b' ']).to_string(), "\\x00A\\xff");
    assert_eq!(format!("{:>6}|{:<6}", FourCc::Z16, FourCc::Z16), "   Z16|Z16   ");
}

#[test]
fn the_table_agrees_with_the_layouts() {
    for fourcc in FourCc::supported_formats() {
        let layout = Layout::packed(fourcc, 640, 480).unwrap();
        let total: usize = layout.planes().iter().map(|plane| plane.size_bytes).sum();
        match bits_per_px(fourcc) {
            Some(bits) => assert_eq!(total, 640 * 480 * bits as usize / 8, "{fourcc}"),
            None => assert!(!fourcc.is_raw() && layout.components().count() == 0),
        }
        assert_eq!(FourCc::supported_formats().filter(|&other| other == fourcc).count(), 1);
    }
    assert_eq!(FourCc(*b"H264").family(), None);
}

/// Returns the mean bits per pixel; `None` for compressed and unsupported formats.
fn bits_per_px(fourcc: FourCc) -> Option<u32> {
    Some(match fourcc.family()? {
        Family::Packed422 { .. } | Family::Depth16 => 16,
        Family::SemiPlanar420 { .. } | Family::Planar420 { .. } => 12,
        Family::Rgb24 { .. } => 24,
        Family::Grey => 8,
        Family::Jpeg => return None,
    })
}

#[test]
fn colours_that_are_left_open_follow_the_colour_space() {
    use {Range::*, Transfer::*, YcbcrMatrix::*};
    // Colour space, encoding, quantization, transfer.
    for (color, expected) in [
        ([0, 0, 0, 0], (Bt601, Limited, Display)),
        ([8, 0, 0, 0], (Bt601, Limited, Display)),
        ([1, 0, 0, 0], (Bt601, Limited, Display)),
        ([7, 0, 0, 0], (Bt601, Full, Display)),
        ([3, 0, 0, 0], (Bt709, Limited, Display)),
        ([2, 0, 0, 0], (Bt709, Limited, Display)),
        ([10, 0, 0, 0], (Bt2020, Limited, Display)),
        ([11, 0, 0, 0], (Bt601, Limited, Linear)),
        ([9, 0, 0, 0], (Bt601, Limited, Gamma(22))),
        ([8, 2, 1, 0], (Bt709, Full, Display)),
        ([3, 1, 2, 5], (Bt601, Limited, Linear)),
        ([8, 6, 1, 7], (Bt2020, Full, Pq)),
        ([99, 200, 77, 250], (Bt601, Limited, Display)),
        ([u32::MAX; 4], (Bt601, Limited, Display)),
    ] {
        let layout = from_format(&with_color(single(FourCc::YUYV, 64, 8, 128, 1024), color)).unwrap();
        assert_eq!((layout.matrix, layout.range, layout.transfer), expected, "{color:?}");
    }
    let rgb = from_format(&with_color(single(FourCc::RGB3, 64, 8, 192, 1536), [8, 0, 0, 0])).unwrap();
    assert_eq!(rgb.range, Full);
    // A JPEG defines its own colours, whatever the driver reports.
    let jpeg = from_format(&with_color(single(FourCc::MJPG, 64, 8, 0, 9999), [3, 2, 2, 5])).unwrap();
    assert_eq!((jpeg.matrix, jpeg.range, jpeg.transfer), (Bt601, Full, Display));
}

#[test]
fn fields_that_were_never_written_do_not_count() {
    let mut format = with_color(single(FourCc::YUYV, 64, 8, 128, 1024), [8, 2, 1, 5]);
    format.fmt.pix.priv_ = 0;
    let layout = from_format(&format).unwrap();
    assert_eq!((layout.matrix, layout.range, layout.transfer), (YcbcrMatrix::Bt601, Range::Limited, Transfer::Display));
}

#[test]
fn components_lie_where_the_kernel_puts_them() {
    let at = |layout: Layout| -> Vec<_> {
        layout.components().map(|c| (c.plane, c.offset_bytes, c.stride_bytes, c.row_bytes, c.rows)).collect()
    };
    let nv12 = from_format(&single(FourCc::NV12, 638, 480, 640, 460_800)).unwrap();
    assert_eq!(at(nv12), [(0, 0, 640, 638, 480), (0, 307_200, 640, 638, 240)]);
    let yu12 = from_format(&single(FourCc::YU12, 638, 480, 640, 500_000)).unwrap();
    let expected = [(0, 0, 640, 638, 480), (0, 307_200, 320, 319, 240), (0, 384_000, 320, 319, 240)];
    assert_eq!(at(yu12), expected);
    assert_eq!((yu12.planes()[0].size_bytes, yu12.min_size_bytes(0)), (500_000, 384_000 + 320 * 239 + 319));
    let apart = from_format(&multi(FourCc(*b"NM12"), 640, 480, &[(704, 337_920), (768, 184_320)])).unwrap();
    assert_eq!(at(apart), [(0, 0, 704, 640, 480), (1, 0, 768, 640, 240)]);
    let three = from_format(&multi(FourCc(*b"YM12"), 16, 4, &[(32, 128), (16, 32), (16, 32)])).unwrap();
    assert_eq!(at(three), [(0, 0, 32, 16, 4), (1, 0, 16, 8, 2), (2, 0, 16, 8, 2)]);
    // A multi-planar queue may also offer a format with a single memory plane.
    let one = from_format(&multi(FourCc::NV12, 640, 480, &[(640, 460_800)])).unwrap();
    assert_eq!(at(one), [(0, 0, 640, 640, 480), (0, 307_200, 640, 640, 240)]);
    let odd = Layout::packed(FourCc::NV12, 5, 3).unwrap();
    assert_eq!(at(odd), [(0, 0, 5, 5, 3), (0, 15, 6, 6, 2)]);
}

#[test]
fn what_cannot_be_read_is_refused() {
    let refusal = |format: sys::v4l2_format| from_format(&format).unwrap_err();
    assert_eq!(refusal(single(FourCc(*b"H264"), 64, 8, 0, 0)), LayoutError::FourCc(FourCc(*b"H264")));
    assert!(matches!(refusal(single(FourCc::YUYV, 0, 8, 0, 0)), LayoutError::Size { .. }));
    assert!(matches!(refusal(single(FourCc::YUYV, 64, u32::MAX, 0, 0)), LayoutError::Size { .. }));
    assert!(matches!(refusal(single(FourCc::YUYV, 64, 8, 127, 1024)), LayoutError::Stride { min_size_bytes: 128, .. }));
    assert!(matches!(refusal(single(FourCc::YUYV, 64, 8, u32::MAX, 0)), LayoutError::Stride { .. }));
    assert!(matches!(refusal(single(FourCc::YUYV, 64, 8, 128, 1023)), LayoutError::Short { min_size_bytes: 1024, .. }));
    assert!(matches!(refusal(multi(FourCc(*b"NM12"), 64, 8, &[(64, 512)])), LayoutError::Planes { found: 1, .. }));
    assert!(matches!(refusal(multi(FourCc::NV12, 64, 8, &[(64, 768); 9])), LayoutError::Planes { found: 9, .. }));
    let mut interlaced = single(FourCc::YUYV, 64, 8, 128, 1024);
    interlaced.fmt.pix.field = 4;
    assert_eq!(refusal(interlaced), LayoutError::Interlaced(4));
    let mut other = single(FourCc::YUYV, 64, 8, 128, 1024);
    other.type_ = 13;
    assert_eq!(refusal(other), LayoutError::BufferType(13));
    // No stride stated: rows are packed tightly.
    let open = from_format(&single(FourCc::YUYV, 64, 8, 0, 0)).unwrap();
    assert_eq!(open.planes(), [Plane { stride_bytes: 128, size_bytes: 1024 }]);
}
