//! Recordings, the demonstration and the synthetic scene as cameras.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, GrayImage, Stamp};
use bokehcam_lab::scene::{Scene, View};
use bokehcam_lab::synthetic::Synthetic;
use bokehcam_live::capture::demo::{self, Demo};
use bokehcam_live::capture::replay::{PlayRange, Replay};
use bokehcam_live::capture::synthetic::Format;
use bokehcam_live::capture::{Camera, CaptureError, Captured, FrameBuffers, FrameData};
use bokehcam_live::depth::looped_recording::LoopedRecording;
use bokehcam_live::depth::recorded::RecordedDepth;
use bokehcam_live::pipeline::{Pace, Run, run};
use bokehcam_live::sink::{Sink, Target};
use bokehcam_media::recording::RecordingWriter;
use bokehcam_media::recording::{Options, Recording};

use crate::common::psnr_db;
use crate::fakes::*;
use crate::setup::*;

pub const FRAMES: usize = 10;
pub const STEP_NS: u64 = 40_000_000;

/// Writes ten frames at 25 per second; frame `n` has bytes of value `n` and a depth of 1 m plus `n` decimetres.
pub fn record(dir: &Path, with_depth: bool) {
    let mut writer = RecordingWriter::create(dir, false).unwrap();
    for frame in 0..FRAMES {
        let mut color = ColorImage::new(SIZE.0, SIZE.1);
        color.rgb.fill(frame as u8);
        let mut depth = DepthMap::new(SIZE.0, SIZE.1);
        depth.metres.fill(1.0 + 0.1 * frame as f32);
        writer.add(frame as u64 * STEP_NS, &color, with_depth.then_some(&depth)).unwrap();
    }
    writer.finish().unwrap();
}

pub fn open(dir: &Path) -> Arc<Recording> {
    Arc::new(Recording::open(dir, &Options::default()).unwrap())
}

fn replay(dir: &Path, part: PlayRange) -> Result<Replay, CaptureError> {
    Replay::new(open(dir), "test recording", &part)
}

/// Returns index, media time in milliseconds and first byte of all frames, at most `limit`.
pub fn play(camera: &mut dyn Camera, limit: usize) -> Vec<(usize, u64, u8)> {
    let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
    let mut frames = Vec::new();
    while frames.len() < limit {
        match camera.next(FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right }).unwrap() {
            Captured::Frame(Stamp { index, time_ns, .. }) => frames.push((index, time_ns / 1_000_000, color.rgb[0])),
            Captured::Corrupt(error) => panic!("{error}"),
            Captured::End => break,
            other => panic!("{other:?} of a recording"),
        }
    }
    frames
}

#[test]
fn a_recording_plays_from_start_to_end() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), false);
    let mut whole = replay(folder.path(), PlayRange::default()).unwrap();
    let info = whole.info();
    assert_eq!((info.size, info.period_ns, info.frames), (SIZE, STEP_NS, Some(10)));
    assert_eq!((info.name.as_str(), info.live, info.frame_data), ("test recording", false, FrameData::Color));
    assert!(play(&mut whole, 99).into_iter().eq((0..10).map(|i| (i, 40 * i as u64, i as u8))));

    // From 0.08 s, that frame included, to before 0.2 s.
    let part = PlayRange { start_s: 0.08, end_s: Some(0.2), ..PlayRange::default() };
    let mut middle = replay(folder.path(), part).unwrap();
    assert_eq!(middle.info().frames, Some(3));
    assert_eq!(play(&mut middle, 99), [(2, 0, 2), (3, 40, 3), (4, 80, 4)]);
    let mut few = replay(folder.path(), PlayRange { frames: Some(2), ..part }).unwrap();
    assert_eq!((few.info().frames, play(&mut few, 99).len()), (Some(2), 2));
}

