//! The same rig in every format, and what is lacking in a file of none.

use bokehcam::calibration::{Distortion, LengthUnit, StereoCalibration};
use bokehcam_calibration::formats::FORMATS;
use glam::{DVec2, DVec3};

use super::files::{load, load_first, load_for};
use super::writers::{LENSES, PINHOLES, TRANSLATION_M, all, flat, kalibr_imu, oak, opencv_yaml, ros, rotation, zed};

fn load_texts(texts: &[String]) -> Result<StereoCalibration, String> {
    let named: Vec<(&str, &str)> = ["one", "two"].into_iter().zip(texts.iter().map(String::as_str)).collect();
    load_for(&named, Some((1280, 720)))
}

#[test]
fn every_format_gives_the_same_rig() {
    for (name, texts) in all() {
        let rig = load_texts(&texts).unwrap_or_else(|error| panic!("{name}: {error}"));
        for (side, camera) in rig.cameras.iter().enumerate() {
            let [fx, fy, cx, cy] = PINHOLES[side];
            assert!((camera.focal_px - DVec2::new(fx, fy)).length() < 1e-9, "{name}: {}", camera.focal_px);
            assert!((camera.center_px - DVec2::new(cx, cy)).length() < 1e-9, "{name}: {}", camera.center_px);
            let [k1, k2, p1, p2] = LENSES[side];
            assert_eq!(camera.distortion, Distortion::RadialTangential([k1, k2, p1, p2, 0.0, 0.0, 0.0, 0.0]), "{name}");
            let expected = match name {
                _ if name.starts_with("YAML") => None,
                _ if name.starts_with("ZED") => Some((1280, 720)),
                _ => Some((752, 480)),
            };
            assert_eq!(camera.size, expected, "{name}");
        }
        let turn = (rig.rotation - rotation()).to_cols_array().iter().fold(0.0_f64, |most, part| most.max(part.abs()));
        assert!(turn < 1e-7, "{name}: the rotation is off by {turn}");
        let off_m = (rig.translation_m - DVec3::from_array(TRANSLATION_M)).length();
        assert!(off_m < 1e-7, "{name}: the translation is off by {off_m} m");
        assert_eq!(rig.describe_doubt(), None, "{name}");
        let stored = rig.stored_rectification.map(|stored| stored.rig());
        assert_eq!(stored.is_some(), name.starts_with("ROS"), "{name}");
        assert!(stored.is_none_or(|stored| (stored.baseline_m - 0.110_077_8).abs() < 1e-6), "{name}: {stored:?}");
    }
}

#[test]
fn half_a_file_or_a_corrupted_one_is_one_line() {
    for (name, texts) in all() {
        for at in (0..texts[0].len()).step_by(50).filter(|&at| texts[0].is_char_boundary(at)) {
            let mut cut = texts.clone();
            cut[0].truncate(at);
            let cut = load_texts(&cut);
            // A cut at the end may only shorten the last number or a part that is not needed.
            assert!(cut.is_err() || at * 10 > texts[0].len() * 7, "{name} ends at {at}");
            for noise in ["\0", "]", "<", ":", "1e999", "-", "[", "\n"] {
                let mut corrupted = texts.clone();
                corrupted[0].insert_str(at, noise);
                for read in [&cut, &load_texts(&corrupted)] {
                    let said = read.as_ref().err().map_or("", String::as_str);
                    assert!(!said.contains(['\n', '\r']) && said.len() < 1000, "{name}, {noise:?} at {at}: {said}");
                }
            }
        }
    }
}

