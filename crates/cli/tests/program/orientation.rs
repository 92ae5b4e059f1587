//! Pictures that are turned, flipped and cut at the source, with all that is in their pixels.

use std::fs;
use std::path::Path;

use image::{DynamicImage, GrayImage, Rgb, RgbImage};

use crate::program::{Home, PORTRAIT, STEREO};

fn open(path: impl AsRef<Path>) -> DynamicImage {
    image::open(path.as_ref()).unwrap_or_else(|error| panic!("{}: {error}", path.as_ref().display()))
}

/// Creates a picture, its depth map of half the size, and a mask, in which each quarter differs.
fn photo(home: &Home) {
    let color = RgbImage::from_fn(96, 64, |x, y| {
        let check = if (x / 6 + y / 6) % 2 == 0 { 70 } else { 0 };
        Rgb([(x + check) as u8, (2 * y + check) as u8, (120 + check) as u8])
    });
    color.save(home.path("in.png")).unwrap();
    let is_near = |x: u32, y: u32| (20..60).contains(&x) && y > 16;
    let depth =
        image::ImageBuffer::from_fn(96, 64, |x, y| image::Luma([if is_near(x, y) { 5000_u16 } else { 20_000 }]));
    depth.save(home.path("in-depth.png")).unwrap();
    GrayImage::from_fn(96, 64, |x, y| image::Luma([if is_near(x, y) { 255 } else { 0 }]))
        .save(home.path("mask.png"))
        .unwrap();
}

/// Turns a picture by a quarter clockwise, flips it left to right, and cuts 40x60 pixels out of it at column 10 and row 20.
fn turned(picture: &DynamicImage) -> DynamicImage {
    picture.rotate90().fliph().crop_imm(10, 20, 40, 60)
}

const TURN: [&str; 6] = ["--rotate", "90", "--flip", "horizontal", "--crop", "40x60+10+20"];

#[test]
fn a_photo_its_map_and_its_mask_are_turned_before_anything_else() {
    let home = Home::new();
    photo(&home);
    for name in ["in", "in-depth", "mask"] {
        turned(&open(home.path(format!("{name}.png")))).save(home.path(format!("turned-{name}.png"))).unwrap();
    }
    fs::rename(home.path("turned-in-depth.png"), home.path("turned.png")).unwrap();
    for (with, by_hand) in [
        // Found beside the photo.
        (&[][..], &["--depth-map", "turned.png", "--refine", "off"][..]),
        (&["--depth-map", "in-depth.png"], &["--depth-map", "turned.png"]),
        (&["--mask", "mask.png"], &["--mask", "turned-mask.png"]),
        (&["--effect", "tilt-shift"], &["--effect", "tilt-shift"]),
    ] {
        let refine = if with.is_empty() { &["--refine", "off"][..] } else { &[] };
        let render = |image: &str, out: &str, more: &[&[&str]]| {
            let args = ["render", image, "--out", out, "--force", "--backend", "cpu", "-q", "--depth-scale", "5000"];
            home.run(&[&args[..], &more.concat()].concat()).done();
        };
        render("in.png", "by-option.png", &[&TURN, with, refine]);
        render("turned-in.png", "by-hand.png", &[by_hand]);
        let [by_option, by_hand] = ["by-option.png", "by-hand.png"].map(|name| open(home.path(name)).into_rgb8());
        assert!(by_option == by_hand && by_option.dimensions() == (40, 60), "{with:?}");
    }
}

#[test]
fn a_recording_is_turned_with_its_depth_and_so_is_what_is_recorded_of_it() {
    let home = Home::new();
    let record = ["record", PORTRAIT, "--end", "0.1", "-q", "--to"];
    home.run(&[&record[..], &["whole"]].concat()).done();
    let cut = ["--rotate", "270", "--flip", "vertical", "--crop", "200x300+20+15"];
    home.run(&[&record[..], &["part"], &cut].concat()).done();
    for folder in ["rgb", "depth"] {
        let mut names: Vec<_> = fs::read_dir(home.path("whole").join(folder)).unwrap().map(|e| e.unwrap()).collect();
        names.sort_by_key(fs::DirEntry::file_name);
        assert!(names.len() > 1);
        for whole in names {
            let expected = open(whole.path()).rotate270().flipv().crop_imm(20, 15, 200, 300);
            let part = open(home.path("part").join(folder).join(whole.file_name()));
            assert!(part == expected, "{folder}/{:?}", whole.file_name());
        }
    }
    let stream = ["stream", "whole", "--effect", "none", "-q", "--to", "out/"];
    home.run(&[&stream[..], &cut].concat()).done();
    assert!(open(home.path("out/000001.png")) == open(home.path("part/rgb/000001.png")));
}

#[test]
fn a_stereo_pair_is_matched_in_its_own_pixels_and_then_turned() {
    let home = Home::new();
    let record = ["record", STEREO, "--frames", "1", "-q", "--to"];
    home.run(&[&record[..], &["whole"]].concat()).done();
    home.run(&[&record[..], &["turned", "--rotate", "180", "--crop", "300x200+7+9"]].concat()).done();
    for file in ["rgb/000000.png", "depth/000000.png"] {
        let expected = open(home.path("whole").join(file)).rotate180().crop_imm(7, 9, 300, 200);
        assert!(open(home.path("turned").join(file)) == expected, "{file}");
    }
    // The picture is turned whatever the look does with it.
    for effect in ["none", "dof"] {
        let to = format!("{effect}/");
        let args = ["stream", STEREO, "--frames", "1", "--rotate", "90", "--effect", effect, "-q", "--to", &to];
        home.run(&args).done();
        let (width, height) = open(home.path(to).join("000000.png")).into_rgb8().dimensions();
        assert!(width < height, "{effect}: {width}x{height}");
    }
}

#[test]
fn a_part_outside_is_one_line_and_settings_of_files_count() {
    let home = Home::new();
    photo(&home);
    for (args, said) in [
        ("render in.png --effect blur --out x.png --crop 97x64+0+0", "in.png are 96x64"),
        ("render in.png --effect blur --out x.png --rotate 90 --crop 96x64+0+0", "in.png are 64x96"),
        ("stream in.png --effect blur --to null --crop 96x64+1+0", "in.png are 96x64"),
        ("record demo --frames 1 --to x --crop 9999x2+0+0", "demo"),
        ("stream in.png --to null --crop 96x64", "WIDTHxHEIGHT+X+Y"),
        ("stream in.png --to null --crop 0x64+0+0", "WIDTHxHEIGHT+X+Y"),
        ("stream in.png --to null --rotate 45", "use 0, 90, 180 or 270"),
        ("stream in.png --to null --flip left", "use none, horizontal or vertical"),
    ] {
        home.run(&args.split(' ').collect::<Vec<_>>()).refused(2, &[said]);
        assert!(!home.path("x").exists() && !home.path("x.png").exists(), "{args}");
    }
    let home = home.with_settings("rotate = 180\ncrop = \"50x40+1+2\"\n");
    let args = ["render", "in.png", "--effect", "none", "--out", "x.png", "-q"];
    home.run(&args).done();
    assert!(open(home.path("x.png")) == open(home.path("in.png")).rotate180().crop_imm(1, 2, 50, 40));
    home.run(&[&args[..], &["--force", "--rotate", "0", "--crop", "96x64+0+0"]].concat()).done();
    assert!(open(home.path("x.png")) == open(home.path("in.png")), "flags come first");
}
