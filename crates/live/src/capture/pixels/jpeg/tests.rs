//! JPEGs of one picture by another encoder (ffmpeg 5.1, `-c:v mjpeg -huffman default -q:v 4`; with restarts by
//! `-thread_type slice -slices 4`), unchanged and with the defects that cameras cause.

use super::super::tests::Random;
use super::super::{Decoder, PixelError};
use crate::layout::{FourCc, Layout};
use bokehcam::frame::ColorImage;

const FILES: [(&str, &[u8]); 5] = [
    ("4:2:0", include_bytes!("testdata/420.jpg")),
    ("4:2:2", include_bytes!("testdata/422.jpg")),
    ("4:4:4", include_bytes!("testdata/444.jpg")),
    ("grey", include_bytes!("testdata/grey.jpg")),
    ("restarts", include_bytes!("testdata/restart.jpg")),
];
const SIZE: (u32, u32) = (70, 50);

fn decoder() -> Decoder {
    Decoder::new(&Layout::packed(FourCc::MJPG, SIZE.0, SIZE.1).unwrap()).unwrap()
}

fn decode(bytes: &[u8]) -> Result<Vec<u8>, PixelError> {
    let mut out = ColorImage::default();
    decoder().decode(&[bytes], &mut out)?;
    assert_eq!(out.size(), SIZE);
    Ok(out.rgb)
}

/// Range of the segment with this marker.
fn segment(bytes: &[u8], marker: u8) -> std::ops::Range<usize> {
    let at = bytes.windows(2).position(|pair| pair == [0xFF, marker]).unwrap();
    at..at + 2 + usize::from(u16::from_be_bytes([bytes[at + 2], bytes[at + 3]]))
}

fn without(bytes: &[u8], range: std::ops::Range<usize>) -> Vec<u8> {
    [&bytes[..range.start], &bytes[range.end..]].concat()
}

/// Start of the coded data.
fn coded(bytes: &[u8]) -> usize {
    segment(bytes, 0xDA).end
}

#[test]
fn the_picture_comes_back_whatever_the_sampling() {
    let original = image::load_from_memory(include_bytes!("testdata/original.png")).unwrap().into_rgb8();
    let (width, height) = (SIZE.0 as usize, SIZE.1 as usize);
    for (name, bytes) in FILES {
        let rgb = decode(bytes).unwrap();
        // The picture is noisy, and its chroma is coded coarsely: the mean colours of 10 x 10 patches are compared.
        for (top, left) in (0..height).step_by(10).flat_map(|top| (0..width).step_by(10).map(move |left| (top, left))) {
            let mean = |rgb: &[u8]| {
                let mut sum = [0.0; 3];
                for k in (0..100).map(|k| 3 * ((top + k / 10) * width + left + k % 10)) {
                    (0..3).for_each(|channel| sum[channel] += f64::from(rgb[k + channel]) / 100.0);
                }
                sum
            };
            let [r, g, b] = mean(&original);
            let expected = if name == "grey" { [0.299 * r + 0.587 * g + 0.114 * b; 3] } else { [r, g, b] };
            for (found, expected) in mean(&rgb).into_iter().zip(expected) {
                assert!((found - expected).abs() < 4.0, "{name} at {left}, {top}: {found} for {expected}");
            }
        }
    }
}

#[test]
fn what_cameras_leave_out_and_put_in_changes_nothing() {
    for (name, bytes) in FILES {
        let whole = decode(bytes).unwrap();
        let same = |what: &str, spoilt: &[u8]| {
            assert_eq!(decode(spoilt).as_ref(), Ok(&whole), "{name} {what}");
        };
        same("without tables", &without(bytes, segment(bytes, 0xC4)));
        same("after junk", &[b"\0\xFFjunk\xFF\xFF", bytes].concat());
        same("before junk", &[bytes, b"junk\xFF\xD8\xFF\xC4\0"].concat());
        same("without its end", &bytes[..bytes.len() - 2]);
        same("with half its end", &bytes[..bytes.len() - 1]);
        same("before the next one", &[&bytes[..bytes.len() - 2], bytes].concat());
        same("padded with zeros", &[bytes, &[0; 4096]].concat());
        let avi = b"\xFF\xE0\0\x10AVI1\0\0\0\0\0\0\0\0\0\0";
        same("of an AVI", &[&bytes[..2], avi, &without(bytes, segment(bytes, 0xC4))[2..]].concat());
        let thumbnail = [&b"\xFF\xE1\x0F\xFF"[..], bytes, &vec![0x55; 0xFFD - bytes.len()]].concat();
        same("with a thumbnail", &[&bytes[..2], &thumbnail, &bytes[2..]].concat());
        let end = bytes.len() - 2;
        same("with fill bytes", &[&bytes[..end], &[0xFF; 5], &bytes[end..]].concat());
    }
}

