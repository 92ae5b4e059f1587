//! Comparison with floating-point reference implementations, on pseudo-random bytes.

use super::*;
use crate::layout::Range;
use bokehcam::color::YcbcrMatrix;

/// A deterministic pseudo-random generator.
pub(super) struct Random(pub u64);

impl Random {
    pub(super) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    pub(super) fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.next() as u8).collect()
    }
}

/// Converts luma and chroma of a pixel to colours by the standard's formulas.
fn to_rgb([luma, cb, cr]: [f64; 3], matrix: YcbcrMatrix, range: Range) -> [f64; 3] {
    let (red, blue) = match matrix {
        YcbcrMatrix::Bt601 => (0.299, 0.114),
        YcbcrMatrix::Bt709 => (0.2126, 0.0722),
        YcbcrMatrix::Bt2020 => (0.2627, 0.0593),
    };
    let (y, pb, pr) = match range {
        Range::Limited => ((luma - 16.0) / 219.0, (cb - 128.0) / 224.0, (cr - 128.0) / 224.0),
        Range::Full => (luma / 255.0, (cb - 128.0) / 255.0, (cr - 128.0) / 255.0),
    };
    let (r, b) = (y + 2.0 * (1.0 - red) * pr, y + 2.0 * (1.0 - blue) * pb);
    [r, (y - red * r - blue * b) / (1.0 - red - blue), b].map(|color| color.clamp(0.0, 1.0) * 255.0)
}

fn to_ycc(rgb: [f64; 3], matrix: YcbcrMatrix, range: Range) -> [f64; 3] {
    let (red, blue) = match matrix {
        YcbcrMatrix::Bt601 => (0.299, 0.114),
        YcbcrMatrix::Bt709 => (0.2126, 0.0722),
        YcbcrMatrix::Bt2020 => (0.2627, 0.0593),
    };
    let [r, g, b] = rgb.map(|color| color / 255.0);
    let y = red * r + (1.0 - red - blue) * g + blue * b;
    let (pb, pr) = ((b - y) / (2.0 * (1.0 - blue)), (r - y) / (2.0 * (1.0 - red)));
    match range {
        Range::Limited => [16.0 + 219.0 * y, 128.0 + 224.0 * pb, 128.0 + 224.0 * pr],
        Range::Full => [255.0 * y, 128.0 + 255.0 * pb, 128.0 + 255.0 * pr],
    }
}

/// Location of the sample (0 luma, 1 Cb, 2 Cr) of pixel or pair `x`, `y`: memory plane and byte.
type Place = fn(&Layout, usize, usize, usize) -> (usize, usize);

/// Formats with their vertical chroma step and sample locations, written independently of the decoder.
const FORMATS: [(&[u8; 4], usize, Place); 12] = [
    (b"YUYV", 1, |l, s, x, y| (0, y * l.planes()[0].stride_bytes + [2 * x, 4 * x + 1, 4 * x + 3][s])),
    (b"YVYU", 1, |l, s, x, y| (0, y * l.planes()[0].stride_bytes + [2 * x, 4 * x + 3, 4 * x + 1][s])),
    (b"UYVY", 1, |l, s, x, y| (0, y * l.planes()[0].stride_bytes + [2 * x + 1, 4 * x, 4 * x + 2][s])),
    (b"VYUY", 1, |l, s, x, y| (0, y * l.planes()[0].stride_bytes + [2 * x + 1, 4 * x + 2, 4 * x][s])),
    (b"NV12", 2, |l, s, x, y| semi_planar(l, s, x, y, 0)),
    (b"NV21", 2, |l, s, x, y| semi_planar(l, [0, 2, 1][s], x, y, 0)),
    (b"NM12", 2, |l, s, x, y| semi_planar(l, s, x, y, 1)),
    (b"NM21", 2, |l, s, x, y| semi_planar(l, [0, 2, 1][s], x, y, 1)),
    (b"YU12", 2, |l, s, x, y| planar(l, s, x, y, 0)),
    (b"YV12", 2, |l, s, x, y| planar(l, [0, 2, 1][s], x, y, 0)),
    (b"YM12", 2, |l, s, x, y| planar(l, s, x, y, 1)),
    (b"YM21", 2, |l, s, x, y| planar(l, [0, 2, 1][s], x, y, 1)),
];

