//! Depth maps of photos.

use std::fs;
use std::io::Cursor;

use bokehcam_media::recording::still;

use crate::program::{Home, Ran};

fn render(home: &Home, more: &[&str]) -> Ran {
    home.run(&[&["render", "photo.png", "--out", "out.png", "--force", "--backend", "cpu"], more].concat())
}

#[test]
fn depth_of_another_aspect_is_asked_about_unless_it_is_that_of_a_network_or_a_sensor() {
    let home = Home::new().with_photo();
    for (name, (width, height)) in [("tall.png", (48, 64)), ("wide.pfm", (64, 36))] {
        home.add_depth(name, (width, height));
        let said = format!("{name}: the depth map is {width}x{height}, which does not cover a colour picture of 64x48");
        render(&home, &["--depth-map", name]).refused(1, &[&said, "--depth-fit stretch", "--depth-fit crop"]);
        for fit in ["stretch", "crop"] {
            render(&home, &["--depth-map", name, "--depth-fit", fit]).done();
        }
    }
    for (name, size, note) in [
        ("half.png", (32, 24), ""),
        ("square.png", (48, 48), "48x48 pixels, stretched to the picture's 64x48"),
        ("sensor.pfm", (50, 37), "50x37 pixels, stretched"),
        ("large.png", (256, 192), ""),
    ] {
        home.add_depth(name, size);
        let ran = render(&home, &["--depth-map", name]);
        assert_eq!(ran.warning(), "", "{name}");
        assert_eq!(ran.stderr.contains("stretched"), !note.is_empty(), "{name}: {}", ran.stderr);
        assert!(ran.stderr.contains(note), "{name}: {}", ran.stderr);
    }
}

#[test]
fn a_stream_and_a_picture_of_a_photo_with_a_relative_map_look_alike() {
    let home = Home::new().with_photo();
    fs::copy(home.path("photo.png"), home.path("ph.png")).unwrap();
    // As telephones write it: 8 bits, of which few are used.
    image::GrayImage::from_fn(64, 48, |x, _| [100 + (60 - x.min(60)) as u8].into())
        .save(home.path("ph-depth.png"))
        .unwrap();
    let relative = ["--depth-unit", "inverse", "--backend", "cpu", "--force"];
    let picture = |path: &str| still::read_color(&home.path(path)).unwrap();
    let ran = home.run(&[&["render", "ph.png", "--out", "r.png"], &relative[..]].concat());
    assert!(ran.done().contains("taken as near; --depth-invert"), "{}", ran.stderr);
    let ran = home.run(&[&["stream", "ph.png", "--to", "s/"], &relative[..]].concat());
    assert!(ran.done().contains("taken as near; --depth-invert"), "{}", ran.stderr);
    home.run(&[&["render", "ph.png", "--depth-map", "ph-depth.png", "--out", "m.png"], &relative[..]].concat()).done();
    assert!(picture("r.png") == picture("s/000000.png") && picture("r.png") == picture("m.png"));
}

/// Inserts EXIF orientation 6 (rotate 90° clockwise) after the header of a PNG.
fn turn(path: &std::path::Path) {
    const ORIENTATION_6: &[u8] =
        b"eXIfMM\x00\x2a\x00\x00\x00\x08\x00\x01\x01\x12\x00\x03\x00\x00\x00\x01\x00\x06\x00\x00\x00\x00\x00\x00";
    let mut file = fs::read(path).unwrap();
    let crc = ORIENTATION_6.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 })
    });
    let mut chunk = (ORIENTATION_6.len() as u32 - 4).to_be_bytes().to_vec();
    chunk.extend_from_slice(ORIENTATION_6);
    chunk.extend_from_slice(&(!crc).to_be_bytes());
    let header_end = 8 + 25;
    file.splice(header_end..header_end, chunk);
    fs::write(path, file).unwrap();
}

#[test]
fn a_picture_that_was_held_upright_needs_depth_that_was() {
    let home = Home::new().with_photo();
    turn(&home.path("photo.png"));
    assert_eq!(still::read_color(&home.path("photo.png")).unwrap().size(), (48, 64));
    render(&home, &["--depth-map", "depth.png"]).refused(1, &["64x48", "48x64"]);
    turn(&home.path("depth.png"));
    let turned = still::read_depth(&home.path("depth.png"), 5000.0, None).unwrap();
    assert_eq!(turned.size(), (48, 64));
    // The left side is at the top after the rotation.
    assert!(turned.metres[0] < 0.6 && turned.metres[63 * 48] > 4.0);
    assert_eq!(render(&home, &["--depth-map", "depth.png"]).warning(), "");
}