#[test]
fn a_picture_that_ends_too_early_is_refused_wherever_it_ends() {
    for (name, bytes) in FILES {
        let end = bytes.len() - 2;
        let mut passed = Vec::new();
        for length in 0..end {
            let cut = &bytes[..length];
            for file in [cut.to_vec(), [cut, &[0xFF, 0xD9]].concat(), [cut, &[0; 4096]].concat()] {
                if decode(&file).is_ok() {
                    passed.push(end - length);
                }
            }
        }
        // At most the last symbol may be missing.
        assert!(passed.iter().all(|&lacking| lacking <= 3), "{name}: {passed:?}");
    }
}

#[test]
fn most_pictures_that_lost_a_piece_are_refused() {
    let mut random = Random(7);
    for (name, bytes) in FILES {
        let (start, end) = (coded(bytes), bytes.len() - 2);
        let (mut found, mut tried) = (0, 0);
        for _ in 0..2000 {
            let length = 64 + random.next() as usize % 256;
            let from = start + random.next() as usize % (end - start - length);
            tried += 1;
            found += usize::from(decode(&without(bytes, from..from + length)).is_err());
        }
        // The remaining data may by chance code the same number of units, or more: often so in a picture this small.
        assert!(found * 100 >= tried * 60, "{name}: {found} of {tried}");
    }
}

#[test]
fn what_is_no_such_picture_is_refused_in_one_line() {
    let bytes = FILES[1].1;
    let mut other = Decoder::new(&Layout::packed(FourCc::MJPG, 64, 48).unwrap()).unwrap();
    let size = PixelError::Size { found: (70, 50), expected: (64, 48) };
    assert_eq!(other.decode(&[bytes], &mut ColorImage::default()), Err(size));
    let mut progressive_arithmetic = bytes.to_vec();
    progressive_arithmetic[segment(bytes, 0xC0).start + 1] = 0xCA;
    for file in [
        &[][..],
        b"\xFF\xD8\xFF",
        b"\xFF\xD8\xFF\xD9",
        &[0; 1000],
        &[0xFF; 1000],
        b"RIFF",
        &without(bytes, segment(bytes, 0xDB)),
        &without(bytes, segment(bytes, 0xC0)),
        &without(bytes, segment(bytes, 0xDA)),
        &progressive_arithmetic,
    ] {
        let text = decode(file).unwrap_err().to_string();
        assert!(!text.contains('\n') && text.len() < 160, "{text}");
    }
    // A lost run with its restart marker, and one of the markers.
    let restarts = FILES[4].1;
    let markers: Vec<usize> = (coded(restarts)..restarts.len() - 2)
        .filter(|&k| restarts[k] == 0xFF && restarts[k + 1] & 0xF8 == 0xD0)
        .collect();
    assert_eq!(markers.len(), 3);
    for range in [markers[0]..markers[1], markers[1]..markers[2], markers[2]..restarts.len() - 2] {
        let text = decode(&without(restarts, range)).unwrap_err().to_string();
        assert!(text.contains("restart markers"), "{text}");
    }
    let short = decode(&without(restarts, markers[1] - 40..markers[1])).unwrap_err();
    assert!(matches!(short, PixelError::Jpeg(_)));
}

#[test]
fn no_bytes_make_it_panic() {
    let mut random = Random(8);
    let (mut decoder, mut out) = (decoder(), ColorImage::default());
    let mut decoded = 0;
    for round in 0..6000 {
        let (_, bytes) = FILES[round % FILES.len()];
        let mut file = bytes.to_vec();
        match round % 4 {
            // Pseudo-random bytes behind a start marker.
            0 => {
                let length = random.next() as usize % 600;
                file = [&[0xFF, 0xD8, 0xFF][..], &random.bytes(length)].concat();
            }
            // Changed header bytes.
            1 => (0..1 + random.next() % 4).for_each(|_| {
                let at = random.next() as usize % coded(bytes);
                file[at] = random.next() as u8;
            }),
            // Changed bytes anywhere.
            2 => (0..1 + random.next() % 16).for_each(|_| {
                let at = random.next() as usize % file.len();
                file[at] = random.next() as u8;
            }),
            // Exchanged and truncated pieces.
            _ => {
                let at = random.next() as usize % file.len();
                file.rotate_left(at);
                file.splice(0..0, bytes[..random.next() as usize % bytes.len()].iter().copied());
            }
        }
        decoded += usize::from(decoder.decode(&[&file], &mut out).is_ok());
    }
    assert!(decoded > 100, "hardly anything was decoded: {decoded}");
    // And it is as good as before.
    decoder.decode(&[FILES[0].1], &mut out).unwrap();
    assert_eq!(Ok(out.rgb), decode(FILES[0].1));
}
