//! One rule for each question that a file leaves open, whatever its container: which candidate, which window, which unit,
//! which colours, what is transparent, which time.

use std::fs;
use std::path::Path;

use bokehcam::frame::ColorImage;
use bokehcam_media::recording::depth_file::{self, Distances, Options};
use bokehcam_media::recording::still::{PhotoFormat, read_color, write_photo};
use bokehcam_media::recording::{Photo, PhotoMetadata, mask_file};
use image::codecs::bmp::BmpEncoder;
use image::{ExtendedColorType, ImageBuffer, Luma, Rgba, RgbaImage};
use moxcms::ColorProfile;
use tempfile::TempDir;

use super::depth_files::encode::{bytes_of, exr, exr_in_window, npy, npz};
use super::{SIZE, Scene, assert_says, depth_of, times_ns};

/// Size of the maps here, and numbers that may be distances, disparities or nearness.
const MAP_PX: (u32, u32) = (4, 2);
const NUMBERS: [f32; 8] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 1.5, 3.0];
const OTHERS: [f32; 8] = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];

fn read(path: &Path) -> Result<depth_file::DepthFile, bokehcam_media::recording::RecordingError> {
    depth_file::read(path, &Options::default(), MAP_PX)
}

#[test]
fn the_candidate_is_the_one_that_means_depth() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.exr");
    let vector = |layer: &str| ["X", "Y", "Z"].map(|axis| format!("{layer}.{axis}"));
    for (depth, beside) in [
        ("Z", vector("N")),
        ("Z", vector("P")),
        ("ViewLayer.Depth.Z", vector("Background.Normal")),
        ("ViewLayer.Depth.Z", vector("ViewLayer.Denoising Normal")),
        ("ViewLayer.Depth.Z", ["ViewLayer.Denoising Depth.Z", "ViewLayer.Mist.Z", "A"].map(str::to_owned)),
        ("VRayZDepth", ["R", "G", "B"].map(str::to_owned)),
        ("depth.V", ["alpha.V", "mask.V", "confidence.V"].map(str::to_owned)),
    ] {
        let others = beside.iter().map(|name| (&**name, &OTHERS[..]));
        let channels: Vec<(&str, &[f32])> = others.chain([(depth, &NUMBERS[..])]).collect();
        exr(&path, &[&channels]);
        assert_eq!(read(&path).unwrap().map.metres, NUMBERS, "{depth} beside {beside:?}");
        exr(&path, &[&channels[..3]]);
        if beside[2].contains(['N', 'P']) {
            assert_says(read(&path), &["a.exr", "without a layer of depth"]);
        }
    }
    // A layer of equal channels beside colours.
    let zdepth = ["ZDepth.R", "ZDepth.G", "ZDepth.B"].map(|name| (name, &NUMBERS[..]));
    let unequal = [("R", &NUMBERS[..]), ("G", &OTHERS[..]), ("B", &OTHERS[..])];
    exr(&path, &[&[&zdepth[..], &unequal[..]].concat()]);
    assert_eq!(read(&path).unwrap().map.metres, NUMBERS);

    let path = dir.path().join("a.npz");
    let [map, other] = [&NUMBERS, &OTHERS].map(|numbers| npy("<f4", false, "2, 4", &bytes_of(numbers)));
    for (depth, beside) in [
        ("depth", "confidence"),
        ("depths", "depth_mask"),
        ("x_depth", "normals"),
        ("metric_depth", "arr_0"),
        ("arr_1", "valid"),
    ] {
        fs::write(&path, npz(&[(&format!("{beside}.npy"), &other), (&format!("{depth}.npy"), &map)])).unwrap();
        assert_eq!(read(&path).unwrap().map.metres, NUMBERS, "{depth} beside {beside}");
    }
    fs::write(&path, npz(&[("normals.npy", &other)])).unwrap();
    assert_says(read(&path), &["a.npz", "normals", "without an array of depth"]);
    let video = npy("<f4", false, "3, 2, 8", &bytes_of(&[0.0; 48]));
    fs::write(&path, npz(&[("depths.npy", &video)])).unwrap();
    assert_says(read(&path), &["a.npz", "3 maps of 8x2"]);
    let whole: Vec<u8> = NUMBERS.iter().flat_map(|metres| ((1000.0 * metres) as u64).to_le_bytes()).collect();
    fs::write(dir.path().join("u.npy"), npy("<u8", false, "2, 4", &whole)).unwrap();
    let options = Options { scale: Some(1000.0), ..Options::default() };
    assert_eq!(depth_file::read(&dir.path().join("u.npy"), &options, MAP_PX).unwrap().map.metres, NUMBERS);
}

