//! Depth maps of photos, in the formats and units of other tools.

pub mod encode;

use std::fs;
use std::io::Write;
use std::path::Path;

use bokehcam::frame::DepthMap;
use bokehcam_media::recording::depth_file::{self, DepthFile, DepthUnit, Distances, Options};
use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage, Rgba, RgbaImage};
use tempfile::TempDir;

use super::assert_says;
use encode::{bytes_of, exr, exr_that_claims, npy, npz, tiff};

type Gray16 = ImageBuffer<Luma<u16>, Vec<u16>>;

/// The size of all maps here.
const SIZE: (u32, u32) = (4, 2);
/// Distances that every format holds exactly, in metres.
const DEPTHS_M: [f32; 8] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 1.5, 3.0];

fn read(path: &Path, options: Options) -> Result<DepthFile, bokehcam_media::recording::RecordingError> {
    depth_file::read(path, &options, SIZE)
}

fn with_unit(unit: DepthUnit) -> Options {
    Options { unit: Some(unit), ..Options::default() }
}

#[test]
fn floats_of_every_format_are_metres() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name);
    let columns: Vec<f32> = (0..8).map(|k| DEPTHS_M[k % 2 * 4 + k / 2]).collect();
    let doubles: Vec<u8> = DEPTHS_M.iter().flat_map(|metres| f64::from(*metres).to_be_bytes()).collect();
    let pose = npy("<f4", false, "4, 4, 2", &[0; 128]);
    let map = npy("<f4", false, "2, 4", &bytes_of(&DEPTHS_M));
    let bottom_first = bytes_of(&[&DEPTHS_M[4..], &DEPTHS_M[..4]].concat());
    let tripled: Vec<f32> = DEPTHS_M[4..].iter().chain(&DEPTHS_M[..4]).flat_map(|&metres| [metres; 3]).collect();
    for (name, content) in [
        ("c.npy", map.clone()),
        ("f.npy", npy("<f4", true, "2, 4", &bytes_of(&columns))),
        ("d.npy", npy(">f8", false, "1, 2, 4", &doubles)),
        ("m.npz", npz(&[("camera.npy", &pose), ("depth.npy", &map)])),
        ("o.npz", npz(&[("arr_0.npy", &map)])),
        ("f.tif", tiff(32, 3, 1, &bytes_of(&DEPTHS_M))),
        ("p.pfm", [b"Pf\n4 2\n-1.0\n", &bottom_first[..]].concat()),
        // Photoshop's has two lines for the size, and the top row first.
        ("photoshop.pfm", [b"Pf\n4\n2\n-1.0\n", &bytes_of(&DEPTHS_M)[..]].concat()),
        ("colour.pfm", [b"PF\n4 2\n-1.0\n", &bytes_of(&tripled)[..]].concat()),
    ] {
        fs::write(path(name), &content).unwrap();
        let file = read(&path(name), Options::default()).unwrap();
        assert_eq!((&file.map.metres[..], file.distances), (&DEPTHS_M[..], Distances::Metres), "{name}");
        for length in 0..content.len() {
            fs::write(path(name), &content[..length]).unwrap();
            let Err(error) = read(&path(name), Options::default()) else { continue };
            assert!(error.to_string().lines().count() == 1, "{name} with {length} bytes: {error}");
        }
    }
    for channel in ["Z", "V", "View.Depth.Z"] {
        exr(&path("z.exr"), &[&[(channel, &DEPTHS_M)]]);
        assert_eq!(read(&path("z.exr"), Options::default()).unwrap().map.metres, DEPTHS_M, "{channel}");
    }
    exr(&path("z.exr"), &[&[("alpha", &DEPTHS_M)]]);
    assert_says(read(&path("z.exr"), Options::default()), &["z.exr", "without a layer of depth"]);
}

#[test]
fn an_exr_of_too_many_channels_is_refused_by_its_header() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("big.exr");
    for (channels, width, height, said) in [
        (20, 16384, 6250, "an EXR with 20 channels of 16384x6250 pixels"),
        // Few pixels, but 16 rows of all channels are decompressed at once.
        (1000, 16384, 16, "an EXR with 1000 channels of 16384x16 pixels"),
        (60, 4000, 3000, "copy or export it again"),
    ] {
        fs::write(&path, exr_that_claims(channels, width, height)).unwrap();
        assert_says(read(&path, Options::default()), &["big.exr", said]);
    }
}

