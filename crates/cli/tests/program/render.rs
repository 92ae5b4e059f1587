//! The command `render` on pictures in the formats of cameras and other programs.
#![allow(missing_docs)]

use std::path::Path;

use bokehcam::frame::ColorImage;
use bokehcam_media::recording::still::{read_photo, write_photo};
use bokehcam_media::recording::{Photo, PhotoMetadata};
use image::{ImageBuffer, Rgba};

use crate::common::color;
use crate::program::{Home, Ran, STEREO};

/// Runs a command with these arguments on the CPU.
fn on_cpu(home: &Home, command: &[&str], arguments: &[&str]) -> Ran {
    home.run(&[command, arguments, &["--backend", "cpu"]].concat())
}

/// Runs `render` on the CPU.
fn run(home: &Home, arguments: &[&str]) -> Ran {
    on_cpu(home, &["render"], arguments)
}

/// Blurs `image`; returns stderr.
fn render(home: &Home, image: &str, out: &str) -> String {
    run(home, &[image, "--effect", "blur", "--coc-at-infinity", "3", "--out", out]).done().to_owned()
}

/// Creates a checkerboard of 8 by 8 pixels, light in the left half and dark in the right.
fn halves(home: &Home) -> ColorImage {
    let picture = color(160, 96, |x, y| {
        let check = if (x / 8 + y / 8) % 2 == 0 { 60 } else { 0 };
        [if x < 80 { 180 + check } else { 20 + check }; 3]
    });
    write_photo(&home.path("in.png"), &picture, &PhotoMetadata::default(), false).unwrap();
    picture
}

/// Returns the mean absolute difference of two pictures in some columns, in 8-bit codes.
fn difference(a: &ColorImage, b: &ColorImage, columns: std::ops::Range<usize>) -> f32 {
    let width = a.width as usize;
    let bytes = (0..a.rgb.len()).filter(|byte| columns.contains(&(byte / 3 % width)));
    let (sum, count) =
        bytes.fold((0.0, 0.0), |(sum, count), k| (sum + f32::from(a.rgb[k].abs_diff(b.rgb[k])), count + 1.0));
    sum / count
}

#[test]
fn what_goes_with_a_picture_stays_with_it() {
    let home = Home::new();
    let profile = moxcms::ColorProfile::new_display_p3().encode().unwrap();
    // EXIF with one entry, the camera's name.
    let exif = b"MM\0\x2a\0\0\0\x08\0\x01\x01\x10\0\x02\0\0\0\x04CAM\0\0\0\0\0".to_vec();
    let xmp =
        "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\"><rdf:Description dc:rights=\"Mine, \u{e4}\"/></x:xmpmeta>".to_owned();
    let iptc = b"8BIM\x04\x04\0\0\0\0\0\x08\x1c\x02\x74\0\x03(c)";
    let (profile, exif, xmp, image_resources) = (Some(profile), Some(exif), Some(xmp), Some(iptc.to_vec()));
    let metadata = PhotoMetadata { icc_profile: profile, exif, xmp, image_resources, ..PhotoMetadata::default() };
    write_photo(&home.path("in.jpg"), &ColorImage::new(40, 30), &metadata, false).unwrap();
    for out in ["out.png", "out.jpg", "out.webp", "out.tif"] {
        let said = render(&home, "in.jpg", out);
        let mut kept = Photo::read(&home.path(out)).unwrap().metadata;
        if matches!(out, "out.png" | "out.webp") {
            assert!(said.starts_with(&format!("note: not in {out}: captions and rights as IPTC\n")), "{said}");
            kept.image_resources = metadata.image_resources.clone();
        } else {
            assert_eq!(said.lines().count(), 1, "{said}");
        }
        if out == "out.tif" {
            // EXIF is entries of the file itself there.
            let exif = kept.exif.replace(metadata.exif.clone().unwrap()).unwrap();
            assert!(exif.windows(4).any(|part| part == b"CAM\0"), "{exif:?}");
        }
        assert_eq!(kept, metadata, "{out}");
    }
    // From TIFF to the others, too.
    render(&home, "out.tif", "again.jpg");
    let kept = Photo::read(&home.path("again.jpg")).unwrap().metadata;
    assert!(kept.exif.unwrap().windows(4).any(|part| part == b"CAM\0") && kept.xmp == metadata.xmp);
    assert_eq!(kept.image_resources, metadata.image_resources);
}

#[test]
fn what_does_not_fit_is_said_once() {
    let home = Home::new();
    ImageBuffer::<Rgba<u16>, _>::from_pixel(40, 30, [1, 2, 3, 4].into()).save(home.path("in.png")).unwrap();
    for (out, lost) in [
        ("out.png", None),
        ("out.tif", None),
        ("out.webp", Some("16 bits a channel")),
        ("out.jpg", Some("transparency, 16 bits a channel")),
    ] {
        let said = render(&home, "in.png", out);
        assert_eq!(said.lines().count(), 1 + lost.iter().count(), "{said}");
        let note = lost.map_or(String::new(), |lost| format!("note: not in {out}: {lost}\n"));
        assert!(said.starts_with(&note), "{said}");
    }
}

