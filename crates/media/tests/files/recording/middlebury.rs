//! The layout of Middlebury and ETH3D: one pair.

use std::fs;

use bokehcam::frame::DisparityMap;
use bokehcam_media::recording::still::write_disparity;
use bokehcam_media::recording::{Options, Recording, StereoGeometry};

use super::{SIZE, Scene, assert_says, color_of, depth_of, right_of, save_grey, times_ns};

const CALIBRATION: &str = "cam0=[100 0 12; 0 100 8; 0 0 1]\ncam1=[100 0 14; 0 100 8; 0 0 1]\n\
                           doffs=2\nbaseline=120\nwidth=24\nheight=16\nndisp=17\n";

fn with_pair() -> Scene {
    let scene = Scene::new();
    scene.color("im0.png", SIZE, 7);
    save_grey(&scene.path("im1.png"), SIZE, 9);
    scene.write("calib.txt", CALIBRATION);
    let mut truth = DisparityMap { width: SIZE.0, height: SIZE.1, px: vec![4.0; 24 * 16] };
    truth.px[0] = 0.0;
    truth.px[1] = 10.0;
    write_disparity(&scene.path("disp0.pfm"), &truth, None, false).unwrap();
    scene
}

#[test]
fn a_pair_is_a_recording_of_one_frame_with_depth() {
    let scene = with_pair();
    let recording = scene.open().unwrap();
    assert_eq!((recording.layout(), times_ns(&recording)), ("Middlebury stereo", vec![0]));
    let Some(StereoGeometry::Rectified(rig)) = recording.stereo_geometry() else {
        panic!("{:?}", recording.stereo_geometry())
    };
    assert_eq!((rig.focal_px, rig.baseline_m, rig.doffs_px), (100.0, 0.12, 2.0));
    assert_eq!((recording.disparity_count(), recording.has_depth()), (Some(32), true));
    assert_eq!(color_of(&recording, 0).unwrap().rgb[..3], [7, 100, 200]);
    assert_eq!(right_of(&recording, 0).unwrap().luma, [9; 24 * 16]);
    // Z = baseline f / (d + doffs); infinity is unknown.
    let depth = depth_of(&recording, 0).unwrap();
    assert_eq!((depth.size(), &depth.metres[..3]), (SIZE, &[0.0, 1.0, 2.0][..]));
}

#[test]
fn nothing_but_the_pictures_is_needed() {
    for [left, right] in [["im0.png", "im1.png"], ["im2.png", "im6.png"]] {
        let scene = Scene::new();
        for name in [left, right] {
            save_grey(&scene.path(name), SIZE, 3);
        }
        let recording = scene.open().unwrap();
        assert_eq!((recording.stereo_geometry(), recording.has_depth()), (Some(&StereoGeometry::Uncalibrated), false));
        assert_eq!(recording.disparity_count(), None);
    }
    // Disparity without a calibration gives no depth.
    let scene = with_pair();
    scene.remove("calib.txt");
    assert!(!scene.open().unwrap().has_depth());
}

#[test]
fn a_calibration_of_another_size_is_scaled_or_refused() {
    let scene = with_pair();
    scene.color("im0.png", (12, 8), 7);
    save_grey(&scene.path("im1.png"), (12, 8), 9);
    let half = DisparityMap { width: 6, height: 4, px: vec![1.0; 24] };
    write_disparity(&scene.path("disp0.pfm"), &half, None, true).unwrap();
    let recording = scene.open().unwrap();
    let Some(StereoGeometry::Rectified(rig)) = recording.stereo_geometry() else {
        panic!("{:?}", recording.stereo_geometry())
    };
    assert_eq!((rig.focal_px, rig.doffs_px, recording.disparity_count()), (50.0, 1.0, Some(16)));
    // One pixel of six columns is two of twelve, and four of the calibration's 24.
    assert_eq!(depth_of(&recording, 0).unwrap().metres, [2.0; 24]);

    scene.color("im0.png", (24, 12), 7);
    assert_says(scene.open(), &["calib.txt: made for pictures of 24x16, but these are 24x12", "aspect"]);
}

#[test]
fn what_is_wrong_is_told() {
    let open = |from: &str, to: &str| {
        let scene = with_pair();
        scene.write("calib.txt", CALIBRATION.replace(from, to));
        scene.open()
    };
    assert_says(open("baseline", "base"), &["calib.txt: the key baseline is missing"]);
    assert_says(open("=120", "=0"), &["calib.txt:4: the baseline is 0"]);
    assert_says(open("=120", "=0,12 m"), &["calib.txt:4: baseline: \"0,12 m\" is not a number"]);
    assert_says(open("[100 0 12;", "[100 0;"), &["calib.txt:1: cam0: ", "`[f 0 cx; 0 f cy; 0 0 1]`"]);

    let scene = with_pair();
    save_grey(&scene.path("im1.png"), (23, 16), 9);
    assert_says(right_of(&scene.open().unwrap(), 0), &["im1.png: the right picture is 23x16"]);
    let tall = DisparityMap { width: 24, height: 20, px: vec![1.0; 24 * 20] };
    write_disparity(&scene.path("disp0.pfm"), &tall, None, true).unwrap();
    assert_says(depth_of(&scene.open().unwrap(), 0), &["disp0.pfm: the depth map is 24x20", "24x16"]);
    fs::write(scene.path("disp0.pfm"), "Pf\n24 16\n-1\n").unwrap();
    assert_says(depth_of(&scene.open().unwrap(), 0), &["disp0.pfm: the file ends before"]);
}

#[test]
fn half_a_pair_is_told() {
    for (missing, present) in [("im1.png", "im0.png"), ("im0.png", "im1.png")] {
        for remaining in ["calib.txt", "disp0.pfm"] {
            let scene = with_pair();
            ["calib.txt", "disp0.pfm"].iter().filter(|name| **name != remaining).for_each(|name| scene.remove(name));
            scene.remove(missing);
            assert_says(scene.open(), &[&format!("{missing} is missing beside {present}")]);
        }
    }
}

#[test]
fn a_folder_that_is_nothing_is_told_all_layouts() {
    let scene = Scene::new();
    let opened = Recording::open(&scene.path(""), &Options::default());
    let layouts = [
        "rgb.txt (TUM RGB-D)",
        "mav0/cam0",
        "(EuRoC/ASL)",
        "image_2 and image_3",
        "(KITTI)",
        "im0.png and im1.png",
        "color and depth",
        "PNG or JPEG",
    ];
    assert_says(opened, &[&["not a recording", "give the folder"], &layouts[..]].concat());
}
