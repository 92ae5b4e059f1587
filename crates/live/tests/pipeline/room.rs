//! A call never shows the room: a person comes and goes before a wall with a mark, and no frame that leaves has the mark
//! sharp, however depth, blur and look change or fail.

use std::collections::BTreeSet;
use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use bokehcam::bokeh::fallback::Fallback;
use bokehcam::bokeh::{self, Bokeh, BokehError, PassTimes};
use bokehcam::budget::Quality;
use bokehcam::clock::Clock;
use bokehcam::compute::Backend;
use bokehcam::computing::ComputeOptions;
use bokehcam::depth::backdrop::Background;
use bokehcam::depth::focus::FocusRule;
use bokehcam::depth::{DepthError, DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam::look::{Effect, Look, Strength};
use bokehcam_live::capture::{Camera, Captured, FrameBuffers, FrameData, SourceInfo};
use bokehcam_live::pipeline::{BlurSetup, ChangeSender, Destination, Pace, PipelineError, Run, run};
use bokehcam_live::sink::{Ending, Sink, SinkError};
use bokehcam_live::stats::Report;
use bokehcam_networks::single_camera::{Hints, SingleCamera};

use crate::fakes::{FakeBokeh, Trouble, camera_by, changed, depth_by, fake_bokeh};
use crate::onnx;

const SIZE: (u32, u32) = (64, 48);
/// Period of the media time, and of the frames in real time.
const MEDIA_NS: u64 = 33_000_000;
const PERIOD_NS: u64 = 4_000_000;
/// Side of the blocks in which the mark is looked for, and the distance that they keep from the person.
const BLOCK_PX: usize = 8;
const MARGIN_PX: usize = 10;
/// Difference of the mark's codes within a block that counts as sharp: half of the mark's own.
const SHARP: u8 = 55;

/// The columns of the person in a frame, if a person is there: they come, walk, and are gone from one frame to the next.
fn person(index: usize) -> Option<Range<usize>> {
    let step = index % 50;
    let left = 4 + (step * 3 + index / 50 * 7) % 36;
    (12..40).contains(&step).then_some(left..left + 20)
}

fn is_person(index: usize, x: usize, y: usize) -> bool {
    y >= 10 && person(index).is_some_and(|columns| columns.contains(&x))
}

/// Draws a frame: noise, the person, and a wall of stripes; an empty one, the network takes half for a person in part.
fn draw(index: usize, color: &mut ColorImage) {
    color.resize(SIZE.0, SIZE.1);
    for (at, pixel) in color.rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        let (x, y) = (at % SIZE.0 as usize, at / SIZE.0 as usize);
        let noise = (at.wrapping_mul(7919) ^ index.wrapping_mul(104_729)) % 5;
        let stripe = if x / 2 % 2 == 0 { 70 } else { 180 } + noise as u8;
        *pixel = match () {
            () if is_person(index, x, y) => [210, 40 + (x % 7) as u8, 40],
            () if (8..40).contains(&y) && x < 40 && person(index).is_none() => [stripe + 46, stripe - 46, stripe],
            () => [stripe; 3],
        };
    }
}

/// Whether a block of the wall, away from the person, has the mark sharp.
fn shows_room(index: usize, picture: &ColorImage) -> bool {
    let (width, height) = (SIZE.0 as usize, SIZE.1 as usize);
    assert_eq!(picture.size(), SIZE);
    let blocks = (0..width / BLOCK_PX).flat_map(|x| (0..height / BLOCK_PX).map(move |y| (x * BLOCK_PX, y * BLOCK_PX)));
    let is_of_wall = |&(x, _): &(usize, usize)| {
        person(index).is_none_or(|them| x + BLOCK_PX + MARGIN_PX <= them.start || x >= them.end + MARGIN_PX)
    };
    blocks.filter(is_of_wall).any(|(left, top)| {
        let rows = (top..top + BLOCK_PX).map(|y| &picture.rgb[3 * (y * width + left)..][..3 * BLOCK_PX]);
        let codes = || rows.clone().flat_map(|row| row.iter().skip(1).step_by(3).copied());
        codes().max() > codes().min().map(|least| least.saturating_add(SHARP))
    })
}

