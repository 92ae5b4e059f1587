//! The command `render` on pictures as cameras and programs write them.
#![allow(missing_docs)]

use std::path::Path;
use std::process::{Command, Stdio};

use bokehcam::frame::ColorImage;
use bokehcam::recording::Extras;
use bokehcam::recording::still::{read_photo, write_photo};
use image::{ImageBuffer, Rgba};
use tempfile::TempDir;

/// Blurs `image` in `dir`; gives what was said.
fn render(dir: &Path, image: &str, out: &str) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bokehcam"));
    command.env_clear().env("XDG_CONFIG_HOME", dir).current_dir(dir).stdin(Stdio::null());
    command.args(["render", image, "--effect", "blur", "--coc-at-infinity", "3", "--backend", "cpu", "--out", out]);
    let output = command.output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    stderr
}

#[test]
fn what_goes_with_a_picture_stays_with_it() {
    let dir = TempDir::new().unwrap();
    let mut profile = vec![7; 200];
    profile[16..20].copy_from_slice(b"RGB ");
    // One entry, the name of the camera.
    let exif = b"MM\0\x2a\0\0\0\x08\0\x01\x01\x10\0\x02\0\0\0\x04CAM\0\0\0\0\0".to_vec();
    let extras = Extras { icc_profile: Some(profile), exif: Some(exif), ..Extras::default() };
    write_photo(&dir.path().join("in.jpg"), &ColorImage::new(40, 30), &extras, false).unwrap();
    for out in ["out.png", "out.jpg"] {
        let said = render(dir.path(), "in.jpg", out);
        assert_eq!(said.lines().count(), 1, "{said}");
        assert_eq!(read_photo(&dir.path().join(out)).unwrap().1, extras, "{out}");
    }
}

#[test]
fn what_does_not_fit_is_said_once() {
    let dir = TempDir::new().unwrap();
    ImageBuffer::<Rgba<u16>, _>::from_pixel(40, 30, [1, 2, 3, 4].into()).save(dir.path().join("in.png")).unwrap();
    let said = render(dir.path(), "in.png", "out.png");
    assert_eq!(said.lines().count(), 2, "{said}");
    assert!(said.starts_with("note: not in out.png: transparency, 16 bits a channel\n"), "{said}");
}
