//! Conversion of y4m pictures to sRGB.

use super::header::{Chroma, Header};
use crate::capture::pixels::Decoder;
use crate::layout::{FourCc, Layout, LayoutError, Plane, Range, Transfer};
use bokehcam::color::YcbcrMatrix;
use bokehcam::frame::ColorImage;

/// Converts the pictures of one stream. Y'CbCr is BT.601 or BT.709 by the number of rows, as players assume: the
/// format does not say it.
#[derive(Debug)]
pub struct Converter {
    planes: ([(usize, usize); 3], usize),
    /// For the formats that cameras have, too.
    decoder: Option<Decoder>,
    matrix: YcbcrMatrix,
    range: Range,
}

impl Converter {
    /// Creates a converter for the pictures of a stream.
    ///
    /// # Errors
    /// The size is not supported.
    pub fn new(header: &Header) -> Result<Self, LayoutError> {
        let matrix = YcbcrMatrix::for_height(header.size_px.1);
        let planes = header.planes();
        let fourcc = match header.chroma {
            Chroma::Mono => Some(FourCc::GREY),
            // With a memory plane each, an odd width has whole rows of chroma.
            Chroma::Quarter => Some(FourCc(*b"YM12")),
            Chroma::Half | Chroma::Full => None,
        };
        let colors = Some((matrix, header.range, Transfer::Display));
        let create = |fourcc| Layout::new(fourcc, header.size_px, &[Plane::default(); 3][..planes.1], colors);
        // Both formats have colours or luma, so that there is a decoder.
        let decoder = fourcc.map(create).transpose()?.and_then(|layout| Decoder::new(&layout).ok());
        Ok(Self { planes, decoder, matrix, range: header.range })
    }

    /// Returns the number of bytes of a picture.
    pub fn picture_bytes(&self) -> usize {
        self.planes.0.iter().map(|(width, height)| width * height).sum()
    }

    /// Converts a picture of [`Converter::picture_bytes`] into `out`, which is resized to fit.
    pub fn convert(&mut self, picture: &[u8], out: &mut ColorImage) {
        let (sizes, count) = self.planes;
        let mut rest = picture;
        let planes = sizes.map(|(width, height)| {
            let (plane, after) = rest.split_at(width * height);
            rest = after;
            plane
        });
        match &mut self.decoder {
            // Fails only for planes of another size.
            Some(decoder) => drop(decoder.decode(&planes[..count], out)),
            None => self.convert_rows(planes, out),
        }
    }

    /// Converts planes of chroma with all rows; half the columns are interpolated, co-sited with the left pixel of each
    /// pair.
    fn convert_rows(&self, planes: [&[u8]; 3], out: &mut ColorImage) {
        let [(width, height), (chroma_width, _), _] = self.planes.0;
        out.resize(width as u32, height as u32);
        let to_rgb = ycc_to_rgb(self.matrix, self.range);
        let sample = |row: &[u8], x: usize| match chroma_width == width {
            true => f32::from(row[x]),
            false => f32::from(row[x / 2]).midpoint(f32::from(row[x.div_ceil(2).min(chroma_width - 1)])),
        };
        let [luma, cb, cr] = planes;
        let rows = luma.chunks_exact(width).zip(cb.chunks_exact(chroma_width)).zip(cr.chunks_exact(chroma_width));
        for (((luma, cb), cr), rgb) in rows.zip(out.rgb.chunks_exact_mut(3 * width)) {
            for (x, (&luma, rgb)) in luma.iter().zip(rgb.as_chunks_mut::<3>().0).enumerate() {
                *rgb = to_rgb([f32::from(luma), sample(cb, x), sample(cr, x)]);
            }
        }
    }
}