#[test]
fn a_loop_goes_on_in_media_time() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), false);
    let part = PlayRange { start_s: 0.3, end_s: None, looped: true, frames: Some(5) };
    let mut looped = replay(folder.path(), part).unwrap();
    assert_eq!(looped.info().frames, Some(5));
    assert_eq!(play(&mut looped, 99), [(8, 0, 8), (9, 40, 9), (8, 80, 8), (9, 120, 9), (8, 160, 8)]);
    let mut endless = replay(folder.path(), PlayRange { frames: None, ..part }).unwrap();
    assert_eq!((endless.info().frames, play(&mut endless, 31).len()), (None, 31));
}

#[test]
fn frames_can_be_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), false);
    let mut camera = replay(folder.path(), PlayRange { looped: true, ..PlayRange::default() }).unwrap();
    assert_eq!(camera.skip_until(0), 0);
    assert_eq!(camera.skip_until(81_000_000), 3);
    assert_eq!(play(&mut camera, 1), [(3, 120, 3)]);
    assert_eq!(camera.skip_until(500_000_000), 9);
    assert_eq!(play(&mut camera, 1), [(3, 520, 3)]);
    let mut ends = replay(folder.path(), PlayRange::default()).unwrap();
    assert_eq!((ends.skip_until(u64::MAX), play(&mut ends, 1).len()), (10, 0));
}

#[test]
fn an_empty_part_says_how_long_the_recording_is() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), false);
    for (start_s, end_s, range) in
        [(3.0, None, "from 3 s to its end"), (0.2, Some(0.1), "from 0.2 s to 0.1 s"), (f64::NAN, None, "NaN")]
    {
        let error =
            replay(folder.path(), PlayRange { start_s, end_s, ..PlayRange::default() }).err().unwrap().to_string();
        assert!(error.contains(range) && error.ends_with("it lasts 0.400 s"), "{error}");
    }
}

#[test]
fn a_loop_of_nothing_but_bad_frames_ends() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), false);
    let part = PlayRange { start_s: 0.3, looped: true, ..PlayRange::default() };
    let camera = replay(folder.path(), part).unwrap();
    for picture in fs::read_dir(folder.path().join("rgb")).unwrap() {
        fs::write(picture.unwrap().path(), "no picture").unwrap();
    }
    let stop = AtomicBool::new(false);
    let sink = Target::Null.open(&sink_options()).unwrap();
    let run_of = simple(Box::new(camera), sink, &stop, Pace::Asap);
    let frames = run(Run { keep_going: true, ..run_of }).unwrap().frames;
    assert_eq!((frames.captured, frames.dropped.corrupt), (2, 2));
}

pub fn sink_options() -> bokehcam_live::sink::Options {
    bokehcam_live::sink::Options::new(SIZE, STEP_NS)
}

/// Returns a frame that has only a stamp.
pub fn seen(stamp: Stamp) -> FrameInput<'static> {
    static BLACK: ColorImage = ColorImage { width: 0, height: 0, rgb: Vec::new() };
    FrameInput { stamp, color: &BLACK, right: None }
}

#[test]
fn recorded_depth_is_that_of_the_frame() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), true);
    let mut depth = RecordedDepth::new(open(folder.path()), "test recording").unwrap();
    let mut map = DepthMap::default();
    depth.read(seen(Stamp { index: 7, time_ns: 0, captured_ns: None }), &mut map).unwrap();
    assert_eq!(map.size(), SIZE);
    assert!(map.metres.iter().all(|&z_m| (z_m - 1.7).abs() < 1e-3));

    let without = tempfile::tempdir().unwrap();
    record(without.path(), false);
    let error = RecordedDepth::new(open(without.path()), "test recording").err().unwrap();
    assert!(matches!(&error, DepthError::NoDepth { .. }) && error.to_string().contains("test recording"), "{error}");
}

