//! What holds in one reader holds in those beside it: single maps, folders of maps, and recordings.

use std::fs;
use std::path::Path;

use bokehcam_media::recording::depth_file::{self, DepthUnit, Distances, Options};
use bokehcam_media::recording::map_sequence::{MapSequence, Pictured};
use bokehcam_media::recording::still::{read_color, write_photo};
use bokehcam_media::recording::{Options as RecordingOptions, Photo, PhotoMetadata};
use image::{ImageBuffer, Luma, Rgba};
use tempfile::TempDir;

use super::depth_files::encode::{bytes_of, exr, npy, npz};
use super::{Scene, assert_says, depth_of};

/// Size of the maps here, and whole numbers in them.
const MAP_PX: (u32, u32) = (4, 2);
const CODES: [u16; 8] = [1000, 1200, 1400, 1600, 1800, 2000, 2200, 4095];

/// A recording of one picture in `color` and one map in `depth`.
fn pair(map: &str) -> (Scene, std::path::PathBuf) {
    let scene = Scene::new();
    fs::rename(scene.path("rgb"), scene.path("color")).unwrap();
    scene.color("color/1.png", MAP_PX, 9);
    let path = scene.path(&format!("depth/{map}"));
    (scene, path)
}

fn pgm(white: u16, codes: &[u16]) -> Vec<u8> {
    let codes: Vec<u8> = codes.iter().flat_map(|code| code.to_be_bytes()).collect();
    [format!("P5\n4 2\n{white}\n").as_bytes(), &codes].concat()
}

fn metres(path: &Path, options: Options) -> Vec<f32> {
    depth_file::read(path, &options, MAP_PX).unwrap().map.metres
}

#[test]
fn a_pgm_has_the_numbers_in_it_whatever_its_largest() {
    let expected: Vec<f32> = CODES.map(|code| f32::from(code) / 1000.0).to_vec();
    let near = |found: &[f32]| found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 2e-4);
    for white in [4095, 10_000, 65_535] {
        let (scene, path) = pair("1.pgm");
        fs::write(&path, pgm(white, &CODES)).unwrap();
        let recorded = depth_of(&scene.open().unwrap(), 0).unwrap().metres;
        assert!(near(&recorded), "{white}: {recorded:?}");
        let invalid = RecordingOptions { depth_invalid: Some(1400), ..RecordingOptions::default() };
        assert_eq!(depth_of(&scene.open_with(&invalid).unwrap(), 0).unwrap().metres[2], 0.0, "{white}");
        let single = metres(&path, Options { scale: Some(1000.0), ..Options::default() });
        assert!(near(&single), "{white}: {single:?}");
    }
}

