//! HEIC pictures, which `heif-convert` reads where it is installed.
#![allow(missing_docs)]

use bokehcam::frame::ColorImage;
use bokehcam::recording::still::{read_color, write_color};

use crate::program::{Home, Ran};

/// A home with a HEIC file, which no decoder reads, and a picture in its place.
fn home() -> Home {
    let home = Home::new();
    std::fs::write(home.path("in.heic"), b"\0\0\0\x18ftypheic\0\0\0\0").unwrap();
    write_color(&home.path("shot.png"), &ColorImage::new(40, 30), false).unwrap();
    home
}

fn render(home: &Home, path: &str) -> Ran {
    let arguments = ["render", "in.heic", "--effect", "blur", "--coc-at-infinity", "3", "--out", "out.png"];
    Ran::of(home.command(&[&arguments[..], &["--backend", "cpu"]].concat()).env("PATH", path))
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
