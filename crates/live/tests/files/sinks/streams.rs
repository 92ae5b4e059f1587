//! y4m: its bytes, its colours, its times.

use std::fs;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::Path;

use bokehcam::color::YcbcrMatrix;
use bokehcam_live::layout::Range;
use bokehcam_live::sink::yuv::Converter;
use bokehcam_live::sink::{Ending, Sink, Y4m};

use super::{PERIOD_NS, flat, open, options, picture};

/// Converts limited-range planes to RGB by the definition of the matrix, in floating point.
fn decode(matrix: YcbcrMatrix, width: usize, height: usize, planes: &[u8]) -> Vec<[f64; 3]> {
    let [kr, _, kb] = matrix.luma_weights();
    let half = width.div_ceil(2);
    let (luma, chroma) = planes.split_at(width * height);
    let (cb, cr) = chroma.split_at(half * height.div_ceil(2));
    let rgb_at = |x: usize, y: usize| {
        let at = y / 2 * half + x / 2;
        let l = (f64::from(luma[y * width + x]) - 16.0) / 219.0;
        let r = l + 2.0 * (1.0 - kr) * (f64::from(cr[at]) - 128.0) / 224.0;
        let b = l + 2.0 * (1.0 - kb) * (f64::from(cb[at]) - 128.0) / 224.0;
        [r, (l - kr * r - kb * b) / (1.0 - kr - kb), b].map(|value| value * 255.0)
    };
    (0..width * height).map(|index| rgb_at(index % width, index / width)).collect()
}

/// Pictures go into a pipe one by one; each is complete at the reader before the next one comes.
#[test]
fn a_picture_is_not_held_back() {
    let (mut reader, writer) = io::pipe().unwrap();
    let mut stream = Y4m::new(writer, Path::new("pipe"), &options((16, 12)));
    let mut bytes = [0; 1024];
    for frame in 0..3 {
        stream.write(&picture(16, 12, frame), u64::from(frame) * PERIOD_NS).unwrap();
        // Less than a pipe's capacity: all that was written is readable now, or never.
        let read = io::Read::read(&mut reader, &mut bytes).unwrap();
        let whole = b"FRAME\n".len() + 16 * 12 * 3 / 2;
        let header = bytes[..read].windows(6).position(|bytes| bytes == b"FRAME\n").unwrap();
        assert_eq!(read - header, whole, "frame {frame}");
    }
}

#[test]
fn a_grey_picture_is_this_y4m_to_the_byte() {
    let mut stream = Y4m::new(Vec::new(), Path::new("memory"), &options((3, 3)));
    stream.write(&flat(3, 3, [128; 3]), 7).unwrap();
    stream.write(&flat(3, 3, [255; 3]), 7 + PERIOD_NS).unwrap();
    let mut expected = b"YUV4MPEG2 W3 H3 F25:1 Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n".to_vec();
    for luma in [126, 235] {
        expected.extend_from_slice(b"FRAME\n");
        expected.extend_from_slice(&[luma; 9]);
        expected.extend_from_slice(&[128; 8]);
    }
    assert_eq!(stream.into_inner().unwrap(), expected);
}

#[test]
fn colours_survive_within_two_levels() {
    for matrix in [YcbcrMatrix::Bt601, YcbcrMatrix::Bt709] {
        let converter = Converter::new(matrix, Range::Limited);
        for (width, height) in [(4, 2), (5, 3), (1, 1), (1, 6)] {
            for code in 0..125u32 {
                let rgb = [code % 5, code / 5 % 5, code / 25].map(|step| (step * 255 / 4) as u8);
                let mut planes = Vec::new();
                converter.append_planes(&flat(width, height, rgb), &mut planes);
                for pixel in decode(matrix, width as usize, height as usize, &planes) {
                    let off = pixel.iter().zip(rgb).map(|(value, exact)| (value - f64::from(exact)).abs());
                    assert!(off.fold(0.0, f64::max) <= 2.0, "{matrix:?} {rgb:?} came back as {pixel:?}");
                }
            }
        }
    }
}

