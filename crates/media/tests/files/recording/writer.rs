//! A written recording is read back.

use std::fs;

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam_media::recording::{Options, Recording, RecordingWriter, Unpaired};
use tempfile::TempDir;

use super::{SIZE, assert_says, color_of, depth_of, times_ns};

const SCALE: f32 = 5000.0;

/// Returns a picture and a depth map of `SIZE` with different values in each pixel; every seventh depth is unknown.
fn frame(seed: u32) -> (ColorImage, DepthMap) {
    let (mut color, mut depth) = (ColorImage::new(SIZE.0, SIZE.1), DepthMap::new(SIZE.0, SIZE.1));
    for (index, byte) in (0..).zip(&mut color.rgb) {
        *byte = ((index * 31 + seed * 77) % 256) as u8;
    }
    for (index, metres) in (0_u32..).zip(&mut depth.metres) {
        *metres = if index % 7 == 3 { 0.0 } else { 0.3 + 0.0271 * index as f32 + 0.001 * seed as f32 };
    }
    (color, depth)
}

#[test]
fn colour_is_exact_and_depth_within_half_a_unit() {
    let dir = TempDir::new().unwrap();
    let dir = dir.path().join("new/folder");
    let mut writer = RecordingWriter::create(&dir, false).unwrap();
    let times = [1_305_031_102_175_304_001, 1_305_031_102_208_637_334, 1_305_031_102_275_304_000];
    for (seed, &time_ns) in (0..).zip(&times) {
        let (color, depth) = frame(seed);
        writer.add(time_ns, &color, Some(&depth)).unwrap();
    }
    writer.finish().unwrap();

    let recording = Recording::open(&dir, &Options::default()).unwrap();
    assert_eq!((recording.len(), recording.size(), recording.has_depth()), (3, SIZE, true));
    assert_eq!(recording.unpaired(), Unpaired::default());
    assert_eq!(times_ns(&recording), times.map(|time_ns| time_ns - times[0]));
    for index in 0..3 {
        let (color, depth) = frame(index as u32);
        assert_eq!(color_of(&recording, index).unwrap(), color);
        let read = depth_of(&recording, index).unwrap();
        for (&written, &read) in depth.metres.iter().zip(&read.metres) {
            assert_eq!(DepthMap::is_known(written), DepthMap::is_known(read));
            // The second term is f32 rounding.
            assert!((written - read).abs() <= 0.5 / SCALE + 1e-6, "{written} m became {read} m");
        }
    }
}

#[test]
fn depth_beyond_the_range_is_unknown_rather_than_wrong() {
    let dir = TempDir::new().unwrap();
    let (color, mut depth) = frame(0);
    depth.metres[..4].copy_from_slice(&[13.2, f32::NAN, f32::INFINITY, -1.0]);
    let mut writer = RecordingWriter::create(dir.path(), false).unwrap();
    writer.add(0, &color, Some(&depth)).unwrap();
    writer.finish().unwrap();
    let recording = Recording::open(dir.path(), &Options::default()).unwrap();
    assert_eq!(depth_of(&recording, 0).unwrap().metres[..4], [0.0; 4]);
}

#[test]
fn depth_may_be_absent_always_or_now_and_then() {
    let dir = TempDir::new().unwrap();
    let (color, depth) = frame(0);
    for (depths, len, unpaired) in [([false; 3], 3, 0), ([true, false, true], 2, 1), ([false, false, true], 1, 2)] {
        let mut writer = RecordingWriter::create(dir.path(), true).unwrap();
        for (time_ms, has_depth) in (0..).step_by(33).zip(depths) {
            writer.add(time_ms * 1_000_000, &color, has_depth.then_some(&depth)).unwrap();
        }
        writer.finish().unwrap();
        let recording = Recording::open(dir.path(), &Options::default()).unwrap();
        assert_eq!(recording.has_depth(), depths.contains(&true));
        assert_eq!((recording.len(), recording.unpaired().color), (len, unpaired));
    }
}

