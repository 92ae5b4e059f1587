//! HEIC pictures, which `heif-convert` reads where it is installed.
#![allow(missing_docs)]

use std::fs;
use std::path::Path;
use std::time::Duration;

use bokehcam::frame::ColorImage;
use bokehcam_media::recording::still::{read_color, write_color, write_photo};
use bokehcam_media::recording::{Photo, PhotoMetadata};
use rustix::process::Signal;

use crate::program::{Beside, Home, Ran, until};

/// Timeout against hangs.
const HANG: Duration = Duration::from_secs(60);

const ARGUMENTS: [&str; 9] =
    ["render", "in.heic", "--effect", "blur", "--coc-at-infinity", "3", "--out", "out.png", "--quiet"];

/// A home with a HEIC file, which no decoder reads, and a picture in its place.
fn home() -> Home {
    let home = Home::new();
    std::fs::write(home.path("in.heic"), b"\0\0\0\x18ftypheic\0\0\0\0").unwrap();
    write_color(&home.path("shot.png"), &ColorImage::new(40, 30), false).unwrap();
    home
}

fn render(home: &Home, path: &str) -> Ran {
    Ran::of(home.command(&[&ARGUMENTS[..], &["--backend", "cpu"]].concat()).env("PATH", path))
}

#[test]
fn a_heic_picture_is_converted_by_the_installed_program() {
    let home = home();
    let path = home.add_program("heif-convert", "cp shot.png \"$3\"");
    render(&home, &path).done();
    assert_eq!(read_color(&home.path("out.png")).unwrap().size(), (40, 30));
}

/// Adds a converter that writes `shot.png`, of 40 by 30 pixels, and depth inside; returns its `PATH`.
fn add_converter_with_depth(home: &Home) -> String {
    image::GrayImage::from_fn(40, 30, |x, _| [(6 * x) as u8].into()).save(home.path("depth.png")).unwrap();
    home.add_program("heif-convert", "cp shot.png \"$3\"; cp depth.png \"$(dirname \"$3\")/picture-depth.png\"")
}

#[test]
fn a_heic_picture_is_upright_whatever_its_exif_says() {
    let home = home();
    // EXIF with the camera's name, and the orientation of a phone held upright.
    let entries = b"\x01\x10\0\x02\0\0\0\x04CAM\0\x01\x12\0\x03\0\0\0\x01\0\x06\0\0";
    let exif = [&b"MM\0\x2a\0\0\0\x08\0\x02"[..], entries, &[0; 4]].concat();
    let metadata = PhotoMetadata { exif: Some(exif), ..PhotoMetadata::default() };
    write_photo(&home.path("shot.png"), &ColorImage::new(40, 30), &metadata, true).unwrap();
    let path = add_converter_with_depth(&home);
    for out in ["out.png", "out.jpg"] {
        let arguments = ["render", "in.heic", "--blur", "3", "--backend", "cpu", "--out", out];
        let ran = Ran::of(home.command(&arguments).env("PATH", &path));
        assert!(ran.done().contains("depth by in.heic itself (HEIC)"), "{}", ran.stderr);
        let Photo { color, metadata, .. } = Photo::read(&home.path(out)).unwrap();
        assert_eq!(color.size(), (40, 30), "{out}");
        assert!(metadata.exif.unwrap().windows(3).any(|part| part == b"CAM"), "{out}");
    }
}

#[test]
fn a_heic_picture_with_depth_inside_is_itself_and_shown_in_srgb() {
    let home = home();
    let mut picture = ColorImage::new(40, 30);
    picture.rgb.as_chunks_mut::<3>().0.fill([200, 60, 40]);
    let icc_profile = Some(moxcms::ColorProfile::new_display_p3().encode().unwrap());
    let metadata = PhotoMetadata { icc_profile, ..PhotoMetadata::default() };
    write_photo(&home.path("shot.png"), &picture, &metadata, true).unwrap();
    let shown = read_color(&home.path("shot.png")).unwrap();
    assert_ne!(shown, picture);
    let path = add_converter_with_depth(&home);
    let arguments = ["stream", "in.heic", "--effect", "none", "--to", "s/"];
    let ran = Ran::of(home.command(&arguments).env("PATH", &path));
    assert!(!ran.done().contains("the phone's own blur"), "{}", ran.stderr);
    assert!(read_color(&home.path("s/000000.png")).unwrap() == shown);
}

