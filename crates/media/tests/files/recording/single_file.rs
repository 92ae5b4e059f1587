//! Recordings in a single file: MCAP of ROS, and Record3D. The files in `fuzz/seeds/recording_file` were written by other
//! programs (Python's mcap-ros2-support, zipfile and pyliblzfse): three frames of 24x16, 0.1 s apart, of the colour
//! (10 k, 100, 200) and the depth k + 1 m.

mod limits;
mod times;
mod topics;

use std::fs;
use std::path::Path;

use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam_media::recording::{DepthUnit, Options, Recording, RecordingError, RecordingWriter, Scratch};

use super::{SIZE, Scene, assert_says, color_of, depth_of, times_ns};

const RAW: &[u8] = include_bytes!("../../../../../fuzz/seeds/recording_file/raw.mcap");
const LZ4: &[u8] = include_bytes!("../../../../../fuzz/seeds/recording_file/lz4.mcap");
const ZSTD: &[u8] = include_bytes!("../../../../../fuzz/seeds/recording_file/zstd.mcap");
const REGISTERED: &[u8] = include_bytes!("../../../../../fuzz/seeds/recording_file/registered.mcap");
const RECORD3D: &[u8] = include_bytes!("../../../../../fuzz/seeds/recording_file/small.r3d");

/// Writes a file in a folder of its own, and opens it.
fn open(scene: &Scene, name: &str, bytes: &[u8], options: &Options) -> Result<Recording, RecordingError> {
    scene.write(name, bytes);
    Recording::open(&scene.path(name), options)
}

/// Asserts that a frame has its colour and depth.
#[track_caller]
fn assert_frame(recording: &Recording, at: usize, number: usize) {
    let color = color_of(recording, at).unwrap();
    assert_eq!(color.size(), SIZE);
    let expected = [10 * number as u8, 100, 200];
    for (found, expected) in color.rgb.iter().zip(expected.iter().cycle()) {
        assert!(found.abs_diff(*expected) <= 2, "frame {at}: {found} for {expected}");
    }
    let depth = depth_of(recording, at).unwrap();
    assert_eq!(depth.size(), (12, 8));
    for &metres in &depth.metres[1..] {
        assert!((metres / (number as f32 + 1.0) - 1.0).abs() < 1e-3, "frame {at}: {metres} m");
    }
}

#[test]
fn mcap_of_every_compression_is_read() {
    let scene = Scene::new();
    for (name, bytes) in [("raw.mcap", RAW), ("lz4.mcap", LZ4), ("zstd.mcap", ZSTD)] {
        let recording = open(&scene, name, bytes, &Options::default()).unwrap();
        assert_eq!((recording.layout(), recording.len(), recording.has_times()), ("MCAP", 3, true));
        assert!(recording.has_depth() && !recording.has_depth_in_units(), "metres");
        assert_eq!(times_ns(&recording), [0, 100_000_000, 200_000_000]);
        // Backwards, too: compressed chunks are found again.
        (0..3).rev().for_each(|frame| assert_frame(&recording, frame, frame));
    }
}

#[test]
fn a_folder_of_rosbag2_is_its_file() {
    let scene = Scene::new();
    fs::create_dir(scene.path("bag")).unwrap();
    scene.write("bag/bag_0.mcap", RAW);
    assert_says(Recording::open(&scene.path("bag"), &Options::default()), &["not a recording"]);
    scene.write("bag/metadata.yaml", "rosbag2_bagfile_information:");
    assert_frame(&Recording::open(&scene.path("bag"), &Options::default()).unwrap(), 1, 1);
    scene.write("bag/bag_1.mcap", RAW);
    assert_says(Recording::open(&scene.path("bag"), &Options::default()), &["several files", "bag_0.mcap"]);
}

#[test]
fn record3d_is_read_at_its_own_times() {
    let recording = open(&Scene::new(), "take.r3d", RECORD3D, &Options::default()).unwrap();
    assert_eq!((recording.layout(), recording.len(), recording.has_depth()), ("Record3D", 3, true));
    assert_eq!(times_ns(&recording), [0, 120_000_000, 200_000_000]);
    (0..3).for_each(|frame| assert_frame(&recording, frame, frame));
    assert_eq!(depth_of(&recording, 0).unwrap().metres[0], 0.0, "not a number is unknown");
}

#[test]
fn options_of_depth_hold_for_millimetres_and_not_for_metres() {
    let scene = Scene::new();
    let options = Options { depth_scale: Some(500.0), ..Options::default() };
    let depth = |bytes| depth_of(&open(&scene, "take.mcap", bytes, &options).unwrap(), 0).unwrap().metres[0];
    assert_eq!(depth(RAW), 2.0);
    assert!((depth(ZSTD) - 1.0).abs() < 1e-3);
    let options = Options { depth_unit: DepthUnit::Inverse, ..Options::default() };
    assert!(!open(&scene, "take.mcap", RAW, &options).unwrap().has_relative_depth());
}