#[test]
fn a_focus_that_nothing_is_near_is_told_with_the_distances_that_there_are() {
    let home = Home::new().with_photo();
    let warned = |more: &[&str]| {
        let ran = render(&home, &[&["--depth-map", "depth.png"], more].concat());
        let of_focus = ran.done().lines().filter(|line| line.starts_with("warning: --focus"));
        of_focus.collect::<String>()
    };
    assert_eq!(warned(&["--focus", "1.5"]), "");
    let far = warned(&["--focus", "1.5", "--depth-scale", "100", "--coc-at-infinity", "4"]);
    assert!(far.contains("--focus 1.5: the depth lies from 2") && far.contains("beyond that"), "{far}");
    assert!(far.contains("is --depth-scale right for this depth?"), "{far}");
    let near = warned(&["--focus", "100"]);
    assert!(near.contains("all of it before that"), "{near}");
    assert_eq!(warned(&["--focus", "auto", "--depth-scale", "100"]), "");
}

#[test]
fn a_recording_in_other_units_is_told_as_well() {
    let home = Home::new().with_recording();
    let stream = |scale: &str| {
        let args =
            ["stream", "recording", "--to", "null", "--backend", "cpu", "--coc-at-infinity", "4", "--focus", "1.2"];
        home.run(&[&args[..], &["--depth-scale", scale]].concat()).warning().to_owned()
    };
    assert_eq!(stream("5000"), "");
    assert!(stream("50").contains("beyond that, so nothing is sharp; is --depth-scale right for this depth?"));
}

#[test]
fn a_photo_has_the_depth_beside_it_in_every_command() {
    let home = Home::new().with_photo();
    let picture = |path: &str| still::read_color(&home.path(path)).unwrap();
    for (name, map) in [("ph-depth.png", "depth.png"), ("ph.depth.pfm", "depth.pfm")] {
        fs::copy(home.path("photo.png"), home.path("ph.png")).unwrap();
        fs::copy(home.path(map), home.path(name)).unwrap();
        for more in [&[][..], &["--refine", "off"], &["--refine", "on", "--focus", "0.6"], &["--effect", "blur"]] {
            let render = ["render", "ph.png", "--out", "r.png", "--force", "--backend", "cpu"];
            let ran = home.run(&[&render[..], more].concat());
            assert_eq!(ran.warning(), "", "{name} {more:?}");
            assert_eq!(
                ran.stderr.contains(&format!("depth by {name}, beside it")),
                more != ["--effect", "blur"],
                "{}",
                ran.stderr
            );
            let stream = ["stream", "ph.png", "--to", "s/", "--force", "--backend", "cpu"];
            home.run(&[&stream[..], more].concat()).done();
            assert!(picture("r.png") == picture("s/000000.png"), "{name} {more:?}");
        }
        // Explicit options take precedence over a depth map found beside the photo.
        let said = render_of(&home, &["--mask", "photo.png"]);
        assert!(!said.stderr.contains("beside it"), "{}", said.stderr);
        assert!(render_of(&home, &["--depth", "none"]).stderr.contains("written"));
        let why = if name.ends_with("png") { "which is the input" } else { "no format is known" };
        render_of(&home, &["--out", name]).refused(2, &[why]);
        fs::remove_file(home.path(name)).unwrap();
    }
    // A snapshot's name refers to its sources.
    fs::rename(home.path("ph.png"), home.path("shot-color.png")).unwrap();
    fs::copy(home.path("depth.pfm"), home.path("shot-depth.pfm")).unwrap();
    still::write_color(&home.path("shot.png"), &bokehcam::frame::ColorImage::new(64, 48), false).unwrap();
    home.run(&["render", "shot.png", "--out", "r.png", "--force", "--backend", "cpu"]).done();
    home.run(&["stream", "shot.png", "--to", "s/", "--force", "--backend", "cpu"]).done();
    assert!(picture("r.png") == picture("s/000000.png"));
}

fn render_of(home: &Home, more: &[&str]) -> Ran {
    let out: &[&str] = if more.contains(&"--out") { &[] } else { &["--out", "r.png"] };
    home.run(&[&["render", "ph.png", "--force", "--backend", "cpu"], out, more].concat())
}

