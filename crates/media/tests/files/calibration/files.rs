//! Files of all formats give the same rig, and every fault is reported in one line.

use std::fs;
use std::path::{Path, PathBuf};

use bokehcam::calibration::{Distortion, LengthUnit, StereoCalibration};
use bokehcam_calibration::euroc;
use glam::{DVec2, DVec3};
use tempfile::TempDir;

const INTRINSICS: &str = "%YAML:1.0
---
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.1805160946433762e+02, 0., 3.1388127793166115e+02, 0.,
       5.1805160946433762e+02, 2.4938851985251131e+02, 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -5.5e-02, 7.8e-02, 1.e-03, 2.e-03, -.14 ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 518., 0., 327.5, 0., 518., 261.5, 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.08, 0.2, 0., 0., -0.2 ]
";

const EXTRINSICS: &str = "%YAML:1.0
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 0.8, -0.6, 0., 0.6, 0.8 ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -91.2, 2., -3. ]
";

const SENSOR: &str = "%YAML:1.0
# General sensor definitions.
sensor_type: camera
comment: VI-Sensor cam0 (MT9M034)
T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, -0.02,
         1.0,  0.0, 0.0, SHIFT,
         0.0,  0.0, 1.0, 0.01,
         0.0,  0.0, 0.0, 1.0]
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 0.00002]
";

const CAMCHAIN: &str = "cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [0.0034, 0.0007, -0.002, 0.0002]
  distortion_model: equidistant
  intrinsics: [190.9, 190.9, 254.9, 256.8]
  resolution: [512, 512]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.1009]
  - [0.0, 1.0, 0.0, 0.0019]
  - [0.0, 0.0, 1.0, 0.0012]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [0.1, 0.01, 0.001, 0.002]
  distortion_model: radtan
  intrinsics: [190.4, 190.4, 252.5, 254.9]
  resolution: [512, 512]
  rostopic: /cam1/image_raw
";

/// Creates a folder with files of these names and contents.
fn folder(files: &[(&str, &str)]) -> (TempDir, Vec<PathBuf>) {
    let dir = TempDir::new().unwrap();
    let paths: Vec<_> = files.iter().map(|(name, _)| dir.path().join(name)).collect();
    for (path, (_, text)) in paths.iter().zip(files) {
        fs::write(path, text).unwrap();
    }
    (dir, paths)
}

pub fn load(files: &[(&str, &str)]) -> Result<StereoCalibration, String> {
    load_for(files, None)
}

/// Loads the calibration in these files for pictures of `size`.
pub fn load_for(files: &[(&str, &str)], size: Option<(u32, u32)>) -> Result<StereoCalibration, String> {
    load_some(files, files.len(), size)
}

/// Loads the calibration in the first file, beside the others.
pub fn load_first(files: &[(&str, &str)]) -> Result<StereoCalibration, String> {
    load_some(files, 1, None)
}

fn load_some(files: &[(&str, &str)], count: usize, size: Option<(u32, u32)>) -> Result<StereoCalibration, String> {
    let (dir, paths) = folder(files);
    let paths: Vec<&Path> = paths.iter().take(count).map(PathBuf::as_path).collect();
    let folder = format!("{}/", dir.path().display());
    bokehcam_calibration::load_calibration_for(&paths, size).map_err(|error| error.to_string().replace(&folder, ""))
}

fn sensor(shift: &str) -> String {
    SENSOR.replace("SHIFT", shift)
}