fn semi_planar(layout: &Layout, sample: usize, x: usize, y: usize, chroma_plane: usize) -> (usize, usize) {
    let stride = layout.planes()[0].stride_bytes;
    match (sample, chroma_plane) {
        (0, _) => (0, y * stride + x),
        (_, 0) => (0, stride * layout.height as usize + y * stride.next_multiple_of(2) + 2 * x + sample - 1),
        (_, plane) => (plane, y * layout.planes()[plane].stride_bytes + 2 * x + sample - 1),
    }
}

fn planar(layout: &Layout, sample: usize, x: usize, y: usize, apart: usize) -> (usize, usize) {
    let (stride, height) = (layout.planes()[0].stride_bytes, layout.height as usize);
    let half = stride.div_ceil(2);
    match (sample, apart) {
        (0, _) => (0, y * stride + x),
        (_, 0) => (0, stride * height + (sample - 1) * half * height.div_ceil(2) + y * half + x),
        _ => (sample, y * layout.planes()[sample].stride_bytes + x),
    }
}

fn layout(fourcc: &[u8; 4], width: u32, height: u32, matrix: YcbcrMatrix, range: Range) -> Layout {
    let mut layout = Layout::packed(FourCc(*fourcc), width, height).unwrap();
    (layout.matrix, layout.range) = (matrix, range);
    layout
}

fn memory(layout: &Layout, random: &mut Random) -> Vec<Vec<u8>> {
    layout.planes().iter().map(|plane| random.bytes(plane.size_bytes)).collect()
}

fn decoded(decoder: &mut Decoder, planes: &[Vec<u8>]) -> ColorImage {
    let planes: Vec<&[u8]> = planes.iter().map(Vec::as_slice).collect();
    let mut out = ColorImage::default();
    decoder.decode(&planes, &mut out).unwrap();
    out
}

/// Reference chroma of a pixel: co-sited with the left one of a pair, and midway between rows if they are subsampled.
fn chroma(get: impl Fn(usize, usize) -> f64, pairs: usize, rows: usize, down: usize, x: usize, y: usize) -> f64 {
    let across = |row: usize| {
        let (left, right) = (get(x / 2, row), get((x / 2 + 1).min(pairs - 1), row));
        if x.is_multiple_of(2) { left } else { (left + right) / 2.0 }
    };
    if down == 1 {
        return across(y);
    }
    let near = y / 2;
    let far = if y.is_multiple_of(2) { near.saturating_sub(1) } else { (near + 1).min(rows - 1) };
    0.75 * across(near) + 0.25 * across(far)
}

