//! The layout of EuRoC and ASL: times in nanoseconds, and a list for each camera.

use std::fs;

use bokehcam_media::recording::{Options, Recording, StereoGeometry, Unpaired};

use super::{SIZE, Scene, assert_says, color_of, right_of, save_grey, times_ns};

/// A time whose last digits do not fit an `f64`.
const START_NS: u64 = 1_403_715_276_262_142_977;
const PERIOD_NS: u64 = 50_000_001;

fn time_ns(index: u64) -> u64 {
    START_NS + index * PERIOD_NS
}

/// Creates `count` pairs, left shade 10 + index, right 100 + index, with their lists.
fn with_cameras(count: u64) -> Scene {
    let scene = Scene::new();
    for (camera, shade) in [("cam0", 10), ("cam1", 100)] {
        fs::create_dir_all(scene.path(&format!("mav0/{camera}/data"))).unwrap();
        let mut list = "#timestamp [ns],filename\r\n".to_owned();
        for index in 0..count {
            let time_ns = time_ns(index);
            save_grey(&scene.path(&format!("mav0/{camera}/data/{time_ns}.png")), SIZE, shade + index as u8);
            list += &format!("{time_ns},{time_ns}.png\r\n");
        }
        scene.write(&format!("mav0/{camera}/data.csv"), list);
    }
    scene
}

fn assert_is_whole(recording: &Recording) {
    assert_eq!((recording.layout(), recording.len(), recording.size()), ("EuRoC/ASL", 3, SIZE));
    assert_eq!(times_ns(recording), [0, PERIOD_NS, 2 * PERIOD_NS]);
    assert_eq!((recording.stereo_geometry(), recording.has_depth()), (Some(&StereoGeometry::Uncalibrated), false));
    for index in 0..3 {
        assert_eq!(color_of(recording, index).unwrap().rgb[0], 10 + index as u8);
        assert_eq!(right_of(recording, index).unwrap().luma[0], 100 + index as u8);
    }
}

#[test]
fn every_nanosecond_counts_from_the_lists_or_the_names() {
    let scene = with_cameras(3);
    assert_is_whole(&scene.open().unwrap());
    assert_is_whole(&Recording::open(&scene.path("mav0"), &Options::default()).unwrap());
    scene.remove("mav0/cam0/data.csv");
    assert_is_whole(&scene.open().unwrap());
    scene.remove("mav0/cam1/data.csv");
    assert_is_whole(&scene.open().unwrap());
}

#[test]
fn cameras_are_paired_by_time_and_what_is_left_over_is_counted() {
    let scene = with_cameras(4);
    // The right camera missed the second frame, delivered the third slightly late, and has one that the left camera
    // missed.
    let late_ns = time_ns(2) + 3_000_000;
    let between_ns = time_ns(3) + PERIOD_NS / 2 + 1_000_000;
    let name = |index: u64| format!("{}.png", time_ns(index));
    scene.write(
        "mav0/cam1/data.csv",
        format!(
            "{},{}\n{late_ns},{}\n{},{}\n{between_ns},{}\n",
            time_ns(0),
            name(0),
            name(2),
            time_ns(3),
            name(3),
            name(1)
        ),
    );
    let recording = scene.open().unwrap();
    assert_eq!(recording.unpaired(), Unpaired { color: 1, depth: 0, right: 1 });
    assert_eq!(times_ns(&recording), [0, 2 * PERIOD_NS, 3 * PERIOD_NS]);
    assert_eq!(right_of(&recording, 1).unwrap().luma[0], 102);

    scene.write("mav0/cam1/data.csv", format!("{},{}\n", time_ns(900), name(0)));
    assert_says(scene.open(), &["no picture of the right camera lies within 20 ms", "one recording?"]);
}

#[test]
fn half_a_period_is_the_most_that_makes_a_pair() {
    let scene = with_cameras(4);
    let list: String =
        (0..4).map(|index| format!("{},{}.png\n", time_ns(index) + PERIOD_NS / 2 + 1, time_ns(index))).collect();
    scene.write("mav0/cam1/data.csv", list);
    let wide = Options { pair_tolerance_ns: u64::MAX, ..Options::default() };
    assert_eq!(scene.open_with(&wide).unwrap().unpaired(), Unpaired { color: 1, depth: 0, right: 1 });
}

#[test]
fn one_camera_is_a_recording_without_a_right_eye() {
    let scene = with_cameras(2);
    fs::remove_dir_all(scene.path("mav0/cam1")).unwrap();
    let recording = scene.open().unwrap();
    assert_eq!((recording.len(), recording.stereo_geometry()), (2, None));
    assert_says(right_of(&recording, 0), &["one camera"]);
}

#[test]
fn wrong_lines_are_told_with_their_number() {
    for (line, says) in [
        ("14.5,a.png", "\"14.5\" is not a time; write nanoseconds"),
        ("+14,a.png", "\"+14\" is not a time"),
        ("99999999999999999999,a.png", "is not a time"),
        ("14", "expected `nanoseconds,file`, found 1 column(s)"),
        ("14,../../a.png", "points outside the recording"),
    ] {
        for camera in ["cam0", "cam1"] {
            let scene = with_cameras(3);
            let list = format!("mav0/{camera}/data.csv");
            let text = fs::read_to_string(scene.path(&list)).unwrap();
            scene.write(&list, text.replace("filename\r\n", &format!("filename\r\n{line}\r\n")));
            assert_says(scene.open(), &[&format!("{list}:2: "), says]);
            let recording = scene.open_keep_going();
            let readable = |index| color_of(&recording, index).is_ok() && right_of(&recording, index).is_ok();
            assert_eq!((0..recording.len()).filter(|&index| readable(index)).count(), 3, "{line}");
        }
    }
}

#[test]
fn a_picture_that_is_missing_is_told_where_it_is_listed() {
    let scene = with_cameras(2);
    scene.remove(&format!("mav0/cam1/data/{}.png", time_ns(1)));
    let recording = scene.open().unwrap();
    assert_says(right_of(&recording, 1), &["mav0/cam1/data.csv:3: mav0/cam1/data/", "no such file"]);
    assert!(color_of(&recording, 1).is_ok());
}

#[test]
fn the_calibration_of_one_camera_does_not_do() {
    let scene = with_cameras(2);
    scene.write("mav0/cam0/sensor.yaml", "sensor_type: camera\n");
    assert_says(scene.open(), &["sensor.yaml"]);
}
