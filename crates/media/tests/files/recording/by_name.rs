//! What the names of files and folders say of what they hold, and what else stands beside numbers.

use std::fs;

use bokehcam_media::recording::depth_file::{self, Distances, Options};
use bokehcam_media::recording::{Recording, mask_file};
use image::{ImageBuffer, Luma};
use tempfile::TempDir;
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::Tag;

use super::depth_files::encode::{bytes_of, npy, npz};
use super::{SIZE, Scene, assert_says, color_of, depth_of, times_ns};

const MAP_PX: (u32, u32) = (4, 2);
const NUMBERS: [f32; 8] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 1.5, 3.0];

/// A folder of pictures without depth.
fn folder() -> Scene {
    let scene = Scene::new();
    ["rgb", "depth"].iter().for_each(|folder| fs::remove_dir(scene.path(folder)).unwrap());
    scene
}

#[test]
fn the_nearest_folder_that_names_a_role_says_what_maps_hold() {
    let dir = TempDir::new().unwrap();
    for (name, is_distance) in [
        ("disparity/frame_0001.npy", false),
        ("disparity/TRAIN/A/0000/left/0006.npy", false),
        ("disparity/depth/0001.npy", true),
        ("disparity/TRAIN/metric_depth.npy", true),
        ("disparity of last year/left/0001.npy", true),
        ("frames/0001.npy", true),
    ] {
        let path = dir.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, npy("<f4", false, "2, 4", &bytes_of(&NUMBERS))).unwrap();
        let found = depth_file::read(&path, &Options::default(), MAP_PX).unwrap().distances;
        assert_eq!(found == Distances::Metres, is_distance, "{name}");
    }
}

#[test]
fn an_array_is_the_map_before_a_matrix_that_is_named_so() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.npz");
    let map = npy("<f4", false, "2, 8", &bytes_of(&[NUMBERS, NUMBERS].concat()));
    let matrix = npy("<f4", false, "3, 3", &bytes_of(&[1.0; 9]));
    fs::write(&path, npz(&[("depth_intrinsics.npy", &matrix), ("dpt.npy", &map)])).unwrap();
    assert_eq!(depth_file::read(&path, &Options::default(), (8, 2)).unwrap().map.size(), (8, 2));
}

#[test]
fn the_number_that_a_tiff_calls_unknown_is_unknown() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.tif");
    let mut encoder = TiffEncoder::new(fs::File::create(&path).unwrap()).unwrap();
    let mut picture = encoder.new_image::<colortype::Gray32Float>(4, 2).unwrap();
    picture.encoder().write_tag(Tag::Unknown(42113), "16 ").unwrap();
    picture.write_data(&NUMBERS).unwrap();
    for invalid in [None, Some(0.0)] {
        let metres = depth_file::read(&path, &Options { invalid, ..Options::default() }, MAP_PX).unwrap().map.metres;
        assert_eq!(metres, NUMBERS.map(|metres| if metres == 16.0 { 0.0 } else { metres }));
    }
}

#[test]
fn maps_that_were_stretched_and_then_scaled_in_size_are_asked_about() {
    let dir = TempDir::new().unwrap();
    let (array, png) = (dir.path().join("a.npy"), dir.path().join("a.png"));
    let (width, height) = (32_u32, 16_u32);
    let count = (width * height) as usize;
    // From `near` to `far`, of the full range.
    let ramp = |near: f32, far: f32| (0..count).map(move |k| near + (far - near) * k as f32 / (count - 1) as f32);
    let read = |near: f32, far: f32| {
        let numbers: Vec<f32> = ramp(near, far).collect();
        fs::write(&array, npy("<f4", false, "16, 32", &bytes_of(&numbers))).unwrap();
        let codes: Vec<u16> = ramp(near, far).map(|number| (number * 65535.0).min(65535.0) as u16).collect();
        ImageBuffer::<Luma<u16>, _>::from_raw(width, height, codes).unwrap().save(&png).unwrap();
        [&array, &png].map(|path| depth_file::read(path, &Options::default(), (width, height)))
    };
    for (near, far) in [(0.0, 1.0), (0.003, 0.991), (0.0, 0.96)] {
        for asked in read(near, far) {
            assert_says(asked, &["stretched"]);
        }
    }
    // No camera sees so near; these are distances.
    for (near, far) in [(0.2, 0.99), (0.1, 1.0), (0.003, 0.8)] {
        assert!(read(near, far).iter().all(Result::is_ok), "{near} to {far}");
    }
}

#[test]
fn what_is_no_object_is_no_subject_of_a_mask() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("mask.png");
    let write = |codes: [u8; 8]| image::GrayImage::from_raw(4, 2, codes.to_vec()).unwrap().save(&path).unwrap();
    let read = || mask_file::read(&path, MAP_PX).unwrap();
    // As of VOC: a person (15) with a rim that is neither.
    write([0, 255, 15, 15, 0, 255, 15, 15]);
    let file = read();
    assert_eq!(file.mask.alpha, [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0]);
    assert!(file.notes[0].contains("0 and white"), "{:?}", file.notes);
    // A white subject before a dark wall is a mask as any other.
    write([20, 255, 20, 20, 20, 255, 20, 20]);
    assert!(read().mask.alpha[1] > 0.99);
    // Nor is one with a little noise in the dark.
    write([0, 255, 255, 255, 3, 255, 255, 255]);
    assert!(read().mask.alpha[1] > 0.99);
}