#[test]
fn a_mask_says_what_stays_sharp_in_any_size() {
    let home = Home::new();
    let picture = halves(&home);
    // The mask has a sixteenth of the picture's size; its left half is white.
    let mask = image::GrayImage::from_fn(10, 6, |x, _| [if x < 5 { 255 } else { 0 }].into());
    mask.save(home.path("mask.png")).unwrap();
    let ran = run(&home, &["in.png", "--mask", "mask.png", "--coc-at-infinity", "8", "--out", "out.png"]);
    assert_eq!(ran.done().lines().count(), 1, "{}", ran.stderr);
    let out = read_photo(&home.path("out.png")).unwrap().0;
    assert_eq!(difference(&picture, &out, 0..70), 0.0, "the subject is not touched");
    assert!(difference(&picture, &out, 90..160) > 10.0);
    // The outline follows the picture's colours, although the mask is coarse.
    assert!(difference(&picture, &out, 76..80) < 2.0, "{}", difference(&picture, &out, 76..80));
    // So do a larger one, a square, one that its tag turns, and the alpha of a picture that was cut out.
    let left = |x: u32, width: u32| if 2 * x < width { 255 } else { 0 };
    for (name, width, height) in [("large.png", 320, 192), ("square.png", 64, 64)] {
        let mask = image::GrayImage::from_fn(width, height, |x, _| [left(x, width)].into());
        mask.save(home.path(name)).unwrap();
    }
    let cut = image::RgbaImage::from_fn(160, 96, |x, _| [30, 20, 10, left(x, 160)].into());
    cut.save(home.path("cut.png")).unwrap();
    let exif = b"MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0".to_vec();
    let metadata = PhotoMetadata { exif: Some(exif), ..PhotoMetadata::default() };
    let turned = color(96, 160, |_, y| if y < 80 { [0; 3] } else { [255; 3] });
    for name in ["turned.tif", "turned.png", "turned.jpg"] {
        write_photo(&home.path(name), &turned, &metadata, false).unwrap();
    }
    for (mask, note) in [
        ("large.png", ""),
        ("square.png", "64x64 pixels, stretched to the picture's 160x96"),
        ("cut.png", "its alpha is taken as the mask, not its colours"),
        ("turned.tif", ""),
        ("turned.png", ""),
        ("turned.jpg", ""),
    ] {
        let ran = run(&home, &["in.png", "--mask", mask, "--coc-at-infinity", "8", "--out", "out.png", "--force"]);
        let note = if note.is_empty() { String::new() } else { format!("note: {mask}: {note}\n") };
        assert!(ran.done().starts_with(&note) && ran.stderr.lines().count() == 1 + note.lines().count(), "{ran:?}");
        let out = read_photo(&home.path("out.png")).unwrap().0;
        assert_eq!(difference(&picture, &out, 0..70), 0.0, "{mask}");
        assert!(difference(&picture, &out, 90..160) > 10.0, "{mask}");
    }
    for (arguments, expected) in [
        (vec!["in.png", "--mask", "mask.png", "--focus", "2", "--out", "no.png"], "--focus 2 needs distances"),
        (
            vec!["in.png", "--mask", "mask.png", "--depth", "matte", "--out", "no.png"],
            "leave --depth-map and --mask out",
        ),
    ] {
        run(&home, &arguments).failed(2, &[expected]);
    }
}

#[test]
fn relative_inverse_depth_has_white_near_or_far() {
    let home = Home::new();
    let picture = halves(&home);
    let near_left = image::GrayImage::from_fn(160, 96, |x, _| [if x < 80 { 200 } else { 40 }].into());
    near_left.save(home.path("near.png")).unwrap();
    let mut far_left = near_left;
    far_left.pixels_mut().for_each(|pixel| pixel.0[0] = 240 - pixel.0[0]);
    far_left.save(home.path("far.png")).unwrap();
    let blur = |map: &str, out: &str, more: &[&str]| {
        let arguments =
            [&["in.png", "--depth-map", map, "--depth-unit", "inverse", "--focus", "0.2,0.5", "--out", out], more]
                .concat();
        run(&home, &arguments).done();
        read_photo(&home.path(out)).unwrap().0
    };
    let (near, inverted) = (blur("near.png", "a.png", &[]), blur("far.png", "b.png", &["--depth-invert"]));
    assert_eq!(near, inverted);
    assert_eq!(difference(&picture, &near, 0..70), 0.0);
    assert!(difference(&picture, &near, 90..160) > 5.0);
    // 8 bits alone mean nothing; the question names the option for each answer.
    let asked = ["--depth-unit inverse if white is near", "--depth-invert if black is near", "scale:N"];
    run(&home, &["in.png", "--depth-map", "near.png", "--out", "no.png"]).failed(1, &asked);
}

