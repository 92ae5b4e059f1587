//! Targets for camera input: format descriptions of drivers, raw pixels, and Motion-JPEG.

use bokehcam::frame::ColorImage;
use bokehcam_live::capture::pixels::Decoder;
use bokehcam_live::v4l2::{FourCc, Layout};
use v4l::v4l_sys as sys;

use super::input::{Numbers, assert_one_line};

/// Maximum size of a raw picture to decode, in bytes.
const MAX_BYTES: usize = 1 << 22;

/// Repairs and decodes a Motion-JPEG picture.
pub fn mjpeg(data: &[u8]) {
    let (width, height) = jpeg_size(data).unwrap_or((64, 48));
    let layout = Layout::packed(FourCc::MJPG, width, height).unwrap();
    let mut decoder = Decoder::new(&layout).unwrap();
    let mut picture = ColorImage::default();
    match decoder.decode(&[data], &mut picture) {
        Ok(()) => assert_eq!(picture.rgb.len(), (width * height * 3) as usize),
        Err(error) => assert_one_line(error),
    }
}

/// Returns the size in a JPEG's first frame header, if it is at most 512 x 512.
fn jpeg_size(data: &[u8]) -> Option<(u32, u32)> {
    let at = data.windows(2).position(|pair| pair[0] == 0xff && matches!(pair[1], 0xc0..=0xc2))?;
    let &[h1, h0, w1, w0] = data.get(at + 5..at + 9)?.first_chunk()?;
    let size = (u16::from_be_bytes([w1, w0]).into(), u16::from_be_bytes([h1, h0]).into());
    Some(size).filter(|size| (1..=512).contains(&size.0) && (1..=512).contains(&size.1))
}

/// Decodes a possibly truncated picture in a format as a driver could describe it.
pub fn raw_pixels(data: &[u8]) {
    let mut numbers = Numbers(data);
    let format = build_format(&mut numbers);
    let layout = match bokehcam_live::v4l2::layout::from_format(&format) {
        Ok(layout) => layout,
        Err(error) => return assert_one_line(error),
    };
    let needed: Vec<usize> = (0..layout.planes().len()).map(|plane| layout.min_size_bytes(plane)).collect();
    if needed.iter().sum::<usize>() > MAX_BYTES {
        return;
    }
    let Ok(mut decoder) = Decoder::new(&layout) else { return };
    let cuts: [u8; 3] = std::array::from_fn(|_| numbers.u8());
    let fill = numbers.u8();
    let buffers: Vec<Vec<u8>> = needed
        .iter()
        .zip(cuts)
        .map(|(&needed, cut)| {
            // Exact, one byte short, too long, or an arbitrary short buffer.
            let length = match cut % 4 {
                0 => needed,
                1 => needed - 1,
                2 => needed + 7,
                _ => cut.into(),
            };
            let mut buffer = vec![fill; length];
            buffer.iter_mut().zip(numbers.0).for_each(|(to, from)| *to = *from);
            buffer
        })
        .collect();
    let planes: Vec<&[u8]> = buffers.iter().map(Vec::as_slice).collect();
    let mut picture = ColorImage::default();
    let whole = planes.iter().zip(&needed).all(|(plane, needed)| plane.len() >= *needed);
    match decoder.decode(&planes, &mut picture) {
        Ok(()) => assert_eq!(picture.rgb.len(), layout.width as usize * layout.height as usize * 3),
        Err(error) => {
            assert!(!whole || !layout.fourcc.is_raw(), "a whole picture is refused: {error}");
            assert_one_line(error);
        }
    }
    assert!(decoder.decode(&planes[1..], &mut picture).is_err(), "a plane lacks, and the picture is accepted");
}

/// Builds the kernel's structure from arbitrary numbers.
fn build_format(numbers: &mut Numbers) -> sys::v4l2_format {
    let [multi, code, field, quantization, transfer, encoding, planes, large] = std::array::from_fn(|_| numbers.u8());
    let codes: Vec<FourCc> = FourCc::supported_formats().collect();
    let fourcc = codes[code as usize % codes.len()].to_u32();
    let (width, height): (u32, u32) = (numbers.u16().into(), numbers.u16().into());
    let (width, height) = if large & 1 == 1 { (width, height) } else { (width % 70, height % 40) };
    let colorspace = numbers.u8().into();
    let strides: [u32; 3] = std::array::from_fn(|_| numbers.u32());
    let sizes: [u32; 3] = std::array::from_fn(|_| numbers.u32());
    // SAFETY: plain numbers; all zeros are a valid value.
    #[allow(unsafe_code)]
    let mut format: sys::v4l2_format = unsafe { std::mem::zeroed() };
    if multi & 1 == 1 {
        format.type_ = sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
        // SAFETY: as above.
        #[allow(unsafe_code)]
        let mut pix: sys::v4l2_pix_format_mplane = unsafe { std::mem::zeroed() };
        (pix.width, pix.height, pix.pixelformat, pix.field) = (width, height, fourcc, (field % 3).into());
        (pix.colorspace, pix.quantization, pix.xfer_func, pix.num_planes) =
            (colorspace, quantization, transfer, planes);
        pix.__bindgen_anon_1.ycbcr_enc = encoding;
        // A copy, as the structure is packed.
        let mut each = pix.plane_fmt;
        for (plane, (stride, size)) in each.iter_mut().zip(strides.into_iter().zip(sizes)) {
            (plane.bytesperline, plane.sizeimage) = (stride, size);
        }
        pix.plane_fmt = each;
        format.fmt.pix_mp = pix;
    } else {
        format.type_ = sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE;
        // SAFETY: as above.
        #[allow(unsafe_code)]
        let mut pix: sys::v4l2_pix_format = unsafe { std::mem::zeroed() };
        (pix.width, pix.height, pix.pixelformat, pix.field) = (width, height, fourcc, (field % 3).into());
        (pix.colorspace, pix.quantization, pix.xfer_func) = (colorspace, quantization.into(), transfer.into());
        pix.priv_ = if planes & 1 == 0 { sys::V4L2_PIX_FMT_PRIV_MAGIC } else { 0 };
        (pix.bytesperline, pix.sizeimage) = (strides[0], sizes[0]);
        pix.__bindgen_anon_1.ycbcr_enc = encoding.into();
        format.fmt.pix = pix;
    }
    format
}