/// What a run has sent.
#[derive(Clone, Default)]
struct Sent {
    /// The next frame to be captured, and one more than the last that was sent.
    captured: Arc<AtomicUsize>,
    sent: Arc<AtomicUsize>,
    frames: Arc<AtomicUsize>,
    /// Frames that show the room, and those that show a person sharp.
    leaks: Arc<Mutex<BTreeSet<usize>>>,
    persons: Arc<AtomicUsize>,
}

impl Sent {
    fn leaks(&self) -> BTreeSet<usize> {
        self.leaks.lock().unwrap().clone()
    }
}

impl Sink for Sent {
    fn write_frame(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        let index = (time_ns / MEDIA_NS) as usize;
        self.frames.fetch_add(1, Ordering::SeqCst);
        if shows_room(index, frame) {
            self.leaks.lock().unwrap().insert(index);
        }
        if let Some(columns) = person(index) {
            // Near the outline, where a blur would mix in the wall.
            let inside = 3 * (30 * SIZE.0 as usize + columns.start + 3);
            let [red, green] = [0, 1].map(|p| frame.rgb[inside + p]);
            self.persons.fetch_add(usize::from(red > 190 && green < 60), Ordering::SeqCst);
        }
        self.sent.store(index + 1, Ordering::SeqCst);
        Ok(ControlFlow::Continue(()))
    }
    fn finish(self: Box<Self>, _: Ending) -> Result<(), SinkError> {
        Ok(())
    }
    fn describe(&self) -> String {
        "the call".into()
    }
}

/// Creates a camera that ends once this many frames are sent; they come about as fast, and a busy machine loses some.
fn camera(frames: usize, sent: &Sent) -> Box<dyn Camera> {
    let (name, frame_data) = ("a call".into(), FrameData::Color);
    let info = SourceInfo { name, size: SIZE, period_ns: PERIOD_NS, frames: None, live: true, frame_data };
    let (sent, clock) = (sent.clone(), Clock::system());
    camera_by(info, move |index, FrameBuffers { color, .. }| {
        let until = Instant::now() + Duration::from_nanos(PERIOD_NS);
        while sent.sent.load(Ordering::SeqCst) < index && Instant::now() < until {
            thread::sleep(Duration::from_micros(20));
        }
        if sent.frames.load(Ordering::SeqCst) >= frames || index == 20 * frames {
            return Captured::End;
        }
        sent.captured.store(index + 1, Ordering::SeqCst);
        draw(index, color);
        Captured::Frame(Stamp { index, time_ns: index as u64 * MEDIA_NS, captured_ns: Some(clock.now_ns()) })
    })
}

fn create_blur(settings: &bokeh::Settings) -> Result<Box<dyn Bokeh>, BokehError> {
    ComputeOptions { backend: Backend::Cpu, threads: Some(1), ..ComputeOptions::default() }.create_blur(settings, SIZE)
}

fn look(focus: FocusRule) -> Look {
    let (strength, quality) = (Strength::AtInfinity(8.0), Some(Quality::Draft));
    Look { focus, strength, quality, ..Look::with_effect(Effect::Dof) }
}

/// Creates the depth of a network that takes red for a person.
fn network() -> Box<dyn DepthSource> {
    open(&onnx::matte(32, 24, [19.0, -19.0, 0.0], -6.0))
}

fn open(file: &[u8]) -> Box<dyn DepthSource> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("red.onnx");
    std::fs::write(&path, file).unwrap();
    Box::new(SingleCamera::open(Some(&path), None, &Hints::default()).unwrap())
}

