//! Recordings of Azure Kinect, written here element by element as the recorder of its SDK does, and one by ffmpeg.

mod camera;
mod matroska;

use std::fs;

use bokehcam_media::recording::{DepthUnit, Options, Recording, RecordingError};

use self::matroska::{Take, block, block_group, element, imu_block};
use super::{SIZE, Scene, assert_says, color_of, depth_of, times_ns};

/// Three frames of 24x16 and 12x8, 0.1 s apart, of the colour (10 k, 100, 200) and the depth k + 1 m; by ffmpeg, which
/// leaves out the pixel format of the depth, `b16g`: it was put in afterwards.
const FFMPEG: &[u8] = include_bytes!("../../../../../fuzz/seeds/recording_file/kinect.mkv");

fn open(scene: &Scene, file: &[u8]) -> Result<Recording, RecordingError> {
    scene.write("take.mkv", file);
    Recording::open(&scene.path("take.mkv"), &Options::default())
}

/// Asserts that a frame has the colour and depth of frame `number`.
#[track_caller]
fn assert_frame(recording: &Recording, at: usize, number: usize) {
    let color = color_of(recording, at).unwrap();
    assert_eq!(color.size(), SIZE);
    let expected = [10 * number as u8, 100, 200];
    for (found, expected) in color.rgb.iter().zip(expected.iter().cycle()) {
        assert!(found.abs_diff(*expected) <= 3, "frame {at}: {found} for {expected}");
    }
    let depth = depth_of(recording, at).unwrap();
    assert_eq!((depth.size(), depth.metres[0]), ((12, 8), 0.0));
    assert!(depth.metres[1..].iter().all(|&metres| metres == number as f32 + 1.0), "{:?}", &depth.metres[..3]);
}

#[test]
fn a_file_of_ffmpeg_is_read() {
    let recording = open(&Scene::new(), FFMPEG).unwrap();
    assert_eq!((recording.layout(), recording.len(), recording.size()), ("Azure Kinect", 3, SIZE));
    assert_eq!(times_ns(&recording), [0, 100_000_000, 200_000_000]);
    for frame in [2, 0, 1] {
        let (color, depth) = (color_of(&recording, frame).unwrap(), depth_of(&recording, frame).unwrap());
        assert!(color.rgb[0].abs_diff(10 * frame as u8) <= 2 && color.rgb[2].abs_diff(200) <= 2);
        assert!(depth.size() == (12, 8) && depth.metres.iter().all(|&metres| metres == frame as f32 + 1.0));
    }
}

#[test]
fn every_format_of_colour_gives_the_same_pictures() {
    let scene = Scene::new();
    for format in ["MJPG", "NV12", "YUY2", "BGRA"] {
        let recording = open(&scene, &Take::with_frames(format, 3).file()).unwrap();
        assert!((recording.len(), recording.has_times(), recording.has_depth_in_units()) == (3, true, false));
        assert_eq!(times_ns(&recording), [0, 33_333_000, 66_666_000]);
        (0..3).rev().for_each(|frame| assert_frame(&recording, frame, frame));
    }
    let mut take = Take::with_frames("MJPG", 1);
    take.tracks[0] = matroska::track(1, "COLOR", "YV12", SIZE);
    assert_says(open(&scene, &take.file()), &["take.mkv", "YV12", "record them as MJPG"]);
    // Bytes that are missing in the picture itself.
    let mut take = Take::with_frames("BGRA", 0);
    take.clusters.push((0, vec![block(1, 0, &[0; 24 * 16 * 4 - 1]), block(2, 0, &[0; 12 * 8 * 2 - 1])]));
    let recording = open(&scene, &take.file()).unwrap();
    assert_says(color_of(&recording, 0), &["take.mkv/COLOR, frame 0", "ends before"]);
    assert_says(depth_of(&recording, 0), &["take.mkv/DEPTH, frame 0", "ends before"]);
}

