//! Pixels without compression inside a file, by the names that ROS has for their formats
//! (`sensor_msgs/image_encodings.hpp`).

use super::decode::DepthUnits;
use super::decoders::check_size;
use super::fault::PictureFault;
use bokehcam::color::{YcbcrMatrix, round_to_8bit};
use bokehcam::frame::{ColorImage, DepthMap};

/// Pixels row by row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RawImage<'a> {
    /// Width and height.
    pub size: (u32, u32),
    /// The name of the pixel format, such as `rgb8`.
    pub format: &'a str,
    /// Whether samples of several bytes begin with the most significant one.
    pub is_big_endian: bool,
    /// Bytes from a row to the next.
    pub stride_bytes: usize,
    pub data: &'a [u8],
}

/// A pixel format of colour or grey.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColorFormat {
    /// Samples of 8 bits: their number per pixel, and the positions of red, green and blue.
    Packed { channels: usize, rgb: [usize; 3] },
    /// Grey of 16 bits.
    Grey16,
    /// Two pixels in four bytes: the positions of their luma, and of both chroma samples. BT.601, limited range.
    Ycbcr422 { luma: [usize; 2], chroma: [usize; 2] },
}

impl ColorFormat {
    /// Returns the format with a name; `None` if it is not read.
    pub fn from_name(name: &str) -> Option<Self> {
        let packed = |channels, rgb| Some(Self::Packed { channels, rgb });
        match name {
            "rgb8" => packed(3, [0, 1, 2]),
            "bgr8" | "8UC3" => packed(3, [2, 1, 0]),
            "rgba8" => packed(4, [0, 1, 2]),
            "bgra8" | "8UC4" => packed(4, [2, 1, 0]),
            "mono8" | "8UC1" => packed(1, [0; 3]),
            "mono16" => Some(Self::Grey16),
            "yuv422" | "uyvy" => Some(Self::Ycbcr422 { luma: [1, 3], chroma: [0, 2] }),
            "yuv422_yuy2" | "yuyv" => Some(Self::Ycbcr422 { luma: [0, 2], chroma: [1, 3] }),
            _ => None,
        }
    }

    fn row_bytes(self, width: usize) -> usize {
        match self {
            Self::Packed { channels, .. } => width * channels,
            Self::Grey16 => width * 2,
            Self::Ycbcr422 { .. } => width.next_multiple_of(2) * 2,
        }
    }
}

/// Samples of depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DepthSamples {
    /// Units of a scale; 0 is unknown.
    Units,
    /// Floats, in metres. NaN is unknown, and infinity is too far to be measured (ROS REP 117 and 118).
    Metres,
}

impl DepthSamples {
    /// Returns the samples of a format; `None` if it is not depth.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "16UC1" => Some(Self::Units),
            "32FC1" => Some(Self::Metres),
            _ => None,
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::Units => 2,
            Self::Metres => 4,
        }
    }
}

/// Checks that an image has all its rows of `row_bytes`, and returns them.
fn rows<'a>(image: &RawImage<'a>, row_bytes: usize) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>, PictureFault> {
    let (stride_bytes, data, height) = (image.stride_bytes, image.data, image.size.1 as usize);
    if stride_bytes < row_bytes {
        return Err(PictureFault::Damaged(format!("rows of {stride_bytes} bytes, and they need {row_bytes}")));
    }
    // The last row may end without its padding.
    let needed = stride_bytes.checked_mul(height - 1).and_then(|above| above.checked_add(row_bytes));
    match needed {
        Some(needed) if needed <= data.len() => {
            Ok((0..height).map(move |row| &data[row * stride_bytes..][..row_bytes]))
        }
        _ => Err(PictureFault::Truncated),
    }
}

/// Decodes an image to RGB of 8 bits.
pub(super) fn decode_color(image: &RawImage, into: &mut ColorImage) -> Result<(), PictureFault> {
    let (width, height) = image.size;
    check_size(width, height)?;
    let format = ColorFormat::from_name(image.format)
        .ok_or_else(|| PictureFault::Unsupported(format!("pixel format {:?}", image.format)))?;
    let width = width as usize;
    let rows = rows(image, format.row_bytes(width))?;
    into.resize(image.size.0, height);
    for (row, out) in rows.zip(into.rgb.chunks_exact_mut(3 * width)) {
        let out = out.as_chunks_mut::<3>().0;
        match format {
            ColorFormat::Packed { channels: 3, rgb: [0, 1, 2] } => out.as_flattened_mut().copy_from_slice(row),
            ColorFormat::Packed { channels, rgb } => {
                out.iter_mut().zip(row.chunks_exact(channels)).for_each(|(out, pixel)| *out = rgb.map(|at| pixel[at]));
            }
            ColorFormat::Grey16 => {
                let code = if image.is_big_endian { u16::from_be_bytes } else { u16::from_le_bytes };
                out.iter_mut().zip(row.as_chunks().0).for_each(|(out, &pixel)| *out = [round_to_8bit(code(pixel)); 3]);
            }
            ColorFormat::Ycbcr422 { luma, chroma: [cb, cr] } => {
                for (out, pair) in out.chunks_mut(2).zip(row.as_chunks::<4>().0) {
                    out.iter_mut().zip(luma).for_each(|(out, y)| *out = to_rgb([pair[y], pair[cb], pair[cr]]));
                }
            }
        }
    }
    Ok(())
}

