//! Targets for stereo calibrations, and for calibrations of a depth camera next to a colour camera.

use bokehcam::calibration::CameraIntrinsics;
use bokehcam::calibration::rectifier::Rectifier;
use bokehcam::calibration::registration::{Registration, RgbdCalibration};
use bokehcam::frame::{ColorImage, DepthMap, GrayImage};
use bokehcam_cli::parsers;

use super::input::{assert_one_line, file_path, split_files, write_file};

/// Reads calibrations of all formats from one or two files, and rectifies pictures with them.
pub fn calibration(data: &[u8]) {
    let (one, two) = ("intrinsics.yml", "other.yml");
    let read = match split_files(data).as_slice() {
        [only] => bokehcam_calibration::load_calibration(&[&write_file(one, only)]),
        [left, right, ..] => bokehcam_calibration::load_calibration(&[&write_file(one, left), &write_file(two, right)]),
        [] => return,
    };
    let rig = match read {
        Ok(rig) => rig,
        Err(error) => return assert_one_line(error),
    };
    assert!(!file_path("extrinsics.yml").exists());
    let _ = (rig.is_swapped(), rig.with_swapped_cameras());
    rig.describe_doubt().into_iter().for_each(assert_one_line);
    assert!((rig.with_baseline_m(0.1).baseline_m() - 0.1).abs() < 1e-9, "{rig:?}");
    let own = rig.cameras[0].size.unwrap_or((32, 24));
    for size in [(32, 24), (2, 2), (16, 16), (own.0.min(64), own.1.min(64))] {
        let _ = rig.describe_assumptions(size);
        match Rectifier::new(&rig, size) {
            Ok(rectifier) => check_rectifier(&rectifier, size),
            Err(error) => assert_one_line(error),
        }
    }
}

fn check_rectifier(rectifier: &Rectifier, (width, height): (u32, u32)) {
    let rig = rectifier.rig();
    assert!(rig.focal_px.is_finite() && rig.focal_px > 0.0, "{rig:?}");
    assert!(rig.baseline_m.is_finite() && rig.baseline_m > 0.0, "{rig:?}");
    assert!(rig.doffs_px.is_finite(), "{rig:?}");
    for disparity_px in [0.0, 1.0, 100.0, -5.0] {
        assert!(!rig.depth_m(disparity_px).is_nan(), "{rig:?}");
    }
    let (mut color, mut rectified) = (ColorImage::new(width, height), ColorImage::default());
    color.rgb.iter_mut().enumerate().for_each(|(at, byte)| *byte = at as u8);
    rectifier.rectify_left(&color, &mut rectified);
    assert_eq!(rectified.rgb.len(), color.rgb.len());
    let (mut grey, mut rectified) = (GrayImage::default(), GrayImage::default());
    grey.resize(width, height);
    rectifier.rectify_right(&grey, &mut rectified);
    assert_eq!(rectified.luma.len(), grey.luma.len());
}

/// Reads a TOML file, and registers depth by it.
pub fn depth_calibration(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let calibration = match parsers::depth_calibration("calibration.toml".as_ref(), text) {
        Ok(calibration) => calibration,
        Err(error) => return assert_one_line(error),
    };
    // Large colour pictures take long, and teach nothing.
    let color =
        CameraIntrinsics { size: calibration.color.size.map(|(x, y)| (x.min(64), y.min(64))), ..calibration.color };
    let calibration = RgbdCalibration { color, ..calibration };
    const ODD: [f32; 8] = [0.0, 0.5, 2.0, 1e30, f32::NAN, f32::INFINITY, -1.0, 1e-30];
    let (mut scratch, mut registered) = (DepthMap::default(), DepthMap::default());
    for (width, height) in [(4, 2), (1, 1), (16, 9)] {
        let mut depth = DepthMap::new(width, height);
        depth.metres.iter_mut().zip(ODD.iter().cycle()).for_each(|(to, from)| *to = *from);
        let registration = Registration::new(calibration, depth.size()).expect("a calibration that was checked");
        registration.register(&depth, &mut scratch, &mut registered);
        assert!(registered.metres.iter().all(|metres| metres.is_finite() && *metres >= 0.0));
    }
}