/// Returns the bytes of a record.
fn record(code: u8, content: &[&[u8]]) -> Vec<u8> {
    let content = content.concat();
    [&[code][..], &(content.len() as u64).to_le_bytes(), &content].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

/// A topic: its name, and its pictures' format, shade or millimetres, and times in milliseconds.
type TestTopic<'a> = (&'a str, &'a str, u8, &'a [u32]);

/// Builds a file without chunks and summary, of images of 4x2 pixels, in the encoding of ROS 2 or ROS 1. The headers
/// have the times after 100 s, and the messages are recorded at twice the times.
fn unchunked(topics: &[TestTopic], is_ros1: bool) -> Vec<u8> {
    let mut file = b"\x89MCAP0\r\n".to_vec();
    file.extend(record(1, &[&text("test"), &text("")]));
    let (kind, encoding) = if is_ros1 { ("sensor_msgs/Image", "ros1") } else { ("sensor_msgs/msg/Image", "cdr") };
    file.extend(record(3, &[&7_u16.to_le_bytes(), &text(kind), &text(""), &text("")]));
    for (id, (name, ..)) in (1_u16..).zip(topics) {
        let ids = [id.to_le_bytes(), 7_u16.to_le_bytes()].concat();
        file.extend(record(4, &[&ids, &text(name), &text(encoding), &0_u32.to_le_bytes()]));
    }
    for (id, (_, format, value, times_ms)) in (1_u16..).zip(topics) {
        for ms in *times_ms {
            let samples = match *format {
                "16UC1" => vec![0, *value],
                "32FC1" => f32::from(*value).to_le_bytes().to_vec(),
                "rgb8" | "bgr8" => vec![*value; 3],
                _ => vec![*value],
            };
            let data = samples.repeat(4 * 2);
            // In CDR a text ends with a zero, and numbers are aligned to 4 bytes.
            let field = |content: &str, after: &[u8]| {
                let mut bytes = if is_ros1 { text(content) } else { text(&format!("{content}\0")) };
                bytes.extend(after);
                bytes.resize(if is_ros1 { bytes.len() } else { bytes.len().next_multiple_of(4) }, 0);
                bytes
            };
            let mut message = if is_ros1 { 5_u32.to_le_bytes().to_vec() } else { vec![0, 1, 0, 0] };
            message.extend([100_u32.to_le_bytes(), (ms * 1_000_000).to_le_bytes()].as_flattened());
            message.extend(field("camera", &[]));
            message.extend([2_u32.to_le_bytes(), 4_u32.to_le_bytes()].as_flattened());
            message.extend(field(format, &[0]));
            message.extend((data.len() as u32 / 2).to_le_bytes());
            message.extend((data.len() as u32).to_le_bytes());
            message.extend(data);
            let log_ns = (2_000_000 * u64::from(*ms)).to_le_bytes();
            let head = [&id.to_le_bytes()[..], &0_u32.to_le_bytes(), &log_ns, &log_ns];
            file.extend(record(5, &[&head.concat(), &message]));
        }
    }
    file
}

/// Colour, infrared pictures and two kinds of depth, as a depth camera records them.
const CAMERA: [TestTopic; 4] = [
    ("/camera/infra1/image_rect_raw", "mono8", 30, &[0, 33, 66]),
    ("/camera/color/image_raw", "rgb8", 90, &[1, 34, 67]),
    ("/camera/depth/image_rect_raw", "16UC1", 4, &[0, 33, 66]),
    ("/camera/aligned_depth_to_color/image_raw", "16UC1", 8, &[2, 35, 68]),
];

fn with_topics(names: &[&str]) -> Options {
    Options { topics: names.iter().map(|name| (*name).to_owned()).collect(), ..Options::default() }
}