/// Decodes NV12 to RGB, whatever the format is named: all luma, then rows with both chroma samples of two by two pixels.
/// BT.601, limited range.
pub(super) fn decode_nv12(image: &RawImage, into: &mut ColorImage) -> Result<(), PictureFault> {
    let (width, height) = image.size;
    check_size(width, height)?;
    let row_bytes = width.next_multiple_of(2) as usize;
    let luma_bytes = image.stride_bytes.saturating_mul(height as usize);
    let (luma, chroma) = image.data.split_at_checked(luma_bytes).ok_or(PictureFault::Truncated)?;
    let luma_rows = rows(&RawImage { data: luma, ..image.clone() }, row_bytes)?;
    let chroma_size = (width, height.div_ceil(2));
    let chroma_rows = rows(&RawImage { data: chroma, size: chroma_size, ..image.clone() }, row_bytes)?;
    into.resize(width, height);
    let row_pairs = luma_rows.zip(chroma_rows.flat_map(|row| [row; 2]));
    for ((luma_row, chroma_row), out) in row_pairs.zip(into.rgb.chunks_exact_mut(3 * width as usize)) {
        let chroma = chroma_row.as_chunks::<2>().0.iter().flat_map(|pair| [pair; 2]);
        for ((&y, &[cb, cr]), pixel) in luma_row.iter().zip(chroma).zip(out.as_chunks_mut::<3>().0) {
            *pixel = to_rgb([y, cb, cr]);
        }
    }
    Ok(())
}

/// Converts Y'CbCr of BT.601 in limited range to R'G'B'.
fn to_rgb([y, cb, cr]: [u8; 3]) -> [u8; 3] {
    let [red_weight, green_weight, blue_weight] = YcbcrMatrix::Bt601.luma_weights().map(|weight| weight as f32);
    let luma = (f32::from(y) - 16.0) * (255.0 / 219.0);
    let [cb, cr] = [cb, cr].map(|chroma| (f32::from(chroma) - 128.0) * (255.0 / 112.0));
    let (red, blue) = (luma + (1.0 - red_weight) * cr, luma + (1.0 - blue_weight) * cb);
    let green = (luma - red_weight * red - blue_weight * blue) / green_weight;
    [red, green, blue].map(|color| (color + 0.5) as u8)
}

/// Decodes a depth map of these samples to metres.
pub(super) fn decode_depth(
    image: &RawImage,
    samples: DepthSamples,
    units: DepthUnits,
    into: &mut DepthMap,
) -> Result<(), PictureFault> {
    let (width, height) = image.size;
    check_size(width, height)?;
    let rows = rows(image, width as usize * samples.bytes())?;
    into.resize(width, height);
    for (row, metres) in rows.zip(into.metres.chunks_exact_mut(width as usize)) {
        match samples {
            DepthSamples::Units => {
                for (metres, &(mut value)) in metres.iter_mut().zip(row.as_chunks::<2>().0) {
                    if !image.is_big_endian {
                        value.reverse();
                    }
                    *metres = units.to_metres(value);
                }
            }
            DepthSamples::Metres => {
                for (metres, &value) in metres.iter_mut().zip(row.as_chunks::<4>().0) {
                    let value = if image.is_big_endian { f32::from_be_bytes(value) } else { f32::from_le_bytes(value) };
                    *metres = to_depth(value);
                }
            }
        }
    }
    Ok(())
}

