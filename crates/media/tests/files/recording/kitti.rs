//! The layouts of KITTI, and common variants.

use std::fs;

use bokehcam_media::recording::{Options, RecordingError, StereoGeometry, Unpaired};

use super::{SIZE, Scene, assert_says, color_of, right_of, save_grey, times_ns};

const CALIBRATION: &str = "P0: 700 0 600 0 0 700 180 0 0 0 1 0\nP1: 700 0 600 -350 0 700 180 0 0 0 1 0\n\
                           P2: 700 0 610 42 0 700 180 0 0 0 1 0\nP3: 700 0 612 -343 0 700 180 0 0 0 1 0\n";

/// Creates `count` pairs in the folders `left` and `right`: colour of the shade of their number, right grey 100 more.
fn with_eyes(left: &str, right: &str, count: u8) -> Scene {
    let scene = Scene::new();
    add_eyes(&scene, left, right, count);
    scene
}

fn add_eyes(scene: &Scene, left: &str, right: &str, count: u8) {
    for eye in [left, right] {
        fs::create_dir_all(scene.path(eye)).unwrap();
    }
    for index in 0..count {
        scene.color(&format!("{left}/{index:06}.png"), SIZE, index);
        save_grey(&scene.path(&format!("{right}/{index:06}.png")), SIZE, 100 + index);
    }
}

fn odometry() -> Scene {
    let scene = with_eyes("image_2", "image_3", 3);
    scene.write("calib.txt", CALIBRATION);
    scene.write("times.txt", "0.000000e+00\n1.037359e-01\n2.074342e-01\n");
    scene
}

#[test]
fn a_sequence_has_two_rectified_eyes_and_its_times() {
    let scene = odometry();
    // Grey pictures are there, too, and colour takes precedence.
    add_eyes(&scene, "image_0", "image_1", 1);
    let recording = scene.open().unwrap();
    assert_eq!((recording.layout(), recording.len(), recording.has_depth()), ("KITTI", 3, false));
    assert_eq!(times_ns(&recording), [0, 103_735_900, 207_434_200]);
    let Some(StereoGeometry::Rectified(rig)) = recording.stereo_geometry() else {
        panic!("{:?}", recording.stereo_geometry())
    };
    assert_eq!((rig.focal_px, rig.baseline_m, rig.doffs_px, rig.metric), (700.0, 0.55, 2.0, true));
    assert_eq!((recording.disparity_count(), recording.unpaired()), (None, Unpaired::default()));
    for index in 0..3 {
        assert_eq!(color_of(&recording, index).unwrap().rgb[..3], [index as u8, 100, 200]);
        let right = right_of(&recording, index).unwrap();
        assert_eq!((right.size(), right.luma[0]), (SIZE, 100 + index as u8));
    }
}

#[test]
fn the_folders_that_people_have_are_known() {
    for (left, right, baseline_m) in [
        ("image_2", "image_3", 0.55),
        ("image_02/data", "image_03/data", 0.55),
        ("colored_0", "colored_1", 0.55),
        ("image_0", "image_1", 0.5),
        ("image_00/data", "image_01/data", 0.5),
    ] {
        let scene = with_eyes(left, right, 2);
        let recording = scene.open().unwrap();
        // Without a calibration: ten frames a second, of cameras in unknown positions.
        assert_eq!(times_ns(&recording), [0, 100_000_000]);
        assert_eq!(recording.stereo_geometry(), Some(&StereoGeometry::Uncalibrated));
        scene.write("calib_cam_to_cam.txt", CALIBRATION.replace('P', "P_rect_0"));
        let recording = scene.open().unwrap();
        let Some(StereoGeometry::Rectified(rig)) = recording.stereo_geometry() else {
            panic!("{:?}", recording.stereo_geometry())
        };
        assert_eq!(rig.baseline_m, baseline_m, "{left}");
    }
    let scene = with_eyes("image_l", "image_r", 2);
    let rows: String = CALIBRATION.lines().take(2).map(|line| format!("{}\n", &line[4..])).collect();
    scene.write("calib.txt", rows);
    assert!(
        matches!(scene.open().unwrap().stereo_geometry(), Some(StereoGeometry::Rectified(rig)) if rig.baseline_m == 0.5)
    );
}

#[test]
fn a_colour_right_eye_is_read_as_the_luma_of_the_left_would_be() {
    let scene = odometry();
    scene.color("image_3/000001.png", SIZE, 50);
    let mut luma = bokehcam::frame::GrayImage::default();
    scene.color("image_2/000001.png", SIZE, 50);
    let recording = scene.open().unwrap();
    luma.set_luma_from(&color_of(&recording, 1).unwrap());
    assert_eq!(right_of(&recording, 1).unwrap(), luma);
}

#[test]
fn an_excerpt_keeps_the_times_of_the_whole() {
    let scene = odometry();
    for eye in ["image_2", "image_3"] {
        fs::remove_file(scene.path(&format!("{eye}/000000.png"))).unwrap();
    }
    assert_eq!(times_ns(&scene.open().unwrap()), [0, 103_698_300]);
}