#[test]
fn opencv_in_one_file_or_two() {
    let whole = format!("{INTRINSICS}{}", EXTRINSICS.replace("%YAML:1.0\n", ""));
    let one = load(&[("stereo.yml", &whole)]).unwrap();
    assert_eq!(one, load(&[("a.yml", INTRINSICS), ("b.yml", EXTRINSICS)]).unwrap());
    assert_eq!(one, load(&[("b.yml", EXTRINSICS), ("a.yml", INTRINSICS)]).unwrap());
    let (_dir, paths) = folder(&[("my_intrinsics.yml", INTRINSICS), ("my_extrinsics.yml", EXTRINSICS)]);
    for path in &paths {
        assert_eq!(one, bokehcam_calibration::load_calibration(&[path]).unwrap(), "the other one lies beside it");
    }

    assert!(
        one.unit == LengthUnit::AssumedMillimetres
            && one.cameras[0].size.is_none()
            && one.stored_rectification.is_none()
    );
    assert!((one.translation_m - DVec3::new(-0.0912, 0.002, -0.003)).length() < 1e-12);
    assert!((one.rotation * DVec3::Y - DVec3::new(0.0, 0.8, 0.6)).length() < 1e-12, "row by row");
    assert_eq!(one.cameras[1].center_px, DVec2::new(327.5, 261.5));
    let lens = Distortion::RadialTangential([-0.055, 0.078, 0.001, 0.002, -0.14, 0.0, 0.0, 0.0]);
    assert_eq!(one.cameras[0].distortion, lens);
    // OpenCV writes 8, 12 or 14 coefficients, depending on the model.
    let rational = whole.replace("rows: 5\n   cols: 1", "rows: 14\n   cols: 1");
    let rational = rational.replace("-0.2 ]", "-0.2, 0., 0., -.1, 0., 0., 0., 0., 0., 0. ]");
    let lens = Distortion::RadialTangential([-0.08, 0.2, 0.0, 0.0, -0.2, 0.0, 0.0, -0.1]);
    assert_eq!(load(&[("stereo.yml", &rational)]).unwrap().cameras[1].distortion, lens);
    let notes = one.describe_assumptions((640, 512));
    assert!(notes[0].contains("millimetres") && notes[0].contains("91.3 mm"), "{notes:?}");
}

#[test]
fn opencv_by_other_names_and_with_a_size() {
    let whole = format!("{INTRINSICS}{}image_size: [ 640, 512 ]\n", EXTRINSICS.replace("%YAML:1.0\n", ""));
    let expected = load(&[("stereo.yml", &whole)]).unwrap();
    assert_eq!(expected.cameras[0].size, Some((640, 512)));
    let renamed = whole
        .replace("M1:", "camera_matrix_left:")
        .replace("M2:", "camera_matrix_right:")
        .replace("D1:", "dist_coeffs_left:")
        .replace("D2:", "distCoeffs2:")
        .replace("image_size: [ 640, 512 ]", "image_width: 640\nimage_height: 512");
    assert_eq!(load(&[("stereo.yml", &renamed)]).unwrap(), expected);
    let fisheye = whole
        .replace("rows: 1\n   cols: 5", "rows: 1\n   cols: 4")
        .replace("rows: 5\n   cols: 1", "rows: 4\n   cols: 1")
        .replace(", -.14", "")
        .replace(", -0.2 ]", " ]")
        + "distortion_model: fisheye\n";
    let fisheye = load(&[("stereo.yml", &fisheye)]).unwrap();
    assert_eq!(fisheye.cameras[1].distortion, Distortion::Equidistant([-0.08, 0.2, 0.0, 0.0]));
}