#[test]
fn a_map_is_placed_in_its_display_window() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("a.exr");
    // Data of 4x2 at (column, row), in a display of (columns, rows): what each pixel of the display shows.
    for (at, display, shown) in [
        ((0, 0), (4, 2), NUMBERS.to_vec()),
        ((-1, 0), (2, 2), vec![1.0, 2.0, 16.0, 1.5]),
        ((1, 1), (6, 3), vec![0., 0., 0., 0., 0., 0., 0., 0.5, 1., 2., 4., 0., 0., 8., 16., 1.5, 3., 0.]),
        ((0, -1), (4, 1), vec![8.0, 16.0, 1.5, 3.0]),
    ] {
        exr_in_window(&path, &[("Z", &NUMBERS)], at, display);
        let file = depth_file::read(&path, &Options::default(), display).unwrap();
        assert_eq!((file.map.size(), file.map.metres), (display, shown), "{at:?} in {display:?}");
    }
}

#[test]
fn the_unit_is_what_the_name_and_the_neighbours_say() {
    let dir = TempDir::new().unwrap();
    let bottom_first = bytes_of(&[&NUMBERS[4..], &NUMBERS[..4]].concat());
    let pfm = [b"Pf\n4 2\n-1.0\n", &bottom_first[..]].concat();
    let array = npy("<f4", false, "2, 4", &bytes_of(&NUMBERS));
    let nearest_by = |distance: fn(f32) -> f32, map: &[f32]| {
        let index = |numbers: &[f32]| (0..8).min_by(|&a, &b| numbers[a].total_cmp(&numbers[b])).unwrap();
        index(map) == index(&NUMBERS.map(distance))
    };
    for (stem, is_distance) in
        [("depth", true), ("map", true), ("disp0", false), ("left_disp", false), ("inv_depth", false)]
    {
        for (ending, content) in
            [("pfm", pfm.clone()), ("npy", array.clone()), ("npz", npz(&[(&format!("{stem}.npy"), &array)]))]
        {
            let path = dir.path().join(format!("{stem}.{ending}"));
            fs::write(&path, content).unwrap();
            let file = read(&path).unwrap();
            let expected = if is_distance { Distances::Metres } else { Distances::Relative };
            assert_eq!(file.distances, expected, "{stem}.{ending}");
            let near = if is_distance { |number: f32| number } else { |number: f32| -number };
            assert!(nearest_by(near, &file.map.metres), "{stem}.{ending}: {:?}", file.map.metres);
            let is_told = file.notes.iter().any(|note| note.contains("by its name"));
            assert_eq!(is_told, !is_distance, "{:?}", file.notes);
            fs::remove_file(path).unwrap();
        }
    }
    // The calibration of a pair beside its disparities gives metres.
    fs::write(dir.path().join("calib.txt"), "cam0=[100 0 2; 0 100 1; 0 0 1]\ndoffs=0\nbaseline=100\n").unwrap();
    let path = dir.path().join("disp0.pfm");
    fs::write(&path, pfm).unwrap();
    let file = read(&path).unwrap();
    assert_eq!((file.map.metres[1], file.distances), (10.0, Distances::Metres));
}

