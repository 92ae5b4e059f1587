//! A point in space lies in one row of both rectified pictures, and its disparity gives its depth.

use bokehcam::calibration::StereoCalibration;
use bokehcam::calibration::rectification::Rectification;
use bokehcam::calibration::rectifier::Rectifier;
use glam::{DMat3, DVec2, DVec3};

use super::{FISHEYE, NONE, RADTAN, SIZE, rig, rigs};

/// Returns where the raw pictures of both cameras show `point`, given in the left camera's axes.
fn raw_px(calibration: &StereoCalibration, point: DVec3) -> Option<[DVec2; 2]> {
    let seen = [point, calibration.rotation * point + calibration.translation_m];
    let [left, right] = [0, 1].map(|side| {
        let eye = &calibration.cameras[side];
        eye.project(seen[side], eye.distortion.max_radius())
    });
    Some([left?, right?])
}

/// Returns the pixel of a rectified picture that is sampled from `raw_px`, through the stored map.
fn mapped_px(rectifier: &Rectifier, side: usize, raw_px: DVec2) -> Option<DVec2> {
    let map = &rectifier.maps()[side];
    let source = |x: u32, y: u32| map.source_px(x, y);
    // Newton's method on the map, which is nearly linear between pixels.
    let mut guess = rectifier.rectification().centers_px[side];
    for _ in 0..40 {
        let corner = guess.floor();
        let (x, y) = (corner.x as u32, corner.y as u32);
        if corner.min_element() < 0.0 || x + 1 >= SIZE.0 || y + 1 >= SIZE.1 {
            return None;
        }
        let four = [source(x, y)?, source(x + 1, y)?, source(x, y + 1)?, source(x + 1, y + 1)?];
        let part = guess - corner;
        let upper = four[0].lerp(four[1], part.x);
        let lower = four[2].lerp(four[3], part.x);
        let slopes = glam::DMat2::from_cols(four[1] - four[0], four[2] - four[0]);
        guess += slopes.inverse() * (raw_px - upper.lerp(lower, part.y));
    }
    Some(guess)
}

/// Returns points before the cameras, near and far.
fn points() -> impl Iterator<Item = DVec3> {
    (0..2000).map(|k: u32| {
        let part = |prime: f64| (f64::from(k) * prime).fract() * 2.0 - 1.0;
        let depth_m = 0.5 + 9.5 * (f64::from(k) * 0.324_717_957).fract();
        DVec3::new(part(0.754_877_666) * 0.7, part(0.569_840_291) * 0.5, 1.0) * depth_m
    })
}

#[test]
fn a_point_lies_in_one_row_and_its_disparity_tells_its_depth() {
    for calibration in rigs() {
        let rectifier = Rectifier::new(&calibration, SIZE).unwrap();
        let (rig, turn) = (rectifier.rig(), rectifier.rectification().rotations[0]);
        assert!(rig.metric && rig.doffs_px == 0.0);
        let (mut checked, mut rows_px) = (0, Vec::new());
        for point in points() {
            let Some(raw_px) = raw_px(&calibration, point) else { continue };
            let pair = [0, 1].map(|side| mapped_px(&rectifier, side, raw_px[side]));
            let [Some(left_px), Some(right_px)] = pair else { continue };
            let depth_m = (turn * point).z;
            let expected_px = f64::from(rig.disparity_px(depth_m as f32));
            let disparity_px = left_px.x - right_px.x;
            assert!((left_px.y - right_px.y).abs() < 0.01, "{left_px} and {right_px}");
            assert!((disparity_px - expected_px).abs() < 0.02, "{disparity_px} for {expected_px}");
            rows_px.push((left_px.y - right_px.y).abs());
            checked += 1;
        }
        assert!(checked > 300, "only {checked} points are seen by both");
        let mean_px = rows_px.iter().sum::<f64>() / rows_px.len() as f64;
        assert!(mean_px < 0.005, "{mean_px}");
    }
}

#[test]
fn without_the_steps_of_the_map_it_is_exact() {
    for calibration in rigs() {
        let rectification = Rectification::from_calibration(&calibration, SIZE).unwrap();
        let rig = rectification.rig();
        let mut checked = 0;
        for point in points() {
            let Some(raw_px) = raw_px(&calibration, point) else { continue };
            let [left_px, right_px] = [0, 1].map(|side| {
                let eye = &calibration.cameras[side];
                let ray = eye.unproject(raw_px[side], eye.distortion.max_radius()).extend(1.0);
                let turned = rectification.rotations[side] * ray;
                turned.truncate() / turned.z * rectification.focal_px + rectification.centers_px[side]
            });
            let depth_m = (rectification.rotations[0] * point).z;
            assert!((left_px.y - right_px.y).abs() < 1e-6, "{left_px} {right_px}");
            assert!((left_px.x - right_px.x - f64::from(rig.disparity_px(depth_m as f32))).abs() < 1e-3);
            checked += 1;
        }
        assert!(checked > 500);
    }
}

