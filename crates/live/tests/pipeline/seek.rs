//! Seeking in a recording: picture, depth and right picture of the requested frame, with times that only increase.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, GrayImage, Stamp};
use bokehcam::link::demand::Demand;
use bokehcam::link::{self, Receiver};
use bokehcam_live::capture::replay::{PlayRange, Replay};
use bokehcam_live::capture::{Camera, Captured, FrameBuffers, FrameData};
use bokehcam_live::depth::looped_recording::LoopedRecording;
use bokehcam_live::depth::recorded::RecordedDepth;
use bokehcam_live::pipeline::{Pace, Run, View, run};
use bokehcam_live::sink::Target;
use bokehcam_media::recording::{Options, Recording, Scratch};

use crate::fakes::fake_bokeh;
use crate::replay::{FRAMES, STEP_NS, open, play, record, seen, sink_options};
use crate::setup::*;
use crate::until::found;

/// Timeout: longer counts as a hang.
const PATIENCE: Duration = Duration::from_secs(60);

fn looped(dir: &Path, start_s: f64) -> Replay {
    Replay::new(open(dir), "test recording", &PlayRange { start_s, looped: true, ..PlayRange::default() }).unwrap()
}

#[test]
fn the_frame_that_is_asked_for_comes_next_and_media_time_only_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), false);
    let mut camera = looped(folder.path(), 0.0);
    let seeker = camera.seeker().unwrap();
    assert_eq!((seeker.frames(), seeker.length_ns(), seeker.time_ns(3)), (FRAMES, 10 * STEP_NS, 3 * STEP_NS));
    let mut frames = play(&mut camera, 2);
    // Forward, backward, across the seam, to the same frame again, and beyond the end.
    for place in [7, 3, 9, 9, 0, 99] {
        camera.seek(place);
        frames.extend(play(&mut camera, 2));
    }
    let indices = [0, 1, 7, 8, 3, 4, 9, 0, 9, 0, 0, 1, 9, 0];
    assert!(frames.iter().map(|frame| frame.0).eq(indices), "{frames:?}");
    assert!(frames.iter().map(|frame| usize::from(frame.2)).eq(indices), "the pictures are those of the frames");
    assert!(frames.iter().map(|frame| frame.1).eq((0..14).map(|k| 40 * k)), "a period after each other: {frames:?}");
    // A requested frame is never skipped; later ones may be.
    camera.seek(2);
    assert_eq!(camera.skip_until(14 * STEP_NS), 0);
    assert_eq!(camera.skip_until(16 * STEP_NS), 2);
    assert_eq!(play(&mut camera, 1), [(4, 640, 4)]);
}

#[test]
fn a_part_is_sought_in_by_its_own_places_and_ends_where_it_did() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), false);
    let part = PlayRange { start_s: 0.08, end_s: Some(0.28), ..PlayRange::default() };
    let mut camera = Replay::new(open(folder.path()), "test recording", &part).unwrap();
    let seeker = camera.seeker().unwrap();
    assert_eq!((seeker.frames(), seeker.length_ns()), (5, 5 * STEP_NS));
    let stamp = |index| Stamp { index, time_ns: 0, captured_ns: None };
    assert_eq!([2, 6].map(|index| seeker.position_of(stamp(index))), [0, 4]);
    camera.seek(4);
    assert_eq!(play(&mut camera, 9), [(6, 0, 6)]);
    camera.seek(1);
    assert_eq!(play(&mut camera, 9).len(), 4, "from the second to the last");
    // The limit on the number of frames holds across seeks.
    let mut few = Replay::new(open(folder.path()), "test recording", &PlayRange { frames: Some(3), ..part }).unwrap();
    few.seek(4);
    assert_eq!(play(&mut few, 9).len(), 1);
    few.seek(0);
    assert_eq!(play(&mut few, 9).len(), 2);
}

#[test]
fn the_newest_wish_counts_and_each_counts_once() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), false);
    let seeker = looped(folder.path(), 0.0).seeker().unwrap();
    assert_eq!(seeker.newer_request(0), None);
    assert_eq!([3, 8, 99].map(|place| seeker.request_frame(place)), [1, 2, 3]);
    let wish = seeker.newer_request(0).unwrap();
    assert_eq!((wish.number, wish.position, seeker.newer_request(3)), (3, 9, None));
}