#[test]
fn a_map_has_the_scale_of_its_folder_alone_and_in_a_sequence() {
    for (file, text, metres) in [
        ("transforms.json", r#"{"integer_depth_scale": 0.0001525902189669642, "frames": []}"#, 1.0 / 6553.5),
        ("transforms.json", r#"{"depth_unit_scale_factor": 0.0001}"#, 0.0001),
        ("transforms.json", r#"{"fl_x": 500.0}"#, 0.001),
        ("cam_params.json", r#"{"camera": {"scale": 2000}}"#, 0.0005),
        ("notes.txt", "", 0.001),
    ] {
        let scene = Scene::new();
        scene.write(file, text);
        scene.color("rgb/1.png", SIZE, 1);
        scene.depth("depth/1.png", SIZE, 15_000);
        let recorded = depth_of(&scene.open().unwrap(), 0).unwrap().metres[0];
        let single = depth_file::read(&scene.path("depth/1.png"), &Options::default(), SIZE);
        let maps = Options { unit: None, ..Options::default() };
        assert!((recorded - 15_000.0 * metres).abs() < 1e-3, "{text}: {recorded}");
        // One distance all over is refused without a statement; here the folder states it.
        assert_eq!(single.unwrap().map.metres[0], recorded, "{text}");
        let unstated = ImageBuffer::<Luma<u16>, _>::from_fn(SIZE.0, SIZE.1, |x, _| [15_000 + x as u16].into());
        let path = scene.path("alone.png");
        unstated.save(&path).unwrap();
        assert_eq!(depth_file::read(&path, &maps, SIZE).unwrap().map.metres[0], 3.0, "of no recording");
    }
}

#[test]
fn pictures_and_maps_are_told_apart_and_paired() {
    let times = |n: u32, step: u32| format!("{:07}-{:012}", n + 1, n * step);
    type Name = Box<dyn Fn(u32) -> String>;
    let names: [[Name; 2]; 5] = [
        [
            Box::new(move |n| format!("image/{}.jpg", times(n, 33_369))),
            Box::new(move |n| format!("depth/{}.png", times(n, 32_169))),
        ],
        [Box::new(|n| format!("{n:05}_colors.png")), Box::new(|n| format!("{n:05}_depth.png"))],
        [Box::new(|n| format!("{n}.png")), Box::new(|n| format!("{n}_depth.png"))],
        [Box::new(|n| format!("{n}.jpg")), Box::new(|n| format!("{n}.png"))],
        [Box::new(|n| format!("frame_{n:05}.jpg")), Box::new(|n| format!("depth_{n:05}.png"))],
    ];
    for [color, depth] in names {
        let scene = Scene::new();
        fs::create_dir(scene.path("image")).unwrap();
        for n in 0..4 {
            scene.color(&color(n), SIZE, 9);
            scene.depth(&depth(n), SIZE, 1500 + n as u16);
            // Confidence, as beside the frames of a phone.
            image::GrayImage::from_pixel(SIZE.0, SIZE.1, [2].into())
                .save(scene.path(&format!("conf_{n:05}.png")))
                .unwrap();
        }
        if color(0).starts_with("image") {
            (0..4).for_each(|n| scene.remove(&format!("conf_{n:05}.png")));
        } else {
            ["image", "rgb", "depth"].iter().for_each(|folder| fs::remove_dir(scene.path(folder)).unwrap());
        }
        let recording = scene.open().unwrap();
        assert_eq!((recording.len(), recording.has_depth()), (4, true), "{} {}", color(0), depth(0));
        for n in 0..4 {
            let metres = depth_of(&recording, n).unwrap().metres[0];
            assert!((metres - (1.5 + n as f32 / 1000.0)).abs() < 1e-5, "{}: {metres}", color(0));
        }
    }
    // Maps of 8 bits have no unit: they are no pictures either.
    let scene = Scene::new();
    ["rgb", "depth"].iter().for_each(|folder| fs::remove_dir(scene.path(folder)).unwrap());
    for n in 0..3 {
        scene.color(&format!("{n}.jpg"), SIZE, 9);
        image::GrayImage::from_pixel(SIZE.0, SIZE.1, [n].into()).save(scene.path(&format!("{n}.png"))).unwrap();
    }
    let recording = scene.open().unwrap();
    assert_eq!((recording.len(), recording.has_depth()), (3, false));
}

#[test]
fn raw_drives_of_kitti_have_their_dates_and_the_calibration_of_their_day() {
    let scene = Scene::new();
    for camera in ["image_02", "image_03"] {
        fs::create_dir_all(scene.path(&format!("drive/{camera}/data"))).unwrap();
        (0..3).for_each(|n| scene.color(&format!("drive/{camera}/data/{n:010}.png"), SIZE, n));
        let dates = ["2011-09-26 23:59:59.900000000", "2011-09-27 00:00:00.003", "2011-09-27 00:00:00.308000001"];
        scene.write(&format!("drive/{camera}/timestamps.txt"), dates.join("\n"));
    }
    scene.write(
        "calib_cam_to_cam.txt",
        "P_rect_02: 100 0 12 0 0 100 8 0 0 0 1 0\nP_rect_03: 100 0 12 -20 0 100 8 0 0 0 1 0\n",
    );
    let recording = bokehcam_media::recording::Recording::open(&scene.path("drive"), &Default::default()).unwrap();
    assert_eq!((times_ns(&recording), recording.has_times()), (vec![0, 103_000_000, 408_000_001], true));
    let geometry = format!("{:?}", recording.stereo_geometry());
    assert!(geometry.contains("Rectified") && geometry.contains("baseline_m: 0.2"), "{geometry}");
}

/// A picture of one colour, with this profile or these chunks.
fn save_color(path: &Path, rgb: [u8; 3], metadata: &PhotoMetadata) {
    let mut image = ColorImage::new(8, 8);
    image.rgb.as_chunks_mut::<3>().0.fill(rgb);
    write_photo(path, &image, &metadata.clone().for_format(format_of(path)), true).unwrap();
}

fn format_of(path: &Path) -> PhotoFormat {
    bokehcam_media::recording::still::photo_format(path).unwrap()
}

#[test]
fn colours_are_shown_in_srgb_and_kept_in_their_space() {
    let dir = TempDir::new().unwrap();
    let adobe = ColorProfile::new_adobe_rgb().encode().unwrap();
    let profile = |bytes: Vec<u8>| PhotoMetadata { icc_profile: Some(bytes), ..PhotoMetadata::default() };
    let chunks = |name: &[u8; 4], data: &[u8]| PhotoMetadata {
        png_chunks: vec![(*name, data.to_vec())],
        ..PhotoMetadata::default()
    };
    for (name, metadata, stored, shown) in [
        ("a.png", profile(adobe.clone()), [99, 175, 75], [0, 177, 64]),
        ("a.jpg", profile(adobe.clone()), [99, 175, 75], [0, 177, 64]),
        ("a.tif", profile(adobe.clone()), [99, 175, 75], [0, 177, 64]),
        ("a.webp", profile(adobe), [99, 175, 75], [0, 177, 64]),
        // Light of a half is the code 188 of sRGB.
        ("gamma.png", chunks(b"gAMA", &100_000_u32.to_be_bytes()), [128; 3], [188; 3]),
        ("points.png", chunks(b"cICP", &[1, 8, 0, 1]), [128; 3], [188; 3]),
        ("srgb.png", chunks(b"gAMA", &45_455_u32.to_be_bytes()), [128; 3], [128; 3]),
    ] {
        let path = dir.path().join(name);
        save_color(&path, stored, &metadata);
        let near = |a: &[u8], b: [u8; 3]| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 3);
        let color = read_color(&path).unwrap();
        assert!(near(&color.rgb[..3], shown), "{name}: {:?} is shown", &color.rgb[..3]);
        let photo = Photo::read(&path).unwrap();
        let again = dir.path().join(format!("again-{name}"));
        assert!(photo.metadata.png_chunks == metadata.png_chunks, "{name}");
        photo.write(&again, true).unwrap();
        assert!(near(&read_color(&again).unwrap().rgb[..3], shown), "{name}, written again");
        // In another format, the same colours are stated by a profile.
        let other = dir.path().join("other.webp");
        Photo::read(&path).unwrap().write(&other, true).unwrap();
        assert!(
            near(&read_color(&other).unwrap().rgb[..3], shown),
            "{name} as WebP: {:?}",
            read_color(&other).unwrap().rgb
        );
    }
}

#[test]
fn colours_under_alpha_0_are_in_no_picture() {
    let dir = TempDir::new().unwrap();
    // A visible half, and one that hides another colour.
    let picture = RgbaImage::from_fn(8, 4, |x, _| if x < 4 { Rgba([200, 100, 50, 255]) } else { Rgba([1, 2, 3, 0]) });
    for name in ["a.png", "a.webp", "a.tif"] {
        let path = dir.path().join(name);
        picture.save(&path).unwrap();
        let shown = read_color(&path).unwrap();
        assert_eq!((&shown.rgb[9..12], &shown.rgb[12..15]), (&[200, 100, 50][..], &[255; 3][..]), "{name}");
        let photo = Photo::read(&path).unwrap();
        assert!(
            photo.color.rgb.as_chunks::<3>().0.iter().all(|rgb| *rgb == [200, 100, 50]),
            "{name}: {:?}",
            photo.color
        );
        let jpeg = dir.path().join("a.jpg");
        assert_eq!(photo.write(&jpeg, true).unwrap(), ["transparency"]);
        let jpeg = read_color(&jpeg).unwrap();
        assert!(jpeg.rgb[21..24].iter().all(|&code| code > 230), "{name}: {:?}", &jpeg.rgb[21..24]);
    }
}

#[test]
fn masks_may_number_objects() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("mask.png");
    let numbers: Vec<u8> = (0..32).map(|at| [0, 0, 1, 2][at % 4]).collect();
    let expected: Vec<f32> = numbers.iter().map(|&number| f32::from(number > 0)).collect();
    let read = |path: &Path| mask_file::read(path, (8, 4)).unwrap();
    image::GrayImage::from_raw(8, 4, numbers.clone()).unwrap().save(&path).unwrap();
    let grey = read(&path);
    // As DAVIS and VOC write them: a palette whose first colours are black, dark red and dark green.
    let mut encoder = png::Encoder::new(fs::File::create(&path).unwrap(), 8, 4);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(vec![0, 0, 0, 128, 0, 0, 0, 128, 0]);
    encoder.write_header().unwrap().write_image_data(&numbers).unwrap();
    let palette = read(&path);
    let (mut bytes, bright) = (Vec::new(), [[0, 0, 0], [250, 0, 0], [0, 128, 0]]);
    let mut encoder = BmpEncoder::new(&mut bytes);
    encoder.encode_with_palette(&numbers, 8, 4, ExtendedColorType::L8, Some(&bright[..])).unwrap();
    fs::write(dir.path().join("mask.bmp"), bytes).unwrap();
    for file in [grey, palette, read(&dir.path().join("mask.bmp"))] {
        assert_eq!(file.mask.alpha, expected);
        assert!(file.notes[0].contains("numbers objects"), "{:?}", file.notes);
    }
    // A palette of black and white is a mask as any other.
    let mut encoder = png::Encoder::new(fs::File::create(&path).unwrap(), 8, 4);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(vec![255, 255, 255, 0, 0, 0, 0, 0, 0]);
    encoder.write_header().unwrap().write_image_data(&numbers).unwrap();
    let file = read(&path);
    assert_eq!((file.mask.alpha, file.notes.len()), (expected.iter().map(|alpha| 1.0 - alpha).collect(), 0));
    // The largest number of a PGM is any, often that of its last object.
    let path = dir.path().join("mask.pgm");
    for white in [2_u8, 100, 255] {
        fs::write(&path, [format!("P5\n8 4\n{white}\n").as_bytes(), &numbers].concat()).unwrap();
        assert_eq!(read(&path).mask.alpha, expected, "of {white}");
    }
    // Compression makes such codes of black.
    let path = dir.path().join("mask.jpg");
    image::GrayImage::from_pixel(8, 4, [2].into()).save(&path).unwrap();
    assert!(read(&path).mask.alpha.iter().all(|&alpha| alpha < 0.05));
}