#[test]
fn whole_numbers_of_any_file_have_the_scale_that_is_stated_beside_them() {
    let codes: Vec<u16> = (0..8).map(|k| 15_000 + 100 * k).collect();
    let array = npy("<u2", false, "2, 4", &codes.iter().flat_map(|code| code.to_le_bytes()).collect::<Vec<u8>>());
    let picture = ImageBuffer::<Luma<u16>, _>::from_raw(4, 2, codes.clone()).unwrap();
    for ending in ["png", "pgm", "tif", "npy", "npz"] {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join(format!("1_depth.{ending}"));
        match ending {
            "npy" => fs::write(&path, &array).unwrap(),
            "npz" => fs::write(&path, npz(&[("depth.npy", &array)])).unwrap(),
            "pgm" => fs::write(&path, pgm(65_535, &codes)).unwrap(),
            _ => picture.save(&path).unwrap(),
        }
        // What no file states is assumed of the pictures that cameras write.
        let is_assumed = ["png", "pgm"].contains(&ending);
        let check = |metres: f32, is_sure: bool| match depth_file::read(&path, &Options::default(), MAP_PX) {
            Ok(file) if is_sure || is_assumed => assert!((file.map.metres[0] - metres).abs() < 1e-4, "{ending}"),
            found => assert_says(found, &[ending, "whole numbers of an unknown unit"]),
        };
        check(3.0, false);
        image::RgbImage::from_fn(4, 2, |x, y| [x as u8 * 50, y as u8, 9].into())
            .save(dir.path().join("1.jpg"))
            .unwrap();
        check(15.0, false);
        fs::write(dir.path().join("transforms.json"), r#"{"integer_depth_scale": 0.0005}"#).unwrap();
        check(7.5, true);
    }
}

#[test]
fn what_is_transparent_in_a_map_is_unknown() {
    let options = Options { scale: Some(1000.0), ..Options::default() };
    let picture = ImageBuffer::<Rgba<u16>, Vec<u16>>::from_fn(4, 2, |x, y| {
        let code = CODES[(4 * y + x) as usize];
        // What is hidden may have any colour.
        if x == 1 { Rgba([9000, 50, code, 0]) } else { Rgba([code, code, code, u16::MAX]) }
    });
    let dir = TempDir::new().unwrap();
    for name in ["map.png", "map.tif"] {
        let path = dir.path().join(name);
        picture.save(&path).unwrap();
        let found = metres(&path, options);
        assert_eq!((found[0], found[1], found[2], found[5]), (1.0, 0.0, 1.4, 0.0), "{name}");
    }
    let (scene, path) = pair("1.png");
    picture.save(&path).unwrap();
    let inverse = RecordingOptions { depth_unit: DepthUnit::Inverse, ..RecordingOptions::default() };
    let found = depth_of(&scene.open_with(&inverse).unwrap(), 0).unwrap().metres;
    assert!(found[1] == 0.0 && found[0] > 0.0, "{found:?}");
}

#[test]
fn relative_maps_of_a_recording_are_those_of_a_folder() {
    let stretched: Vec<u16> = (0..8).map(|k| (k * 65_535 / 7) as u16).collect();
    let (scene, path) = pair("1.png");
    let save = |codes: &[u16]| {
        ImageBuffer::<Luma<u16>, _>::from_raw(4, 2, codes.to_vec()).unwrap().save(&path).unwrap();
    };
    save(&stretched);
    let folder = |invalid: Option<f32>| {
        let options = Options { unit: Some(DepthUnit::Inverse), invalid, ..Options::default() };
        let (maps, notes) = MapSequence::open(&scene.path("depth"), Pictured::Frames(Some(1)), None, options).unwrap();
        assert!(notes.iter().all(|note| !note.contains("millimetres")), "{notes:?}");
        maps.read(0, MAP_PX).unwrap().map.metres
    };
    let recorded = |invalid: Option<u16>| {
        let options = RecordingOptions { depth_unit: DepthUnit::Inverse, depth_invalid: invalid, ..Default::default() };
        depth_of(&scene.open_with(&options).unwrap(), 0).unwrap().metres
    };
    let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a / b - 1.0).abs() < 1e-3);
    let (found, expected) = (folder(None), recorded(None));
    assert!(near(&found, &expected) && found.iter().all(|&metres| metres > 0.0), "{found:?} and {expected:?}");
    let last = (folder(Some(65_535.0))[7], recorded(Some(65_535))[7]);
    assert_eq!(last, (0.0, 0.0), "the number that means unknown");
    // Colours have no order.
    image::RgbImage::from_fn(4, 2, |x, y| [60 * x as u8, 200, 90 * y as u8].into()).save(&path).unwrap();
    let options = RecordingOptions { depth_unit: DepthUnit::Inverse, ..RecordingOptions::default() };
    assert_says(depth_of(&scene.open_with(&options).unwrap(), 0), &["1.png", "a picture in colours is not depth"]);
}

