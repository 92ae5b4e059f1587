//! Single scenes of the KITTI stereo benchmarks, as downloaded.

use std::fs;

use bokehcam_media::recording::{Options, Recording, StereoGeometry};

use super::{SIZE, Scene, assert_says, color_of, right_of, save_grey, times_ns};

const OTHER_SIZE: (u32, u32) = (SIZE.0 - 2, SIZE.1 - 1);

/// The calibration of a scene with this focal length and cameras 0.5 m apart.
fn calibration(focal_px: u32) -> String {
    let row = |key: &str, offset| format!("{key}: {focal_px} 0 12 {offset} 0 {focal_px} 8 0 0 0 1 0\n");
    let right = -f64::from(focal_px) / 2.0;
    [row("P0", 0.0), row("P1", right), row("P2", 0.0), row("P3", right)].concat()
}

/// Creates scenes with two pictures each, whose shade is the scene's number.
fn with_scenes([left, right]: [&str; 2], calibrations: &str, scenes: &[((u32, u32), u32)]) -> Scene {
    let scene = Scene::new();
    [left, right, calibrations].iter().for_each(|folder| fs::create_dir(scene.path(folder)).unwrap());
    for (number, &(size, focal_px)) in (0..).zip(scenes) {
        for time in [10, 11] {
            scene.color(&format!("{left}/{number:06}_{time}.png"), size, number);
            save_grey(&scene.path(&format!("{right}/{number:06}_{time}.png")), size, 100 + number);
        }
        let text = match calibrations {
            "calib" => calibration(focal_px),
            _ => format!("calib_time: 09-Jan-2012\n{}", calibration(focal_px).replace('P', "P_rect_0")),
        };
        scene.write(&format!("{calibrations}/{number:06}.txt"), text);
    }
    scene
}

const SCENES: [((u32, u32), u32); 4] = [(SIZE, 700), (OTHER_SIZE, 650), (SIZE, 700), (SIZE, 720)];

fn shades(recording: &Recording) -> Vec<u8> {
    (0..recording.len()).map(|index| color_of(recording, index).unwrap().rgb[0]).collect()
}

fn focal_px(recording: &Recording) -> f32 {
    match recording.stereo_geometry() {
        Some(StereoGeometry::Rectified(rig)) => rig.focal_px,
        other => panic!("{other:?}"),
    }
}

#[test]
fn scenes_of_one_size_and_calibration_are_a_recording() {
    for (eyes, calibrations) in [
        (["image_2", "image_3"], "calib_cam_to_cam"),
        (["image_0", "image_1"], "calib"),
        (["colored_0", "colored_1"], "calib"),
    ] {
        let scene = with_scenes(eyes, calibrations, &SCENES);
        let recording = scene.open().unwrap();
        assert_eq!((recording.layout(), recording.size(), recording.is_chosen_by_size()), ("KITTI", SIZE, true));
        // Scene 1 has another size, scene 3 another calibration.
        assert_eq!((shades(&recording), focal_px(&recording)), (vec![0, 0, 2, 2], 700.0));
        assert_eq!(right_of(&recording, 3).unwrap().luma[0], 102);
        assert_eq!(times_ns(&recording), [0, 100_000_000, 200_000_000, 300_000_000]);
    }
}

/// One picture a scene, named by its number alone.
#[test]
fn scenes_of_the_object_benchmark_are_known_by_their_calibrations() {
    let scene = with_scenes(["image_2", "image_3"], "calib", &SCENES);
    for eye in ["image_2", "image_3"] {
        for number in 0..SCENES.len() {
            scene.remove(&format!("{eye}/{number:06}_11.png"));
            let [from, to] = ["_10", ""].map(|time| scene.path(&format!("{eye}/{number:06}{time}.png")));
            fs::rename(from, to).unwrap();
        }
    }
    let recording = scene.open().unwrap();
    assert_eq!((shades(&recording), focal_px(&recording)), (vec![0, 2], 700.0));
}

#[test]
fn the_size_chooses_scenes() {
    let scene = with_scenes(["image_2", "image_3"], "calib_cam_to_cam", &SCENES);
    let with_size = |size| scene.open_with(&Options { size: Some(size), ..Options::default() }).unwrap();
    let recording = with_size(OTHER_SIZE);
    assert_eq!((recording.size(), shades(&recording), focal_px(&recording)), (OTHER_SIZE, vec![1, 1], 650.0));
    // A size that no scene has is that of the first.
    for size in [SIZE, (1, 1)] {
        assert_eq!(shades(&with_size(size)), [0, 0, 2, 2]);
    }
}

#[test]
fn scenes_without_calibration_are_chosen_by_size_alone() {
    let scene = with_scenes(["image_2", "image_3"], "calib", &SCENES);
    fs::remove_dir_all(scene.path("calib")).unwrap();
    let recording = scene.open().unwrap();
    assert_eq!(recording.stereo_geometry(), Some(&StereoGeometry::Uncalibrated));
    assert_eq!(shades(&recording), [0, 0, 2, 2, 3, 3]);
    // A sequence keeps its numbers, and its one size.
    let scene = Scene::new();
    for eye in ["image_2", "image_3"] {
        fs::create_dir(scene.path(eye)).unwrap();
        scene.color(&format!("{eye}/0.png"), SIZE, 0);
        scene.color(&format!("{eye}/1.png"), OTHER_SIZE, 1);
    }
    let recording = scene.open().unwrap();
    assert_eq!((recording.len(), recording.is_chosen_by_size()), (2, false));
    assert_says(color_of(&recording, 1), &["image_2/1.png: the picture is 22x15"]);
}

#[test]
fn a_faulty_calibration_is_told_with_its_file_and_line() {
    for (text, says) in [
        (None, "No such file"),
        (Some(calibration(700).replace("P3", "Q3")), "the key P3 is missing"),
        (Some(calibration(700).replace("P2: 700", "P2: far")), ":3: P2: "),
        (Some(String::new()), "neither a Middlebury calibration"),
    ] {
        let scene = with_scenes(["image_2", "image_3"], "calib", &SCENES);
        match text {
            Some(text) => scene.write("calib/000002.txt", text),
            None => scene.remove("calib/000002.txt"),
        }
        assert_says(scene.open(), &["calib/000002.txt", says]);
        let recording = scene.open_keep_going();
        assert_eq!((shades(&recording), focal_px(&recording)), (vec![0, 0], 700.0));
    }
}

#[test]
fn a_damaged_picture_is_told_when_it_is_read() {
    let scene = with_scenes(["image_2", "image_3"], "calib", &SCENES);
    scene.write("image_2/000002_10.png", "damaged");
    let recording = scene.open().unwrap();
    assert_eq!(recording.len(), 4);
    assert_says(color_of(&recording, 2), &["image_2/000002_10.png: not a PNG, JPEG, TIFF"]);
    scene.remove("image_3/000000_10.png");
    assert_says(scene.open(), &["image_2/000000_10.png: no picture of this name in image_3"]);
}