#[test]
fn depth_beside_other_colours_follows_their_time_in_a_loop() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), true);
    let recording = Recording::open(folder.path(), &Options::default()).unwrap();
    let mut depth = LoopedRecording::new(recording, "test recording").unwrap();
    let mut map = DepthMap::default();
    // A lap lasts 400 ms; the camera's own frame count does not matter.
    for (time_ms, frame) in [(0, 0), (39, 0), (40, 1), (41, 1), (399, 9), (400, 0), (850, 1), (40_000_120, 3), (0, 0)] {
        depth.read(seen(Stamp { index: 77, time_ns: time_ms * 1_000_000, captured_ns: Some(5) }), &mut map).unwrap();
        assert_eq!(map.size(), SIZE);
        assert!(map.metres.iter().all(|&z_m| (z_m - 1.0 - 0.1 * frame as f32).abs() < 1e-3), "{time_ms} ms");
    }
    let without = tempfile::tempdir().unwrap();
    record(without.path(), false);
    let recording = Recording::open(without.path(), &Options::default()).unwrap();
    assert!(matches!(LoopedRecording::new(recording, "test recording"), Err(DepthError::NoDepth { .. })));
}

#[test]
fn frames_before_the_first_depth_are_counted_and_the_run_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), false);
    let stop = AtomicBool::new(false);
    let camera = replay(folder.path(), PlayRange::default()).unwrap();
    let sink = Target::Null.open(&sink_options()).unwrap();
    // Live depth, as from a depth camera.
    let late = depth_by(|FrameInput { stamp, .. }, map| {
        map.metres.fill(1.0);
        match stamp.index {
            0..4 => Err(DepthError::Unpaired { source_name: "a depth camera".to_owned() }),
            _ => Ok(()),
        }
    });
    let frames = run(Run {
        depth: Some(late),
        bokeh: Some(Box::new(fake_bokeh(2, Trouble::default()))),
        look: dof(),
        changes: None,
        keep_going: false,
        ..simple(Box::new(camera), sink, &stop, Pace::Asap)
    })
    .unwrap()
    .frames;
    assert_eq!((frames.captured, frames.dropped.unpaired, frames.delivered), (10, 4, 6));
}

/// Renders the recording through depth and blur into a file; returns its bytes.
fn rendered(dir: &Path, file: &Path) -> Vec<u8> {
    let recording = open(dir);
    let stop = AtomicBool::new(false);
    let camera = Replay::new(recording.clone(), "test recording", &PlayRange::default()).unwrap();
    let sink: Box<dyn Sink> = Target::Y4m(file.to_owned()).open(&sink_options()).unwrap();
    let report = run(Run {
        depth: Some(Box::new(RecordedDepth::new(recording, "test recording").unwrap())),
        bokeh: Some(Box::new(fake_bokeh(2, Trouble::default()))),
        look: dof(),
        changes: None,
        ..simple(Box::new(camera), sink, &stop, Pace::Asap)
    })
    .unwrap();
    assert_eq!((report.frames.captured, report.frames.delivered), (10, 10));
    fs::read(file).unwrap()
}

#[test]
fn asap_twice_gives_identical_files() {
    let folder = tempfile::tempdir().unwrap();
    record(&folder.path().join("recording"), true);
    let file = |name| rendered(&folder.path().join("recording"), &folder.path().join(name));
    let first = file("a.y4m");
    assert!(first.len() > 10 * 36);
    assert!(first == file("b.y4m"), "bit-identical");
}

#[test]
fn the_synthetic_camera_knows_its_depth() {
    let format = Format { size: (48, 27), fps: 12.5, frames: Some(3), threads: 1 };
    let mut camera = Synthetic::new(format).unwrap();
    let info = camera.info();
    assert_eq!((info.size, info.period_ns, info.frames), ((48, 27), 80_000_000, Some(3)));
    assert!(info.frame_data == FrameData::Depth && !info.live);
    let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
    for index in 0..3 {
        let Captured::Frame(stamp) =
            camera.next(FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right }).unwrap()
        else {
            panic!("frame {index}")
        };
        assert_eq!(stamp, Stamp { index, time_ns: index as u64 * 80_000_000, captured_ns: None });
        assert_eq!((color.size(), depth.size()), ((48, 27), (48, 27)));
        assert!(color.rgb.iter().any(|&byte| byte != color.rgb[0]));
        assert!(depth.metres.iter().any(|&z_m| DepthMap::is_known(z_m)));
    }
    assert!(matches!(
        camera.next(FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right }),
        Ok(Captured::End)
    ));

    for (size, fps) in [((0, 9), 30.0), ((9, 9000), 30.0), ((9, 9), 0.0), ((9, 9), f64::NAN)] {
        assert!(matches!(Synthetic::new(Format { size, fps, ..format }), Err(CaptureError::Format { .. })));
    }
}

