//! Comparison with a floating-point reference, and round trips through the decoder.

use super::*;
use crate::capture::pixels::Decoder;
use crate::layout::FourCc;
use bokehcam::color::YcbcrMatrix;

fn noise(width: u32, height: u32) -> ColorImage {
    let mut state = 5_u64;
    let mut byte = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as u8
    };
    let mut picture = ColorImage::new(width, height);
    picture.rgb.iter_mut().for_each(|value| *value = byte());
    picture
}

fn encoded(layout: &Layout, picture: &ColorImage, arch: Arch) -> Vec<Vec<u8>> {
    let mut planes: Vec<Vec<u8>> = layout.planes().iter().map(|plane| vec![9; plane.size_bytes]).collect();
    let mut slices: Vec<&mut [u8]> = planes.iter_mut().map(Vec::as_mut_slice).collect();
    Encoder { arch, ..Encoder::new(layout).unwrap() }.encode(picture, &mut slices);
    planes
}

/// Reference Y'CbCr of a colour, not rounded.
fn exact([r, g, b]: [f64; 3], matrix: YcbcrMatrix, range: Range) -> [f64; 3] {
    let [red, green, blue] = matrix.luma_weights();
    let y = red * r + green * g + blue * b;
    let (luma, black, chroma) = match range {
        Range::Limited => (219.0, 16.0, 224.0),
        Range::Full => (255.0, 0.0, 255.0),
    };
    let of = |color: f64, weight: f64| 128.0 + chroma / 255.0 * (color - y) / (2.0 * (1.0 - weight));
    [black + luma / 255.0 * y, of(b, blue), of(r, red)]
}

/// Reference colour of a pair's chroma: (1 2 1) / 4 around its left pixel, over one row or two.
fn around(picture: &ColorImage, pair: usize, rows: &[usize]) -> [f64; 3] {
    let last = (picture.width as usize - 1, picture.height as usize - 1);
    let at = |x: usize, y: usize, p: usize| {
        f64::from(picture.rgb[3 * (y.min(last.1) * picture.width as usize + x.min(last.0)) + p])
    };
    let (x, share) = (2 * pair, 1.0 / (4.0 * rows.len() as f64));
    let row = |y: usize, p: usize| at(x.saturating_sub(1), y, p) + 2.0 * at(x, y, p) + at(x + 1, y, p);
    [0, 1, 2].map(|p| rows.iter().map(|&y| row(y, p)).sum::<f64>() * share)
}

/// The sample (0 luma, 1 Cb, 2 Cr) of a pixel or pair, located independently of the encoder; `None` at the edge of half
/// a pair.
fn sample(layout: &Layout, planes: &[Vec<u8>], which: usize, x: usize, y: usize) -> Option<u8> {
    let components: Vec<Component> = layout.components().collect();
    let byte = |index: usize, at: usize| {
        let at_row = &components[index];
        (at < at_row.row_bytes).then(|| planes[at_row.plane][at_row.offset_bytes + y * at_row.stride_bytes + at])
    };
    match (layout.family(), which) {
        (Family::Packed422 { luma, .. }, 0) => byte(0, 2 * x + luma),
        (Family::Packed422 { cb, cr, .. }, _) => byte(0, 4 * x + [0, cb, cr][which]),
        (_, 0) => byte(0, x),
        (Family::SemiPlanar420 { swapped, .. }, _) => byte(1, 2 * x + usize::from((which == 2) != swapped)),
        (Family::Planar420 { swapped, .. }, _) => byte(1 + usize::from((which == 2) != swapped), x),
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_sample_is_the_nearest_code() {
    for (width, height) in [(18, 6), (7, 5), (1, 1)] {
        let picture = noise(width, height);
        for fourcc in FourCc::supported_formats() {
            let Some(down) = fourcc.family().and_then(|family| match family {
                Family::Packed422 { .. } => Some(1),
                Family::SemiPlanar420 { .. } | Family::Planar420 { .. } => Some(2),
                _ => None,
            }) else {
                continue;
            };
            for (matrix, range) in [
                (YcbcrMatrix::Bt601, Range::Limited),
                (YcbcrMatrix::Bt709, Range::Full),
                (YcbcrMatrix::Bt2020, Range::Limited),
            ] {
                let mut layout = Layout::packed(fourcc, width, height).unwrap().with_row_padding(2);
                (layout.matrix, layout.range) = (matrix, range);
                let planes = encoded(&layout, &picture, Arch::new());
                assert!(planes == encoded(&layout, &picture, Arch::Scalar), "{fourcc}");
                let (width, height) = (width as usize, height as usize);
                for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
                    let rgb = [0, 1, 2].map(|p| f64::from(picture.rgb[3 * (y * width + x) + p]));
                    let found = f64::from(sample(&layout, &planes, 0, x, y).unwrap());
                    let wanted = exact(rgb, matrix, range)[0];
                    assert!((found - wanted).abs() < 0.51, "{fourcc} luma {x} {y}: {found} {wanted}");
                }
                for (y, x) in (0..height.div_ceil(down)).flat_map(|y| (0..width.div_ceil(2)).map(move |x| (y, x))) {
                    let rows: Vec<usize> = (down * y..down * y + down).collect();
                    let wanted = exact(around(&picture, x, &rows), matrix, range);
                    for which in [1, 2] {
                        let Some(found) = sample(&layout, &planes, which, x, y) else { continue };
                        let off = (f64::from(found) - wanted[which].min(255.0)).abs();
                        assert!(off < 0.52, "{fourcc} {which} {x} {y}: {found} {wanted:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn what_is_decoded_is_what_was_encoded() {
    let (width, height) = (64, 16);
    let mut ramp = ColorImage::new(width, height);
    for (at, pixel) in (0..).zip(ramp.rgb.as_chunks_mut::<3>().0) {
        let (x, y) = ((at % width) as u8, (at / width) as u8);
        *pixel = [40 + 3 * x, 200 - 2 * x, 60 + 8 * y];
    }
    for fourcc in FourCc::supported_formats() {
        for range in [Range::Limited, Range::Full] {
            let mut layout = Layout::packed(fourcc, width, height).unwrap();
            (layout.matrix, layout.range) = (YcbcrMatrix::Bt709, range);
            if Encoder::new(&layout).is_none() {
                continue;
            }
            let planes = encoded(&layout, &ramp, Arch::new());
            let slices: Vec<&[u8]> = planes.iter().map(Vec::as_slice).collect();
            let mut back = ColorImage::default();
            Decoder::new(&layout).unwrap().decode(&slices, &mut back).unwrap();
            // Only away from the edges, beyond which the ramp does not continue.
            let inner = |at: usize| (2..62).contains(&(at % 64)) && (2..14).contains(&(at / 64));
            let pixels = ramp.rgb.as_chunks::<3>().0.iter().zip(back.rgb.as_chunks::<3>().0).enumerate();
            for (at, (was, is)) in pixels.filter(|&(at, _)| inner(at)) {
                let off = was.iter().zip(is).map(|(was, is)| was.abs_diff(*is)).max().unwrap();
                assert!(off <= 3, "{fourcc} {range:?} {at}: {was:?} {is:?}");
            }
        }
    }
}

#[test]
fn there_is_no_way_back_to_what_has_no_colours_or_is_compressed() {
    for fourcc in [FourCc::GREY, FourCc::Z16, FourCc::MJPG] {
        assert!(Encoder::new(&Layout::packed(fourcc, 8, 8).unwrap()).is_none(), "{fourcc}");
    }
}
