//! Depth of another camera's view: registered by the recording's own calibration, or by one that is given.
//! `fuzz/seeds/recording_file/registered.mcap` was written by Python's mcap-ros2-support: a wall at 2 m, and before it a
//! box at 1 m in the columns 12 to 19 and rows 8 to 15 of the depth camera's 32x24 pixels; the colour camera has the same
//! lens, of 40 pixels, and is 10 cm to the right, so that the box is 4 pixels further left for it, and the wall 2. It
//! also has what drivers write: a transform whose rotation is not set, and an unknown lens model without distortion.

use bokehcam::calibration::registration::RgbdCalibration;
use bokehcam::calibration::{CameraIntrinsics, Distortion};
use bokehcam::frame::DepthMap;
use bokehcam_media::recording::{Options, Recording, RecordingError};
use glam::{DMat3, DVec2, DVec3};

use super::{Scene, assert_says, color_of, depth_of};

const FILE: &[u8] = include_bytes!("../../../../../fuzz/seeds/recording_file/registered.mcap");
const SIZE: (u32, u32) = (32, 24);

fn open(file: &[u8], options: &Options) -> Result<Recording, RecordingError> {
    let scene = Scene::new();
    scene.write("take.mcap", file);
    Recording::open(&scene.path("take.mcap"), options)
}

/// Returns what a row shows: the depth of each column in metres.
fn row(depth: &DepthMap, y: usize) -> &[f32] {
    &depth.metres[y * SIZE.0 as usize..][..SIZE.0 as usize]
}

fn calibration() -> RgbdCalibration {
    let camera = CameraIntrinsics {
        size: Some(SIZE),
        focal_px: DVec2::splat(40.0),
        center_px: DVec2::new(15.5, 11.5),
        distortion: Distortion::RadialTangential([0.0; 8]),
    };
    let (rotation, translation_m) = (DMat3::IDENTITY, DVec3::new(-0.1, 0.0, 0.0));
    RgbdCalibration { depth: camera, color: camera, rotation, translation_m }
}

/// Asserts that box and wall are where the colour camera sees them, and nothing is known that only it sees.
fn assert_registered(depth: &DepthMap) {
    assert_eq!(depth.size(), SIZE);
    for y in 0..SIZE.1 as usize {
        for (x, &metres) in row(depth, y).iter().enumerate() {
            let is_in_box_rows = (8..16).contains(&y);
            let expected = match x {
                30.. => 0.0,
                8..16 if is_in_box_rows => 1.0,
                16..18 if is_in_box_rows => 0.0,
                _ => 2.0,
            };
            assert!((metres - expected).abs() < 1e-4, "{metres} at {x}, {y}: {expected}");
        }
    }
}

#[test]
fn depth_is_registered_by_camera_info_and_static_transforms() {
    let recording = open(FILE, &Options::default()).unwrap();
    assert_eq!(recording.len(), 2);
    for frame in 0..2 {
        assert_eq!(color_of(&recording, frame).unwrap().rgb[0], 10 * frame as u8);
        assert_registered(&depth_of(&recording, frame).unwrap());
    }
}

#[test]
fn a_given_calibration_replaces_the_recordings_own() {
    let given = |calibration| Options { depth_calibration: Some(calibration), ..Options::default() };
    let identity = RgbdCalibration::identity(calibration().depth);
    let depth = depth_of(&open(FILE, &given(identity)).unwrap(), 0).unwrap();
    assert_eq!(row(&depth, 10)[11..21], [2.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0]);
    // Without its transforms, the file states only how the lenses are.
    let tf_static = FILE.windows(10).position(|bytes| bytes == b"/tf_static").unwrap();
    let mut without = FILE.to_vec();
    // The chunk of this file is not compressed, and its checksum is not that of the new bytes.
    without[tf_static + 1..][..9].copy_from_slice(b"tf_moving");
    let unregistered = depth_of(&open(&without, &Options::default()).unwrap(), 0).unwrap();
    assert_eq!(row(&unregistered, 10), row(&depth, 10), "taken as if both had the same view");
    assert_registered(&depth_of(&open(&without, &given(calibration())).unwrap(), 0).unwrap());
}