#[test]
fn frames_come_in_the_order_of_their_numbers() {
    let scene = with_eyes("image_0", "image_1", 0);
    for name in ["9.png", "10.png", "8.png", "cover.png", "notes.txt"] {
        let shade = name.split('.').next().unwrap().parse().unwrap_or(0);
        save_grey(&scene.path("mine.png"), SIZE, shade);
        for eye in ["image_0", "image_1"] {
            fs::copy(scene.path("mine.png"), scene.path(&format!("{eye}/{name}"))).unwrap();
        }
    }
    let recording = scene.open().unwrap();
    let shades: Vec<u8> = (0..recording.len()).map(|index| color_of(&recording, index).unwrap().rgb[0]).collect();
    assert_eq!(shades, [8, 9, 10]);
}

#[test]
fn one_eye_alone_is_told() {
    let scene = odometry();
    fs::remove_dir_all(scene.path("image_3")).unwrap();
    assert_says(scene.open(), &["image_3 is missing beside image_2"]);
    fs::create_dir(scene.path("image_3")).unwrap();
    assert_says(scene.open(), &["image_3: no picture here has a number"]);
}

#[test]
fn a_picture_without_its_other_eye_is_told_or_fails_alone() {
    for (removed, says) in [
        ("image_3/000001.png", ["image_2/000001.png: no picture of this name in image_3"]),
        ("image_2/000001.png", ["image_3/000001.png: no picture of this name in image_2"]),
    ] {
        let scene = odometry();
        scene.remove(removed);
        assert_says(scene.open(), &says);
    }
    let scene = odometry();
    scene.remove("image_3/000001.png");
    save_grey(&scene.path("image_3/000007.png"), SIZE, 0);
    let recording = scene.open_keep_going();
    assert_eq!((recording.len(), recording.unpaired()), (3, Unpaired { right: 1, ..Unpaired::default() }));
    assert!(color_of(&recording, 1).is_ok() && right_of(&recording, 2).is_ok());
    assert_says(right_of(&recording, 1), &["image_3/000001.png: there is no such file"]);
}

#[test]
fn eyes_of_unequal_sizes_are_told() {
    let scene = odometry();
    save_grey(&scene.path("image_3/000001.png"), (25, 16), 0);
    let recording = scene.open().unwrap();
    assert!(right_of(&recording, 0).is_ok());
    let says = "image_3/000001.png: the right picture is 25x16, and the left one 24x16; both need the same size";
    assert_says(right_of(&recording, 1), &[says]);
    assert!(right_of(&recording, 2).is_ok());
}

#[test]
fn wrong_times_are_told_with_their_line() {
    for (times, says) in [
        ("0.0\nsoon\n0.2\n", "times.txt:2: \"soon\" is not a time"),
        ("0.0\n0.3\n0.2\n", "times.txt:3: the time is out of order"),
        ("# nothing\n", "times.txt: the list names no picture"),
        ("0.0\n0.1\n", "times.txt: the list has 2 times, but none for image_2/000002.png"),
    ] {
        let scene = odometry();
        scene.write("times.txt", times);
        assert_says(scene.open(), &[says]);
    }
    let scene = odometry();
    scene.write("times.txt", "0.0\nsoon\n");
    let recording = scene.open_keep_going();
    assert_eq!((recording.len(), color_of(&recording, 2).is_ok()), (3, true));
    assert_says(color_of(&recording, 1), &["times.txt:2: \"soon\" is not a time"]);
    assert!(times_ns(&recording).is_sorted());
}

#[test]
fn a_wrong_calibration_fails_the_opening() {
    for (from, to, says) in [
        ("P3", "Q3", "calib.txt: the key P3 is missing"),
        ("-343", "42", "calib.txt:4: the baseline is 0"),
        ("-343", "427", "calib.txt:4: the right camera stands 0.55 m to the left of the left one; swap"),
        ("P2: 700 0", "P2: 700", "calib.txt:3: P2: \"700 610 42 0 700 180 0 0 0 1 0\" is not a projection"),
        ("P", "R", "calib.txt: neither a Middlebury calibration"),
    ] {
        let scene = odometry();
        scene.write("calib.txt", CALIBRATION.replace(from, to));
        assert_says(scene.open(), &[says]);
        let keep_going = Options { keep_going: true, ..Options::default() };
        assert!(matches!(scene.open_with(&keep_going), Err(RecordingError::Geometry { .. })));
    }
}

#[test]
fn a_recording_with_one_eye_has_no_right_one() {
    let recording = Scene::with_pairs(1);
    let recording = recording.open().unwrap();
    assert_eq!((recording.stereo_geometry(), recording.disparity_count()), (None, None));
    assert_says(right_of(&recording, 0), &["the recording has one camera"]);
}