#[test]
fn no_corner_is_black_and_little_is_given_up() {
    for calibration in rigs() {
        let rectifier = Rectifier::new(&calibration, SIZE).unwrap();
        let mut gap_px = f64::INFINITY;
        for map in rectifier.maps() {
            for y in 0..SIZE.1 {
                for x in (0..SIZE.0).filter(|x| y == 0 || y == SIZE.1 - 1 || x % (SIZE.0 - 1) == 0) {
                    let from_px = map.source_px(x, y).expect("no pixel of the rim is black");
                    let last_px = DVec2::new(639.0, 479.0);
                    gap_px = gap_px.min(from_px.min(last_px - from_px).min_element());
                }
            }
        }
        let at_its_least = rectifier.rectification().focal_px.x <= 0.701 * calibration.cameras[0].focal_px.x;
        assert!(gap_px < 0.5 || at_its_least, "{gap_px} px of the pictures' rim are left over");
    }
}

#[test]
fn half_the_size_is_the_same_rays() {
    for calibration in rigs() {
        let half = calibration.scale_to((320, 240)).unwrap();
        for (whole, half) in calibration.cameras.iter().zip(&half.cameras) {
            for (x, y) in [(0.0, 0.0), (100.0, 37.0), (318.0, 238.0)] {
                // The centre of a pixel at half the resolution is that of four pixels at full resolution.
                let pixel_px = DVec2::new(x, y);
                let ray = half.unproject(pixel_px, half.distortion.max_radius());
                let expected = whole.unproject(pixel_px * 2.0 + 0.5, whole.distortion.max_radius());
                assert!((ray - expected).length() < 1e-9);
            }
        }
        assert_eq!((half.rotation, half.translation_m), (calibration.rotation, calibration.translation_m));
        let notes = calibration.describe_assumptions((320, 240));
        assert!(notes.len() == 1 && notes[0].contains("640x480") && notes[0].contains("320x240"), "{notes:?}");
        assert!(calibration.describe_assumptions(SIZE).is_empty());
    }
}

#[test]
fn a_rectified_pair_stays_as_it_is() {
    let mut calibration = rig(NONE, 500.0, [0.0; 3]);
    calibration.cameras[1] = calibration.cameras[0];
    calibration.cameras.iter_mut().for_each(|eye| eye.focal_px = DVec2::splat(500.0));
    calibration.translation_m = DVec3::new(-0.06, 0.0, 0.0);
    let rectification = Rectification::from_calibration(&calibration, SIZE).unwrap();
    assert_eq!(rectification.rotations, [DMat3::IDENTITY; 2]);
    assert!((rectification.focal_px - 500.0).length() < 1e-9);
    assert!((rectification.centers_px[0] - calibration.cameras[0].center_px).length() < 1e-9);
    assert!((rectification.baseline_m - 0.06).abs() < 1e-12);
}

#[test]
fn exchanged_eyes_are_seen_and_exchanged_back() {
    for calibration in rigs() {
        let exchanged = calibration.with_swapped_cameras();
        assert!(!calibration.is_swapped() && exchanged.is_swapped());
        let refusal = Rectifier::new(&exchanged, SIZE).unwrap_err().to_string();
        assert!(refusal.contains("left camera stands on the right") && !refusal.contains('\n'), "{refusal}");
        let again = exchanged.with_swapped_cameras();
        assert_eq!(again.cameras, calibration.cameras);
        assert!((again.translation_m - calibration.translation_m).length() < 1e-12);
    }
}

#[test]
fn rigs_that_cannot_be_matched_are_refused_in_one_line() {
    let good = rig(RADTAN, 460.0, [0.0; 3]);
    let moved = |translation_m| StereoCalibration { translation_m, ..good };
    let turned = |turn_deg| rig(NONE, 460.0, turn_deg);
    let nowhere = |calibration: StereoCalibration| {
        let mut calibration = calibration;
        calibration.cameras[0].size = None;
        calibration
    };
    for (calibration, size, what) in [
        (moved(DVec3::new(0.0, -0.1, 0.0)), SIZE, "above each other"),
        (moved(DVec3::new(-0.01, 0.0, -0.1)), SIZE, "behind each other"),
        (moved(DVec3::ZERO), SIZE, "same place"),
        (moved(DVec3::NAN), SIZE, "same place"),
        (turned([0.0, 60.0, 0.0]), SIZE, "too different"),
        (good, (640, 400), "640x480, but these are 640x400"),
        (good, (1, 1), "2 to 16384"),
        (nowhere(good), (1280, 960), "image_size"),
        (rig(FISHEYE, 0.0, [0.0; 3]), SIZE, "focal length"),
    ] {
        let refusal = Rectifier::new(&calibration, size).unwrap_err().to_string();
        assert!(refusal.contains(what) && !refusal.contains('\n'), "{refusal}");
    }
    let assumed = nowhere(good);
    assert!(Rectifier::new(&assumed, SIZE).is_ok());
    assert!(assumed.describe_assumptions(SIZE)[0].contains("no picture size"));
}
