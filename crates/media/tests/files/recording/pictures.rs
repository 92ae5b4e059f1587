//! Folders of pictures without lists, and patterns of their names.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;

use bokehcam::frame::ColorImage;
use bokehcam_media::recording::pictures::{input_folders, pattern_folder};
use bokehcam_media::recording::still::{read_color, write_photo};
use bokehcam_media::recording::{Options, PhotoMetadata, Recording, RecordingError, Unpaired, depth_file};
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::{SIZE, Scene, assert_says, color_of, depth_of, times_ns};

/// Creates a folder `take` in a scene with pictures of these names, whose shade is their position.
fn with_pictures(names: &[&str]) -> Scene {
    let scene = Scene::new();
    fs::create_dir(scene.path("take")).unwrap();
    for (shade, name) in (0..).zip(names) {
        scene.color(&format!("take/{name}"), SIZE, shade);
    }
    scene
}

fn add_maps(scene: &Scene, folder: &str, names: &[&str]) {
    fs::create_dir_all(scene.path(folder)).unwrap();
    for (index, name) in (1..).zip(names) {
        scene.depth(&format!("{folder}/{name}"), SIZE, 1000 * index);
    }
}

fn open(scene: &Scene, name: &str) -> Result<Recording, RecordingError> {
    Recording::open(&scene.path(name), &Options::default())
}

fn shades(recording: &Recording) -> Vec<u8> {
    (0..recording.len()).map(|index| color_of(recording, index).unwrap().rgb[0]).collect()
}

#[test]
fn pictures_are_in_natural_order() {
    for names in [
        &["1.png", "2.png", "10.png"][..],
        &["depth-of-field.png", "frame-1.color.png", "left-hand.png"],
        &["IMG_0009.PNG", "IMG_0010.png", "img_0011.png"],
        &["anna.png", "berta.png", "clara 2.png", "clara 10.png"],
    ] {
        let scene = with_pictures(names);
        scene.write("take/notes.txt", "no list");
        scene.write("take/.hidden.png", "no picture");
        let recording = open(&scene, "take").unwrap();
        assert_eq!((recording.layout(), recording.has_depth()), ("pictures", false));
        assert_eq!(shades(&recording), (0..names.len() as u8).collect::<Vec<_>>());
        assert_eq!(times_ns(&recording)[..3], [0, 33_333_333, 66_666_666]);
        let options = Options { period_ns: Some(40_000_000), ..Options::default() };
        assert_eq!(Recording::open(&scene.path("take"), &options).unwrap().period_ns(), 40_000_000);
        for period_ns in [0, u64::MAX] {
            let options = Options { period_ns: Some(period_ns), ..Options::default() };
            let recording = Recording::open(&scene.path("take"), &options).unwrap();
            assert!(times_ns(&recording).is_sorted_by(|one, next| one < next) && recording.period_ns() > 0);
        }
    }
}

#[test]
fn masks_beside_their_pictures_are_no_frames() {
    let scene = with_pictures(&["1.png", "1-mask.png", "2.png", "2.mask.png", "face-mask.png"]);
    assert_eq!(shades(&open(&scene, "take").unwrap()), [0, 2, 4]);
    add_maps(&scene, "take", &["1-depth.png", "2-depth.png"]);
    let recording = open(&scene, "take").unwrap();
    assert_eq!((recording.len(), recording.has_depth(), shades(&recording)), (2, true, vec![0, 2]));
}

#[test]
fn a_pattern_chooses_names() {
    let scene = with_pictures(&["IMG_0007.png", "IMG_0008.png", "IMG_0100.png", "IMG_12345.png", "IMG_1.png", "x.png"]);
    for (pattern, expected) in [
        ("take/IMG_%04d.png", &[0, 1, 2, 3][..]),
        ("take/IMG_%d.png", &[4, 3]),
        ("take/IMG_00%02d.png", &[0, 1]),
        ("take/IMG_%05d.png", &[3]),
    ] {
        let recording = open(&scene, pattern).unwrap();
        assert_eq!(shades(&recording), expected, "{pattern}");
        assert_eq!(recording.layout(), "pictures");
        assert_eq!(pattern_folder(&scene.path(pattern)), Some(scene.path("take").as_path()));
    }
    assert_says(open(&scene, "take/IMG_%04d.jpg"), &["take: no picture has a name like IMG_%04d.jpg"]);
    for other in ["none/IMG_%04d.png", "take/IMG_%s.png", "take/IMG_%4d.png", "take/%d_%d.png", "take"] {
        assert_eq!(pattern_folder(&scene.path(other)), None, "{other}");
    }
    // A file of this very name is no pattern.
    scene.write("take/%d.png", "");
    assert_eq!(pattern_folder(&scene.path("take/%d.png")), None);
}

