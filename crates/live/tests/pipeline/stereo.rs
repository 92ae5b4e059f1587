//! Stereo pairs through the pipeline: the right picture stays with its left one, and the blur follows the disparity.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use bokehcam::bokeh::aperture::Aperture;
use bokehcam::bokeh::{self, Backend, Method};
use bokehcam::budget::Quality;
use bokehcam::depth::focus::FocusRule;
use bokehcam::depth::stereo::source::StereoDepth;
use bokehcam::depth::stereo::{self, Effort, Matcher, Settings};
use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam::look::{Effect, Look};
use bokehcam::optics::CocKind;
use bokehcam::optics::StereoRig;
use bokehcam_live::capture::{Camera, Captured, FrameBuffers, FrameData, SourceInfo};
use bokehcam_live::pipeline::{Fault, Pace, Run, run};

use crate::fakes::*;
use crate::planes;
use crate::setup::*;

fn two_eyes(frames: usize) -> FakeCamera {
    FakeCamera { frame_data: FrameData::RightCamera, ..fake_camera(frames) }
}

/// Creates a matcher of small pictures.
fn matcher(size: (u32, u32)) -> Box<dyn Matcher> {
    stereo::create(&Settings { size, disparities: 16, effort: Effort::Full, threads: 1 }, Backend::Cpu, None).unwrap()
}

#[test]
fn the_right_eye_comes_with_its_picture_and_unpaired_frames_are_counted() {
    let stop = AtomicBool::new(false);
    for pace in [Pace::Asap, Pace::Realtime] {
        let received = Received::default();
        // The right picture must be of the same frame as the left one.
        let depth = depth_by(|seen, map| {
            let right = seen.right.expect("a right eye");
            assert_eq!((right.luma[0], right.size()), (seen.stamp.index as u8, SIZE));
            assert_eq!(seen.color.rgb[0], right.luma[0], "picture and right eye are of one frame");
            map.metres.fill(1.0 + f32::from(right.luma[0]));
            Ok(())
        });
        let camera = FakeCamera { unpaired_every: 3, ..two_eyes(60) };
        let frames = run(Run {
            depth: Some(depth),
            bokeh: Some(Box::new(fake_bokeh(2, Trouble::default()))),
            look: dof(),
            ..simple(Box::new(camera), Box::new(fake_sink(&received)), &stop, pace)
        })
        .unwrap()
        .frames;
        assert!(frames.is_balanced(), "{frames:?}");
        assert_eq!((frames.captured, frames.in_flight, frames.delivered), (60, 0, received.count()), "{pace:?}");
        if pace == Pace::Asap {
            assert_eq!((frames.delivered, frames.dropped.unpaired), (40, 20));
            assert!(received.numbers().iter().all(|number| number % 3 != 2));
        }
    }
}

#[test]
fn depth_from_two_eyes_of_a_camera_with_one_is_an_error() {
    let stop = AtomicBool::new(false);
    let matcher = matcher(SIZE);
    let error = run(Run {
        depth: Some(Box::new(StereoDepth::from_rectified(
            "fake camera",
            StereoRig::default_for_width(SIZE.0),
            matcher,
            16,
        ))),
        bokeh: Some(Box::new(fake_bokeh(2, Trouble::default()))),
        look: dof(),
        ..simple(Box::new(fake_camera(5)), Box::new(fake_sink(&Received::default())), &stop, Pace::Asap)
    })
    .unwrap_err();
    assert!(matches!(error.fault, Fault::Depth(DepthError::MissingRight { .. })), "{error}");
}

/// Depth that takes long, less at lower effort; it marks the pictures that it rectifies.
struct Slow {
    effort: Arc<AtomicUsize>,
    most: usize,
}

const MARK: u8 = 77;

impl DepthSource for Slow {
    fn rectify(&mut self, color: &mut ColorImage) {
        color.rgb[BLURRED] = MARK;
    }
    fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        assert_eq!(seen.color.rgb[BLURRED], MARK, "straightened before it is matched");
        std::thread::sleep(Duration::from_millis(1 + self.most as u64));
        map.resize(SIZE.0, SIZE.1);
        map.metres.fill(1.0);
        Ok(())
    }
    fn efforts(&self) -> &'static [f64] {
        &[0.3, 1.0]
    }
    fn set_effort(&mut self, effort: usize) {
        self.most = effort;
        self.effort.store(effort, Ordering::SeqCst);
    }
}

