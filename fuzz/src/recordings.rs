//! Targets for recordings: frame lists and calibrations, and recordings in a single file.

use std::cell::Cell;

use bokehcam::frame::{ColorImage, DepthMap, GrayImage};
use bokehcam_media::recording::{DepthUnit, Options, Recording, Scratch, still};

use super::input::{assert_one_line, file_path, split_files, write_file};

/// Layouts: the folder, and the files in it that come from the input.
const LAYOUTS: [(&str, &[&str]); 5] = [
    ("tum", &["rgb.txt", "depth.txt"]),
    ("pairs", &["associations.txt", "rgb.txt"]),
    ("kitti", &["times.txt", "calib.txt"]),
    ("euroc", &["mav0/cam0/data.csv", "mav0/cam1/data.csv", "mav0/cam0/sensor.yaml", "mav0/cam1/sensor.yaml"]),
    ("middlebury", &["calib.txt", "disp0.pfm"]),
];

thread_local! {
    static READY: Cell<bool> = const { Cell::new(false) };
}

/// Opens a recording: the first byte selects the layout, the second one the options; the files follow.
pub fn recording(data: &[u8]) {
    let Some((&[layout, flags], rest)) = data.split_first_chunk() else { return };
    if !READY.replace(true) {
        make_pictures();
    }
    let (folder, names) = LAYOUTS[layout as usize % LAYOUTS.len()];
    let given = split_files(rest);
    for (at, name) in names.iter().enumerate() {
        let name = format!("{folder}/{name}");
        match given.get(at) {
            Some(bytes) if at == 0 || !bytes.is_empty() => drop(write_file(&name, bytes)),
            _ => drop(std::fs::remove_file(file_path(&name))),
        }
    }
    let options = Options {
        keep_going: flags & 1 != 0,
        pair_tolerance_ns: if flags & 2 != 0 { u64::MAX } else { 20_000_000 },
        depth_scale: (flags & 4 != 0).then_some(1e-38),
        depth_unit: if flags & 16 != 0 { DepthUnit::Inverse } else { DepthUnit::Metres },
        depth_invert: flags & 32 != 0,
        depth_invalid: (flags & 8 != 0).then_some(65535),
        ..Options::default()
    };
    match Recording::open(&file_path(folder), &options) {
        Ok(recording) => check_recording(&recording),
        Err(error) => assert_one_line(error),
    }
}

/// Opens a recording in a single file: MCAP or Matroska if it begins so, else Record3D.
pub fn recording_file(data: &[u8]) {
    let name = match data {
        [0x89, b'M', b'C', b'A', b'P', ..] => "take.mcap",
        [0x1A, 0x45, 0xDF, 0xA3, ..] => "take.mkv",
        _ => "take.r3d",
    };
    let path = write_file(name, data);
    match Recording::open(&path, &Options::default()) {
        Ok(recording) => check_recording(&recording),
        Err(error) => assert_one_line(error),
    }
}

fn check_recording(recording: &Recording) {
    assert!(!recording.is_empty() && recording.period_ns() > 0);
    let times: Vec<u64> = (0..recording.len()).map(|index| recording.time_ns(index)).collect();
    assert!(times.is_sorted_by(|one, next| one < next), "times do not increase: {times:?}");
    let mut scratch = Scratch::default();
    let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
    for index in 0..recording.len().min(4) {
        if let Err(error) = recording.read_color(index, &mut scratch, &mut color) {
            assert_one_line(error);
        }
        match recording.read_depth(index, &mut scratch, &mut depth) {
            Ok(()) => {
                assert_eq!(depth.metres.len(), depth.width as usize * depth.height as usize);
                assert!(depth.metres.iter().all(|metres| !metres.is_nan()));
            }
            Err(error) => assert_one_line(error),
        }
        if let Err(error) = recording.read_right(index, &mut scratch, &mut right) {
            assert_one_line(error);
        }
    }
}

fn make_pictures() {
    let mut color = ColorImage::new(8, 6);
    color.rgb.iter_mut().enumerate().for_each(|(at, byte)| *byte = (at * 5) as u8);
    let mut depth = DepthMap::new(8, 6);
    depth.metres.iter_mut().enumerate().for_each(|(at, metres)| *metres = at as f32 * 0.1);
    let [color_file, depth_file] = [file_path("color.png"), file_path("depth.png")];
    still::write_color(&color_file, &color, true).unwrap();
    still::write_depth(&depth_file, &depth, 5000.0, true).unwrap();
    let [color, depth] = [color_file, depth_file].map(|path| std::fs::read(path).unwrap());
    for frame in 0..4 {
        for list in ["tum", "pairs"] {
            write_file(&format!("{list}/rgb/{frame}.png"), &color);
            write_file(&format!("{list}/depth/{frame}.png"), &depth);
        }
        for eye in ["image_2", "image_3"] {
            write_file(&format!("kitti/{eye}/{frame:06}.png"), &color);
        }
        for eye in ["cam0", "cam1"] {
            write_file(&format!("euroc/mav0/{eye}/data/140363657976355555{frame}.png"), &color);
        }
    }
    for eye in ["im0.png", "im1.png"] {
        write_file(&format!("middlebury/{eye}"), &color);
    }
}
