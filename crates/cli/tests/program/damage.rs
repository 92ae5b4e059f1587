//! Files that make a decoder panic, end early or lead elsewhere: a file's error, after which all that is whole goes on.
#![allow(missing_docs)]

use std::fs;
use std::path::Path;

use bokehcam::frame::ColorImage;
use bokehcam_media::recording::still::{read_color, write_color};
use bokehcam_media::recording::{Options, Recording};

use crate::common::noise;
use crate::program::{Home, Ran};

const SIZE: (u32, u32) = (24, 16);

/// Writes a PNG whose palette ends within a colour, at which the crate `png` panics.
fn write_bad_png(path: &Path) {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, SIZE.0, SIZE.1);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(vec![9, 90, 200, 7, 8]);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[1; (SIZE.0 * SIZE.1) as usize]).unwrap();
    writer.finish().unwrap();
    fs::write(path, file).unwrap();
}

/// A home with a good picture, a bad one, and a recording whose third picture is bad.
fn home() -> Home {
    let home = Home::new();
    write_color(&home.path("good.png"), &noise(SIZE.0, SIZE.1), false).unwrap();
    write_bad_png(&home.path("bad.png"));
    fs::create_dir_all(home.path("take/rgb")).unwrap();
    let list: String = (0..4).map(|frame| format!("1.{frame} rgb/{frame}.png\n")).collect();
    fs::write(home.path("take/rgb.txt"), list).unwrap();
    for frame in 0..4 {
        let name = if frame == 2 { "bad.png" } else { "good.png" };
        fs::copy(home.path(name), home.path(format!("take/rgb/{frame}.png"))).unwrap();
    }
    home
}

/// A picture that a setting names may count as a wrong argument.
#[track_caller]
fn assert_damaged(ran: &Ran, file: &str) {
    ran.failed(if ran.code == 2 { 2 } else { 1 }, &[&format!("{file}: damaged (")]);
    assert!(!ran.stderr.contains("panicked"), "{}", ran.stderr);
}

#[test]
fn a_picture_that_makes_its_decoder_panic_is_damaged_in_every_command() {
    let home = home();
    for arguments in [
        "render bad.png --effect blur",
        "render good.png --depth-map bad.png",
        "render good.png --mask bad.png",
        "render good.png --effect blur --aperture image:bad.png",
        "render good.png --effect blur --behind image:bad.png",
    ] {
        let arguments: Vec<&str> = arguments.split(' ').chain(["--out", "out.png", "--backend", "cpu"]).collect();
        assert_damaged(&home.run(&arguments), "bad.png");
        assert!(!home.path("out.png").exists());
    }
    assert_damaged(&home.run(&["stream", "bad.png", "--effect", "none", "--to", "null"]), "bad.png");
}

#[test]
fn a_batch_goes_on_after_a_picture_that_makes_its_decoder_panic() {
    let home = home();
    fs::create_dir(home.path("batch")).unwrap();
    for (from, to) in [("good.png", "a.png"), ("bad.png", "b.png"), ("good.png", "c.png")] {
        fs::copy(home.path(from), home.path("batch").join(to)).unwrap();
    }
    let ran = home.run(&["render", "batch", "--effect", "blur", "--out", "out", "--backend", "cpu"]);
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("error: batch/b.png: damaged ("), "{}", ran.stderr);
    assert!(ran.stderr.ends_with("error: 2 written, 0 skipped, 1 failed\n"), "{}", ran.stderr);
    assert!(["a.png", "c.png"].iter().all(|name| read_color(&home.path("out").join(name)).is_ok()));
}

#[test]
fn a_stream_and_a_recording_keep_what_came_before_or_go_on() {
    let home = home();
    assert_damaged(&home.run(&["stream", "take", "--effect", "none", "--to", "cut/"]), "rgb/2.png");
    home.run(&["stream", "take", "--effect", "none", "--keep-going", "--to", "all/"]).done();
    for (folder, count) in [("cut", 2), ("all", 3)] {
        let names = fs::read_dir(home.path(folder)).unwrap().map(|entry| entry.unwrap().file_name());
        assert_eq!(names.filter(|name| name.to_string_lossy().ends_with(".png")).count(), count, "{folder}");
    }
    for (to, kept) in [("new", "new"), ("new.mcap", "new.incomplete.mcap")] {
        let ran = home.run(&["record", "take", "--to", to]);
        assert_damaged(&ran, "rgb/2.png");
        assert!(ran.stderr.contains("incomplete; the 2 frames until then"), "{}", ran.stderr);
        assert_eq!(Recording::open(&home.path(kept), &Options::default()).unwrap().len(), 2, "{to}");
    }
}

#[test]
fn a_jpeg_that_was_cut_and_closed_is_no_picture() {
    let home = Home::new();
    write_color(&home.path("whole.jpg"), &noise(160, 120), false).unwrap();
    let whole = fs::read(home.path("whole.jpg")).unwrap();
    fs::write(home.path("cut.jpg"), &whole[..whole.len() / 2]).unwrap();
    fs::write(home.path("closed.jpg"), [&whole[..whole.len() / 2], &[0xFF, 0xD9]].concat()).unwrap();
    for name in ["cut.jpg", "closed.jpg"] {
        let ran = home.run(&["render", name, "--effect", "none", "--out", "out.png"]);
        ran.failed(1, &[&format!("{name}: the file ends before the picture does")]);
    }
    home.run(&["render", "whole.jpg", "--effect", "none", "--out", "out.png"]).done();
    assert_eq!(read_color(&home.path("out.png")).unwrap().size(), ColorImage::new(160, 120).size());
}