#[test]
fn the_colours_of_an_exr_are_depth_only_if_they_are_equal() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("c.exr");
    let other = DEPTHS_M.map(|depth| 0.7 * depth);
    for prefix in ["", "Combined.", "View.Combined."] {
        let [r, g, b] = ["R", "G", "B"].map(|name| format!("{prefix}{name}"));
        let colors = |green: &'static [f32; 8]| [(&*r, &DEPTHS_M[..]), (&*g, &green[..]), (&*b, &DEPTHS_M[..])];
        let other: &'static [f32; 8] = Box::leak(Box::new(other));
        let read_layers = |layers: &[&[(&str, &[f32])]]| {
            exr(&path, layers);
            read(&path, Options::default())
        };
        assert_says(read_layers(&[&colors(other)]), &["c.exr", "a picture in colours is not depth"]);
        assert_eq!(read_layers(&[&colors(&DEPTHS_M)]).unwrap().map.metres, DEPTHS_M, "{r}");
        assert_eq!(read_layers(&[&colors(other)[..1]]).unwrap().map.metres, DEPTHS_M, "{r} alone");
        // Depth has priority, wherever it is.
        let depth: [(&str, &[f32]); 1] = [("Depth.Z", other)];
        assert_eq!(read_layers(&[&colors(other), &depth]).unwrap().map.metres, *other, "{r}");
        assert_eq!(read_layers(&[&[&colors(other)[..], &depth].concat()]).unwrap().map.metres, *other, "{r}");
    }
}

#[test]
fn a_tiff_is_turned_by_its_orientation_tag() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("m.tif");
    let (width, height) = (SIZE.0 as usize, SIZE.1 as usize);
    for (tag, at) in [
        (1, (|x, y, _, _| (x, y)) as fn(usize, usize, usize, usize) -> (usize, usize)),
        (2, |x, y, w, _| (w - 1 - x, y)),
        (3, |x, y, w, h| (w - 1 - x, h - 1 - y)),
        (4, |x, y, _, h| (x, h - 1 - y)),
        (5, |x, y, _, _| (y, x)),
        (6, |x, y, _, h| (h - 1 - y, x)),
        (7, |x, y, w, h| (h - 1 - y, w - 1 - x)),
        (8, |x, y, w, _| (y, w - 1 - x)),
    ] {
        let size = if tag < 5 { SIZE } else { (SIZE.1, SIZE.0) };
        let mut upright = [0.0; 8];
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let (column, row) = at(x, y, width, height);
            upright[row * size.0 as usize + column] = DEPTHS_M[y * width + x];
        }
        for (bits, format, data) in
            [(32, 3, bytes_of(&DEPTHS_M)), (8, 1, DEPTHS_M.map(|depth| (10.0 * depth) as u8).to_vec())]
        {
            fs::write(&path, tiff(bits, format, tag, &data)).unwrap();
            let unit = (bits == 8).then_some(DepthUnit::PerMetre(10.0));
            let file = depth_file::read(&path, &Options { unit, ..Options::default() }, size).unwrap();
            assert_eq!((file.map.size(), &file.map.metres[..]), (size, &upright[..]), "{tag}, {bits} bits");
        }
    }
}

#[test]
fn the_map_that_is_taken_of_several_arrays_is_named() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("m.npz");
    let size = (8, 2);
    let map = |scale: f32| {
        let depths = [DEPTHS_M, DEPTHS_M].concat().iter().map(|depth| scale * depth).collect::<Vec<_>>();
        npy("<f4", false, "2, 8", &bytes_of(&depths))
    };
    let camera = npy("<f4", false, "3, 3", &bytes_of(&[1.0; 9]));
    for (names, taken, is_said) in [
        (["B", "a", "K"], 0, true),
        (["a", "depth", "K"], 1, false),
        (["a", "DEPTH", "K"], 1, false),
        // Matrices come after maps, and are none of them.
        (["K", "b", "c"], 1, true),
    ] {
        let arrays = [map(1.0), map(2.0), camera.clone()];
        let order = if names[0] == "K" { [2, 0, 1] } else { [0, 1, 2] };
        let files = [0, 1, 2].map(|at| format!("{}.npy", names[at]));
        let members = [0, 1, 2].map(|at| (&*files[at], &arrays[order[at]][..]));
        fs::write(&path, npz(&members)).unwrap();
        let file = depth_file::read(&path, &Options::default(), size).unwrap();
        assert_eq!(file.map.metres[0], 0.5 * (1 + order[taken]) as f32, "{names:?}");
        let said = format!("has 2 arrays that may be the map, of which {:?} is taken", names[taken]);
        assert_eq!(file.notes.iter().any(|note| note.starts_with(&said)), is_said, "{names:?}: {:?}", file.notes);
    }
}