#[test]
fn topics_are_chosen_by_content_or_by_name() {
    let scene = Scene::new();
    for is_ros1 in [false, true] {
        let file = unchunked(&CAMERA, is_ros1);
        let first = |options: &Options| {
            let recording = open(&scene, "take.mcap", &file, options).unwrap();
            assert_eq!((recording.len(), recording.size()), (3, (4, 2)));
            (color_of(&recording, 0).unwrap().rgb[0], depth_of(&recording, 0).unwrap().metres[7])
        };
        assert_eq!(first(&Options::default()), (90, 2.048));
        assert_eq!(first(&with_topics(&["/camera/infra1/image_rect_raw", "camera/depth/image_rect_raw"])), (30, 1.024));
        assert_eq!(first(&with_topics(&["/camera/depth/image_rect_raw"])), (90, 1.024));
    }
    let file = unchunked(&CAMERA, false);
    let refused = |names: &[&str], parts: &[&str]| {
        assert_says(open(&scene, "take.mcap", &file, &with_topics(names)), parts);
    };
    refused(&["/else"], &["--topic /else", "/camera/color/image_raw (rgb8, 3 messages)"]);
    refused(&["/camera/depth/image_rect_raw", CAMERA[3].0], &["both have depth"]);
    let [infra, color, depth, _] = CAMERA;
    let two = [color, ("/other/image_raw", "bgr8", 1, &[1, 34]), depth];
    assert_says(
        open(&scene, "take.mcap", &unchunked(&two, false), &Options::default()),
        &["several topics have colour", "--topic", "/other/image_raw (bgr8, 2 messages)"],
    );
    let bayer = ("/raw", "bayer_rggb8", 1, &[1_u32, 2][..]);
    assert_says(
        open(&scene, "take.mcap", &unchunked(&[bayer], false), &Options::default()),
        &["no topic with colour", "/raw (bayer_rggb8"],
    );
    assert_says(open(&scene, "take.mcap", &unchunked(&[bayer], false), &with_topics(&["/raw"])), &["not read"]);
    assert_says(open(&scene, "take.mcap", &unchunked(&[], false), &Options::default()), &["the file has no topics"]);
    // Grey alone is what there is to show.
    assert_eq!(open(&scene, "take.mcap", &unchunked(&[infra], false), &Options::default()).unwrap().len(), 3);
}

#[test]
fn pictures_are_paired_within_half_a_frame() {
    let scene = Scene::new();
    let pair = |colors: &'static [u32], depths: &'static [u32]| {
        let topics = [("/color", "rgb8", 9, colors), ("/depth", "16UC1", 8, depths)];
        open(&scene, "take.mcap", &unchunked(&topics, false), &Options::default())
    };
    let recording = pair(&[10, 43, 76, 109], &[26, 109, 500]).unwrap();
    // 26 is within half a frame of 10, and not of 43.
    assert_eq!(times_ns(&recording), [0, 99_000_000]);
    assert_eq!((recording.unpaired().color, recording.unpaired().depth), (2, 1));
    assert_says(pair(&[10, 43], &[400, 500]), &["no depth map of /depth", "half a frame", "--depth none"]);
    // Out of order in the file, and one twice.
    let recording = pair(&[43, 10, 43, 76], &[76, 43, 10]).unwrap();
    assert_eq!(times_ns(&recording), [0, 33_000_000, 66_000_000]);
}