#[test]
fn the_right_eye_is_that_of_the_frame() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("recordings/stereo");
    let recording = Arc::new(Recording::open(&folder, &Options::default()).unwrap());
    let part = PlayRange { looped: true, ..PlayRange::default() };
    let mut camera = Replay::new(Arc::clone(&recording), "stereo", &part).unwrap().with_right_camera();
    assert_eq!(camera.info().frame_data, FrameData::RightCamera);
    let (mut color, mut depth, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
    let (mut scratch, mut own_color, mut own_right) = (Scratch::default(), ColorImage::default(), GrayImage::default());
    let last = recording.len() - 1;
    assert!(last > 1);
    for place in [last, 0, last / 2] {
        camera.seek(place);
        let shot = FrameBuffers { color: &mut color, depth: &mut depth, right: &mut right };
        let Captured::Frame(stamp) = camera.next(shot).unwrap() else { panic!("frame {place}") };
        recording.read_color(place, &mut scratch, &mut own_color).unwrap();
        recording.read_right(place, &mut scratch, &mut own_right).unwrap();
        assert!(stamp.index == place && color == own_color && right == own_right);
    }
}

#[test]
fn depth_of_another_recording_stays_beside_the_colours() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), true);
    let mut camera = looped(folder.path(), 0.0);
    let mut depth =
        LoopedRecording::new(Recording::open(folder.path(), &Options::default()).unwrap(), "beside").unwrap();
    let (mut color, mut map, mut right) = (ColorImage::default(), DepthMap::default(), GrayImage::default());
    for place in [None, Some(6), None, Some(2), Some(9), None, None, Some(5)] {
        if let Some(place) = place {
            depth.seek(camera.seek(place));
        }
        let shot = FrameBuffers { color: &mut color, depth: &mut DepthMap::default(), right: &mut right };
        let Captured::Frame(stamp) = camera.next(shot).unwrap() else { panic!("{place:?}") };
        depth.read(seen(stamp), &mut map).unwrap();
        let expected_m = 1.0 + 0.1 * f32::from(color.rgb[0]);
        assert!(map.metres.iter().all(|&m| (m - expected_m).abs() < 1e-3), "{stamp:?}: {}", map.metres[0]);
    }
}

/// Recorded depth that counts scene changes.
struct Told(RecordedDepth, Arc<std::sync::atomic::AtomicUsize>);

impl DepthSource for Told {
    fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        self.0.read(seen, map)
    }
    fn seek(&mut self, _: i64) {
        self.1.fetch_add(1, Ordering::SeqCst);
    }
}

#[test]
fn while_nobody_watches_each_wish_brings_its_one_frame_with_its_depth() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), true);
    let mut camera = looped(folder.path(), 0.0);
    let seeker = camera.seeker().unwrap();
    let jumps = Arc::default();
    let depth = Told(RecordedDepth::new(open(folder.path()), "test").unwrap(), Arc::clone(&jumps));
    let (stop, demand) = (AtomicBool::new(false), Demand::new());
    let (view, mut views) = link::live::<View>();
    let sink = Target::Null.open(&sink_options()).unwrap();
    let simple = simple(Box::new(camera), sink, &stop, Pace::Realtime);
    let bokeh = fake_bokeh(2, Default::default());
    let run_of = Run {
        depth: Some(Box::new(depth)),
        bokeh: Some(Box::new(bokeh)),
        look: dof(),
        demand: Some(demand.clone()),
        view: Some(view),
        ..simple
    };
    let next = |views: &mut Receiver<View>, number: u64, place: usize| {
        let view = found(&format!("frame {place}"), PATIENCE, || views.try_recv());
        assert_eq!((view.stamp.index, view.seek, view.is_seek_target), (place, number, true));
        assert_eq!(usize::from(view.color.as_ref().unwrap().rgb[0]), place);
        let depth = view.depth.as_ref().unwrap();
        assert!(depth.metres.iter().all(|&m| (m - 1.0 - 0.1 * place as f32).abs() < 1e-3));
        drop(view);
        std::thread::sleep(Duration::from_millis(150));
        assert!(views.try_recv().is_none(), "no other frame comes");
    };
    let checked = || {
        // Stops the run even if a check fails.
        let _end = SetAtEnd(&stop);
        for (number, place) in [(1, 6), (2, 7), (3, 0), (4, 9)] {
            assert_eq!(seeker.request_frame(place), number);
            next(&mut views, number, place);
        }
        // With a viewer, playback continues from there, across the seam.
        let _watch = demand.watch();
        let view = found("it goes on", PATIENCE, || views.try_recv());
        assert!(view.stamp.index < 9 && view.seek == 4 && !view.is_seek_target, "{:?}", view.stamp);
    };
    let report = std::thread::scope(|scope| {
        let checked = scope.spawn(checked);
        let report = run(run_of).unwrap();
        checked.join().unwrap();
        report
    });
    assert!(report.frames.is_balanced());
    assert_eq!(jumps.load(Ordering::SeqCst), 4, "depth is told each time");
}

struct SetAtEnd<'a>(&'a AtomicBool);

impl Drop for SetAtEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::SeqCst);
    }
}