#[test]
fn of_several_pictures_the_primary_one_is_converted() {
    let home = home();
    write_color(&home.path("other.png"), &ColorImage::new(20, 10), false).unwrap();
    let script = "to=$(dirname \"$3\"); cp other.png $to/picture-1.png; cp shot.png $to/picture-2.png";
    home.add_program("heif-convert", script);
    for (listed, size, is_said) in [
        (
            "echo 'image: 20x10 (id=1)'; echo '  depth channel: no'; echo 'image: 40x30 (id=2), primary'",
            (40, 30),
            false,
        ),
        ("echo 'image: 20x10 (id=1), primary'; echo 'image: 40x30 (id=2)'", (20, 10), false),
        ("exit 1", (20, 10), true),
    ] {
        let path = home.add_program("heif-info", listed);
        let arguments = ["render", "in.heic", "--effect", "none", "--out", "out.png", "--force"];
        let ran = Ran::of(home.command(&arguments).env("PATH", &path));
        assert_eq!(ran.warning().contains("in.heic: it holds several pictures"), is_said, "{listed}: {}", ran.stderr);
        assert_eq!(read_color(&home.path("out.png")).unwrap().size(), size, "{listed}");
    }
}

#[test]
fn without_the_program_its_package_is_named() {
    let home = home();
    let said = ["in.heic: it is a HEIC picture", "heif-convert (package libheif-examples)", "IN.heic OUT.png"];
    render(&home, home.path("none").to_str().unwrap()).failed(1, &said);
    let path = home.add_program("heif-convert", "echo Input file is broken >&2; exit 1");
    render(&home, &path).failed(1, &["heif-convert: Input file is broken"]);
    assert!(!home.path("out.png").exists());
}

/// A converter that never ends, and starts another process; both note their numbers.
const HANGS: &str = "echo $$ > first; touch \"$3\"; sleep 600 & echo $! > second; wait";

/// Waits until both processes of [`HANGS`] are gone, and the picture with its folder.
fn until_nothing_is_left(home: &Home) {
    for name in ["first", "second"] {
        let number = fs::read_to_string(home.path(name)).unwrap();
        let line = format!("/proc/{}/cmdline", number.trim());
        until("the process is gone", HANG, || fs::read(&line).map_or(true, |line| line.is_empty()));
    }
    until("the folder is gone", HANG, || is_empty(&home.path("tmp")));
}

fn is_empty(folder: &Path) -> bool {
    fs::read_dir(folder).unwrap().next().is_none()
}

#[test]
fn a_converter_ends_with_the_program_and_leaves_no_picture() {
    for signal in [Signal::INT, Signal::TERM, Signal::KILL] {
        let home = home();
        fs::create_dir(home.path("tmp")).unwrap();
        let path = home.add_program("heif-convert", HANGS);
        let mut run = Beside::start(home.command(&ARGUMENTS).env("PATH", path).env("TMPDIR", home.path("tmp")));
        until("the converter runs", HANG, || {
            fs::read_to_string(home.path("second")).is_ok_and(|text| text.ends_with('\n'))
        });
        assert!(run.runs() && !is_empty(&home.path("tmp")));
        run.signal(signal);
        until_nothing_is_left(&home);
        assert!(!home.path("out.png").exists());
    }
}

#[test]
fn a_converter_that_hangs_is_killed_with_its_processes() {
    let home = home();
    fs::create_dir(home.path("tmp")).unwrap();
    let path = home.add_program("heif-convert", HANGS);
    let ran = Ran::of(home.command(&ARGUMENTS).env("PATH", path).env("TMPDIR", home.path("tmp")));
    ran.failed(1, &["in.heic: damaged (heif-convert hung, and was killed)"]);
    until_nothing_is_left(&home);
}