#[test]
fn every_colour_is_within_one_code_of_the_definition() {
    let mut random = Random(1);
    for (fourcc, down, place) in FORMATS {
        for matrix in [YcbcrMatrix::Bt601, YcbcrMatrix::Bt709, YcbcrMatrix::Bt2020] {
            for range in [Range::Limited, Range::Full] {
                for (width, height) in [(64, 24), (66, 5), (2, 1), (34, 2)] {
                    let layout = layout(fourcc, width, height, matrix, range);
                    let planes = memory(&layout, &mut random);
                    let out = decoded(&mut Decoder::new(&layout).unwrap(), &planes);
                    let (width, height) = (width as usize, height as usize);
                    let get = |sample: usize, x: usize, y: usize| {
                        let (plane, at) = place(&layout, sample, x, y);
                        f64::from(planes[plane][at])
                    };
                    for (k, pixel) in out.rgb.chunks_exact(3).enumerate() {
                        let (x, y) = (k % width, k / width);
                        let (pairs, rows) = (width.div_ceil(2), height.div_ceil(down));
                        let of = |sample| chroma(|x, y| get(sample, x, y), pairs, rows, down, x, y);
                        let exact = to_rgb([get(0, x, y), of(1), of(2)], matrix, range);
                        for (&byte, exact) in pixel.iter().zip(exact) {
                            let off = (f64::from(byte) - exact).abs();
                            assert!(off <= 1.0, "{} {matrix:?} {range:?} at {x}, {y}: {off}", layout.fourcc);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn the_usual_error_is_that_of_rounding() {
    let layout = layout(b"YUYV", 256, 256, YcbcrMatrix::Bt601, Range::Limited);
    let planes = memory(&layout, &mut Random(2));
    let out = decoded(&mut Decoder::new(&layout).unwrap(), &planes);
    let (mut sum, mut count) = (0.0, 0.0);
    // Chroma is not interpolated on the left pixels.
    for (bytes, pixels) in planes[0].chunks_exact(4).zip(out.rgb.chunks_exact(6)) {
        let exact = to_rgb([bytes[0], bytes[1], bytes[3]].map(f64::from), layout.matrix, layout.range);
        for (&byte, exact) in pixels.iter().zip(exact).filter(|(_, exact)| (1.0..254.0).contains(exact)) {
            (sum, count) = (sum + f64::from(byte) - exact, count + 1.0);
        }
    }
    // No tint: the mean error is zero.
    assert!((sum / count).abs() < 0.02, "{}", sum / count);
}

#[test]
fn a_picture_comes_back_from_every_format_with_any_stride_and_size() {
    let colors = [[255, 255, 255], [255, 255, 0], [0, 255, 255], [0, 255, 0], [255, 0, 255], [255, 0, 0], [0, 0, 255]];
    let band = |y: usize| colors[y / 8 % colors.len()].map(f64::from);
    for (fourcc, down, place) in FORMATS {
        for (width, height, extra) in [(32u32, 56u32, 0), (31, 55, 6), (1, 9, 0), (30, 56, 64)] {
            let mut format = layout(fourcc, width, height, YcbcrMatrix::Bt709, Range::Limited);
            format = format.with_row_padding(extra);
            let mut planes = memory(&format, &mut Random(3));
            for y in 0..height as usize {
                for x in 0..width as usize {
                    let ycc = to_ycc(band(y), format.matrix, format.range);
                    let (plane, at) = place(&format, 0, x, y);
                    planes[plane][at] = ycc[0].round() as u8;
                    for (sample, value) in ycc.into_iter().enumerate().skip(1) {
                        let (plane, at) = place(&format, sample, x / 2, y / down);
                        // A lone last pixel has only one kind of chroma.
                        if let Some(byte) = planes[plane].get_mut(at) {
                            *byte = value.round() as u8;
                        }
                    }
                }
            }
            let out = decoded(&mut Decoder::new(&format).unwrap(), &planes);
            // Only away from the edges of bands, where rows share chroma, and from the lone last pixel.
            let whole = if down == 1 { (width as usize & !1).max(1) } else { width as usize };
            for (k, pixel) in out.rgb.chunks_exact(3).enumerate() {
                let (x, y) = (k % width as usize, k / width as usize);
                if x >= whole || width == 1 && down == 1 || !(2..6).contains(&(y % 8)) {
                    continue;
                }
                for (&byte, exact) in pixel.iter().zip(band(y)) {
                    assert!((f64::from(byte) - exact).abs() <= 2.0, "{} {width} at {x}, {y}: {pixel:?}", format.fourcc);
                }
            }
        }
    }
}

#[test]
fn a_lone_last_pixel_takes_the_chroma_that_it_lacks_from_its_neighbour() {
    let format = layout(b"YUYV", 3, 1, YcbcrMatrix::Bt601, Range::Full);
    assert_eq!(format.min_size_bytes(0), 6);
    let out = decoded(&mut Decoder::new(&format).unwrap(), &[vec![100, 90, 100, 170, 100, 90]]);
    assert_eq!(out.rgb[..3], out.rgb[6..]);
}

#[test]
fn rgb_and_grey_are_taken_as_they_are() {
    let mut random = Random(4);
    for (fourcc, order) in [(b"RGB3", [0, 1, 2]), (b"BGR3", [2, 1, 0]), (b"GREY", [0, 0, 0])] {
        for (width, height, extra) in [(33u32, 7u32, 0), (33, 7, 5)] {
            let format = layout(fourcc, width, height, YcbcrMatrix::Bt601, Range::Full).with_row_padding(extra);
            let planes = memory(&format, &mut random);
            let out = decoded(&mut Decoder::new(&format).unwrap(), &planes);
            let bytes = if fourcc == b"GREY" { 1 } else { 3 };
            for (k, pixel) in out.rgb.chunks_exact(3).enumerate() {
                let (x, y) = (k % width as usize, k / width as usize);
                let at = y * format.planes()[0].stride_bytes + bytes * x;
                assert_eq!(pixel, order.map(|channel| planes[0][at + channel]));
            }
        }
    }
    let limited = layout(b"GREY", 3, 1, YcbcrMatrix::Bt601, Range::Limited);
    let out = decoded(&mut Decoder::new(&limited).unwrap(), &[vec![16, 126, 235]]);
    assert_eq!(out.rgb, [0, 0, 0, 128, 128, 128, 255, 255, 255]);
}

#[test]
fn linear_light_is_put_on_the_curve() {
    let mut format = layout(b"RGB3", 1, 1, YcbcrMatrix::Bt601, Range::Full);
    format.transfer = Transfer::Linear;
    assert_eq!(decoded(&mut Decoder::new(&format).unwrap(), &[vec![0, 55, 255]]).rgb, [0, 128, 255]);
}

#[test]
fn every_instruction_set_gives_the_same_bytes() {
    let mut random = Random(5);
    for (fourcc, ..) in FORMATS {
        let format = layout(fourcc, 101, 7, YcbcrMatrix::Bt601, Range::Limited);
        let planes = memory(&format, &mut random);
        let slices: Vec<&[u8]> = planes.iter().map(Vec::as_slice).collect();
        let mut plain = ColorImage::default();
        let mut raw = raw::RawDecoder::new(&format).with_arch(pulp::Arch::Scalar);
        raw.decode(&format, &slices, &mut plain).unwrap();
        assert_eq!(decoded(&mut Decoder::new(&format).unwrap(), &planes), plain, "{}", format.fourcc);
    }
}

#[test]
fn pictures_that_are_cut_short_are_refused() {
    for (fourcc, ..) in FORMATS {
        let format = layout(fourcc, 17, 9, YcbcrMatrix::Bt601, Range::Limited);
        let mut decoder = Decoder::new(&format).unwrap();
        let planes = memory(&format, &mut Random(6));
        let mut out = ColorImage::default();
        for short in 0..planes.len() {
            let mut slices: Vec<&[u8]> = planes.iter().map(Vec::as_slice).collect();
            slices[short] = &slices[short][..format.min_size_bytes(short) - 1];
            assert!(matches!(decoder.decode(&slices, &mut out), Err(PixelError::Short { .. })), "{fourcc:?}");
            slices[short] = &[];
            assert!(decoder.decode(&slices, &mut out).is_err());
        }
        assert_eq!(decoder.decode(&[], &mut out), Err(PixelError::Planes { found: 0, expected: planes.len() }));
    }
    assert_eq!(Decoder::new(&Layout::packed(FourCc::Z16, 8, 8).unwrap()).unwrap_err(), NoColor(FourCc::Z16));
}
