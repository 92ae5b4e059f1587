//! The bundled stereo recording: calibration, pictures and true disparity are consistent.

use std::fs;
use std::path::PathBuf;

use bokehcam::frame::{ColorImage, GrayImage};

const SIZE: (u32, u32) = (640, 360);
const FRAMES: usize = 12;
const UNITS_PER_PX: f32 = 256.0;
/// `focal_px * baseline_m`.
const DISPARITY_AT_1_M_PX: f32 = 38.4;

fn bundled(path: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../recordings")).join(path)
}

fn color(path: &str) -> ColorImage {
    let image = image::open(bundled(path)).expect("bundled picture").into_rgb8();
    ColorImage { width: image.width(), height: image.height(), rgb: image.into_raw() }
}

fn luma(path: &str) -> GrayImage {
    let mut gray = GrayImage::default();
    gray.set_luma_from(&color(path));
    gray
}

fn gray16(path: &str) -> Vec<u16> {
    let image = image::open(bundled(path)).expect("bundled picture");
    assert_eq!(image.color(), image::ColorType::L16, "{path}");
    let image = image.into_luma16();
    assert_eq!(image.dimensions(), SIZE, "{path}");
    image.into_raw()
}

fn disparity_px(frame: usize) -> Vec<f32> {
    gray16(&format!("stereo/disp/{frame:06}.png")).iter().map(|&units| f32::from(units) / UNITS_PER_PX).collect()
}

/// Returns which pixels of a row the right camera sees, too: those that land in its picture, and no nearer surface
/// lands within a pixel of them.
fn visible(row: &[f32]) -> Vec<bool> {
    let width = row.len();
    let mut nearest = vec![0.0f32; width];
    for (x, &d) in row.iter().enumerate() {
        let lands = x as f32 - d;
        for column in [lands.floor(), lands.ceil()] {
            if column >= 0.0 {
                nearest[column as usize] = nearest[column as usize].max(d);
            }
        }
    }
    let seen = |(x, &d): (usize, &f32)| {
        let lands = x as f32 - d;
        lands >= 0.0 && nearest[lands.floor() as usize].max(nearest[lands.ceil() as usize]) < d + 1.0
    };
    row.iter().enumerate().map(seen).collect()
}

/// Returns the mean difference, in codes, of the left picture and the right one warped by the disparity plus `off_px`,
/// and the fraction of the pixels that counted: those that both cameras see, on surfaces.
fn warped_difference(frame: usize, off_px: f32) -> (f64, f64) {
    let (left, right) =
        (luma(&format!("stereo/image_2/{frame:06}.png")), luma(&format!("stereo/image_3/{frame:06}.png")));
    let disparity = disparity_px(frame);
    let width = SIZE.0 as usize;
    let (mut sum, mut count) = (0.0, 0);
    for (y, row) in disparity.chunks_exact(width).enumerate() {
        let seen = visible(row);
        for x in 1..width - 1 {
            let is_surface = (row[x - 1] - row[x + 1]).abs() < 0.5;
            let lands = x as f32 - row[x] - off_px;
            if !seen[x] || !is_surface || lands < 0.0 || lands > (width - 2) as f32 {
                continue;
            }
            let (column, share) = (lands as usize, lands.fract());
            let at = |column: usize| f32::from(right.luma[y * width + column]);
            let carried = at(column) * (1.0 - share) + at(column + 1) * share;
            sum += f64::from((carried - f32::from(left.luma[y * width + x])).abs());
            count += 1;
        }
    }
    (sum / f64::from(count), f64::from(count) / f64::from(SIZE.0 * SIZE.1))
}

#[test]
fn every_frame_has_both_eyes_a_disparity_and_a_time() {
    for (folder, name) in [("left", "image_2"), ("right", "image_3"), ("truth", "disp")] {
        let mut names: Vec<_> = fs::read_dir(bundled(&format!("stereo/{name}")))
            .expect("folder of the recording")
            .map(|entry| entry.expect("readable folder").file_name().into_string().expect("plain name"))
            .collect();
        names.sort();
        assert_eq!(names, (0..FRAMES).map(|frame| format!("{frame:06}.png")).collect::<Vec<_>>(), "{folder}");
    }
    for frame in 0..FRAMES {
        assert_eq!(color(&format!("stereo/image_2/{frame:06}.png")).size(), SIZE);
        assert_eq!(color(&format!("stereo/image_3/{frame:06}.png")).size(), SIZE);
    }
    let times = fs::read_to_string(bundled("stereo/times.txt")).expect("times.txt");
    let times: Vec<f64> = times.lines().map(|line| line.parse().expect("seconds")).collect();
    assert_eq!(times.len(), FRAMES);
    for (frame, time_s) in times.iter().enumerate() {
        assert!((time_s - frame as f64 / 12.0).abs() < 1e-6, "frame {frame} is at {time_s} s");
    }
}

#[test]
fn the_calibration_is_that_of_the_renderer() {
    let text = fs::read_to_string(bundled("stereo/calib.txt")).expect("calib.txt");
    let matrix = |key: &str| -> Vec<f32> {
        let line = text.lines().find_map(|line| line.strip_prefix(key)).expect("both projections");
        line.split_whitespace().map(|number| number.parse().expect("a number")).collect()
    };
    let view = bokehcam_lab::scene::View::new(SIZE.0, SIZE.1);
    let (f, centre) = (view.focal_px, view.principal_point_px());
    let projection = |eye_px: f32| vec![f, 0.0, centre.x, eye_px, 0.0, f, centre.y, 0.0, 0.0, 0.0, 1.0, 0.0];
    assert_eq!(matrix("P2:"), projection(0.0));
    assert_eq!(matrix("P3:"), projection(-DISPARITY_AT_1_M_PX));
}

#[test]
fn the_left_eye_is_the_portrait_and_its_depth_gives_the_disparity() {
    for frame in [0, 5, 8] {
        assert_eq!(color(&format!("stereo/image_2/{frame:06}.png")), color(&format!("portrait/rgb/{frame:06}.png")));
        let depth = gray16(&format!("portrait/depth/{frame:06}.png"));
        for (d, units) in disparity_px(frame).into_iter().zip(depth) {
            // Half a unit of either, and the effect of the depth's half unit on the disparity.
            let z_m = f32::from(units) / 5000.0;
            let expected_px = DISPARITY_AT_1_M_PX / z_m;
            let rounding_px = 0.5 / UNITS_PER_PX + 1e-4 * expected_px / z_m;
            assert!((d - expected_px).abs() <= rounding_px * 1.1, "{d} px at {z_m} m, expected {expected_px}");
        }
    }
}

#[test]
fn the_right_eye_carried_over_by_the_disparity_is_the_left_one() {
    for frame in [0, 11] {
        let (difference, share) = warped_difference(frame, 0.0);
        assert!(difference < 2.5, "frame {frame}: {difference} codes");
        assert!(share > 0.7, "frame {frame}: {share} of the pixels counted");
        for off_px in [-0.5, 0.5] {
            let (off, _) = warped_difference(frame, off_px);
            assert!(
                off > 1.2 * difference,
                "frame {frame}: {off} codes when off by {off_px} px, {difference} when not"
            );
        }
    }
}