#[test]
fn euroc_and_kalibr() {
    let (_dir, paths) = folder(&[("cam0.yaml", &sensor("-0.06")), ("cam1.yaml", &sensor("0.05"))]);
    let rig = euroc::read_sensors(&paths[0], &paths[1]).unwrap();
    assert_eq!(rig, bokehcam_calibration::load_calibration(&[&paths[0], &paths[1]]).unwrap());
    assert_eq!(rig.cameras[0].size, Some((752, 480)));
    assert!(!rig.is_swapped() && rig.unit == LengthUnit::Stated);
    // 11 cm along the body's y, which is the cameras' x.
    assert!((rig.translation_m - DVec3::new(-0.11, 0.0, 0.0)).length() < 1e-12, "{}", rig.translation_m);

    let chain = load(&[("camchain.yaml", CAMCHAIN)]).unwrap();
    assert_eq!(chain.translation_m, DVec3::new(-0.1009, 0.0019, 0.0012));
    assert_eq!(chain.cameras[0].distortion, Distortion::Equidistant([0.0034, 0.0007, -0.002, 0.0002]));
    let lens = Distortion::RadialTangential([0.1, 0.01, 0.001, 0.002, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(chain.cameras[1].distortion, lens);
}

#[test]
fn what_is_wrong_is_told_in_one_line_with_its_place() {
    let whole = format!("{INTRINSICS}{}", EXTRINSICS.replace("%YAML:1.0\n", ""));
    let (left, right) = (sensor("-0.06"), sensor("0.05"));
    let broken = |from: &str, to: &str| {
        assert!(whole.contains(from), "{from}");
        vec![("s.yml", whole.replacen(from, to, 1))]
    };
    let chain = |from: &str, to: &str| {
        assert!(CAMCHAIN.contains(from), "{from}");
        vec![("s.yml", CAMCHAIN.replacen(from, to, 1))]
    };
    let euroc = |from: &str, to: &str| {
        assert!(left.contains(from), "{from}");
        vec![("s.yml", left.replacen(from, to, 1)), ("r.yml", right.clone())]
    };
    let cases = [
        (vec![("s.yml", INTRINSICS.to_owned())], "s.yml: R is missing; name the file with R and T"),
        (vec![("s.yml", EXTRINSICS.to_owned())], "s.yml: M1 is missing; name the file with M1"),
        (broken("D2:", "D3:"), "s.yml: D2 is missing"),
        (broken("T:", "TT:"), "s.yml: T is missing"),
        (broken("rows: 3\n", "rows: 2\n"), "s.yml:3: M1 says 2x3, but has 9 numbers"),
        (broken("   rows: 3\n", ""), "s.yml:3: rows is missing"),
        (broken("rows: 3\n   cols: 1", "rows: 1\n   cols: 2").replace_all("-91.2, ", ""), "T is 1x2, and must be 3x1"),
        (broken("5.1805160946433762e+02", ".Nan"), "s.yml:7: M1 has \".Nan\" instead of a finite number"),
        (broken("5.1805160946433762e+02", "wide"), "s.yml:7: M1 has \"wide\""),
        (broken("5.1805160946433762e+02", "1e999"), "s.yml:7: M1 has \"1e999\""),
        (broken("5.1805160946433762e+02", "-5"), "M1 has a focal length"),
        (broken("3.1388127793166115e+02", "1e9"), "M1 has a principal point"),
        (broken("02, 0., 3.13", "02, 4., 3.13"), "M1 is not of the form"),
        (broken("0.8, -0.6", "0.8, 0.6"), "R is not a rotation"),
        (broken("[ 1., 0., 0., 0., 0.8", "[ -1., 0., 0., 0., 0.8"), "R is not a rotation"),
        (broken("-91.2, 2., -3.", "0., 0., 0."), "T puts both cameras in the same place"),
        (broken("rows: 5\n   cols: 1", "rows: 3\n   cols: 1").replace_all("-0.08, 0.2, ", ""), "4, 5, 8, 12 or 14"),
        (broken("M1: !!", "distortion_model: omni\nM1: !!"), "s.yml:3: distortion_model \"omni\" is not supported"),
        (broken("M1: !!", "image_size: [0, 5]\nM1: !!"), "s.yml:3: image_size is not a picture size"),
        (broken("M1: !!", "image_width: 0\nimage_height: 5\nM1: !!"), "s.yml:3: image_width is not a picture size"),
        (broken("M1: !!", "image_width: 64.5\nimage_height: 5\nM1: !!"), "s.yml:3: image_width must be a whole number"),
        (broken("[ 518.", "[ 518. : :"), "s.yml:"),
        (vec![("s.yml", "fx: 3\n".into())], "s.yml: not a stereo calibration"),
        (vec![("s.yml", String::new())], "s.yml: not a stereo calibration"),
        (vec![("s.yml", "[".repeat(40))], "s.yml:1: not readable as YAML: nested"),
        (vec![("s.yml", left.clone())], "s.yml: this is the sensor.yaml of one camera"),
        (euroc("intrinsics: [458.654, ", "intrinsics: ["), "s.yml:15: intrinsics is 3x1, and must be 4 numbers"),
        (euroc("intrinsics:", "numbers:"), "s.yml: intrinsics is missing"),
        (euroc("model: pinhole", "model: omni"), "s.yml:14: camera_model \"omni\" is not supported"),
        (euroc("radial-tangential", "fov"), "s.yml:16: distortion_model \"fov\" is not supported"),
        (euroc("-0.06", "0.05"), "r.yml:6: T_BS puts both cameras in the same place"),
        (chain("  T_cn_cnm1:", "  T_cam_imu:"), "s.yml:10: T_cn_cnm1 is missing"),
        (chain("cam1:", "cam2:"), "s.yml: cam1 is missing"),
        (chain("model: pinhole", "model: ds"), "s.yml:3: camera_model \"ds\" is not supported"),
        (chain("0.002, 0.0002]", "0.002]"), "s.yml:4: distortion_coeffs is 3x1"),
        (chain("  - [0.0, 0.0, 0.0, 1.0]\n", ""), "T_cn_cnm1 is 3x4, and must be 4x4"),
        (chain("[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.0, 1.0]"), "T_cn_cnm1 must be a matrix with rows of one length"),
    ];
    for (files, what) in cases {
        let files: Vec<_> = files.iter().map(|(name, text)| (*name, text.as_str())).collect();
        let refusal = load(&files).expect_err(what);
        assert!(refusal.contains(what) && !refusal.contains('\n'), "{refusal}, not {what}");
    }
    let refusal = bokehcam_calibration::load_calibration(&[Path::new("nowhere.yml")]).unwrap_err().to_string();
    assert!(refusal.contains("nowhere.yml: "), "{refusal}");
    assert!(bokehcam_calibration::load_calibration(&[]).unwrap_err().to_string().contains("one or two files"));
}

#[test]
fn half_a_file_is_refused_in_one_line_too() {
    let whole = format!("{INTRINSICS}{}", EXTRINSICS.replace("%YAML:1.0\n", ""));
    for text in [whole.as_str(), CAMCHAIN, &sensor("0.1")] {
        for end in (0..text.len()).step_by(3) {
            // A truncated file either still suffices, or is refused in one line.
            match load(&[("s.yml", &text[..end])]) {
                Ok(_) => assert!(end * 10 > text.len() * 7, "{}", &text[..end]),
                Err(refusal) => assert!(refusal.contains("s.yml") && !refusal.contains('\n'), "{refusal}"),
            }
        }
    }
}

/// Replaces a second part of an already changed file.
trait ReplaceAll {
    fn replace_all(self, from: &str, to: &str) -> Self;
}

impl ReplaceAll for Vec<(&'static str, String)> {
    fn replace_all(self, from: &str, to: &str) -> Self {
        self.into_iter().map(|(name, text)| (name, text.replace(from, to))).collect()
    }
}

#[test]
fn a_rectification_in_the_file_is_taken_and_checked() {
    let camera = "{rows: 3, cols: 3, data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}";
    let unit = "{rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}";
    let base = format!("M1: {camera}\nM2: {camera}\nD1: [0, 0, 0, 0]\nD2: [0, 0, 0, 0]\nR1: {unit}\nR2: {unit}\n");
    let projection = |key: &str, [f, cx, cy, across, down]: [f64; 5]| {
        format!("{key}: {{rows: 3, cols: 4, data: [{f}, 0, {cx}, {across}, 0, {f}, {cy}, {down}, 0, 0, 1, 0]}}\n")
    };
    let pair = |right: [f64; 5]| {
        format!("{base}{}{}", projection("P1", [450.0, 310.0, 240.0, 0.0, 0.0]), projection("P2", right))
    };
    let good = pair([450.0, 330.0, 240.0, -27.0, 0.0]);
    let rig = load(&[("s.yml", &good)]).unwrap();
    let given = rig.stored_rectification.unwrap().rig();
    assert!((given.focal_px, given.doffs_px, given.metric) == (450.0, 20.0, true));
    assert!((given.baseline_m - 0.06).abs() < 1e-7);
    assert!((rig.translation_m - DVec3::new(-0.06, 0.0, 0.0)).length() < 1e-12);
    let half = rig.scale_to((320, 240)).map(|_| ()).unwrap_err().to_string();
    assert!(half.contains("image_size"), "{half}");
    let sized = load(&[("s.yml", &format!("{good}image_size: [640, 480]\n"))]).unwrap();
    let half = sized.scale_to((320, 240)).unwrap().stored_rectification.unwrap().rig();
    assert_eq!((half.focal_px, half.doffs_px), (225.0, 10.0));

    let place = format!("R: {unit}\nT: [-0.06, 0.01, 0]\n");
    for (text, what) in [
        (pair([450.0, 330.0, 240.0, 0.0, -27.0]), "above each other"),
        (pair([450.0, 330.0, 240.0, 0.0, 0.0]), "P2 puts both cameras in the same place"),
        (pair([440.0, 330.0, 240.0, -27.0, 0.0]), "P2 is not the partner of P1 in a rectified pair"),
        (pair([450.0, 330.0, 250.0, -27.0, 0.0]), "P2 is not the partner of P1 in a rectified pair"),
        (format!("{good}{place}"), "R2 does not match R and T"),
        (base, "P1 is missing"),
    ] {
        let refusal = load(&[("s.yml", &text)]).unwrap_err();
        assert!(refusal.contains(what) && !refusal.contains('\n'), "{refusal}");
    }
}
