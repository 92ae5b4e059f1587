use std::io::Write;

use super::*;
use bokehcam::frame::{ColorImage, DepthMap, GrayImage};

const HEADER: &[u8] = b"YUV4MPEG2 W2 H2 F10:1 Cmono XCOLORRANGE=FULL\n";

/// Returns a stream with these frames, each of one grey.
fn stream(greys: &[u8]) -> Vec<u8> {
    greys.iter().fold(HEADER.to_vec(), |stream, &grey| [&stream, &b"FRAME\n"[..], &[grey; 4]].concat())
}

fn open(bytes: &[u8], limit: Option<u64>) -> Result<Y4m, CaptureError> {
    let (reader, mut writer) = io::pipe().unwrap();
    writer.write_all(bytes).unwrap();
    drop(writer);
    Y4m::new(PipeReader::from_owned(reader.into()), limit)
}

/// Returns the grey and the time in ms of the next frame, or what came instead.
fn next(camera: &mut Y4m) -> Result<(u8, u64), String> {
    let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
    match camera.next(FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right }).unwrap() {
        Captured::Frame(stamp) => Ok((color.rgb[0], stamp.time_ns / 1_000_000)),
        Captured::Corrupt(error) => Err(error.to_string()),
        other => Err(format!("{other:?}")),
    }
}

fn read_all(mut camera: Y4m) -> (Vec<(u8, u64)>, String) {
    let mut frames = Vec::new();
    loop {
        match next(&mut camera) {
            Ok(frame) => frames.push(frame),
            Err(end) => return (frames, end),
        }
    }
}

#[test]
fn frames_come_at_the_rate_of_the_header_until_the_end_or_the_limit() {
    let bytes = stream(&[7, 8, 9]);
    let frames = [(7, 0), (8, 100), (9, 200)];
    assert_eq!(read_all(open(&bytes, None).unwrap()), (frames.to_vec(), "End".to_owned()));
    assert_eq!(read_all(open(&bytes, Some(2)).unwrap()).0, frames[..2]);
    let mut camera = open(&bytes, None).unwrap();
    assert_eq!(camera.skip_until(150_000_000), 2);
    assert_eq!(next(&mut camera), Ok((9, 200)));
    assert_eq!(camera.skip_until(u64::MAX), 0);
}

#[test]
fn a_stream_cut_anywhere_gives_its_whole_frames_and_one_fault() {
    let whole = stream(&[7, 8, 9]);
    for cut in 0..whole.len() {
        let Ok(camera) = open(&whole[..cut], None) else {
            assert!(cut < HEADER.len(), "{cut}");
            continue;
        };
        let (frames, end) = read_all(camera);
        let (expected, rest) = (cut.saturating_sub(HEADER.len()) / 10, cut.saturating_sub(HEADER.len()) % 10);
        assert_eq!(frames.len(), expected, "{cut}");
        assert_eq!(end == "End", rest == 0, "{cut}: {end}");
    }
}

#[test]
fn what_is_no_stream_is_one_line() {
    let no_frame = [HEADER, &b"FRAMES\n0000"[..]].concat();
    assert!(read_all(open(&no_frame, None).unwrap()).1.contains("FRAME"));
    for bytes in [&b""[..], b"GIF89a\n", &[b'Y'; 5000], &[0; 3000]] {
        let error = open(bytes, None).err().unwrap().to_string();
        assert!(error.starts_with("standard input: ") && !error.contains('\n'), "{error}");
    }
}

#[test]
fn a_frame_that_is_on_its_way_is_waited_for_and_not_skipped() {
    let (reader, mut writer) = io::pipe().unwrap();
    writer.write_all(&stream(&[7])).unwrap();
    let mut camera = Y4m::new(PipeReader::from_owned(reader.into()), None).unwrap();
    assert_eq!(next(&mut camera), Ok((7, 0)));
    writer.write_all(b"FRAME\n\x08\x08").unwrap();
    assert_eq!(camera.skip_until(u64::MAX), 0);
    assert_eq!(next(&mut camera), Err("Waiting".to_owned()));
    writer.write_all(b"\x08\x08").unwrap();
    assert_eq!(next(&mut camera), Ok((8, 100)));
}