/// Runs a call until this many frames are sent; `change` adapts the run.
fn play(
    frames: usize,
    depth: Box<dyn DepthSource>,
    look: &Look,
    change: impl FnOnce(Run<'_>, &Sent) -> Result<Report, PipelineError>,
) -> (Result<Report, PipelineError>, Sent) {
    let (sent, stop) = (Sent::default(), AtomicBool::new(false));
    let bokeh = look.blur_settings(SIZE, false).map(|settings| create_blur(&settings).unwrap());
    let blurring = BlurSetup { look: look.clone(), bokeh, adaptive: false, changes: None };
    let output = Destination::Owned(Box::new(sent.clone()));
    let with_blur = Run::with_blur(camera(frames, &sent), Some(depth), blurring, output, &stop);
    let report = change(Run { threads: 1, pace: Pace::Realtime, keep_going: true, ..with_blur }, &sent);
    (report, sent)
}

/// Sends this many frames, and checks that none shows the room; returns in how many a person is sharp.
fn check(frames: usize, depth: Box<dyn DepthSource>, look: &Look) -> usize {
    let (report, sent) = play(frames, depth, look, |call, _| run(call));
    report.unwrap();
    assert_eq!(sent.leaks(), BTreeSet::new());
    let count = sent.frames.load(Ordering::SeqCst);
    assert!(count >= frames, "{count} of {frames} frames were sent");
    sent.persons.load(Ordering::SeqCst)
}

/// A source of depth that is late with some of its maps.
struct Late(Box<dyn DepthSource>);

impl DepthSource for Late {
    fn inner(&self) -> Option<&dyn DepthSource> {
        Some(&*self.0)
    }
    fn inner_mut(&mut self) -> Option<&mut dyn DepthSource> {
        Some(&mut *self.0)
    }
    fn read(&mut self, seen: FrameInput, map: &mut DepthMap) -> Result<(), DepthError> {
        thread::sleep(Duration::from_millis([0, 9, 2][seen.stamp.index / 10 % 3]));
        self.0.read(seen, map)
    }
}

#[test]
fn a_wall_is_seen_where_nothing_is_blurred() {
    let (report, sent) = play(100, network(), &Look::with_effect(Effect::None), |call, _| run(call));
    report.unwrap();
    assert_eq!(sent.leaks().len(), sent.frames.load(Ordering::SeqCst));
}

#[test]
fn an_empty_room_a_first_frame_and_somebody_who_leaves_show_no_room() {
    // Where the first one stands when they come.
    let [x, y] = [0.33, 0.6];
    for (focus, frames) in
        [(FocusRule::Auto, 3000), (FocusRule::Point { x, y }, 1000), (FocusRule::Track { x, y }, 1000)]
    {
        let persons = check(frames, network(), &look(focus));
        assert!(3 * persons > frames, "{focus:?}: somebody is sharp in {persons} of {frames} frames");
    }
}

#[test]
fn late_depth_shows_no_room() {
    assert!(check(600, Box::new(Late(network())), &look(FocusRule::Auto)) > 100);
}

#[test]
fn a_network_that_fails_shows_no_room() {
    // The root of a negative number, wherever there is more red than green.
    let sides = |channels| [1, channels, 24, 32].map(onnx::Side::Is);
    let nodes = [onnx::conv(&["picture", "w", "b"], "sum"), onnx::node("Sqrt", &["sum"], "mask", &[])];
    let constants = [onnx::constant("w", &[1, 3, 1, 1], &[-1.0, 1.0, 0.0]), onnx::constant("b", &[1], &[0.02])];
    let file = onnx::model(&[onnx::port("picture", &sides(3))], &constants, &nodes, &[onnx::port("mask", &sides(1))]);
    assert_eq!(check(400, open(&file), &look(FocusRule::Auto)), 0);
}

#[test]
fn measured_depth_that_is_missing_shows_no_room() {
    for (measured, takes_ms) in [(false, 0), (true, 0), (true, 6)] {
        // No map, an empty one, or one of the frame, for some frames each, and an empty one first. Slow ones are shared.
        let depth = depth_by(move |FrameInput { stamp, color, .. }, map| {
            thread::sleep(Duration::from_millis(takes_ms));
            map.resize(SIZE.0, SIZE.1);
            map.metres.fill(0.0);
            match stamp.index / 5 % 4 {
                0 => {}
                1 => return Err(DepthError::Unpaired { source_name: "a depth camera".into() }),
                _ => {
                    let metres = |at: usize| {
                        let is_near = is_person(stamp.index, at % color.width as usize, at / color.width as usize);
                        if is_near { 1.0 } else { 6.0 }
                    };
                    map.metres.iter_mut().enumerate().for_each(|(at, z_m)| *z_m = metres(at));
                }
            }
            Ok(())
        });
        let (report, sent) = play(750, depth, &look(FocusRule::Metres(1.0)), |call, _| run(Run { measured, ..call }));
        assert!(report.unwrap().frames.dropped.unpaired > 0);
        assert_eq!(sent.leaks(), BTreeSet::new(), "measured: {measured}, {takes_ms} ms");
        assert!(sent.persons.load(Ordering::SeqCst) > 100);
    }
}

#[test]
fn a_device_that_is_lost_shows_no_room() {
    for fails_at in [0, 1, 20, 41] {
        let look = look(FocusRule::Auto);
        let settings = look.blur_settings(SIZE, false).unwrap();
        let (report, sent) = play(500, network(), &look, |call, _| {
            let makes = Box::new(|job| changed(job, PassTimes::new(), |job| job.out.rgb.fill(90)));
            let gpu = FakeBokeh {
                backend: Backend::Gpu,
                collect_fails: true,
                gives_back: true,
                makes,
                ..fake_bokeh(3, Trouble::fails_at(fails_at))
            };
            let cpu = Box::new(move || create_blur(&settings).unwrap());
            run(Run { bokeh: Some(Box::new(Fallback::new(Box::new(gpu), cpu))), ..call })
        });
        assert_eq!(report.unwrap().backend, "gpu, then cpu");
        assert_eq!(sent.leaks(), BTreeSet::new(), "lost at frame {fails_at}");
        assert!(sent.persons.load(Ordering::SeqCst) > 50);
    }
}

#[test]
fn frames_of_another_size_end_the_run_and_show_no_room() {
    let (report, sent) = play(0, network(), &look(FocusRule::Auto), |call, sent| {
        let mut before = camera(60, sent);
        let camera = camera_by(before.info(), move |index, FrameBuffers { color, depth, right }| {
            let buffers = FrameBuffers { color: &mut *color, depth, right };
            let shot = before.next(buffers).unwrap();
            if index >= 40 {
                *color = ColorImage { width: SIZE.1, height: SIZE.0, ..std::mem::take(color) };
            }
            shot
        });
        run(Run { camera, ..call })
    });
    report.unwrap_err();
    assert_eq!(sent.leaks(), BTreeSet::new());
}

#[test]
fn changes_of_the_look_show_the_room_only_while_the_blur_is_off() {
    let start = look(FocusRule::Auto);
    let looks = [
        Look { strength: Strength::AtInfinity(11.0), ..start.clone() },
        Look { focus: FocusRule::Metres(1.0), ..start.clone() },
        Look { background: Background::Color([0, 90, 0]), ..start.clone() },
        Look { quality: Some(Quality::Balanced), ..start.clone() },
        Look { strength: Strength::AtInfinity(8.0), ..Look::with_effect(Effect::Blur) },
        Look::with_effect(Effect::None),
        start.clone(),
    ];
    let mut off = Vec::new();
    let (report, sent) = play(2500, network(), &start, |call, sent| {
        let (mut changes, to_come) = ChangeSender::new(start.clone(), SIZE, false);
        thread::scope(|scope| {
            let (off, looks) = (&mut off, &looks);
            scope.spawn(move || {
                for (number, look) in (1..).zip(looks.iter().cycle()) {
                    let began = sent.captured.load(Ordering::SeqCst);
                    if sent.frames.load(Ordering::SeqCst) >= 2400 {
                        return;
                    }
                    changes.switch_look(look.clone(), number, create_blur).unwrap();
                    // Frames captured from here on have the look.
                    let until = sent.captured.load(Ordering::SeqCst);
                    match look.effect {
                        Effect::None => off.push(began.saturating_sub(8)..usize::MAX),
                        _ => off.iter_mut().for_each(|range: &mut Range<usize>| range.end = range.end.min(until)),
                    }
                    thread::sleep(Duration::from_millis(5 + number % 7 * 3));
                }
            });
            run(Run { changes: Some(to_come), ..call })
        })
    });
    report.unwrap();
    let (while_off, leaks): (Vec<usize>, Vec<usize>) =
        sent.leaks().into_iter().partition(|index| off.iter().any(|range| range.contains(index)));
    assert!(leaks.is_empty(), "{leaks:?} beside {off:?}");
    assert!(!while_off.is_empty() && off.len() > 10, "{off:?}");
}
