//! Folders of colour pictures and depth maps without lists, as data sets have them.

use std::fs;

use bokehcam_media::recording::{DepthUnit, Options, Unpaired};

use super::{SIZE, Scene, assert_says, color_of, depth_of, times_ns};

/// Creates a folder with `count` pairs, whose names are made from their numbers: colour of that shade, and depth of
/// 1000, 2000, ... units.
fn with_names(count: u8, color: impl Fn(u8) -> String, depth: impl Fn(u8) -> String) -> Scene {
    let scene = Scene::new();
    for index in 0..count {
        for name in [color(index), depth(index)] {
            fs::create_dir_all(scene.path(&name).parent().unwrap()).unwrap();
        }
        scene.color(&color(index), SIZE, index);
        scene.depth(&depth(index), SIZE, 1000 * (u16::from(index) + 1));
    }
    scene
}

fn scannet(count: u8) -> Scene {
    with_names(count, |n| format!("color/{n}.jpg"), |n| format!("depth/{n}.png"))
}

fn replica(count: u8) -> Scene {
    with_names(count, |n| format!("results/frame{n:06}.jpg"), |n| format!("results/depth{n:06}.png"))
}

fn bop(count: u8) -> Scene {
    with_names(count, |n| format!("rgb/{n:06}.png"), |n| format!("depth/{n:06}.png"))
}

#[track_caller]
fn assert_depth(scene: &Scene, index: usize, metres: f32) {
    let depth = depth_of(&scene.open().unwrap(), index).unwrap();
    assert!((depth.metres[0] - metres).abs() < 1e-5, "{} m, not {metres}", depth.metres[0]);
}

#[test]
fn folders_that_people_have_are_paired_by_number() {
    for scene in [
        scannet(12),
        with_names(12, |n| format!("rgb/{n:05}.jpg"), |n| format!("depth/{n:05}.png")),
        with_names(12, |n| format!("image/frame_{n}.png"), |n| format!("depth/depth_{n:04}.png")),
        with_names(12, |n| format!("images/{n}.jpeg"), |n| format!("depths/{n:03}.png")),
        with_names(
            12,
            |n| format!("color/{n:06}_{:011}.jpg", 33 * u32::from(n)),
            |n| format!("depth/{n:06}_{:011}.png", 33 * u32::from(n)),
        ),
        with_names(12, |n| format!("frame-{n:06}.color.png"), |n| format!("frame-{n:06}.depth.png")),
        with_names(12, |n| format!("left{n:06}.png"), |n| format!("depth{n:06}.png")),
    ] {
        let recording = scene.open().unwrap();
        assert_eq!((recording.layout(), recording.len(), recording.has_depth()), ("RGB-D folders", 12, true));
        assert_eq!((recording.unpaired(), recording.has_times()), (Unpaired::default(), false));
        // 9 is before 10 and 11.
        for index in 0..12 {
            let shade = color_of(&recording, index).unwrap().rgb[0];
            assert!(usize::from(shade).abs_diff(index) <= 3, "JPEG, {shade} for {index}");
            assert_eq!(depth_of(&recording, index).unwrap().metres[0], index as f32 + 1.0);
        }
        assert_eq!(times_ns(&recording)[..3], [0, 33_333_333, 66_666_666]);
        let options = Options { period_ns: Some(100_000_000), ..Options::default() };
        assert_eq!(times_ns(&scene.open_with(&options).unwrap())[..3], [0, 100_000_000, 200_000_000]);
    }
}

#[test]
fn millimetres_are_assumed_and_the_largest_value_is_unknown() {
    let scene = scannet(2);
    scene.depth("depth/0.png", SIZE, 65535);
    assert_depth(&scene, 0, 0.0);
    assert!(!scene.open().unwrap().has_depth_in_units(), "its own units");
    let with = |options| depth_of(&scene.open_with(&options).unwrap(), 1).unwrap().metres[0];
    assert_eq!(with(Options { depth_scale: Some(500.0), ..Options::default() }), 4.0);
    assert_eq!(with(Options { depth_invalid: Some(2000), ..Options::default() }), 0.0);
    // 0 states nothing, as it is unknown anyway.
    let zero = scene.open_with(&Options { depth_invalid: Some(0), ..Options::default() }).unwrap();
    assert_eq!(depth_of(&zero, 0).unwrap().metres[0], 0.0);
    let scaled = scene.open_with(&Options { depth_scale: Some(1000.0), ..Options::default() }).unwrap();
    assert!(scaled.has_depth_in_units());
    assert_eq!(depth_of(&scaled, 0).unwrap().metres[0], 65.535);
    let inverse = Options { depth_unit: DepthUnit::Inverse, ..Options::default() };
    assert!(scene.open_with(&inverse).unwrap().has_relative_depth());
}

