//! Masks of photos, of any size and tool.

use std::path::Path;

use bokehcam::frame::Mask;
use bokehcam_media::recording::RecordingError;
use bokehcam_media::recording::mask_file::{self, MaskFile};
use bokehcam_media::recording::still::read_grey;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::metadata::Orientation;
use image::{DynamicImage, GrayImage, ImageEncoder, Luma, LumaA, Rgba, RgbaImage};
use tempfile::TempDir;

use super::assert_says;

const SIZE: (u32, u32) = (48, 32);

fn read(path: &Path) -> Result<MaskFile, RecordingError> {
    mask_file::read(path, SIZE)
}

/// Whether a place, in fractions of the sides, is the subject: no two quarters are alike.
fn is_subject(x: f32, y: f32) -> bool {
    x < 0.5 && y < 0.25 || (0.25..0.75).contains(&x) && y > 0.5
}

fn grey(width: u32, height: u32) -> GrayImage {
    let center = |at: u32, side: u32| (at as f32 + 0.5) / side as f32;
    GrayImage::from_fn(width, height, |x, y| {
        Luma([if is_subject(center(x, width), center(y, height)) { 255 } else { 0 }])
    })
}

fn alphas(picture: &GrayImage) -> Vec<f32> {
    picture.pixels().map(|pixel| f32::from(pixel[0]) / 255.0).collect()
}

#[test]
fn a_mask_is_turned_by_its_orientation_tag() {
    let dir = TempDir::new().unwrap();
    let upright = grey(SIZE.0, SIZE.1);
    for tag in 1..=8 {
        let orientation = Orientation::from_exif(tag).unwrap();
        // What becomes the upright mask once it is turned.
        let mut stored = DynamicImage::from(upright.clone());
        stored.apply_orientation(match orientation {
            Orientation::Rotate90 => Orientation::Rotate270,
            Orientation::Rotate270 => Orientation::Rotate90,
            own => own,
        });
        let exif = [b"II\x2a\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0", &[tag, 0, 0, 0, 0, 0, 0, 0][..]].concat();
        let (mut png, mut jpeg) = (Vec::new(), Vec::new());
        let mut encoder = PngEncoder::new(&mut png);
        encoder.set_exif_metadata(exif.clone()).unwrap();
        stored.write_with_encoder(encoder).unwrap();
        let mut encoder = JpegEncoder::new_with_quality(&mut jpeg, 100);
        encoder.set_exif_metadata(exif).unwrap();
        stored.write_with_encoder(encoder).unwrap();
        for (name, file) in [("m.png", png), ("m.jpg", jpeg)] {
            let path = dir.path().join(name);
            std::fs::write(&path, file).unwrap();
            let MaskFile { mask, notes } = read(&path).unwrap();
            assert_eq!((mask.width, mask.height, notes.len()), (SIZE.0, SIZE.1, 0), "{name} {tag}");
            // So is a picture of an aperture.
            let (width, height, grey) = read_grey(&path).unwrap();
            assert_eq!((width, height), SIZE, "{name} {tag}");
            for found in [mask.alpha, grey] {
                let worst = found.iter().zip(alphas(&upright)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(worst < 0.05, "{name} {tag}: {worst}");
            }
        }
    }
}

#[test]
fn the_mask_of_a_cut_out_picture_is_its_alpha() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("m.png");
    let picture = grey(SIZE.0, SIZE.1);
    let white = alphas(&picture);
    let cut = |colors: fn(u32, u32, u8) -> [u8; 3]| {
        let image = RgbaImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            let alpha = picture.get_pixel(x, y)[0];
            let [r, g, b] = colors(x, y, alpha);
            Rgba([r, g, b, alpha])
        });
        DynamicImage::from(image)
    };
    let opaque = picture.pixels().map(|pixel| LumaA([pixel[0], 255]));
    let mut opaque_mask = image::GrayAlphaImage::new(SIZE.0, SIZE.1);
    opaque_mask.pixels_mut().zip(opaque).for_each(|(pixel, value)| *pixel = value);
    for (what, image, is_said) in [
        ("a dark subject", cut(|x, y, _| [x as u8, y as u8, 20]), true),
        ("black", cut(|_, _, _| [0; 3]), true),
        ("white", cut(|_, _, _| [255; 3]), false),
        ("white on transparent black", cut(|_, _, alpha| [alpha; 3]), false),
        ("opaque", DynamicImage::from(opaque_mask), false),
        ("without alpha", DynamicImage::from(picture.clone()), false),
    ] {
        image.save(&path).unwrap();
        let MaskFile { mask, notes } = read(&path).unwrap();
        assert_eq!(mask, Mask { width: SIZE.0, height: SIZE.1, alpha: white.clone() }, "{what}");
        assert_eq!(notes.iter().filter(|note| note.contains("its alpha is taken as the mask")).count(), notes.len());
        assert_eq!(notes.len(), usize::from(is_said), "{what}: {notes:?}");
    }
    // Nothing is the subject where nothing is opaque.
    RgbaImage::from_pixel(SIZE.0, SIZE.1, Rgba([255, 255, 255, 0])).save(&path).unwrap();
    assert!(read(&path).unwrap().mask.alpha.iter().all(|&alpha| alpha == 0.0));
}

#[test]
fn a_mask_of_any_size_has_the_aspect_of_its_picture_or_is_a_square() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("m.png");
    for (size, expected, notes) in [
        ((48, 32), (48, 32), 0),
        ((24, 16), (24, 16), 0),
        ((96, 64), (48, 32), 0),
        ((4800, 3200), (48, 32), 0),
        ((53, 35), (48, 32), 1),
        ((40, 40), (40, 32), 1),
        ((256, 256), (48, 32), 1),
        ((16, 16), (16, 16), 1),
    ] {
        grey(size.0, size.1).save(&path).unwrap();
        let file = read(&path).unwrap();
        assert_eq!((file.mask.width, file.mask.height), expected, "{size:?}");
        assert_eq!(file.notes.len(), notes, "{size:?}: {:?}", file.notes);
        // Off the outline it is what it was; the area is the same.
        let right = alphas(&grey(expected.0, expected.1));
        let [area, right_area] = [&file.mask.alpha, &right].map(|alpha| alpha.iter().sum::<f32>());
        assert!((area / right_area - 1.0).abs() < 0.03, "{size:?}: {area} {right_area}");
        let wrong = file.mask.alpha.iter().zip(&right).filter(|(a, b)| (*a - *b).abs() > 0.51).count();
        assert_eq!(wrong, 0, "{size:?}");
    }
    for size in [(32, 48), (48, 40), (480, 200)] {
        grey(size.0, size.1).save(&path).unwrap();
        let says = format!("the mask is {}x{}, of another aspect ratio than the picture's 48x32", size.0, size.1);
        assert_says(read(&path), &["m.png", &says]);
    }
}