#[test]
fn a_size_is_chosen_by_the_pictures() {
    let conf = zed();
    for (size, expected) in [
        (Some((1280, 720)), (1280, 720)),
        (Some((2208, 1242)), (2208, 1242)),
        (Some((640, 360)), (1280, 720)),
        (Some((1920, 1080)), (2208, 1242)),
        (None, (2208, 1242)),
    ] {
        let rig = load_for(&[("SN1.conf", &conf)], size).unwrap();
        assert_eq!(rig.cameras[1].size, Some(expected), "{size:?}");
        assert!((rig.cameras[0].focal_px.x / f64::from(expected.0) - PINHOLES[0][0] / 1280.0).abs() < 1e-9);
    }
    let refusal = load_for(&[("SN1.conf", &conf)], Some((640, 480))).unwrap().scale_to((640, 480)).unwrap_err();
    assert!(refusal.to_string().contains("1280x720"), "{refusal}");
}

#[test]
fn lenses_with_prism_and_tilt_are_read_and_fisheyes_too() {
    let prism = "0.01, 0, 0, 0, 0.0005, -0.0001, 0.0002, 0, 0.001, -0.002";
    let rig = load(&[("oak.json", &oak(false).replace("0, 0, 0, 0, 0, 0, 0, 0, 0, 0", prism))]).unwrap();
    let [k1, k2, p1, p2] = LENSES[1];
    let all = [k1, k2, p1, p2, 0.01, 0.0, 0.0, 0.0, 0.0005, -0.0001, 0.0002, 0.0, 0.001, -0.002];
    assert_eq!(rig.cameras[1].distortion, Distortion::PrismTilted(all));
    // The values of OpenCV's projectPoints.
    for (point, expected) in [
        ([0.3, -0.2], [0.28949785901102604, -0.19294617428887287]),
        ([-0.5, 0.4], [-0.44801452380546897, 0.35858803917503057]),
        ([0.0, 0.6], [0.00015432315957559858, 0.5450546410444087]),
    ] {
        let found = rig.cameras[1].distortion.distort(DVec2::from_array(point));
        assert!((found - DVec2::from_array(expected)).length() < 1e-12, "{point:?}: {found}");
    }
    let fisheye = load(&[("oak.json", &oak(true).replace("\"cameraType\": 0", "\"cameraType\": 1"))]).unwrap();
    assert_eq!(fisheye.cameras.map(|camera| camera.distortion), LENSES.map(Distortion::Equidistant));
    let wide =
        load(&[("oak.json", &oak(false).replace("0, 0, 0, 0, 0, 0, 0, 0, 0, 0", "0, 0, 0, 0, 0, 0, 0, 0, 0, 1"))]);
    assert!(wide.unwrap_err().contains("distortionCoeff has a sensor that is tilted"));
    let ros_fisheye = ros().map(|text| {
        text.replace("plumb_bob", "equidistant").replace("cols: 5", "cols: 4").replace(", 0]\nrect", "]\nrect")
    });
    let rig = load(&[("left.yaml", &ros_fisheye[0]), ("right.yaml", &ros_fisheye[1])]).unwrap();
    assert_eq!(rig.cameras[0].distortion, Distortion::Equidistant(LENSES[0]));
}

#[test]
fn an_assumed_unit_is_doubted_by_its_size() {
    let squares_m = 0.108;
    for (unit_m, unit, is_doubted) in [
        (1.0, LengthUnit::AssumedMetres, false),
        (1e-3, LengthUnit::AssumedMillimetres, false),
        (0.1, LengthUnit::AssumedMetres, true),
        (squares_m, LengthUnit::AssumedMetres, true),
        (0.01, LengthUnit::AssumedMillimetres, true),
        (0.03, LengthUnit::AssumedMillimetres, true),
        (100.0, LengthUnit::AssumedMetres, true),
    ] {
        let rig = load(&[("s.yml", &opencv_yaml("%YAML:1.0", ": ", unit_m))]).unwrap();
        assert_eq!((rig.unit, rig.describe_doubt().is_some()), (unit, is_doubted), "{unit_m}");
        assert!(rig.describe_doubt().is_none_or(|doubt| doubt.contains("--baseline-m") && !doubt.contains('\n')));
        let stated = rig.with_baseline_m(0.12);
        assert!((stated.baseline_m() - 0.12).abs() < 1e-12 && stated.describe_doubt().is_none());
        assert!(stated.translation_m.normalize().distance(rig.translation_m.normalize()) < 1e-12);
    }
    let [left, right] = ros();
    let rig = load(&[("a.yaml", &left), ("b.yaml", &right)]).unwrap().with_baseline_m(0.05);
    assert!((rig.stored_rectification.unwrap().baseline_m - 0.05).abs() < 1e-12);
}