#[test]
fn a_faulty_scale_is_refused_for_one_map_as_for_a_recording() {
    let (scene, path) = pair("1.png");
    ImageBuffer::<Luma<u16>, _>::from_raw(4, 2, CODES.to_vec()).unwrap().save(&path).unwrap();
    for (text, says) in [
        (
            r#"{"2": {"depth_scale": 0.1}, "3": {"depth_scale": 0.2}}"#,
            "depth_scale is 0.1 for picture 2, but 0.2 for 3",
        ),
        (r#"{"1": {"depth_scale": 0}}"#, "not a scale > 0"),
        ("{", "scene_camera.json"),
    ] {
        scene.write("scene_camera.json", text);
        assert_says(scene.open(), &["scene_camera.json", says, "--depth-scale"]);
        assert_says(
            depth_file::read(&path, &Options::default(), MAP_PX),
            &["scene_camera.json", says, "--depth-scale"],
        );
        let given = Options { scale: Some(1000.0), ..Options::default() };
        assert_eq!(metres(&path, given)[0], 1.0, "an option has priority");
    }
    scene.write("scene_camera.json", r#"{"1": {"depth_scale": 0.1}, "2": {"depth_scale": 0.2}}"#);
    assert_eq!(metres(&path, Options::default())[0], 0.1, "its own");
    assert_says(scene.open(), &["all need one"]);
}

#[test]
fn the_name_of_what_is_read_counts_before_that_of_its_file_and_folder() {
    let numbers = CODES.map(|code| f32::from(code) / 1000.0);
    let dir = TempDir::new().unwrap();
    let read = |name: &str| depth_file::read(&dir.path().join(name), &Options::default(), MAP_PX).unwrap();
    // A layer or array of depth in a file of any name.
    exr(&dir.path().join("room_inv.exr"), &[&[("Z", &numbers)]]);
    exr(&dir.path().join("disp.exr"), &[&[("ViewLayer.Depth.Z", &numbers)]]);
    let array = npy("<f4", false, "2, 4", &bytes_of(&numbers));
    fs::write(dir.path().join("room_inv.npz"), npz(&[("depth.npy", &array)])).unwrap();
    for name in ["room_inv.exr", "disp.exr", "room_inv.npz"] {
        assert_eq!((read(name).map.metres, read(name).distances), (numbers.to_vec(), Distances::Metres), "{name}");
    }
    // A layer of disparity alone.
    exr(&dir.path().join("a.exr"), &[&[("disparity", &numbers)]]);
    assert_eq!(read("a.exr").distances, Distances::Relative);
    // A number says nothing, and its folder does.
    fs::create_dir(dir.path().join("disp_occ_0")).unwrap();
    let map = ImageBuffer::<Luma<u16>, _>::from_raw(4, 2, CODES.to_vec()).unwrap();
    map.save(dir.path().join("disp_occ_0/000000_10.png")).unwrap();
    let file = read("disp_occ_0/000000_10.png");
    assert_eq!(file.distances, Distances::Relative);
    assert!(file.notes.iter().any(|note| note.contains("holds disparity by its name")), "{:?}", file.notes);
    assert!(file.map.metres[7] < file.map.metres[0], "large is near");
}

#[test]
fn a_file_of_several_pictures_says_that_the_first_is_used() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("pages.tif");
    for (kinds, is_said) in [(&[0_u32][..], false), (&[0, 0], true), (&[0, 1], false), (&[0, 4], false)] {
        let mut encoder = tiff::encoder::TiffEncoder::new(fs::File::create(&path).unwrap()).unwrap();
        for &kind in kinds {
            let mut page = encoder.new_image::<tiff::encoder::colortype::RGB8>(4, 2).unwrap();
            page.encoder().write_tag(tiff::tags::Tag::NewSubfileType, kind).unwrap();
            page.write_data(&[9; 24]).unwrap();
        }
        drop(encoder);
        let notes = Photo::read(&path).unwrap().notes;
        assert_eq!(notes.iter().any(|note| note.contains("has several pictures")), is_said, "{kinds:?}: {notes:?}");
    }
}

/// EXIF with one entry, or with a chain of directories to the mark of Adobe RGB.
fn exif_of(orientation: Option<u16>) -> Vec<u8> {
    let directory = |tag: u16, kind: u16, count: u32, value: [u8; 4]| {
        [&1_u16.to_le_bytes()[..], &tag.to_le_bytes(), &kind.to_le_bytes(), &count.to_le_bytes(), &value, &[0; 4]]
            .concat()
    };
    let long = |tag, at: u32| directory(tag, 4, 1, at.to_le_bytes());
    let directories = match orientation {
        Some(orientation) => directory(0x112, 3, 1, u32::from(orientation).to_le_bytes()),
        None => [long(0x8769, 26), long(0xA005, 44), directory(1, 2, 4, *b"R03\0")].concat(),
    };
    [&b"II*\0\x08\0\0\0"[..], &directories].concat()
}

#[test]
fn the_colours_of_a_camera_without_a_profile_are_those_that_its_exif_names() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.jpg");
    let mut picture = bokehcam::frame::ColorImage::new(8, 8);
    picture.rgb.as_chunks_mut::<3>().0.fill([99, 175, 75]);
    for (exif, shown) in [(exif_of(Some(1)), [99, 175, 75]), (exif_of(None), [0, 177, 64])] {
        write_photo(&path, &picture, &PhotoMetadata { exif: Some(exif), ..PhotoMetadata::default() }, true).unwrap();
        let color = read_color(&path).unwrap();
        assert!(color.rgb[..3].iter().zip(shown).all(|(a, b): (&u8, u8)| a.abs_diff(b) <= 3), "{:?}", &color.rgb[..3]);
        // The result states them by a profile.
        let again = dir.path().join("a.png");
        Photo::read(&path).unwrap().write(&again, true).unwrap();
        let color = read_color(&again).unwrap();
        assert!(color.rgb[..3].iter().zip(shown).all(|(a, b)| a.abs_diff(b) <= 3), "{:?}, again", &color.rgb[..3]);
    }
}