#[test]
fn whole_numbers_need_a_unit_unless_depth_cameras_wrote_them() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name);
    let millimetres: Vec<u16> = DEPTHS_M.iter().map(|metres| (1000.0 * metres) as u16).collect();
    let little: Vec<u8> = millimetres.iter().flat_map(|code| code.to_le_bytes()).collect();
    fs::write(path("mm.npy"), npy("<u2", false, "2, 4", &little)).unwrap();
    fs::write(path("mm.tif"), tiff(16, 1, 1, &little)).unwrap();
    Gray16::from_raw(4, 2, millimetres.clone()).unwrap().save(path("mm.png")).unwrap();
    let rgba: Vec<u16> = millimetres.iter().flat_map(|&code| [code, code, code, 65535]).collect();
    ImageBuffer::<Rgba<u16>, _>::from_raw(4, 2, rgba).unwrap().save(path("rgba.png")).unwrap();
    for name in ["mm.npy", "mm.tif", "mm.png", "rgba.png"] {
        for options in [
            with_unit(DepthUnit::PerMetre(1000.0)),
            with_unit("millimetres".parse().unwrap()),
            Options { scale: Some(1000.0), ..Options::default() },
        ] {
            assert_eq!(read(&path(name), options).unwrap().map.metres, DEPTHS_M, "{name}");
        }
        let unmarked = read(&path(name), Options::default());
        match name.ends_with("png") {
            true => assert_eq!(unmarked.unwrap().map.metres[2], 0.4, "5000 units per metre"),
            false => assert_says(unmarked, &[name, "--depth-unit", "millimetres"]),
        }
    }
}

#[test]
fn nearness_is_asked_about_and_never_taken_for_metres() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name);
    let size = (256, 4);
    let ramp = |scale: u32| (0..1024).map(move |k| k % 256 * scale);
    let float = |scale: f32| bytes_of(&ramp(1).map(|code| scale * code as f32 / 255.0).collect::<Vec<_>>());
    GrayImage::from_raw(256, 4, ramp(1).map(|code| code as u8).collect()).unwrap().save(path("8.png")).unwrap();
    GrayImage::from_raw(256, 4, ramp(1).map(|code| code as u8).collect()).unwrap().save(path("8.jpg")).unwrap();
    let rgb = RgbImage::from_fn(256, 4, |x, _| Rgb([x as u8; 3]));
    rgb.save(path("rgb.png")).unwrap();
    Gray16::from_raw(256, 4, ramp(257).map(|code| code as u16).collect()).unwrap().save(path("16.png")).unwrap();
    fs::write(path("1.npy"), npy("<f4", false, "4, 256", &float(1.0))).unwrap();
    fs::write(path("midas.npy"), npy("<f4", false, "4, 256", &float(3200.0))).unwrap();
    for name in ["8.png", "8.jpg", "rgb.png", "16.png", "1.npy", "midas.npy"] {
        let read = |options: Options| depth_file::read(&path(name), &options, size);
        assert_says(read(Options::default()), &[name, "--depth-unit inverse", "--depth-invert", "metre"]);
        let near = read(with_unit(DepthUnit::Inverse)).unwrap();
        assert_eq!(near.distances, Distances::Relative, "{name}");
        assert!(near.notes[0].contains("taken as near; --depth-invert"), "{name}: {:?}", near.notes);
        let far = read(Options { invert: true, ..Options::default() }).unwrap();
        let nearness = |file: &DepthFile, at: usize| DepthMap::SUBJECT_M / file.map.metres[at];
        // JPEG changes grey a little.
        for (file, at, wanted) in [(&near, 0, 0.0), (&near, 255, 1.0), (&far, 0, 1.0), (&far, 255, 0.0)] {
            let found = nearness(file, at);
            assert!((found - wanted).abs() < 0.02, "{name}: {found} at {at}");
        }
    }
    // A range of its own is stretched, so that every tool's map looks alike.
    let narrow = GrayImage::from_fn(256, 4, |x, _| Luma([100 + (x / 4) as u8]));
    narrow.save(path("narrow.png")).unwrap();
    let map = depth_file::read(&path("narrow.png"), &with_unit(DepthUnit::Inverse), size).unwrap().map;
    assert_eq!(map.metres[255], DepthMap::relative_to_metres(1.0));
    // 8 bits in a wider number have no unit either, whatever part of their range is used.
    for step in [256, 257] {
        Gray16::from_fn(256, 4, |x, _| Luma([(20 + x as u16 / 2) * step])).save(path("wide.png")).unwrap();
        assert_says(depth_file::read(&path("wide.png"), &Options::default(), size), &["8 bits stretched to 16"]);
    }
    let whole: Vec<f32> = (0..4).flat_map(|_| (0..256).map(|x| x as f32)).collect();
    fs::write(path("255.npy"), npy("<f4", false, "4, 256", &bytes_of(&whole))).unwrap();
    assert_says(depth_file::read(&path("255.npy"), &Options::default(), size), &["whole numbers from 0 to 255"]);
    // A camera's map with unknown and saturated pixels is not stretched.
    let sensor = Gray16::from_fn(256, 4, |x, _| Luma([[0, 65535, 400 + 40 * x as u16][(x as usize).min(2)]]));
    sensor.save(path("sensor.png")).unwrap();
    assert_eq!(depth_file::read(&path("sensor.png"), &Options::default(), size).unwrap().distances, Distances::Scaled);
}

