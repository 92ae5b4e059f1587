//! Pictures in formats besides PNG and JPEG.

use std::fs;
use std::path::PathBuf;

use bokehcam_media::recording::still::{read_color, read_depth, read_photo};
use image::{DynamicImage, GrayAlphaImage, GrayImage, ImageBuffer, ImageFormat, Luma, Rgb, RgbImage, Rgba, RgbaImage};
use tempfile::TempDir;

use super::assert_says;

const FORMATS: [ImageFormat; 4] = [ImageFormat::WebP, ImageFormat::Tiff, ImageFormat::Bmp, ImageFormat::Gif];

fn save(dir: &TempDir, image: impl Into<DynamicImage>, format: ImageFormat) -> PathBuf {
    // The content decides, not the name.
    let path = dir.path().join("picture.png");
    image.into().save_with_format(&path, format).unwrap();
    path
}

fn gradient() -> RgbImage {
    RgbImage::from_fn(15, 9, |x, y| [x as u8 * 17, y as u8 * 31, 200].into())
}

#[test]
fn colour_is_read_exactly() {
    let dir = TempDir::new().unwrap();
    for format in FORMATS {
        let image = read_color(&save(&dir, gradient(), format)).unwrap();
        assert_eq!((image.size(), &image.rgb), ((15, 9), gradient().as_raw()), "{format:?}");
    }
    let grey = GrayImage::from_fn(7, 3, |x, y| [x as u8 * 30 + y as u8].into());
    let repeated: Vec<u8> = grey.as_raw().iter().flat_map(|value| [*value; 3]).collect();
    for format in [ImageFormat::Tiff, ImageFormat::Bmp] {
        assert_eq!(read_color(&save(&dir, grey.clone(), format)).unwrap().rgb, repeated, "{format:?}");
    }
    let pnm = dir.path().join("a.pgm");
    fs::write(&pnm, b"P5\n2 1\n65535\n\x12\x34\xff\xff").unwrap();
    assert_eq!(read_color(&pnm).unwrap().rgb, [18, 18, 18, 255, 255, 255]);
    // 16 bits are rounded, and said to be lost, as is transparency, which is in front of white.
    let wide = ImageBuffer::<Rgb<u16>, _>::from_pixel(3, 2, [0, 65535, 300].into());
    let (image, metadata) = read_photo(&save(&dir, wide, ImageFormat::Tiff)).unwrap();
    assert_eq!((&image.rgb[..3], metadata.lost_properties), (&[0, 255, 1][..], vec!["16 bits a channel"]));
    let clear = RgbaImage::from_pixel(3, 2, [10, 20, 30, 128].into());
    for format in [ImageFormat::WebP, ImageFormat::Tiff] {
        let (image, metadata) = read_photo(&save(&dir, clear.clone(), format)).unwrap();
        assert_eq!(
            (&image.rgb[..3], metadata.lost_properties),
            (&[132, 137, 142][..], vec!["transparency"]),
            "{format:?}"
        );
    }
    let (image, _) =
        read_photo(&save(&dir, GrayAlphaImage::from_pixel(3, 2, [77, 5].into()), ImageFormat::WebP)).unwrap();
    assert_eq!(image.rgb, [252; 18], "nearly white");
}

#[test]
fn a_16_bit_tiff_is_depth_as_a_png_is() {
    let dir = TempDir::new().unwrap();
    let map = ImageBuffer::<Luma<u16>, _>::from_fn(4, 3, |x, y| [(x * 5000 + y) as u16].into());
    let depth = read_depth(&save(&dir, map.clone(), ImageFormat::Tiff), 5000.0, None).unwrap();
    let expected: Vec<f32> = map.as_raw().iter().map(|value| f32::from(*value) / 5000.0).collect();
    assert_eq!((depth.size(), depth.metres), ((4, 3), expected));
}

/// A little-endian TIFF of one grey pixel with these entries besides: tag and 16-bit value.
fn tiff(entries: &[(u16, u16)]) -> Vec<u8> {
    let pixel_at = 200;
    let defaults = [(256, 2), (257, 1), (258, 8), (259, 1), (262, 1), (273, pixel_at), (278, 1), (279, 2)];
    let is_given = |tag: u16| entries.iter().any(|entry| entry.0 == tag);
    let mut entries = [entries, &defaults.into_iter().filter(|entry| !is_given(entry.0)).collect::<Vec<_>>()].concat();
    entries.sort_unstable();
    let mut file = [&b"II*\0\x08\0\0\0"[..], &(entries.len() as u16).to_le_bytes()].concat();
    for (tag, value) in entries {
        file.extend([tag.to_le_bytes(), [3, 0], [1, 0], [0, 0], value.to_le_bytes(), [0, 0]].concat());
    }
    file.resize(usize::from(pixel_at), 0);
    [&file[..], &[10, 240]].concat()
}

#[test]
fn a_turned_tiff_is_upright_and_a_raw_picture_is_none() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.tif");
    for (orientation, size, first) in [(1, (2, 1), 10), (3, (2, 1), 240), (6, (1, 2), 10), (8, (1, 2), 240)] {
        fs::write(&path, tiff(&[(274, orientation)])).unwrap();
        let image = read_color(&path).unwrap();
        assert_eq!((image.size(), image.rgb[0]), (size, first), "orientation {orientation}");
    }
    // A reduced copy, a colour filter array, and DNG.
    for raw in [(254, 1), (262, 32803), (50706, 1)] {
        fs::write(&path, tiff(&[raw])).unwrap();
        assert_says(read_color(&path), &["a.tif", "a camera's raw picture", "darktable-cli IN.nef OUT.jpg"]);
    }
}