/// Returns a distance in metres as a depth map has it.
pub(super) fn to_depth(metres: f32) -> f32 {
    match metres {
        metres if DepthMap::is_known(metres) => metres,
        metres if metres > DepthMap::MAX_M => DepthMap::MAX_M,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image<'a>(format: &'a str, size: (u32, u32), stride_bytes: usize, data: &'a [u8]) -> RawImage<'a> {
        RawImage { size, format, is_big_endian: false, stride_bytes, data }
    }

    fn color(image: &RawImage) -> Result<Vec<u8>, PictureFault> {
        let mut into = ColorImage::default();
        decode_color(image, &mut into).map(|()| into.rgb)
    }

    #[test]
    fn every_format_gives_the_same_two_pixels() {
        let rgb = vec![200, 100, 50, 10, 20, 30];
        for (format, data) in [
            ("rgb8", rgb.clone()),
            ("bgr8", vec![50, 100, 200, 30, 20, 10]),
            ("8UC3", vec![50, 100, 200, 30, 20, 10]),
            ("rgba8", vec![200, 100, 50, 0, 10, 20, 30, 255]),
            ("bgra8", vec![50, 100, 200, 9, 30, 20, 10, 9]),
        ] {
            assert_eq!(color(&image(format, (2, 1), data.len(), &data)).unwrap(), rgb, "{format}");
        }
        assert_eq!(color(&image("mono8", (2, 1), 2, &[7, 8])).unwrap(), [7, 7, 7, 8, 8, 8]);
        assert_eq!(color(&image("mono16", (2, 1), 4, &[0xFF, 6, 2, 8])).unwrap(), [7, 7, 7, 8, 8, 8]);
        let big = RawImage { is_big_endian: true, ..image("mono16", (2, 1), 4, &[6, 0xFF, 8, 2]) };
        assert_eq!(color(&big).unwrap(), [7, 7, 7, 8, 8, 8]);
    }

    #[test]
    fn luma_and_chroma_give_the_colours_of_the_standard() {
        // Black, white, and the pure colours of BT.601, as tables of colour bars have them.
        for (ycbcr, rgb) in [
            ([16, 128, 128], [0, 0, 0]),
            ([235, 128, 128], [255, 255, 255]),
            ([81, 90, 240], [255, 0, 0]),
            ([145, 54, 34], [0, 255, 0]),
            ([41, 240, 110], [0, 0, 255]),
        ] {
            let [y, cb, cr] = ycbcr;
            for (format, data) in [("yuv422", [cb, y, cr, y]), ("yuv422_yuy2", [y, cb, y, cr])] {
                let found = color(&image(format, (2, 1), 4, &data)).unwrap();
                for (found, expected) in found.iter().zip([rgb, rgb].as_flattened()) {
                    assert!(found.abs_diff(*expected) <= 2, "{format} {ycbcr:?}: {found} for {expected}");
                }
                // A last column of its own still has a whole pair.
                assert_eq!(color(&image(format, (1, 1), 4, &data)).unwrap(), found[..3]);
            }
        }
    }

    #[test]
    fn four_pixels_share_their_chroma_in_nv12() {
        // Three columns and rows: white beside red, above black.
        let luma = [235, 235, 81, 0, 235, 235, 81, 0, 16, 16, 81, 0];
        let chroma = [128, 128, 90, 240, 128, 128, 90, 240];
        let data = [&luma[..], &chroma].concat();
        let mut into = ColorImage::default();
        decode_nv12(&image("", (3, 3), 4, &data), &mut into).unwrap();
        let (white, red, black) = ([255; 3], [255, 0, 0], [0; 3]);
        let expected = [white, white, red, white, white, red, black, black, red];
        for (found, expected) in into.rgb.iter().zip(expected.as_flattened()) {
            assert!(found.abs_diff(*expected) <= 2, "{:?}", into.rgb);
        }
        for bytes in [data.len() - 1, luma.len(), 5] {
            let cut = decode_nv12(&image("", (3, 3), 4, &data[..bytes]), &mut into);
            assert!(matches!(cut, Err(PictureFault::Truncated)), "{bytes}");
        }
    }

    #[test]
    fn padding_is_skipped_and_missing_rows_are_refused() {
        let data = [1, 2, 3, 99, 4, 5, 6];
        assert_eq!(color(&image("rgb8", (1, 2), 4, &data)).unwrap(), [1, 2, 3, 4, 5, 6]);
        assert!(matches!(color(&image("rgb8", (1, 2), 4, &data[..6])), Err(PictureFault::Truncated)));
        assert!(matches!(color(&image("rgb8", (2, 1), 4, &data)), Err(PictureFault::Damaged(_))));
        assert!(matches!(color(&image("rgb8", (1, 9), usize::MAX, &data)), Err(PictureFault::Truncated)));
        assert!(matches!(color(&image("rgb8", (0, 9), 4, &data)), Err(PictureFault::NoPixel { .. })));
        assert!(matches!(color(&image("bayer_rggb8", (1, 1), 4, &data)), Err(PictureFault::Unsupported(_))));
    }

    #[test]
    fn depth_is_in_millimetres_or_metres() {
        let units = DepthUnits { scale: 1000.0, invalid: Some(65535) };
        let mut map = DepthMap::default();
        let mut depth = |image: &RawImage, samples| {
            decode_depth(image, samples, units, &mut map).unwrap();
            map.metres.clone()
        };
        let data = [0xE8, 3, 0, 0, 0xFF, 0xFF];
        assert_eq!(depth(&image("16UC1", (3, 1), 6, &data), DepthSamples::Units), [1.0, 0.0, 0.0]);
        let big = RawImage { is_big_endian: true, ..image("16UC1", (1, 1), 2, &[3, 0xE8]) };
        assert_eq!(depth(&big, DepthSamples::Units), [1.0]);
        let values = [1.5, f32::NAN, -1.0, 0.0, f32::INFINITY, f32::NEG_INFINITY];
        let data: Vec<u8> = values.iter().flat_map(|value: &f32| value.to_le_bytes()).collect();
        let found = depth(&image("32FC1", (6, 1), 24, &data), DepthSamples::Metres);
        assert_eq!(found, [1.5, 0.0, 0.0, 0.0, DepthMap::MAX_M, 0.0]);
    }
}