#[test]
fn a_tag_behind_the_pixels_turns_a_picture_in_a_folder_too() {
    let scene = Scene::new();
    ["rgb", "depth"].iter().for_each(|folder| fs::remove_dir(scene.path(folder)).unwrap());
    scene.color("1.png", MAP_PX, 9);
    let before_end = fs::read(scene.path("1.png")).unwrap().len() - 12;
    insert_chunk(&scene.path("1.png"), before_end, b"eXIf", &exif_of(Some(6)));
    assert_eq!(Photo::read(&scene.path("1.png")).unwrap().color.size(), (2, 4));
    assert_eq!(scene.open().unwrap().size(), (2, 4));
}

/// Inserts a chunk into a PNG.
fn insert_chunk(path: &Path, at: usize, name: &[u8; 4], data: &[u8]) {
    let chunk = [&name[..], data].concat();
    let whole = [&(data.len() as u32).to_be_bytes()[..], &chunk, &crc(&chunk).to_be_bytes()].concat();
    let mut file = fs::read(path).unwrap();
    file.splice(at..at, whole);
    fs::write(path, file).unwrap();
}

#[test]
fn a_profile_has_priority_over_a_gamma_beside_it_in_the_result_too() {
    let dir = TempDir::new().unwrap();
    let [path, again] = ["a.png", "again.png"].map(|name| dir.path().join(name));
    let mut picture = bokehcam::frame::ColorImage::new(8, 8);
    picture.rgb.as_chunks_mut::<3>().0.fill([99, 175, 75]);
    let profile = moxcms::ColorProfile::new_adobe_rgb().encode().unwrap();
    write_photo(&path, &picture, &PhotoMetadata { icc_profile: Some(profile), ..PhotoMetadata::default() }, true)
        .unwrap();
    // After the header, as ImageMagick writes it whatever the profile is.
    insert_chunk(&path, 33, b"gAMA", &45_455_u32.to_be_bytes());
    Photo::read(&path).unwrap().write(&again, true).unwrap();
    for path in [&path, &again] {
        let color = read_color(path).unwrap();
        assert!(color.rgb[..3].iter().zip([0, 177, 64]).all(|(a, b)| a.abs_diff(b) <= 3), "{:?}", &color.rgb[..3]);
    }
    // Colours that are converted are stated no more.
    write_photo(&path, &picture, &PhotoMetadata::default(), true).unwrap();
    insert_chunk(&path, 33, b"gAMA", &100_000_u32.to_be_bytes());
    let (shown, metadata) = bokehcam_media::recording::still::read_photo(&path).unwrap();
    write_photo(&again, &shown, &metadata, true).unwrap();
    assert!(shown != picture && read_color(&again).unwrap() == shown);
}

/// The checksum of a PNG's chunk.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 })
    })
}