#[test]
fn the_folder_of_the_result_is_made() {
    let home = Home::new().with_photo();
    home.run(&["render", "photo.png", "--effect", "none", "--out", "a/b/out.png"]).done();
    assert!(home.path("a/b/out.png").is_file());
}

#[test]
fn a_photo_with_the_picture_of_another_camera_says_what_to_do() {
    let home = Home::new();
    let jpeg = |shade: u8| {
        let mut bytes = Cursor::new(Vec::new());
        image::GrayImage::from_pixel(16, 16, [shade].into()).write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
        bytes.into_inner()
    };
    // An index (CIPA DC-007) in a segment of 66 bytes: the photo, and a picture whose kind is "disparity".
    let (left, right) = (jpeg(90), jpeg(200));
    let photo_bytes = left.len() as u32 + 66;
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    let directory = [&b"II*\0\x08\0\0\0\x01\0\x02\xB0\x07\0"[..], &words(&[32, 26, 0])].concat();
    let entries = words(&[0x3_0000, photo_bytes, 0, 0, 0x2_0002, right.len() as u32, photo_bytes - 10, 0]);
    let file = [&left[..2], b"\xFF\xE2\0\x40MPF\0", &directory, &entries, &left[2..], &right].concat();
    fs::write(home.path("two.mpo.jpg"), file).unwrap();
    let ran = home.run(&["depth", "two.mpo.jpg", "--out", "map.png"]);
    ran.refused(2, &["two.mpo.jpg: there is no depth inside, but a picture of another camera", "left and right"]);
    home.run(&["render", "two.mpo.jpg", "--effect", "none", "--out", "left.png"]).done();
}

#[test]
fn a_photo_of_a_phone_is_blurred_by_the_depth_inside_it() {
    let home = Home::new();
    let picture = |path: &str| still::read_color(&home.path(path)).unwrap();
    for (file, kind) in [("gdepth", "GDepth"), ("dynamic", "Dynamic Depth"), ("apple", "Apple")] {
        let photo = format!("{file}.jpg");
        let seeds = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fuzz/seeds/embedded_depth");
        fs::copy(std::path::Path::new(seeds).join(&photo), home.path(&photo)).unwrap();
        let ran = home.run(&["render", &photo, "--out", "r.png", "--force", "--backend", "cpu"]);
        assert!(ran.done().contains(&format!("depth by {photo} itself ({kind})")), "{}", ran.stderr);
        let original = "the original before the phone's own blur is inside, and is used";
        assert_eq!(ran.stderr.contains(original), file != "apple", "{}", ran.stderr);
        assert_eq!(ran.stderr.contains("the focus is that of the photo"), file == "gdepth", "{}", ran.stderr);
        let ran = home.run(&["stream", &photo, "--to", "s/", "--force", "--backend", "cpu"]);
        assert!(ran.done().contains("with its own depth"), "{}", ran.stderr);
        assert!(picture("r.png") == picture("s/000000.png"), "{file}");
        for map in ["map.pfm", "map.png"] {
            let ran = home.run(&["depth", &photo, "--out", map, "--force"]);
            assert!(ran.done().contains(kind), "{}", ran.stderr);
            home.run(&["render", &photo, "--depth-map", map, "--out", "m.png", "--force", "--backend", "cpu"]).done();
        }
        home.run(&["depth", &photo, "--out", &photo, "--force"]).refused(2, &["--out FILE ends with .pfm or .png"]);
        // Depth whose end is cut off is said, and the photo is still one.
        let whole = fs::read(home.path(&photo)).unwrap();
        fs::write(home.path("cut.jpg"), &whole[..whole.len() - 200]).unwrap();
        let ran = home.run(&["render", "cut.jpg", "--out", "c.png", "--force", "--backend", "cpu"]);
        let said = format!("the depth inside ({kind}) cannot be read");
        assert_eq!(ran.stderr.contains(&said), file != "gdepth", "{}", ran.stderr);
    }
    let home = home.with_photo();
    home.run(&["depth", "photo.png", "--out", "no.pfm"]).refused(2, &["photo.png: there is no depth inside"]);
    home.run(&["depth", "photo.png", "--metres", "--out", "no.pfm"]).refused(2, &["two pictures"]);
}