#[test]
fn floats_are_not_a_colour_picture() {
    let dir = TempDir::new().unwrap();
    for image in [
        DynamicImage::from(ImageBuffer::<Rgb<f32>, _>::from_pixel(2, 2, [0.5; 3].into())),
        ImageBuffer::<Rgba<f32>, _>::from_pixel(2, 2, [0.5; 4].into()).into(),
    ] {
        assert_says(
            read_color(&save(&dir, image, ImageFormat::Tiff)),
            &["32-bit floats, which is not read; save it as RGB of 8 or 16 bits"],
        );
    }
}

/// A photo and a map each say in plain words what of a TIFF is not read, and how to save it.
#[test]
fn the_form_of_a_tiff_that_is_not_read_is_named() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.tif");
    for (entries, form, is_map) in [
        (&[(259, 50000)][..], "ZSTD compression (code 50000)", true),
        (&[(259, 50001)], "WebP compression (code 50001)", true),
        (&[(259, 34887)], "LERC compression (code 34887)", true),
        (&[(259, 7777)], "unknown compression (code 7777)", true),
        (&[(262, 3)], "a palette", true),
        (&[(262, 6), (277, 3)], "colours as YCbCr", false),
        (&[(277, 2)], "2 channels of 8-bit numbers", false),
        (&[(258, 32), (339, 3)], "1 channel of 32-bit floats", false),
    ] {
        fs::write(&path, tiff(entries)).unwrap();
        let said = format!("a.tif: it is a TIFF with {form}, which is not read; ");
        assert_says(read_color(&path), &[&said, "save it as RGB of 8 or 16 bits, with LZW compression or none"]);
        if is_map {
            assert_says(read_depth(&path, 1.0, None), &[&said, "save it as grey of 16 bits or floats"]);
        }
    }
    // One bit is black and white, and no map.
    fs::write(&path, tiff(&[(258, 1)])).unwrap();
    assert_eq!(read_color(&path).unwrap().size(), (2, 1));
    assert_says(read_depth(&path, 1.0, None), &["a TIFF with 1 channel of 1-bit numbers, which is not read"]);
}

/// Cut and changed anywhere: a picture or one line, of the size that its header states.
#[test]
fn damage_is_one_line() {
    let dir = TempDir::new().unwrap();
    for format in FORMATS {
        let path = save(&dir, gradient(), format);
        let whole = fs::read(&path).unwrap();
        for at in (0..200).map(|place| place * whole.len() / 200) {
            let mut changed = whole.clone();
            changed[at] ^= 0xFF;
            for file in [&whole[..at], &changed] {
                fs::write(&path, file).unwrap();
                match read_color(&path) {
                    Ok(image) => assert_eq!(image.rgb.len(), 3 * image.width as usize * image.height as usize),
                    Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
                }
            }
        }
    }
}

#[test]
fn a_size_beyond_the_limit_is_refused_by_the_header() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.bmp");
    for (format, width_at) in [(ImageFormat::Bmp, 18), (ImageFormat::Gif, 6)] {
        let mut file = fs::read(save(&dir, gradient(), format)).unwrap();
        file[width_at..width_at + 2].copy_from_slice(&60_000_u16.to_le_bytes());
        fs::write(&path, file).unwrap();
        assert_says(read_color(&path), &["a.bmp: its header claims 60000x9 pixels"]);
    }
    fs::write(&path, tiff(&[(256, 60_000)])).unwrap();
    assert_says(read_color(&path), &["a.bmp: its header claims 60000x1 pixels"]);
}

#[test]
fn foreign_kinds_are_named_with_a_command() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.jpg");
    for (start, parts) in [
        (&b"\0\0\0\x1cftypavif\0\0\0\0"[..], ["an AVIF picture", "avifdec IN.avif OUT.png (package libavif-bin)"]),
        (b"\0\0\0\x0cJXL \r\n\x87\n", ["a JPEG XL picture", "djxl IN.jxl OUT.png (package libjxl-tools)"]),
        (b"\x76\x2f\x31\x01\x02\0\0\0", ["an OpenEXR picture", "convert IN.exr OUT.png"]),
        (b"\x93NUMPY\x01\0", ["a NumPy array", "depth map"]),
        (b"\0\0\0\x0cjP  \r\n\x87\n", ["a JPEG 2000 picture", "opj_decompress -i IN.jp2 -o OUT.png"]),
        (b"%PDF-1.7", ["a PDF document", "pdftoppm -png -singlefile IN.pdf OUT"]),
        (b"<svg/>", ["an SVG drawing", "rsvg-convert IN.svg -o OUT.png"]),
        (b"<?xml version='1.0'?><svg/>", ["an XML file", "rsvg-convert IN.svg -o OUT.png"]),
        (b"FUJIFILMCCD-RAW 0201", ["a camera's raw picture", "package darktable"]),
    ] {
        fs::write(&path, start).unwrap();
        assert_says(read_color(&path), &["a.jpg: it is", parts[0], parts[1]]);
    }
    fs::write(&path, "hello").unwrap();
    assert_says(read_color(&path), &["a.jpg: not a PNG, JPEG, TIFF, WebP, BMP, PNM or GIF file; convert it"]);
}