#[test]
fn maps_beside_the_pictures_are_their_depth() {
    let colors = ["IMG_1.png", "IMG_2.png"];
    for (folder, maps) in [
        ("take/depth", ["IMG_1.png", "IMG_2.png"]),
        ("take/depths", ["1.png", "2.png"]),
        ("take-depth", ["IMG_0001.png", "IMG_0002.png"]),
        ("take_depth", ["d1.png", "d2.png"]),
        ("take", ["IMG_1-depth.png", "IMG_2-depth.png"]),
        ("take", ["IMG_1.depth.png", "IMG_2.depth.png"]),
    ] {
        let scene = with_pictures(&colors);
        add_maps(&scene, folder, &maps);
        for name in ["take", "take/IMG_%d.png"] {
            let recording = open(&scene, name).unwrap();
            assert_eq!((recording.len(), recording.has_depth()), (2, true), "{folder}");
            assert_eq!(shades(&recording), [0, 1]);
            assert_eq!([0, 1].map(|index| depth_of(&recording, index).unwrap().metres[0]), [1.0, 2.0]);
            let inputs = input_folders(&scene.path(name));
            assert!(inputs.contains(&scene.path("take")) && inputs.contains(&scene.path(folder)), "{inputs:?}");
        }
    }
    // The folder beside a folder that is named as part of a recording.
    let scene = with_pictures(&colors);
    fs::rename(scene.path("take"), scene.path("images")).unwrap();
    add_maps(&scene, "depths", &["2.png", "3.png"]);
    let recording = open(&scene, "images").unwrap();
    assert_eq!((recording.len(), recording.unpaired()), (1, Unpaired { color: 1, depth: 1, right: 0 }));
    // A relative name finds the same.
    assert_eq!(input_folders(Path::new("no/such/folder")), [Path::new("no/such/folder")]);
}

#[test]
fn maps_that_do_not_belong_leave_the_pictures_without_depth() {
    let scene = with_pictures(&["1.png", "2.png"]);
    add_maps(&scene, "take-depth", &["7.png"]);
    assert_eq!(open(&scene, "take").map(|recording| (recording.len(), recording.has_depth())).unwrap(), (2, false));
    // A folder of another name has nothing to do with a folder `depth` beside it.
    let scene = with_pictures(&["1.png", "2.png"]);
    add_maps(&scene, "depth", &["1.png", "2.png"]);
    assert!(!open(&scene, "take").unwrap().has_depth());
    // Maps do not lead out of their folder by a link either.
    let scene = with_pictures(&["1.png"]);
    add_maps(&scene, "elsewhere", &["1.png"]);
    fs::create_dir(scene.path("take-depth")).unwrap();
    symlink(scene.path("elsewhere/1.png"), scene.path("take-depth/1.png")).unwrap();
    assert_says(
        depth_of(&open(&scene, "take").unwrap(), 0),
        &["take-depth/1.png: ", "leads outside", "--follow-links"],
    );
}