#[test]
fn a_recording_may_have_relative_inverse_depth() {
    let home = Home::new();
    let picture = halves(&home);
    let at = |name: &str| home.path(name);
    std::fs::create_dir_all(at("rec/rgb")).unwrap();
    std::fs::rename(at("in.png"), at("rec/rgb/0.png")).unwrap();
    std::fs::create_dir(at("rec/depth")).unwrap();
    // Depth as networks write it: 8 bits, here as grey RGB.
    let near_left = image::RgbImage::from_fn(160, 96, |x, _| [if x < 80 { 250 } else { 20 }; 3].into());
    near_left.save(at("rec/depth/0.png")).unwrap();
    std::fs::write(at("rec/rgb.txt"), "0 rgb/0.png\n").unwrap();
    std::fs::write(at("rec/depth.txt"), "0 depth/0.png\n").unwrap();
    let stream = |more: &[&str]| on_cpu(&home, &["stream", "rec", "--to", "out/", "--force"], more);
    stream(&["--depth-unit", "inverse", "--focus", "0.2,0.5", "--coc-at-infinity", "8"]).done();
    let mut written = std::fs::read_dir(at("out")).unwrap().map(|entry| entry.unwrap().path());
    let first = written.find(|path| path.extension().is_some_and(|extension| extension == "png"));
    let blurred = read_photo(&first.unwrap()).unwrap().0;
    assert!(difference(&picture, &blurred, 0..66) < 0.1 && difference(&picture, &blurred, 94..160) > 5.0);
    for (arguments, code, part) in [
        (&["--depth-unit", "inverse", "--focus", "1.2"][..], 2, "--focus 1.2 needs distances"),
        (&["--depth-unit", "inverse", "--depth-scale", "1000", "--quiet"], 0, ""),
        (&["--depth-unit", "inverse", "--depth-scale", "1000"], 0, "relative depth has no scale"),
        (&["--depth-invert"], 1, "depth.txt:1"),
    ] {
        let ran = stream(arguments);
        assert!(ran.code == code && ran.stderr.contains(part), "{arguments:?}: {ran:?}");
    }
}

/// Asserts that valid but probably unintended arguments give a one-line warning and still work.
#[track_caller]
fn warned(home: &Home, command: &[&str], arguments: &[&str], expected: &str) {
    let ran = on_cpu(home, command, &[arguments, &["--force"]].concat());
    assert!(ran.warning().contains(expected), "{arguments:?}: {}", ran.stderr);
}

#[test]
fn pictures_in_the_wrong_place_are_said() {
    let home = Home::new();
    halves(&home);
    for (name, code) in [("white.png", 255), ("black.png", 0), ("grey.png", 128)] {
        image::GrayImage::from_pixel(16, 9, [code].into()).save(home.path(name)).unwrap();
    }
    image::GrayImage::new(90, 160).save(home.path("tall.png")).unwrap();
    let units = |name: &str, at: fn(u32) -> u16| {
        let map = ImageBuffer::<image::Luma<u16>, _>::from_fn(160, 96, |x, _| [at(x)].into());
        map.save(home.path(name)).unwrap();
    };
    units("unknown.png", |_| 0);
    units("flat.png", |_| 5000);
    units("mm.png", |x| if x < 80 { 1000 } else { 3000 });
    for (option, file, expected) in [
        ("--mask", "white.png", "1.0 all over"),
        ("--mask", "black.png", "0.0 all over"),
        ("--mask", "grey.png", "0.5 all over"),
        ("--mask", "in.png", "the picture itself"),
        ("--depth-map", "mm.png", "add --depth-scale 1000"),
    ] {
        warned(&home, &["render"], &["in.png", option, file, "--refine", "off", "--out", "out.png"], expected);
    }
    let inverse = ["in.png", "--depth-map", "in.png", "--depth-unit", "inverse", "--refine", "off", "--out", "out.png"];
    warned(&home, &["render"], &inverse, "the picture itself");
    for (map, expected) in [("unknown.png", "no depth is known"), ("flat.png", "one value"), ("grey.png", "8-bit")] {
        run(&home, &["in.png", "--depth-map", map, "--out", "no.png"]).failed(1, &[map, expected]);
    }
    run(&home, &["in.png", "--mask", "tall.png", "--out", "no.png"]).failed(1, &["tall.png: the mask is 90x160"]);
    // Arguments that resolve the ambiguity give no warning.
    let meant = ["in.png", "--depth-map", "mm.png", "--depth-scale", "1000", "--refine", "off", "--out", "meant.png"];
    let ran = run(&home, &meant);
    assert_eq!(ran.done().lines().count(), 1, "{}", ran.stderr);
}

#[test]
fn one_picture_for_both_eyes_is_said() {
    let home = Home::new();
    let eye = |folder: &str| {
        let mut files: Vec<_> =
            std::fs::read_dir(Path::new(STEREO).join(folder)).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files[0].to_str().unwrap().to_owned()
    };
    let (left, right) = (eye("image_2"), eye("image_3"));
    let out = ["--out", "d.pfm"];
    warned(&home, &["depth", &left, &left], &out, "left and right are the same picture");
    let ran = on_cpu(&home, &["depth", &left, &right, "--force"], &out);
    assert!(!ran.done().contains("warning"), "{}", ran.stderr);
}
