//! Calibrations and pictures of real rigs, where available.

use std::path::PathBuf;

use bokehcam::calibration::rectification::Rectification;
use bokehcam::calibration::{LengthUnit, StereoCalibration};
use bokehcam_calibration::euroc;
use glam::{DMat3, DVec2};

fn data() -> PathBuf {
    PathBuf::from(std::env::var_os("BOKEHCAM_DATA").expect("BOKEHCAM_DATA names the folder of the data"))
}

/// Returns the angle in degrees between two rotations.
fn apart_deg(a: DMat3, b: DMat3) -> f64 {
    glam::DQuat::from_mat3(&(a * b.transpose())).to_scaled_axis().length().to_degrees()
}

#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with calib/intrinsics.yml"]
fn opencvs_own_rectification_is_ours() {
    let file = data().join("calib/extrinsics.yml");
    let rig = bokehcam_calibration::load_calibration(&[&file]).unwrap();
    assert!(rig.is_swapped() && rig.unit == LengthUnit::AssumedMillimetres);
    assert!((rig.baseline_m() - 0.09205).abs() < 1e-4, "{}", rig.baseline_m());
    let rig = rig.with_swapped_cameras();
    let given = Rectification::from_calibration(&rig, (640, 512)).unwrap();
    let ours =
        Rectification::from_calibration(&StereoCalibration { stored_rectification: None, ..rig }, (640, 512)).unwrap();
    for (ours, theirs) in ours.rotations.into_iter().zip(given.rotations) {
        assert!(apart_deg(ours, theirs) < 1e-5, "{} degrees", apart_deg(ours, theirs));
    }
    assert!((ours.baseline_m - given.baseline_m).abs() < 1e-6);
    // The file's window includes black corners, so it covers more.
    assert!((1.0..1.5).contains(&(ours.focal_px.x / given.focal_px.x)), "{} {}", ours.focal_px, given.focal_px);
}

#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with stereo_seq/MicroEurocDataset"]
fn euroc_is_rectified_as_its_readme_says() {
    let sensor = |eye| data().join(format!("stereo_seq/MicroEurocDataset/mav0/{eye}/sensor.yaml"));
    let rig = euroc::read_sensors(&sensor("cam0"), &sensor("cam1")).unwrap();
    assert_eq!(rig.cameras[0].size, Some((752, 480)));
    let rectified = Rectification::from_calibration(&rig, (752, 480)).unwrap();
    assert!((rectified.baseline_m - 0.110).abs() < 5e-4, "{}", rectified.baseline_m);
    assert!((400.0..480.0).contains(&rectified.focal_px.x), "{}", rectified.focal_px);
    assert!((rectified.centers_px[0] - DVec2::new(375.5, 239.5)).length() < 25.0, "{}", rectified.centers_px[0]);
}