#[test]
fn all_pictures_need_one_size() {
    for (at, name) in [(1, "2.png"), (2, "3.png")] {
        let scene = with_pictures(&["1.png", "2.png", "3.png"]);
        scene.color(&format!("take/{name}"), (SIZE.0, SIZE.1 + 1), 9);
        assert_says(open(&scene, "take"), &[&format!("take/{name}: the picture is 24x17"), "24x16", "the same size"]);
        let keep_going = Options { keep_going: true, ..Options::default() };
        let recording = Recording::open(&scene.path("take"), &keep_going).unwrap();
        assert_says(color_of(&recording, at), &[name, "the same size"]);
        assert!(color_of(&recording, 0).is_ok());
    }
    // A damaged picture is told when it is read.
    let scene = with_pictures(&["1.png", "2.png"]);
    scene.write("take/1.png", "damaged");
    let recording = open(&scene, "take").unwrap();
    assert_says(color_of(&recording, 0), &["take/1.png: not a PNG, JPEG, TIFF"]);
    assert!(color_of(&recording, 1).is_ok());
}

#[test]
fn photos_of_a_folder_are_turned_as_a_single_one_is() {
    // One directory with one entry: the tag 0x112, a 16-bit number.
    let exif =
        |orientation: u8| [&b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0"[..], &[orientation], &[0; 6]].concat();
    let mut stored = ColorImage::new(SIZE.0, SIZE.1);
    stored.rgb.iter_mut().enumerate().for_each(|(at, byte)| *byte = (at / 3) as u8);
    for orientation in 1..=8 {
        let scene = with_pictures(&[]);
        for name in ["IMG_0001.jpg", "IMG_0002.png"] {
            let metadata = PhotoMetadata { exif: Some(exif(orientation)), ..PhotoMetadata::default() };
            write_photo(&scene.path(&format!("take/{name}")), &stored, &metadata, false).unwrap();
        }
        let upright = if orientation < 5 { SIZE } else { (SIZE.1, SIZE.0) };
        for source in ["take", "take/IMG_%04d.jpg"] {
            let recording = open(&scene, source).unwrap();
            assert_eq!(recording.size(), upright, "{orientation}");
            let single = read_color(&scene.path("take/IMG_0001.jpg")).unwrap();
            assert!(color_of(&recording, 0).unwrap() == single && single.size() == upright);
        }
        // As in the picture, the map's rows are those of the upright view.
        scene.depth("take/IMG_0001-depth.png", upright, 2000);
        scene.depth("take/IMG_0002-depth.png", upright, 3000);
        let recording = open(&scene, "take").unwrap();
        assert_eq!(depth_of(&recording, 1).unwrap().metres[0], 3.0);
        assert!(color_of(&recording, 1).unwrap() == read_color(&scene.path("take/IMG_0002.png")).unwrap());
        // A map with a tag is turned as a single one is.
        let map = scene.path("take/IMG_0002-depth.png");
        let mut encoder = PngEncoder::new(fs::File::create(&map).unwrap());
        encoder.set_exif_metadata(exif(orientation)).unwrap();
        let units: Vec<u8> = (1..=SIZE.0 * SIZE.1).flat_map(|unit| (unit as u16).to_ne_bytes()).collect();
        encoder.write_image(&units, SIZE.0, SIZE.1, ExtendedColorType::L16).unwrap();
        let options = depth_file::Options { scale: Some(1000.0), ..depth_file::Options::default() };
        let single = depth_file::read(&map, &options, upright).unwrap().map;
        let found = depth_of(&open(&scene, "take").unwrap(), 1).unwrap();
        assert!(found.size() == single.size() && found.metres == single.metres, "{orientation}");
        scene.color("take/IMG_0003.png", SIZE, 9);
        let others = open(&scene, "take");
        match orientation {
            5.. => assert_says(others, &["IMG_0003.png: the picture is 24x16", "16x24", "the same size"]),
            _ => assert!(others.is_ok()),
        }
    }
}

/// A faulty recording of another kind keeps its message, and a folder without pictures is nothing.
#[test]
fn pictures_are_the_last_resort() {
    let scene = with_pictures(&["1.png"]);
    scene.write("take/depth.txt", "1.0 1.png\n");
    assert_says(open(&scene, "take"), &["the list rgb.txt is missing"]);
    scene.remove("take/depth.txt");
    fs::create_dir(scene.path("take/image_2")).unwrap();
    assert_says(open(&scene, "take"), &["image_3 is missing beside image_2"]);
    assert_says(open(&scene, "rgb"), &["not a recording"]);
}