#[test]
fn far_is_not_unknown() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("sky.npy");
    let write = |numbers: [f32; 8]| fs::write(&path, npy("<f4", false, "2, 4", &bytes_of(&numbers))).unwrap();
    for far in [f32::INFINITY, f32::MAX, 1e10, 65504.0, 65535.0] {
        write([far, far, far, 1.0, 2.0, f32::NAN, 0.0, -1.0]);
        let DepthFile { map, notes, .. } = read(&path, Options::default()).unwrap();
        assert_eq!(map.metres[0], far.min(DepthMap::MAX_M), "{far}");
        assert_eq!(map.metres[3..], [1.0, 2.0, 0.0, 0.0, 0.0], "{far}");
        assert!(notes[0].contains("unknown in 38 %"), "{notes:?}");
    }
    // In disparity, the farthest is 0, and infinity is how unknown is written.
    write([f32::INFINITY, 4.0, 8.0, 0.0, 2.0, 1.0, 1.0, 1.0]);
    let map = read(&path, with_unit(DepthUnit::Disparity)).unwrap().map;
    assert!(map.metres[0] == 0.0 && map.metres[3] == 0.0 && map.metres[1] == 2.0 * map.metres[2]);
    // A number of the tool's own.
    write([99.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    let map = read(&path, Options { invalid: Some(99.0), ..Options::default() }).unwrap().map;
    assert_eq!(map.metres[..2], [0.0, 1.0]);
}

#[test]
fn colours_and_maps_that_tell_nothing_are_refused() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name);
    // Spectral, jet and a map with a few colours, with and without transparency.
    RgbImage::from_fn(4, 2, |x, _| Rgb([[158, 1, 66], [253, 174, 97], [102, 194, 165], [94, 79, 162]][x as usize]))
        .save(path("spectral.png"))
        .unwrap();
    RgbImage::from_fn(64, 64, |x, y| Rgb([(4 * x) as u8, 128, (255 - 4 * y) as u8])).save(path("jet.jpg")).unwrap();
    RgbaImage::from_fn(4, 2, |x, _| Rgba([60 * x as u8, 0, 255 - 60 * x as u8, 255])).save(path("hot.png")).unwrap();
    for name in ["spectral.png", "jet.jpg", "hot.png"] {
        for options in [Options::default(), with_unit(DepthUnit::Inverse), with_unit(DepthUnit::Metres)] {
            assert_says(read(&path(name), options), &[name, "a picture in colours is not depth", "grey"]);
        }
    }
    for (name, code) in [("zero.png", 0), ("constant.png", 5000), ("full.png", 65535)] {
        Gray16::from_pixel(4, 2, Luma([code])).save(path(name)).unwrap();
        for unit in [None, Some(DepthUnit::Inverse), Some(DepthUnit::PerMetre(1000.0))] {
            let said = if code == 0 && unit != Some(DepthUnit::Inverse) { "no depth is known" } else { "one value" };
            assert_says(read(&path(name), Options { unit, ..Options::default() }), &[name, said]);
        }
    }
    RgbaImage::from_fn(4, 2, |x, _| Rgba([60 * x as u8, 60 * x as u8, 60 * x as u8, if x == 0 { 0 } else { 255 }]))
        .save(path("clear.png"))
        .unwrap();
    assert_eq!(read(&path("clear.png"), with_unit(DepthUnit::Inverse)).unwrap().map.metres[0], 0.0, "transparent");
}

#[test]
fn files_that_are_no_maps_are_named() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("map");
    for (content, says) in [
        (npy("<f4", false, "2, 4, 3", &[0; 96]), "shape (2, 4, 3) is not a map"),
        (npy("<f4", false, "8,", &[0; 32]), "shape (8,) is not a map"),
        (npy("<c8", false, "2, 4", &[0; 64]), "type \"<c8\""),
        (npy("<f4", false, "99999, 99999", &[]), "claims 99999x99999"),
        (npz(&[("pose.npy", &npy("<f4", false, "4, 4, 2", &[0; 128]))]), "shape (4, 4, 2)"),
        (b"PK\x03\x04 and then something else".to_vec(), "damaged"),
        (b"\x76\x2f\x31\x01 and then something else".to_vec(), "damaged"),
        (b"II\x2a\0\xff\xff\xff\xff".to_vec(), "the file ends before"),
        (b"v 1.0 2.0 3.0".to_vec(), "EXR"),
        (Vec::new(), "ends before"),
    ] {
        fs::File::create(&path).unwrap().write_all(&content).unwrap();
        assert_says(read(&path, Options::default()), &[says]);
    }
}