#[test]
fn a_calibration_at_another_size_is_scaled() {
    let camera = calibration().color;
    let (size, focal_px, center_px) = (Some((64, 48)), DVec2::splat(80.0), DVec2::new(31.5, 23.5));
    let large = CameraIntrinsics { size, focal_px, center_px, ..camera };
    for (depth, color) in [(camera, large), (large, camera), (large, large)] {
        let given = RgbdCalibration { depth, color, ..calibration() };
        let options = Options { depth_calibration: Some(given), ..Options::default() };
        assert_registered(&depth_of(&open(FILE, &options).unwrap(), 0).unwrap());
    }
}

#[test]
fn a_calibration_of_the_recording_itself_that_does_not_fit_is_left_out() {
    // The height in the first `camera_info` of either camera, before the model of its lens: 24 becomes 99.
    for model in [&b"plumb_bob"[..], b"inverse_brown_conrady"] {
        let info = FILE.windows(model.len()).position(|bytes| bytes == model).unwrap();
        let mut other = FILE.to_vec();
        let height = info - 12;
        assert_eq!(other[height..height + 4], 24_u32.to_le_bytes());
        other[height] = 99;
        let depth = depth_of(&open(&other, &Options::default()).unwrap(), 0).unwrap();
        assert_eq!(row(&depth, 10)[12], 1.0, "where the depth camera has it");
    }
}

#[test]
fn pictures_of_a_part_of_the_sensor_have_their_own_principal_point() {
    // Both cameras: 128x48 pixels, of which those from (32, 16) to (96, 40) are read, two beside each other as one.
    let mut file = FILE.to_vec();
    for model in [&b"plumb_bob"[..], b"inverse_brown_conrady"] {
        let info = FILE.windows(model.len()).position(|bytes| bytes == model).unwrap();
        file[info - 12..][..8].copy_from_slice([48_u32, 128].map(u32::to_le_bytes).as_flattened());
        let matrices = info + FILE[info..].windows(8).position(|bytes| *bytes == 40_f64.to_le_bytes()).unwrap();
        // In `k`, and in `p` after nine more numbers of `r`.
        for (at, number) in [(0, 80_f64), (2, 63.5), (5, 27.5), (18, 80.0), (20, 63.5), (24, 27.5)] {
            file[matrices + 8 * at..][..8].copy_from_slice(&number.to_le_bytes());
        }
        // Binning, and the part: its place, height and width.
        let part = [2_u32, 1, 32, 16, 24, 64].map(u32::to_le_bytes);
        file[matrices + 8 * 30..][..24].copy_from_slice(part.as_flattened());
    }
    assert_registered(&depth_of(&open(&file, &Options::default()).unwrap(), 0).unwrap());
}

#[test]
fn without_distances_there_is_nothing_to_register() {
    let scene = Scene::new();
    scene.color("rgb/1.png", (4, 3), 9);
    scene.write("rgb.txt", "0.1 rgb/1.png\n");
    let options = Options { depth_calibration: Some(calibration()), ..Options::default() };
    assert!(!scene.open_with(&options).unwrap().has_depth());
}

#[test]
fn calibrations_that_belong_to_other_pictures_are_refused() {
    let camera = calibration().depth;
    let sized = |size| CameraIntrinsics { size: Some(size), ..camera };
    let refused = |calibration: RgbdCalibration, parts: &[&str]| {
        let options = Options { depth_calibration: Some(calibration), ..Options::default() };
        let read = open(FILE, &options).and_then(|recording| depth_of(&recording, 0));
        assert_says(read, parts);
    };
    refused(RgbdCalibration { color: sized((32, 32)), ..calibration() }, &["depth camera: ", "32x32", "32x24"]);
    refused(RgbdCalibration { depth: sized((40, 40)), ..calibration() }, &["is 32x24", "calibrated for 40x40"]);
    refused(RgbdCalibration { rotation: DMat3::ZERO, ..calibration() }, &["depth camera: rotation"]);
}