#[test]
fn replica_has_its_scale_in_a_file() {
    let scene = replica(2);
    assert_depth(&scene, 1, 2000.0 / 6553.5);
    scene.write("cam_params.json", r#"{"camera": {"w": 1200, "h": 680, "fx": 600.0, "scale": 500}}"#);
    assert_depth(&scene, 1, 4.0);
    // One file for all rooms, beside them.
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("cam_params.json"), r#"{"camera": {"scale": 250.0}}"#).unwrap();
    let room = home.path().join("office0");
    fs::create_dir(&room).unwrap();
    fs::rename(scene.path("results"), room.join("results")).unwrap();
    let recording = bokehcam_media::recording::Recording::open(&room, &Options::default()).unwrap();
    assert_eq!(depth_of(&recording, 1).unwrap().metres[0], 8.0);
}

#[test]
fn bop_has_its_scale_in_a_file() {
    let scene = bop(2);
    scene.write("scene_camera.json", r#"{"0": {"cam_K": [1, 2], "depth_scale": 0.1}, "1": {"depth_scale": 0.1}}"#);
    assert_depth(&scene, 1, 0.2);
    scene.write("scene_camera.json", r#"{"0": {"depth_scale": 1.0}}"#);
    assert_depth(&scene, 1, 2.0);
    // In grey scenes, too.
    fs::rename(scene.path("rgb"), scene.path("gray")).unwrap();
    assert_depth(&scene, 0, 1.0);
}

#[test]
fn a_faulty_scale_is_told_with_its_file() {
    for (text, said) in [
        ("{", "line 1 column 1"),
        (r#"{"0": {"cam_K": []}}"#, "missing field `depth_scale`"),
        (r#"{"0": {"depth_scale": 0}}"#, "not a scale > 0"),
        (r#"{"0": {"depth_scale": -1.5}}"#, "not a scale > 0"),
        (r#"{"0": {"depth_scale": 1e-60}}"#, "not a scale > 0"),
        (r#"{"0": {"depth_scale": 1}, "7": {"depth_scale": 0.1}}"#, "1 for picture 0, but 0.1 for 7"),
        ("{}", "names no picture"),
    ] {
        let scene = bop(1);
        scene.write("scene_camera.json", text);
        assert_says(scene.open(), &["scene_camera.json: ", said, "--depth-scale"]);
        // A scale that the user gives needs no file.
        assert!(scene.open_with(&Options { depth_scale: Some(1000.0), ..Options::default() }).is_ok());
    }
    let scene = replica(1);
    for text in ["", r#"{"camera": {}}"#, r#"{"camera": {"scale": "much"}}"#, &"[".repeat(100_000)] {
        scene.write("cam_params.json", text);
        assert_says(scene.open(), &["cam_params.json: ", "--depth-scale"]);
    }
    scene.write("cam_params.json", " ".repeat(5 << 20));
    assert_says(scene.open(), &["cam_params.json", "too large"]);
}

#[test]
fn pictures_without_a_partner_are_left_out() {
    let scene = scannet(4);
    scene.remove("depth/1.png");
    scene.remove("color/3.jpg");
    let recording = scene.open().unwrap();
    assert_eq!((recording.len(), recording.unpaired()), (2, Unpaired { color: 1, depth: 1, right: 0 }));
    assert_eq!(depth_of(&recording, 1).unwrap().metres[0], 3.0);
}

#[test]
fn names_that_do_not_pair_are_told() {
    // Times of two cameras, as TUM has them: lists are needed.
    let scene = with_names(3, |n| format!("rgb/13.{n}1.png"), |n| format!("depth/13.{n}2.png"));
    assert_says(scene.open(), &["no depth map in ", "depth has the name or number", "associations.txt"]);
    let scene = with_names(2, |_| "color/a1.png".into(), |n| format!("depth/{n}.png"));
    scene.color("color/b01.png", SIZE, 9);
    assert_says(scene.open(), &["color/b01.png: its name or number is also that of a1.png"]);
    let scene = with_names(2, |n| format!("color/a{n}.png"), |n| format!("depth/{n}.png"));
    scene.depth("depth/001.png", SIZE, 9);
    assert_says(scene.open(), &["also that of", "rename"]);
}

#[test]
fn a_faulty_picture_is_told_with_its_path() {
    let scene = scannet(2);
    scene.write("color/1.jpg", "no picture");
    assert_says(color_of(&scene.open().unwrap(), 1), &["color/1.jpg: not a PNG, JPEG, TIFF"]);
    scene.write("depth/1.png", "");
    assert_says(depth_of(&scene.open().unwrap(), 1), &["depth/1.png: "]);
    scene.depth("depth/0.png", (7, 7), 5);
    assert_says(depth_of(&scene.open().unwrap(), 0), &["depth/0.png: the depth map is 7x7"]);
}

#[test]
fn a_film_is_told_its_command() {
    let scene = scannet(2);
    fs::rename(scene.path("color"), scene.path("frames")).unwrap();
    scene.write("rgb.mp4", "film");
    assert_says(scene.open(), &["rgb.mp4: ", "ffmpeg", "/rgb/%06d.png"]);
    fs::rename(scene.path("frames"), scene.path("color")).unwrap();
    assert_eq!(scene.open().unwrap().len(), 2);
}