/// Returns the conversion of one pixel (ITU-R BT.601 and BT.709): R = Y + 2 (1 - Kr) Cr, B = Y + 2 (1 - Kb) Cb, and G
/// from Y = Kr R + Kg G + Kb B.
fn ycc_to_rgb(matrix: YcbcrMatrix, range: Range) -> impl Fn([f32; 3]) -> [u8; 3] {
    let [kr, kg, kb] = matrix.luma_weights().map(|weight| weight as f32);
    let (black, luma_steps, chroma_steps) = match range {
        Range::Limited => (16.0, 219.0, 224.0),
        Range::Full => (0.0, 255.0, 255.0),
    };
    move |[luma, cb, cr]| {
        let luma = (luma - black) / luma_steps;
        let (red, blue) = (
            luma + 2.0 * (1.0 - kr) * (cr - 128.0) / chroma_steps,
            luma + 2.0 * (1.0 - kb) * (cb - 128.0) / chroma_steps,
        );
        // The conversion to bytes clamps.
        [red, (luma - kr * red - kb * blue) / kg, blue].map(|value| (value * 255.0).round() as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the picture of a plain colour, given as Y, Cb and Cr.
    fn plain(header: &str, ycc: [u8; 3]) -> ColorImage {
        let mut converter = Converter::new(&Header::parse(header).unwrap()).unwrap();
        let (sizes, _) = converter.planes;
        let bytes: Vec<u8> =
            sizes.iter().zip(ycc).flat_map(|(&(width, height), value)| vec![value; width * height]).collect();
        assert_eq!(bytes.len(), converter.picture_bytes());
        let mut out = ColorImage::default();
        converter.convert(&bytes, &mut out);
        out
    }

    #[test]
    fn every_format_size_and_range_gives_the_same_colour() {
        // BT.601: red is Y 81, Cb 90, Cr 240 in limited range, and Y 76, Cb 85, Cr 255 in full range.
        for (range, ycc) in [("LIMITED", [81, 90, 240]), ("FULL", [76, 85, 255])] {
            for chroma in ["420", "420mpeg2", "422", "444"] {
                for (width, height) in [(4, 2), (5, 3), (1, 1), (2, 7)] {
                    let header = format!("YUV4MPEG2 W{width} H{height} C{chroma} XCOLORRANGE={range}");
                    let out = plain(&header, ycc);
                    assert_eq!(out.size(), (width, height), "{header}");
                    for rgb in out.rgb.as_chunks::<3>().0 {
                        assert!(rgb[0] >= 253 && rgb[1] <= 2 && rgb[2] <= 2, "{header}: {rgb:?}");
                    }
                }
            }
        }
        for (range, grey, expected) in [("LIMITED", 16, 0), ("LIMITED", 235, 255), ("FULL", 77, 77)] {
            let out = plain(&format!("YUV4MPEG2 W3 H2 Cmono XCOLORRANGE={range}"), [grey, 0, 0]);
            assert!(out.rgb.iter().all(|&value| value == expected), "{range} {grey}: {:?}", out.rgb);
        }
    }

    #[test]
    fn many_rows_are_high_definition() {
        // BT.709's red, in limited range.
        for chroma in ["420", "422", "444"] {
            let out = plain(&format!("YUV4MPEG2 W2 H720 C{chroma}"), [63, 102, 240]);
            assert!(
                out.rgb.as_chunks::<3>().0.iter().all(|rgb| rgb[0] >= 253 && rgb[1] <= 2 && rgb[2] <= 2),
                "{chroma}"
            );
        }
    }

    #[test]
    fn chroma_is_interpolated_between_its_samples() {
        let mut converter = Converter::new(&Header::parse("YUV4MPEG2 W4 H1 C422").unwrap()).unwrap();
        let mut out = ColorImage::default();
        converter.convert(&[126, 126, 126, 126, 128, 128, 128, 168], &mut out);
        let red: Vec<u8> = out.rgb.as_chunks::<3>().0.iter().map(|rgb| rgb[0]).collect();
        assert_eq!((red[0], red[3]), (128, 192));
        assert_eq!((red[1], red[2]), (160, 192));
    }
}
