//! Screenshots for the documentation; `scripts/screenshots` writes them into the repository.

use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use bokehcam::frame::ColorImage;
use image::codecs::jpeg::JpegEncoder;

use super::picture::{distance, is_photograph};
use super::preview::Program;
use super::program::{Home, PORTRAIT};
use super::screen::Screen;

/// Returns the output folder: `BOKEHCAM_SCREENSHOTS`, or else the folder for test pictures.
fn folder() -> PathBuf {
    std::env::var_os("BOKEHCAM_SCREENSHOTS").map_or_else(|| env!("CARGO_TARGET_TMPDIR").into(), PathBuf::from)
}

fn save(image: &ColorImage, path: &Path) {
    let file = std::fs::File::create(path).unwrap();
    let mut encoder = JpegEncoder::new_with_quality(file, 88);
    encoder.encode(&image.rgb, image.width, image.height, image::ExtendedColorType::Rgb8).unwrap();
}

#[test]
#[ignore = "needs an X server"]
fn pictures_for_the_docs() {
    let look = ["--highlights", "12", "--coc-at-infinity", "3%", "--save-to", "."];
    // File name and arguments of each screenshot.
    let scenes: [(&str, &[&str]); 3] = [
        ("panel", &[]),
        ("split", &["--split", "0.52", "--panel=false"]),
        ("depth", &["--show", "depth", "--panel=false"]),
    ];
    std::fs::create_dir_all(folder()).unwrap();
    let mut seen: Vec<ColorImage> = Vec::new();
    for (name, more) in scenes {
        let screen = Screen::new();
        let home = Home::new();
        // The window shows the relative name instead of the project's path.
        symlink(Path::new(PORTRAIT).parent().unwrap(), home.path("recordings")).unwrap();
        let arguments: Vec<&str> = ["recordings/portrait"].iter().chain(&look).chain(more).copied().collect();
        let mut program = Program::start_at(&screen, home, &arguments);
        let window = program.window();
        window.until("the first picture", |image| name == "depth" || is_photograph(image));
        // Wait until notes are gone; the panel stays visible while the pointer is on it.
        for step in 0..12 {
            if name == "panel" {
                window.point((0.80 + 0.002 * f64::from(step), 0.04));
            }
            thread::sleep(Duration::from_millis(500));
        }
        let image = window.until("a picture", |_| true);
        assert!(seen.iter().all(|other| distance(other, &image) > 2.0), "{name} shows what another picture shows");
        save(&image, &folder().join(format!("{name}.jpg")));
        seen.push(image);
        program.close();
    }
}