#[test]
fn a_cut_file_is_played_as_far_as_it_is_whole() {
    let scene = Scene::new();
    let mut lengths = [0; 4];
    for end in (0..RAW.len()).step_by(RAW.len() / 200) {
        match open(&scene, "take.mcap", &RAW[..end], &Options::default()) {
            Ok(recording) => {
                lengths[recording.len()] += 1;
                // The first picture may have come without its depth.
                let frames = if recording.has_depth() { recording.len() } else { 0 };
                (0..frames).for_each(|frame| assert_frame(&recording, frame, frame));
            }
            Err(error) => {
                lengths[0] += 1;
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
    assert!(lengths.iter().all(|&count| count > 10), "{lengths:?}");
    // A picture that is cut does not count, with or without chunks.
    let own = scene.path("own.mcap");
    write(&own, false).unwrap().finish().unwrap();
    let own = fs::read(own).unwrap();
    for end in (0..own.len()).step_by(own.len() / 200) {
        if let Ok(recording) = open(&scene, "take.mcap", &own[..end], &Options::default()) {
            (0..recording.len()).for_each(|frame| drop(color_of(&recording, frame).unwrap()));
        }
    }
    // A compressed chunk is whole or lost.
    for file in [LZ4, ZSTD] {
        assert_says(open(&scene, "take.mcap", &file[..file.len() / 3], &Options::default()), &["ends within a record"]);
    }
    assert_says(
        open(&scene, "take.r3d", &RECORD3D[..RECORD3D.len() - 30], &Options::default()),
        &["take.r3d", "copy it again"],
    );
    assert_says(open(&scene, "take.mcap", b"", &Options::default()), &["not an MCAP file"]);
    // What was not written to its end may go on with zeros.
    let began = unchunked(&[], false);
    let zeros = [&began[..], &[0; 900]].concat();
    let place = format!("something that is no record (at byte {})", began.len());
    assert_says(open(&scene, "take.mcap", &zeros, &Options::default()), &[&place]);
    let zeros = [unchunked(&CAMERA, false), vec![0; 900]].concat();
    assert_eq!(open(&scene, "take.mcap", &zeros, &Options::default()).unwrap().len(), 3);
}

#[test]
fn a_changed_byte_is_refused_in_one_line_or_has_no_effect() {
    let scene = Scene::new();
    for (name, file) in
        [("take.mcap", RAW), ("take.mcap", LZ4), ("take.mcap", ZSTD), ("take.mcap", REGISTERED), ("take.r3d", RECORD3D)]
    {
        for at in (0..file.len()).step_by((file.len() / 200).max(1)) {
            let mut damaged = file.to_vec();
            damaged[at] ^= 0xA5;
            let read = open(&scene, name, &damaged, &Options::default()).and_then(|recording| {
                (0..recording.len()).try_for_each(|frame| {
                    color_of(&recording, frame)?;
                    depth_of(&recording, frame).map(drop)
                })
            });
            if let Err(error) = read {
                assert!(!error.to_string().contains('\n'), "byte {at} of {name}: {error}");
            }
        }
    }
    let left: Vec<_> = fs::read_dir(scene.path("")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left.len(), 4, "the two files beside the scene's folders: {left:?}");
}

/// Returns frame `number` of the recordings that the tests write.
fn frame(number: u8) -> (ColorImage, DepthMap) {
    let (width, height) = SIZE;
    let mut color = ColorImage::new(width, height);
    color.rgb.iter_mut().enumerate().for_each(|(at, sample)| *sample = (at as u8).wrapping_mul(7).wrapping_add(number));
    let mut depth = DepthMap::new(width / 2, height / 2);
    depth.metres.iter_mut().enumerate().for_each(|(at, metres)| *metres = 0.5 + at as f32 * 0.013);
    (color, depth)
}

fn write(path: &Path, overwrite: bool) -> Result<RecordingWriter, RecordingError> {
    let mut writer = RecordingWriter::create(path, overwrite)?;
    for number in 0..4 {
        let (color, depth) = frame(number);
        writer.add(5_000_000_000 + u64::from(number) * 40_000_000, &color, Some(&depth))?;
    }
    Ok(writer)
}

#[test]
fn a_written_file_is_read_back_exactly() {
    let scene = Scene::new();
    let path = scene.path("own.mcap");
    let summary = write(&path, false).unwrap().finish().unwrap();
    assert_eq!((summary.frames, summary.replaced, summary.out_of_range_depths), (4, 0, 0));
    let recording = Recording::open(&path, &Options::default()).unwrap();
    assert_eq!(times_ns(&recording), [0, 40_000_000, 80_000_000, 120_000_000]);
    let (mut color, mut depth, mut scratch) = (ColorImage::default(), DepthMap::default(), Scratch::default());
    for number in 0..4 {
        let (expected, expected_depth) = frame(number);
        recording.read_color(number.into(), &mut scratch, &mut color).unwrap();
        recording.read_depth(number.into(), &mut scratch, &mut depth).unwrap();
        assert_eq!(color, expected);
        for (found, expected) in depth.metres.iter().zip(&expected_depth.metres) {
            assert!((found - expected).abs() <= 0.0005001, "{found} for {expected}");
        }
    }
    // The same frames give the same bytes.
    let again = scene.path("again.mcap");
    write(&again, false).unwrap().finish().unwrap();
    assert!(fs::read(&path).unwrap() == fs::read(&again).unwrap());
}

#[test]
fn a_written_file_replaces_another_only_when_it_is_whole() {
    let scene = Scene::new();
    let path = scene.path("own.mcap");
    scene.write("own.mcap", "earlier");
    assert_says(write(&path, false).map(drop), &["own.mcap: exists already"]);
    drop(write(&path, true).unwrap());
    let kept = write(&path, true).unwrap().finish_incomplete().unwrap();
    assert_eq!(kept.dir, scene.path("own.incomplete.mcap"));
    assert_eq!(Recording::open(&kept.dir, &Options::default()).unwrap().len(), 4);
    assert_eq!(fs::read(&path).unwrap(), b"earlier");
    assert_eq!(write(&path, true).unwrap().finish().unwrap().replaced, 1);
    assert_eq!(Recording::open(&path, &Options::default()).unwrap().len(), 4);
    let empty = RecordingWriter::create(&scene.path("empty.mcap"), false).unwrap();
    assert_says(empty.finish().map(drop), &["nothing was recorded"]);
    let left = fs::read_dir(scene.path("")).unwrap().filter(|entry| entry.as_ref().unwrap().path().is_file()).count();
    assert_eq!(left, 2, "no part is left behind");
}