#[test]
fn only_recordings_of_a_kinect_are_taken_as_such() {
    let scene = Scene::new();
    let is_recording = |name: &str, file: &[u8]| {
        scene.write(name, file);
        bokehcam_media::recording::is_recording_file(&scene.path(name))
    };
    let take = Take::with_frames("MJPG", 1);
    assert!(is_recording("take.mkv", &take.file()) && is_recording("take.MKV", &take.file()));
    assert!(is_recording("take", &take.file()), "by its content");
    // Tags may be lost, or moved to the end.
    assert!(is_recording("take.mkv", &Take { tags: Vec::new(), ..take.clone() }.file()));
    assert!(is_recording("take.mkv", &Take { is_tagged_last: true, ..take.clone() }.file()));
    let without_depth = Take { tracks: take.tracks[..1].to_vec(), ..take.clone() };
    assert!(is_recording("take.mkv", &without_depth.file()));
    // Another video of the same camera, and others.
    let film = Take { tracks: vec![matroska::track(1, "COLOR", "H264", SIZE)], ..take.clone() };
    assert!(!is_recording("film.mkv", &film.file()));
    assert!(!is_recording("film.mkv", &Take { tags: Vec::new(), ..without_depth }.file()));
    assert!(!is_recording("film.mkv", &take.file()[..60]) && !is_recording("film.mkv", b""));
    assert!(!is_recording("film.mkv", &take.file()[1..]));
}

#[test]
fn every_form_that_matroska_allows_is_read() {
    let scene = Scene::new();
    let take = Take::with_frames("MJPG", 3);
    let mut grouped = take.clone();
    for (_, blocks) in &mut grouped.clusters {
        blocks.iter_mut().for_each(|block| *block = block_group(block));
        // Padding, a checksum, and samples of the accelerometer, several in a block.
        blocks.insert(0, element(0xEC, &[0; 40]));
        blocks.insert(1, element(0xBF, &[1, 2, 3, 4]));
        blocks.insert(2, imu_block());
    }
    for (what, take) in [
        ("groups", grouped),
        ("unknown lengths", Take { has_lengths: false, ..take.clone() }),
        ("tags last", Take { is_tagged_last: true, ..take.clone() }),
        ("killed", Take { is_killed: true, ..take.clone() }),
    ] {
        let recording = open(&scene, &take.file()).unwrap();
        assert_eq!(times_ns(&recording), [0, 33_333_000, 66_666_000], "{what}");
        (0..3).for_each(|frame| assert_frame(&recording, frame, frame));
    }
    // Tracks by the tag that names them.
    let mut named = take;
    named.tracks = vec![matroska::track(1, "Video 1", "MJPG", SIZE), matroska::track(2, "Video 2", "b16g", (12, 8))];
    named.tags.extend([("K4A_COLOR_TRACK", "1001".to_owned()), ("K4A_DEPTH_TRACK", "1002".to_owned())]);
    assert_frame(&open(&scene, &named.file()).unwrap(), 1, 1);
    // After a damaged cluster comes a whole one.
    let file = named.file();
    let second = file.windows(4).position(|bytes| bytes == [0x1F, 0x43, 0xB6, 0x75]).unwrap() + 8;
    let mut damaged = file;
    damaged[second] = 0;
    let recording = open(&scene, &damaged).unwrap();
    assert_eq!(recording.len(), 2);
    assert_frame(&recording, 0, 1);
}