#[test]
fn the_lists_appear_only_when_whole() {
    let dir = TempDir::new().unwrap();
    let (color, depth) = frame(0);
    let mut writer = RecordingWriter::create(dir.path(), false).unwrap();
    writer.add(5, &color, Some(&depth)).unwrap();
    assert_says(Recording::open(dir.path(), &Options::default()), &["not a recording"]);
    let written = writer.finish_incomplete().unwrap();
    assert_eq!((written.dir.as_path(), written.frames, written.replaced), (dir.path(), 1, 0));
    let recording = Recording::open(dir.path(), &Options::default()).unwrap();
    assert_eq!(color_of(&recording, 0).unwrap(), color);
}

#[test]
fn an_existing_recording_is_kept_unless_asked() {
    let dir = TempDir::new().unwrap();
    let (color, depth) = frame(0);
    let mut writer = RecordingWriter::create(dir.path(), false).unwrap();
    writer.add(0, &color, Some(&depth)).unwrap();
    writer.add(1, &color, Some(&depth)).unwrap();
    // While it is being written, no other run may write it.
    assert_says(RecordingWriter::create(dir.path(), true).map(drop), &["is being written by another run"]);
    writer.finish().unwrap();
    assert_says(RecordingWriter::create(dir.path(), false).map(drop), &["exists already"]);
    // Pictures without lists count as a recording, too.
    for list in ["rgb.txt", "depth.txt"] {
        fs::remove_file(dir.path().join(list)).unwrap();
    }
    assert_says(RecordingWriter::create(dir.path(), false).map(drop), &["exists already"]);

    fs::write(dir.path().join("notes.txt"), "kept").unwrap();
    assert_says(RecordingWriter::create(dir.path(), true).map(drop), &["notes.txt was not written by"]);
    fs::remove_file(dir.path().join("notes.txt")).unwrap();
    let mut writer = RecordingWriter::create(dir.path(), true).unwrap();
    let other = frame(9).0;
    writer.add(7, &other, None).unwrap();
    assert!(dir.path().join("rgb/000001.png").exists(), "what was there stays until the new is whole");
    let written = writer.finish().unwrap();
    assert_eq!((written.replaced, written.frames), (4, 1));
    let recording = Recording::open(dir.path(), &Options::default()).unwrap();
    assert_eq!((recording.len(), recording.has_depth()), (1, false));
    assert_eq!(color_of(&recording, 0).unwrap(), other);
    assert!(!dir.path().join("rgb/000001.png").exists());
}

#[test]
fn a_frame_that_does_not_fit_is_refused_and_the_rest_stays() {
    let dir = TempDir::new().unwrap();
    let (color, depth) = frame(0);
    let mut writer = RecordingWriter::create(dir.path(), false).unwrap();
    writer.add(10, &color, Some(&depth)).unwrap();
    assert_says(writer.add(10, &color, Some(&depth)), &["frame 1", "not after"]);
    assert_says(writer.add(9, &color, None), &["frame 1", "not after"]);
    assert_says(writer.add(20, &ColorImage::new(8, 8), None), &["frame 1", "8x8", "24x16"]);
    assert_says(writer.add(20, &color, Some(&DepthMap::new(48, 32))), &["frame 1", "48x32"]);
    assert_says(writer.add(20, &ColorImage { rgb: vec![0; 5], ..color.clone() }, None), &["frame 1", "5 bytes"]);
    assert_says(writer.add(20, &color, Some(&DepthMap { metres: vec![], ..depth.clone() })), &["frame 1", "0 values"]);
    writer
        .add(20, &color, Some(&DepthMap { width: 12, height: 8, metres: vec![1.0; 96], ..DepthMap::default() }))
        .unwrap();
    writer.finish().unwrap();
    let recording = Recording::open(dir.path(), &Options::default()).unwrap();
    assert_eq!(times_ns(&recording), [0, 10]);
    assert_eq!(depth_of(&recording, 1).unwrap().size(), (12, 8));
}

#[test]
fn nothing_recorded_is_an_error_and_leaves_the_folder_free() {
    let dir = TempDir::new().unwrap();
    let writer = RecordingWriter::create(dir.path(), false).unwrap();
    assert_says(writer.finish(), &["nothing was recorded"]);
    assert!(RecordingWriter::create(dir.path(), false).is_ok());
    fs::write(dir.path().join("file"), "").unwrap();
    let inside_a_file = dir.path().join("file/recording");
    assert_says(RecordingWriter::create(&inside_a_file, false).map(drop), &["file", "it is not a folder"]);
}