#[test]
fn what_is_lacking_is_said_with_all_formats() {
    let [left, right] = ros();
    let yaml = flat();
    for (text, what) in [
        (yaml.replace("M1", "A").replace("M2", "B").replace("R:", "C:"), "it has D1 D2 T of OpenCV, and lacks M1 M2 R"),
        (left.replace("projection_matrix", "camera"), "of ROS, and lacks projection_matrix"),
        ("[STEREO]\nBaseline=3\n".into(), "it has STEREO of ZED, and lacks LEFT_CAM_HD RIGHT_CAM_HD"),
        ("hello\n".into(), "s.txt: not a stereo calibration that is read; the formats"),
    ] {
        let refusal = load(&[("s.txt", &text)]).unwrap_err();
        assert!(refusal.contains(what) && !refusal.contains('\n'), "{refusal}, not {what}");
        assert!(FORMATS.iter().all(|format| refusal.contains(format.name)), "{refusal}");
    }
    for (files, what) in [
        (vec![("a.yaml", left.as_str())], "a.yaml: this is the camera_info of one camera"),
        (vec![("a.yaml", &left), ("b.yaml", &left)], "projection_matrix puts both cameras in the same place"),
        (vec![("a.yaml", &left), ("b.yaml", "x: 1\n")], "b.yaml: projection_matrix is missing"),
        (
            vec![("a.xml", "\u{feff}\n<opencv_storage>")],
            "a.xml: XML is not read; \"Convert a calibration\" in docs/recordings.md",
        ),
        (vec![("a.yaml", "%YAML:1.0\nCamera1.fx: 3\n")], "a.yaml: ORB-SLAM's format is not read"),
        (vec![("a.conf", "[STEREO]\nx=1\nhello\n")], "a.conf:3: not readable as INI"),
        (vec![("a.json", "{\"cameraData\": []}")], "camera 1 of cameraData is missing"),
        (vec![("a.yaml", &kalibr_imu().replace("pinhole", "ds"))], "calibrate again with pinhole-radtan"),
    ] {
        let refusal = load(&files).unwrap_err();
        assert!(refusal.contains(what) && !refusal.contains('\n'), "{refusal}, not {what}");
    }
    assert!(include_str!("../../../../../docs/recordings.md").contains("\n### Convert a calibration\n"));
    // The other file lies beside it.
    assert!(load_first(&[("my_left.yaml", &left), ("my_right.yaml", &right)]).is_ok());
}

#[test]
fn endless_files_end() {
    for text in ["[".repeat(300_000), format!("{{\"a\": {}", "[".repeat(500))] {
        let refusal = load(&[("s.yaml", &text)]).unwrap_err();
        assert!(refusal.starts_with("s.yaml:1: not readable as YAML") && !refusal.contains('\n'), "{refusal}");
    }
    // The cameras lead to each other in a circle, without the right one.
    let circle = oak(true).replace("\"toCameraSocket\": 2", "\"toCameraSocket\": 1");
    assert!(load(&[("s.json", &circle)]).unwrap_err().contains("no pose between"));
}

#[test]
fn the_documentation_names_every_format() {
    let docs = include_str!("../../../../../docs/recordings.md");
    for format in &FORMATS {
        let row = docs.lines().find(|line| line.starts_with(&format!("| {} |", format.name)));
        let row = row.unwrap_or_else(|| panic!("{} has no row", format.name));
        assert!(row.contains(&format!("| {} |", format.files)), "{row}");
        assert!(format.keys[0].iter().all(|key| row.contains(key)), "{row}");
    }
}
