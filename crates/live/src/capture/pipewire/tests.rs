use super::*;

const SIZE: (usize, usize) = (6, 4);

/// Decodes a picture of [`SIZE`] in these planes with these strides.
fn decode(fourcc: &[u8; 4], planes: &[&[u8]], strides_bytes: &[usize]) -> Result<Vec<u8>, String> {
    let (sender, mut receiver) = link::live();
    let any = ModeRequest::for_content(crate::layout::Content::Color);
    let mut decoder = PictureDecoder::new(any, sender);
    let size = (SIZE.0 as u32, SIZE.1 as u32);
    decoder.set_format(&NegotiatedFormat { fourcc: *fourcc, size, rate: (30, 1) });
    decoder.decode(&Frame { planes, strides_bytes, captured_ns: 0 })?;
    let Received::Item(picture) = receiver.recv_timeout(MAX_WAIT) else { panic!("there is a picture") };
    Ok(picture.color.rgb.clone())
}

/// Returns rows of `row_bytes`, each padded to `stride` bytes.
fn rows((row_bytes, rows): (usize, usize), stride: usize, first: usize) -> Vec<u8> {
    let byte = |x: usize, y: usize| if x < row_bytes { (first + 31 * y + 7 * x) as u8 } else { 0xee };
    (0..rows).flat_map(|y| (0..stride).map(move |x| byte(x, y))).collect()
}

/// libcamera's processing on GPUs pads rows to 2048 bytes.
#[test]
fn padded_rows_are_read_as_rows_without_padding() {
    const PADDED: usize = 2048;
    let picture = |stride: usize, in_two_planes: bool| {
        let planes = [rows(SIZE, stride, 20), rows((SIZE.0, SIZE.1 / 2), stride, 90)];
        let whole = planes.concat();
        let planes: &[&[u8]] = if in_two_planes { &[&planes[0], &planes[1]] } else { &[&whole] };
        decode(b"NV12", planes, &[stride; 2][..planes.len()]).unwrap()
    };
    let plain = picture(SIZE.0, false);
    assert!(plain.iter().any(|&code| code != plain[0]));
    for (stride, in_two_planes) in [(SIZE.0, true), (PADDED, false), (PADDED, true)] {
        assert_eq!(picture(stride, in_two_planes), plain, "{stride} bytes per row, in two planes: {in_two_planes}");
    }
}

#[test]
fn rows_of_chroma_have_their_own_stride_or_half_of_lumas() {
    const PADDED: usize = 32;
    let half = (SIZE.0 / 2, SIZE.1 / 2);
    let picture = |[luma, chroma]: [usize; 2], stated: [usize; 3]| {
        let planes = [rows(SIZE, luma, 20), rows(half, chroma, 90), rows(half, chroma, 150)];
        decode(b"YU12", &planes.each_ref().map(Vec::as_slice), &stated)
    };
    let plain = picture([6, 3], [6, 3, 3]).unwrap();
    for (strides, stated) in [
        ([PADDED, PADDED / 2], [PADDED, PADDED / 2, PADDED / 2]),
        ([PADDED, PADDED / 2], [PADDED; 3]),
        ([PADDED, PADDED], [PADDED; 3]),
        ([PADDED, PADDED / 2], [PADDED, 0, 0]),
        ([6, 3], [0; 3]),
    ] {
        assert_eq!(picture(strides, stated).as_ref(), Ok(&plain), "{strides:?}, stated as {stated:?}");
    }
    let said = picture([PADDED, PADDED / 2], [PADDED, 2, 2]).unwrap_err();
    assert!(said.contains("2 bytes a row"), "{said}");
}

#[test]
fn what_does_not_hold_the_picture_is_damaged() {
    let bytes = rows((SIZE.0, SIZE.1 * 3 / 2), SIZE.0, 20);
    assert!(decode(b"NV12", &[&bytes], &[SIZE.0]).is_ok());
    for (bytes, stride) in
        [(&bytes[1..], SIZE.0), (&bytes, SIZE.0 - 1), (&bytes, SIZE.0 + 1), (&bytes, i32::MAX as usize)]
    {
        assert!(decode(b"NV12", &[bytes], &[stride]).is_err(), "{} bytes, {stride} a row", bytes.len());
    }
}

#[test]
fn modes_are_ranked_as_those_of_other_cameras() {
    let mode = |fourcc: &[u8; 4], sizes, rates| Mode { fourcc: *fourcc, sizes, rates };
    let modes = [
        mode(b"MJPG", Offer::These(vec![(1920, 1080), (1280, 720)]), Offer::These(vec![(30, 1), (60, 1)])),
        mode(b"YUYV", Offer::These(vec![(640, 480), (1280, 720)]), Offer::These(vec![(15, 1), (30, 1)])),
        mode(b"NV12", Offer::Range { min: (2, 2), max: (4096, 4096) }, Offer::Range { min: (0, 1), max: (120, 1) }),
    ];
    let chosen = |request: ModeRequest| {
        let (sender, _receiver) = link::live();
        let mut picture_decoder = PictureDecoder::new(request, sender);
        let NegotiatedFormat { fourcc, size, rate } = picture_decoder.choose_mode(&modes).unwrap();
        format!("{} {size:?} {}/{}", FourCc(fourcc), rate.0, rate.1)
    };
    let any = ModeRequest::for_content(crate::layout::Content::Color);
    let format = |fourcc: &str| ModeRequest { fourcc: Some(fourcc.parse().unwrap()), ..any };
    assert_eq!(chosen(format("YUYV")), "YUYV (1280, 720) 30/1");
    assert_eq!(chosen(format("NV12")), "NV12 (1280, 720) 30/1");
    assert_eq!(
        chosen(ModeRequest { size_px: Some((1920, 1080)), fps: Some(60.0), ..format("MJPG") }),
        "MJPG (1920, 1080) 60/1"
    );
    assert_eq!(chosen(ModeRequest { size_px: Some((640, 360)), ..any }), "NV12 (640, 360) 30/1");
}