#[test]
fn maps_are_found_by_their_names_in_any_case_and_by_the_suffix_that_most_have() {
    for suffix in ["_depth", "_Depth", "-DEPTH"] {
        let scene = folder();
        for n in 0..4 {
            scene.color(&format!("{n}.jpg"), SIZE, 9);
            scene.depth(&format!("{n}{suffix}.png"), SIZE, 1000 + n);
        }
        // A map of an earlier try.
        scene.depth("2.depth.png", SIZE, 9000);
        let recording = scene.open().unwrap();
        assert_eq!(recording.len(), 4, "{suffix}");
        assert_eq!(depth_of(&recording, 2).unwrap().metres[0], 1.002, "{suffix}");
    }
}

#[test]
fn depth_of_the_view_of_the_colour_camera_is_preferred() {
    let scene = Scene::new();
    fs::create_dir(scene.path("aligned_depth")).unwrap();
    for n in 0..2 {
        scene.color(&format!("rgb/{n}.png"), SIZE, 9);
        scene.depth(&format!("depth/{n}.png"), SIZE, 9000);
        scene.depth(&format!("aligned_depth/{n}.png"), SIZE, 2000);
    }
    assert_eq!(depth_of(&scene.open().unwrap(), 1).unwrap().metres[0], 2.0);
    // A single map of the other folder has the scale of its recording, too.
    let options = Options { invalid: Some(0.0), ..Options::default() };
    scene.depth("depth/3.png", SIZE, 9000);
    assert_eq!(depth_file::read(&scene.path("depth/3.png"), &options, SIZE).unwrap().map.metres[0], 9.0);
    for names in [["Color", "Depth"], ["RGB", "Depth"]] {
        let scene = folder();
        names.iter().for_each(|name| fs::create_dir(scene.path(name)).unwrap());
        scene.color(&format!("{}/1.png", names[0]), SIZE, 9);
        scene.depth(&format!("{}/1.png", names[1]), SIZE, 2000);
        assert_eq!(depth_of(&scene.open().unwrap(), 0).unwrap().metres[0], 2.0, "{names:?}");
    }
    // As RTAB-Map exports them; a folder of the whole name has priority.
    let scene = folder();
    fs::create_dir(scene.path("map_rgb")).unwrap();
    scene.color("map_rgb/1.png", SIZE, 9);
    for (name, units) in [("map_depth", 2000), ("map_rgb_depth", 3000)] {
        fs::create_dir(scene.path(name)).unwrap();
        scene.depth(&format!("{name}/1.png"), SIZE, units);
        let recording = Recording::open(&scene.path("map_rgb"), &Default::default()).unwrap();
        assert_eq!(depth_of(&recording, 0).unwrap().metres[0], f32::from(units) / 1000.0, "{name}");
    }
    for prefix in ["color_", "rgb_"] {
        let scene = folder();
        scene.color(&format!("{prefix}0001.png"), SIZE, 9);
        scene.depth("depth_0001.png", SIZE, 2000);
        assert_eq!(depth_of(&scene.open().unwrap(), 0).unwrap().metres[0], 2.0, "{prefix}");
    }
}

#[test]
fn names_of_seconds_are_played_in_their_order() {
    let scene = folder();
    // As Python writes them, without zeros at the end.
    let names = ["1700000000.05", "1700000000.1", "1700000000.15", "1700000001.0"];
    names.iter().zip(1_u8..).for_each(|(name, n)| scene.color(&format!("{name}.png"), SIZE, 20 * n));
    let recording = scene.open().unwrap();
    let shades: Vec<u8> = (0..4).map(|index| color_of(&recording, index).unwrap().rgb[0]).collect();
    assert_eq!(shades, [20, 40, 60, 80]);
}

#[test]
fn numbers_of_frames_are_no_seconds() {
    for first in [0_u32, 1] {
        let scene = Scene::with_pairs(4);
        ["rgb.txt", "depth.txt"].iter().for_each(|list| scene.remove(list));
        let line = |n: u32| format!("{0} depth/{n}.png {0} rgb/{n}.png\n", n + first);
        scene.write("associations.txt", (0..4).map(line).collect::<String>());
        let recording = scene.open().unwrap();
        assert_eq!((times_ns(&recording)[1], recording.has_times()), (33_333_333, false));
        let line = |n: u32| format!("{0} depth/{n}.png {0} rgb/{n}.png\n", f64::from(n) + 5.25);
        scene.write("associations.txt", (0..4).map(line).collect::<String>());
        let recording = scene.open().unwrap();
        assert_eq!((times_ns(&recording)[1], recording.has_times()), (1_000_000_000, true));
    }
}