#[test]
fn what_is_missing_is_said_or_left_out() {
    let scene = Scene::new();
    let take = Take::with_frames("MJPG", 2);
    let passive =
        Take { tracks: vec![take.tracks[0].clone(), matroska::track(3, "IR", "b16g", (12, 8))], ..take.clone() };
    let recording = open(&scene, &passive.file()).unwrap();
    assert_eq!((recording.len(), recording.has_depth()), (2, false));
    let dark = Take { tracks: take.tracks[1..].to_vec(), ..take.clone() };
    assert_says(open(&scene, &dark.file()), &["take.mkv: it has no colour pictures", "COLOR"]);
    assert_says(open(&scene, &Take { clusters: Vec::new(), ..take.clone() }.file()), &["no colour picture"]);
    // Depth half a frame away, and more.
    let shifted = |ticks: i16| {
        let mut take = Take::with_frames("MJPG", 0);
        for frame in 0..3 {
            let [color, depth] = matroska::pictures("MJPG", frame);
            take.clusters.push((u64::from(frame) * 100_000, vec![block(1, 0, &color), block(2, ticks, &depth)]));
        }
        open(&scene, &take.file())
    };
    assert_frame(&shifted(20_000).unwrap(), 2, 2);
    assert_frame(&shifted(-30_000).unwrap(), 2, 2);
    let mut apart = take.clone();
    apart.clusters = vec![(0, vec![take.clusters[0].1[0].clone()]), (50_000, vec![take.clusters[1].1[1].clone()])];
    assert_says(open(&scene, &apart.file()), &["take.mkv: no depth map", "half a frame"]);
    // The file's own calibration is broken: depth is taken as of the same view.
    let broken = Take { calibration: Some("{}".to_owned()), ..take.clone() };
    assert_frame(&open(&scene, &broken.file()).unwrap(), 1, 1);
    // Of another view it is not.
    let mut narrow = take.clone();
    narrow.tracks[1] = matroska::track(2, "DEPTH", "b16g", (8, 12));
    let recording = open(&scene, &narrow.file()).unwrap();
    let uncalibrated = ["frame 1: the depth map is 8x12", "the file has no calibration", "--depth-calibration"];
    assert_says(depth_of(&recording, 1), &uncalibrated);
    assert!(color_of(&recording, 1).is_ok());
    // A block with several pictures does not count.
    let mut laced = take;
    laced.clusters[0].1[0] = matroska::laced(&laced.clusters[0].1[0]);
    let recording = open(&scene, &laced.file()).unwrap();
    assert_eq!((recording.len(), recording.unpaired().depth), (1, 1));
}

#[test]
fn options_of_depth_have_the_effect_that_metres_allow() {
    let scene = Scene::new();
    scene.write("take.mkv", Take::with_frames("MJPG", 2).file());
    let options = Options { depth_invalid: Some(1000), depth_scale: Some(1.0), ..Options::default() };
    let recording = Recording::open(&scene.path("take.mkv"), &options).unwrap();
    assert_eq!(depth_of(&recording, 0).unwrap().metres[5], 0.0);
    assert_eq!(depth_of(&recording, 1).unwrap().metres[5], 2.0, "the file states millimetres");
    let options = Options { depth_unit: DepthUnit::Inverse, ..Options::default() };
    assert!(!Recording::open(&scene.path("take.mkv"), &options).unwrap().has_relative_depth());
}

#[test]
fn a_cut_file_is_played_as_far_as_it_is_whole() {
    let scene = Scene::new();
    for take in [Take::with_frames("MJPG", 3), Take { has_lengths: false, ..Take::with_frames("NV12", 3) }] {
        let file = take.file();
        let mut lengths = [0; 4];
        for end in (0..200).map(|part| part * file.len() / 200) {
            match open(&scene, &file[..end]) {
                Ok(recording) => {
                    lengths[recording.len()] += 1;
                    let frames = if recording.has_depth() { recording.len() } else { 0 };
                    (0..frames).for_each(|frame| assert_frame(&recording, frame, frame));
                }
                Err(error) => {
                    lengths[0] += 1;
                    assert!(!error.to_string().contains('\n'), "{error}");
                }
            }
        }
        assert!(lengths.iter().all(|&count| count >= 10), "{lengths:?}");
    }
    let file = Take::with_frames("MJPG", 3).file();
    assert_says(open(&scene, &file[..600]), &["no colour picture in it is whole", "copy it again"]);
}

#[test]
fn a_changed_byte_is_refused_in_one_line_or_has_no_effect() {
    let scene = Scene::new();
    let mut take = Take::with_frames("MJPG", 3);
    take.calibration = Some(camera::json());
    for file in [FFMPEG, &take.file()] {
        for at in (0..file.len()).step_by((file.len() / 200).max(1)).chain(40..300) {
            let mut damaged = file.to_vec();
            damaged[at] ^= 0xA5;
            let read = open(&scene, &damaged).and_then(|recording| {
                (0..recording.len()).try_for_each(|frame| {
                    color_of(&recording, frame)?;
                    if recording.has_depth() { depth_of(&recording, frame).map(drop) } else { Ok(()) }
                })
            });
            if let Err(error) = read {
                assert!(!error.to_string().contains('\n'), "byte {at}: {error}");
            }
        }
    }
    assert_eq!(fs::read_dir(scene.path("")).unwrap().count(), 3, "nothing is written");
}