#[test]
fn without_time_depth_is_made_with_less_effort_and_every_picture_is_straightened() {
    let stop = AtomicBool::new(false);
    for (pace, held, effort) in [(Pace::Asap, false, 9), (Pace::Realtime, true, 0)] {
        let received = Received::default();
        let last = Arc::new(AtomicUsize::new(9));
        let report = run(Run {
            depth: Some(Box::new(Slow { effort: last.clone(), most: 1 })),
            bokeh: Some(Box::new(fake_bokeh(2, Trouble::default()))),
            look: dof(),
            ..simple(Box::new(two_eyes(400)), Box::new(fake_sink(&received)), &stop, pace)
        })
        .unwrap();
        assert_eq!((report.depth_held > 0, last.load(Ordering::SeqCst)), (held, effort), "{pace:?}");
        assert!(received.count() > 0);
        assert!(received.pictures.lock().unwrap().iter().all(|rgb| rgb[BLURRED] == MARK), "{pace:?}");
    }
}

#[test]
fn pictures_are_straightened_for_a_look_without_depth_as_well() {
    let (stop, received) = (AtomicBool::new(false), Received::default());
    run(Run {
        depth: Some(Box::new(Slow { effort: Arc::default(), most: 1 })),
        bokeh: Some(Box::new(fake_bokeh(2, Trouble::default()))),
        look: Look::with_effect(Effect::Blur),
        ..simple(Box::new(two_eyes(5)), Box::new(fake_sink(&received)), &stop, Pace::Asap)
    })
    .unwrap();
    assert_eq!(received.count(), 5);
    assert!(received.pictures.lock().unwrap().iter().all(|rgb| rgb[BLURRED] == MARK));
}

/// The square before the wall, once.
fn two_planes() -> Box<dyn Camera> {
    let (name, frames, frame_data) = ("two planes".into(), Some(1), FrameData::RightCamera);
    let info = SourceInfo { name, size: planes::SIZE, period_ns: 33_000_000, frames, live: false, frame_data };
    camera_by(info, |index, FrameBuffers { color, right, .. }| {
        (*color, *right) = planes::seen();
        let stamp = Stamp { index, time_ns: 0, captured_ns: None };
        if index == 0 { Captured::Frame(stamp) } else { Captured::End }
    })
}

#[test]
fn what_has_the_disparity_of_the_focus_is_sharp_and_the_rest_is_not() {
    let (width, height) = planes::SIZE;
    let (sharp, _) = planes::seen();
    let settings = bokeh::Settings {
        coc: CocKind::Depth,
        method: Method::Layered,
        aperture: Aperture::default(),
        rim: 0.2,
        rank: None,
        highlights: 0.0,
        quality: Quality::Balanced,
        adaptive: false,
        reuse: false,
        privacy: false,
        far_max_px: 8.0,
        near_max_px: 16.0,
    };
    // For any rig: it does not determine the blur.
    for rig in [
        StereoRig::default_for_width(width),
        StereoRig { focal_px: 300.0, baseline_m: 0.5, doffs_px: 0.0, metric: true },
    ] {
        for (focus, near_is_sharp) in [((0.5, 0.5), true), ((0.85, 0.1), false)] {
            let (stop, received) = (AtomicBool::new(false), Received::default());
            let matcher = matcher((width, height));
            run(Run {
                depth: Some(Box::new(StereoDepth::from_rectified("two planes", rig, matcher, 16))),
                bokeh: Some(bokeh::create_blur(&settings, (width, height), None, Some(1)).unwrap()),
                look: dof_with(FocusRule::Point { x: focus.0, y: focus.1 }, 16.0),
                ..simple(two_planes(), Box::new(fake_sink(&received)), &stop, Pace::Asap)
            })
            .unwrap();
            let pictures = received.pictures.lock().unwrap();
            let near = planes::difference(&pictures[0], &sharp.rgb, planes::is_well_inside);
            let far = planes::difference(&pictures[0], &sharp.rgb, planes::is_well_outside);
            let (in_focus, blurred) = if near_is_sharp { (near, far) } else { (far, near) };
            println!("{rig:?}, near is sharp: {near_is_sharp}: {in_focus:.2} in focus, {blurred:.2} elsewhere");
            assert!(in_focus < 2.0 && blurred > 20.0, "{rig:?}: {in_focus} in focus, {blurred} elsewhere");
        }
    }
}
