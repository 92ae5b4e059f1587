//! Maps of depth and disparity as single files.

use std::fs;
use std::path::Path;

use bokehcam::frame::{DepthMap, DisparityMap};
use bokehcam::optics::StereoRig;
use bokehcam_media::recording::depth_file::{self, Distances};
use bokehcam_media::recording::still::{read_depth, read_disparity, write_depth, write_disparity};
use tempfile::TempDir;

use super::assert_says;

#[test]
fn depth_survives_png_within_half_a_unit_and_pfm_exactly() {
    let dir = TempDir::new().unwrap();
    let mut depth = DepthMap::new(5, 7);
    for (index, metres) in depth.metres.iter_mut().enumerate() {
        *metres = if index % 4 == 0 { 0.0 } else { 0.123_456 * index as f32 };
    }
    let png = dir.path().join("depth.png");
    write_depth(&png, &depth, 1000.0, false).unwrap();
    let read = read_depth(&png, 1000.0, None).unwrap();
    assert_eq!(read.size(), (5, 7));
    assert!(depth.metres.iter().zip(&read.metres).all(|(a, b)| (a - b).abs() <= 0.000_501));
    assert_eq!(read_depth(&png, 1000.0, Some(123)).unwrap().metres[1], 0.0);

    let pfm = dir.path().join("depth.pfm");
    write_depth(&pfm, &depth, 1000.0, false).unwrap();
    assert_eq!(read_depth(&pfm, 1.0, None).unwrap(), depth);
    assert_says(read_depth(&png, f32::NAN, None), &["depth scale"]);
}

#[test]
fn disparity_survives_png_within_half_a_unit_and_pfm_exactly() {
    let dir = TempDir::new().unwrap();
    let px: Vec<f32> = (0..35).map(|index| if index % 4 == 0 { 0.0 } else { 7.3217 * index as f32 }).collect();
    let disparity = DisparityMap { width: 7, height: 5, px };
    let [png, pfm] = ["d.png", "d.pfm"].map(|name| dir.path().join(name));
    for path in [&png, &pfm] {
        write_disparity(path, &disparity, None, false).unwrap();
        assert_says(write_disparity(path, &disparity, None, false), &["exists already"]);
    }
    assert_eq!(read_disparity(&pfm).unwrap(), disparity);
    let read = read_disparity(&png).unwrap();
    assert_eq!(read.size(), (7, 5));
    assert!(disparity.px.iter().zip(&read.px).all(|(a, b)| (a - b).abs() <= 0.5 / 256.0));
    // Unknown values as other tools expect them: KITTI's 0 and Middlebury's infinity.
    let raw = image::open(&png).unwrap().into_luma16();
    assert_eq!((raw.get_pixel(0, 0)[0], raw.get_pixel(1, 0)[0]), (0, 1874));
    // The first value is the bottom row's.
    let first = "Pf\n7 5\n-100e-2\n".len();
    assert_eq!(fs::read(&pfm).unwrap()[first..first + 4], f32::INFINITY.to_le_bytes());
    assert_says(write_disparity(&dir.path().join("d.jpg"), &disparity, None, false), &["`.png` or `.pfm`"]);
}

fn read_pfm(dir: &Path, content: &[u8]) -> Result<DepthMap, bokehcam_media::recording::RecordingError> {
    let path = dir.join("map.pfm");
    fs::write(&path, content).unwrap();
    read_depth(&path, 5000.0, None)
}

#[test]
fn a_pfm_is_read_from_its_bottom_row_in_either_byte_order() {
    let dir = TempDir::new().unwrap();
    let values = [3.0, f32::NAN, 1.0, -2.0];
    let little: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    let big: Vec<u8> = values.iter().flat_map(|value| value.to_be_bytes()).collect();
    for (scale, data) in [("-1.0", little), ("1", big)] {
        let content = [format!("Pf\n2 2\n{scale}\n").as_bytes(), &data].concat();
        // Invalid depths become unknown.
        assert_eq!(read_pfm(dir.path(), &content).unwrap().metres, [1.0, 0.0, 3.0, 0.0]);
        assert_says(read_pfm(dir.path(), &content[..content.len() - 1]), &["map.pfm: the file ends before"]);
    }
}

#[test]
fn a_wrong_pfm_is_told() {
    let dir = TempDir::new().unwrap();
    for (content, says) in [
        (&b"PF\n1 1\n-1\n0123456789ab"[..], "a colour PFM is not depth"),
        (b"Pf\n19999 19999\n-1\n", "claims 19999x19999"),
        (b"Pf\n0 4\n-1\n", "no pixel"),
        (b"Pf\n-1 4\n-1\n", "\"-1\" in its header is not a number"),
        (b"Pf\n1 \xff\n-1\n", "not text"),
        (b"Pf\n1 1\n", "ends before"),
        (b"", "ends before"),
    ] {
        assert_says(read_pfm(dir.path(), content), &["map.pfm: ", says]);
    }
}

#[test]
fn a_map_says_what_it_holds() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name);
    let depth = DepthMap { width: 2, height: 1, metres: vec![0.5, 4.0], ..DepthMap::default() };
    for name in ["z.png", "z.pfm"] {
        write_depth(&path(name), &depth, 1000.0, false).unwrap();
        assert_eq!(read_depth(&path(name), 1000.0, None).unwrap(), depth, "{name}");
    }
    // An explicit scale overrides that of whole numbers, and says so.
    let options = depth_file::Options { scale: Some(500.0), ..depth_file::Options::default() };
    let read = |name: &str| depth_file::read(&path(name), &options, (2, 1)).unwrap();
    assert_eq!((&read("z.png").map.metres[..], read("z.pfm").map), (&[1.0, 8.0][..], depth));
    assert!(read("z.png").notes[0].contains("states 1000 units per metre, but is read with 500"));
    assert!(read("z.pfm").notes[0].contains("--depth-scale does not apply"));

    let disparity = DisparityMap { width: 2, height: 1, px: vec![10.0, 40.0] };
    let rig = StereoRig { focal_px: 200.0, baseline_m: 0.1, doffs_px: 0.0, metric: true };
    for (name, rig, read) in [("d.png", Some(rig), Some(rig)), ("e.png", None, None), ("d.pfm", Some(rig), None)] {
        write_disparity(&path(name), &disparity, rig, false).unwrap();
        assert_eq!(read_disparity(&path(name)).unwrap(), disparity);
        let file = depth_file::read(&path(name), &depth_file::Options::default(), (2, 1)).unwrap();
        assert_eq!(file.distances == Distances::Metres, read.is_some(), "{name}");
        match read {
            Some(_) => assert_eq!(read_depth(&path(name), 5000.0, None).unwrap().metres, [2.0, 0.5]),
            None => assert_says(read_depth(&path(name), 5000.0, None), &[name, "disparity is not depth"]),
        }
    }
    // Files of other tools have no unit, and count as metres.
    let other = [&b"Pf\n1 1\n-1.0\n"[..], &3.0_f32.to_le_bytes()].concat();
    assert_eq!(read_pfm(dir.path(), &other).unwrap().metres, [3.0]);
}
