//! HEIC pictures, which `heif-convert` reads where it is installed.
#![allow(missing_docs)]

use std::fs;
use std::path::Path;
use std::time::Duration;

use bokehcam::frame::ColorImage;
use bokehcam_media::recording::still::{read_color, write_color};
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