/// Returns the next frames of the demonstration, at most `most`.
fn demonstrated(camera: &mut Demo, most: usize) -> Vec<(Stamp, ColorImage, DepthMap)> {
    let mut frames = Vec::new();
    while frames.len() < most {
        let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
        match camera.next(FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right }).unwrap() {
            Captured::Frame(stamp) => frames.push((stamp, color, depth)),
            Captured::End => break,
            other => panic!("{other:?}"),
        }
    }
    frames
}

/// Returns the mean squared difference of two pictures.
fn apart(a: &ColorImage, b: &ColorImage) -> f64 {
    let squares = a.rgb.iter().zip(&b.rgb).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2));
    squares.sum::<f64>() / a.rgb.len() as f64
}

#[test]
fn the_demonstration_is_the_rendered_scene_as_nearly_as_it_is_coded() {
    let (scene, view) = (Scene::portrait(), View::new(demo::SIZE_PX.0, demo::SIZE_PX.1));
    let frames = demonstrated(&mut Demo::new(None).unwrap(), demo::FRAMES as usize);
    let (mut picture, mut map) = (ColorImage::default(), DepthMap::default());
    for index in [0, 29] {
        let time_s = index as f64 / f64::from(demo::FRAMES_PER_SECOND);
        scene.render_pinhole(&view, time_s, 16, 2, &mut picture, &mut map);
        let (_, color, depth) = &frames[index];
        let psnr_db = psnr_db(color, &picture);
        assert!(psnr_db > 34.0, "frame {index}: {psnr_db} dB");
        // Half a quantisation level; another machine's mathematical functions may send a ray past an edge.
        let is_off = |(a, b): &(&f32, &f32)| (a.recip() - b.recip()).abs() > 0.0044;
        let off = depth.metres.iter().zip(&map.metres).filter(is_off).count();
        assert!(off * 1000 <= map.metres.len(), "frame {index}: {off} depths");
    }
}

#[test]
fn the_demonstration_goes_round_without_a_jump_until_its_end() {
    let mut camera = Demo::new(None).unwrap();
    let info = camera.info();
    assert_eq!((info.size, info.period_ns, info.frames), (demo::SIZE_PX, 41_666_667, None));
    assert!(info.frame_data == FrameData::Depth && !info.live);
    let lap = demo::FRAMES as usize;
    let frames = demonstrated(&mut camera, lap + 1);
    assert!(frames.iter().zip(0..).all(|((stamp, ..), index)| stamp.index == index));
    assert_eq!(frames[lap].0.time_ns, 2_000_000_000);
    assert!(frames[lap].1 == frames[0].1 && frames[lap].2 == frames[0].2, "it begins again");
    let steps: Vec<f64> = frames.windows(2).map(|pair| apart(&pair[0].1, &pair[1].1)).collect();
    let most = steps[..lap - 1].iter().copied().fold(0.0, f64::max);
    assert!(steps.iter().all(|step| *step > 0.2 * most) && steps[lap - 1] <= most, "even steps: {steps:?}");
    // Two frames are read, some are skipped, then comes the end.
    let mut camera = Demo::new(Some(9)).unwrap();
    assert_eq!(demonstrated(&mut camera, 2).len(), 2);
    assert_eq!(camera.skip_until(200_000_000), 3);
    let rest = demonstrated(&mut camera, 100);
    assert_eq!(rest.len(), 4);
    assert!(rest[0].1 == frames[5].1 && rest[0].2 == frames[5].2);
}