#[test]
fn chroma_is_the_mean_of_its_four_pixels() {
    let mut image = flat(2, 2, [0; 3]);
    image.rgb[..3].copy_from_slice(&[255, 0, 0]);
    image.rgb[9..].copy_from_slice(&[255, 0, 0]);
    let mut mixed = Vec::new();
    Converter::new(YcbcrMatrix::Bt709, Range::Limited).append_planes(&image, &mut mixed);
    let mut mean = Vec::new();
    Converter::new(YcbcrMatrix::Bt709, Range::Limited).append_planes(&flat(2, 2, [127, 0, 0]), &mut mean);
    assert!(mixed[4].abs_diff(mean[4]) <= 1 && mixed[5].abs_diff(mean[5]) <= 1);
    assert_eq!((mixed[0], mixed[1]), (63, 16));
}

/// Returns the luma of the first pixel of each picture of a y4m.
fn lumas(stream: &[u8], frame_bytes: usize) -> Vec<u8> {
    let header = stream.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    stream[header..].chunks(6 + frame_bytes).map(|frame| frame[6]).collect()
}

#[test]
fn a_stream_of_one_rate_takes_as_long_as_its_frames_did() {
    let mut stream = Y4m::new(Vec::new(), Path::new("memory"), &options((2, 2)));
    // Every second frame is missing, then one comes too early, then half a second is missing.
    for (grey, at) in [(0, 0), (50, 2), (100, 4), (150, 5), (200, 18)] {
        stream.write(&flat(2, 2, [grey; 3]), 5 + at * PERIOD_NS).unwrap();
        if at == 5 {
            stream.write(&flat(2, 2, [255; 3]), 5 + at * PERIOD_NS + 1).unwrap();
        }
    }
    let luma = |grey: u32| (16.0 + f64::from(grey) * 219.0 / 255.0).round() as u8;
    let mut expected = vec![luma(0), luma(0), luma(50), luma(50), luma(100)];
    expected.extend([luma(150); 13]);
    expected.push(luma(200));
    assert_eq!(lumas(&stream.into_inner().unwrap(), 6), expected);
}

#[test]
fn an_hour_without_a_picture_is_no_hour_of_data() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("clip.y4m");
    let mut sink = open(&name, &options((2, 2))).unwrap();
    for at in [0, 90_000, 90_001] {
        assert!(sink.write_frame(&flat(2, 2, [0; 3]), at * PERIOD_NS).unwrap().is_continue());
    }
    sink.finish(Ending::Complete).unwrap();
    assert_eq!(lumas(&fs::read(&name).unwrap(), 6).len(), 10 * 25 + 3, "ten seconds, and the frames");
}

#[test]
fn a_stream_of_no_frames_has_its_header() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("empty.y4m");
    open(&name, &options((6, 4))).unwrap().finish(Ending::Complete).unwrap();
    assert!(fs::read(&name).unwrap().starts_with(b"YUV4MPEG2 W6 H4 F25:1"));
}

#[test]
fn a_stream_keeps_its_size() {
    let mut stream = Y4m::new(Vec::new(), Path::new("memory"), &options((6, 4)));
    let error = stream.write(&flat(4, 6, [0; 3]), 0).unwrap_err();
    assert_eq!(error.to_string(), "the stream is 6 x 4 pixels, and a frame has 4 x 6");
    stream.write(&flat(6, 4, [0; 3]), 0).unwrap();
}

/// Accepts some bytes, then fails like a pipe whose reader has closed.
struct ClosedPipe(usize);

impl Write for ClosedPipe {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 = self.0.checked_sub(bytes.len()).ok_or(io::ErrorKind::BrokenPipe)?;
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_reader_that_goes_ends_the_stream_cleanly() {
    let mut sink: Box<dyn Sink> = Box::new(Y4m::new(ClosedPipe(150), Path::new("pipe"), &options((6, 4))));
    assert_eq!(sink.write_frame(&picture(6, 4, 0), 0).unwrap(), ControlFlow::Continue(()));
    assert_eq!(sink.write_frame(&picture(6, 4, 1), PERIOD_NS).unwrap(), ControlFlow::Continue(()));
    assert_eq!(sink.write_frame(&picture(6, 4, 2), 2 * PERIOD_NS).unwrap(), ControlFlow::Break(()));
    sink.finish(Ending::Complete).unwrap();
}
