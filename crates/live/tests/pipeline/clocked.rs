//! Runs on a clock that only the stages here advance, one frame at a time: measurements are exact, and do not depend on
//! the machine.

use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::thread;
use std::time::Duration;

use bokehcam::bokeh::{Job, PassTimes};
use bokehcam::clock::Clock;
use bokehcam::depth::focus::FocusRule;
use bokehcam::frame::Stamp;
use bokehcam::link::live;
use bokehcam::look::Look;
use bokehcam::optics::CocField;
use bokehcam_live::capture::{Camera, CaptureError, Captured, FrameBuffers, FrameData, SourceInfo};
use bokehcam_live::pipeline::{Change, ExecutorChange, OutputRequest, Pace, Run, Trace, run};
use bokehcam_live::sink::Null;
use bokehcam_live::stats::{DropCause, Report};

use crate::fakes::{FakeBokeh, SIZE, Trouble, camera_by, changed, depth_by, fake_bokeh, sink_by};
use crate::setup::{dof_with, simple};

const MS: u64 = 1_000_000;
const PERIOD_NS: u64 = 40 * MS;
/// Time by which each stage advances the clock for a frame, and the age of a frame when the camera delivers it.
const AGE_NS: u64 = 4 * MS;
const READ_NS: u64 = 2 * MS;
const DEPTH_NS: u64 = 5 * MS;
const BLUR_NS: u64 = 7 * MS;
const SINK_NS: u64 = 3 * MS;

fn info(name: &str) -> SourceInfo {
    let (name, frame_data) = (name.into(), FrameData::Color);
    SourceInfo { name, size: SIZE, period_ns: PERIOD_NS, frames: None, live: true, frame_data }
}

/// A camera that captures its next frame once the previous one is delivered.
struct Lockstep {
    clock: Clock,
    delivered: Arc<AtomicU64>,
    frames: usize,
    next: usize,
    waited_ns: u64,
    /// Called before each frame.
    before: Box<dyn FnMut(usize) + Send>,
}

impl Camera for Lockstep {
    fn info(&self) -> SourceInfo {
        info("lockstep")
    }

    fn next(&mut self, FrameBuffers { color, .. }: FrameBuffers) -> Result<Captured, CaptureError> {
        let (index, asked_ns) = (self.next, self.clock.now_ns());
        while self.delivered.load(Ordering::SeqCst) < index as u64 {
            thread::sleep(Duration::from_micros(50));
        }
        if index == self.frames {
            return Ok(Captured::End);
        }
        self.next += 1;
        (self.before)(index);
        self.clock.advance_ns(PERIOD_NS);
        self.waited_ns = self.clock.now_ns() - asked_ns - READ_NS;
        color.resize(SIZE.0, SIZE.1);
        let captured_ns = Some(self.clock.now_ns() - AGE_NS);
        Ok(Captured::Frame(Stamp { index, time_ns: index as u64 * PERIOD_NS, captured_ns }))
    }

    fn waited_ns(&mut self) -> u64 {
        self.waited_ns
    }
}

fn dof(max_coc_px: f32) -> Look {
    dof_with(FocusRule::Metres(1.0), max_coc_px)
}

/// Runs some frames, whose depth takes `depth_ns`; returns the report and the CoC field of each frame.
fn play(
    (frames, pace): (usize, Pace),
    depth_ns: u64,
    budget_ns: u64,
    changes: Option<mpsc::Receiver<Change>>,
    before: impl FnMut(usize) + Send + 'static,
) -> (Report, Vec<CocField>) {
    let (report, fields, _) = play_seen((frames, pace), (depth_ns, budget_ns), changes, None, before);
    (report, fields)
}

/// Like [`play`]; returns the trace of each frame, too.
fn play_seen(
    (frames, pace): (usize, Pace),
    (depth_ns, budget_ns): (u64, u64),
    changes: Option<mpsc::Receiver<Change>>,
    output_request: Option<Arc<OutputRequest>>,
    before: impl FnMut(usize) + Send + 'static,
) -> (Report, Vec<CocField>, Vec<Trace>) {
    let (view, views) = live();
    let (views, traces) = (RefCell::new(views), RefCell::new(Vec::new()));
    let (clock, delivered) = (Clock::manual(), Arc::<AtomicU64>::default());
    let camera = Lockstep {
        clock: clock.clone(),
        delivered: delivered.clone(),
        frames,
        next: 0,
        waited_ns: 0,
        before: Box::new(before),
    };
    // A wall at one metre.
    let depth_clock = clock.clone();
    let depth = depth_by(move |_, map| {
        depth_clock.advance_ns(depth_ns);
        map.metres.fill(1.0);
        Ok(())
    });
    // The CoC field of each frame.
    let fields = Arc::<Mutex<Vec<CocField>>>::default();
    let (noted, blur_clock) = (Arc::clone(&fields), clock.clone());
    let bokeh = FakeBokeh {
        looks: Box::new(move |job: &Job| {
            blur_clock.advance_ns(BLUR_NS);
            noted.lock().unwrap().push(job.coc);
        }),
        makes: Box::new(|job| changed(job, PassTimes::new(), |_| {})),
        ..fake_bokeh(1, Trouble::default())
    };
    let sink_clock = clock.clone();
    let sink = sink_by(move |_| sink_clock.advance_ns(SINK_NS));
    let stop = AtomicBool::new(false);
    let report = run(Run {
        depth: Some(depth),
        bokeh: Some(Box::new(bokeh)),
        look: dof(10.0),
        changes,
        budget_ns,
        output_request,
        view: Some(view),
        clock,
        progress: &|progress| {
            traces.borrow_mut().extend(views.borrow_mut().try_recv().map(|view| view.trace));
            delivered.store(progress.delivered, Ordering::SeqCst);
        },
        ..simple(Box::new(camera), sink, &stop, pace)
    })
    .unwrap();
    assert!(report.frames.is_balanced(), "{:?}", report.frames);
    assert_eq!((report.frames.captured, report.frames.delivered), (frames as u64, frames as u64));
    let fields = fields.lock().unwrap().clone();
    (report, fields, traces.into_inner())
}

/// Returns whether two times agree to within the rounding of a histogram.
fn is_about(measured_ms: f64, time_ns: u64) -> bool {
    (measured_ms * MS as f64 / time_ns as f64 - 1.0).abs() < 0.01
}

#[test]
fn each_time_is_that_of_its_own_stage_and_latency_is_all_since_the_capture() {
    let (report, _) = play((5, Pace::Asap), DEPTH_NS, BLUR_NS, None, |_| {});
    let latency_ns = AGE_NS + DEPTH_NS + BLUR_NS + SINK_NS;
    assert_eq!(report.latency_ms.unwrap().max, latency_ns as f64 / MS as f64);
    let interval_ns = PERIOD_NS + DEPTH_NS + BLUR_NS + SINK_NS;
    assert_eq!(report.frame_ms.unwrap().max, interval_ns as f64 / MS as f64);
    let stages: Vec<_> = report.stages_ms.0.iter().map(|(name, times)| (name.as_str(), times.p50, times.p99)).collect();
    let expected = [("decode", READ_NS), ("depth", DEPTH_NS), ("blur", BLUR_NS), ("sink", SINK_NS)];
    assert_eq!(stages.len(), expected.len(), "{stages:?}");
    for (stage, (name, ns)) in stages.into_iter().zip(expected) {
        assert!(stage.0 == name && is_about(stage.1, ns) && is_about(stage.2, ns), "{stage:?} is not {name}: {ns} ns");
    }
    assert_eq!((report.misses, report.depth_held), (0, 0), "a blur of exactly the budget is none too long");
    let (report, _) = play((5, Pace::Asap), DEPTH_NS, BLUR_NS - 1, None, |_| {});
    assert_eq!((report.misses, report.budget_ms), (5, 7.0));
}

#[test]
fn a_change_of_the_look_holds_from_its_frame_on_where_depth_is_held_too() {
    // Depth has 9 ms a frame and takes 14: each map serves two frames.
    let (send, changes) = mpsc::channel();
    let before = move |frame: usize| {
        // Changes come at both positions within such a pair.
        if frame >= 30 && frame.is_multiple_of(5) {
            let look = dof(10.0 + frame as f32);
            let _ = send.send(Change { number: frame as u64, look, bokeh: ExecutorChange::Keep });
        }
    };
    let (report, fields) = play((60, Pace::Realtime), 14 * MS, 10 * MS, Some(changes), before);
    assert!(report.depth_held > 20, "{} of 60 frames took over the depth of another", report.depth_held);
    for (frame, field) in fields.into_iter().enumerate() {
        let CocField::Depth(lens) = field else { panic!("no such rule was given") };
        let expected_px = if frame < 30 { 10.0 } else { 10.0 + (frame / 5 * 5) as f32 };
        assert_eq!(lens.max_coc_px, expected_px, "frame {frame}");
    }
}

#[test]
fn the_stages_and_the_wait_for_playout_are_all_of_a_frames_age() {
    for pace in [Pace::Asap, Pace::Realtime] {
        let (report, _, traces) = play_seen((40, pace), (DEPTH_NS, PERIOD_NS), None, None, |_| {});
        assert_eq!(traces.len(), 40);
        for trace in &traces {
            let Trace { depth_ns, blur_ns, age_ns, .. } = *trace;
            assert_eq!((depth_ns, blur_ns), (DEPTH_NS, BLUR_NS));
            // Nothing waits between stages where there is one frame at a time.
            let ready_ns = AGE_NS + DEPTH_NS + BLUR_NS;
            assert!(age_ns == ready_ns || pace == Pace::Realtime && age_ns > ready_ns, "{pace:?}: {age_ns}");
        }
        let waited = report.stages_ms.0.iter().any(|(name, _)| name == "playout");
        assert_eq!(waited, pace == Pace::Realtime);
    }
    // Where every other frame takes longer, the faster ones wait for their playout.
    let before = |_: usize| {};
    let (_, _, traces) = play_seen((60, Pace::Realtime), (14 * MS, 10 * MS), None, None, before);
    let held = traces.iter().filter(|trace| trace.is_depth_reused);
    let waits: Vec<u64> = held.map(|trace| trace.age_ns - AGE_NS - trace.depth_ns - trace.blur_ns).collect();
    assert!(waits.len() > 20 && waits[10..].iter().all(|wait_ns| *wait_ns > 5 * MS), "{waits:?}");
}

#[test]
fn whoever_asks_for_depth_of_its_own_gets_it_with_the_next_frame() {
    let output_request = Arc::new(OutputRequest::default());
    let asks = Arc::clone(&output_request);
    let before = move |frame: usize| match frame {
        40 => asks.require_own_depth(true),
        43 => asks.require_own_depth(false),
        _ => {}
    };
    let (report, _, traces) = play_seen((60, Pace::Realtime), (14 * MS, 10 * MS), None, Some(output_request), before);
    let held: Vec<bool> = traces.iter().map(|trace| trace.is_depth_reused).collect();
    assert_eq!(held.iter().filter(|held| **held).count() as u64, report.depth_held);
    assert_eq!(held[40..46], [false, false, false, true, false, true], "{held:?}");
    assert_eq!(held[34..40].iter().filter(|held| **held).count(), 3);
}

const LOSSES: [DropCause; 3] = [DropCause::Driver, DropCause::Corrupt, DropCause::Evicted];

#[test]
fn what_a_camera_says_is_lost_counts_as_many_times_as_it_says() {
    // Between the frames that it delivers it loses, for each cause, their number plus three.
    let camera = camera_by(info("loser"), |index, FrameBuffers { color, .. }| {
        color.resize(SIZE.0, SIZE.1);
        match index {
            0..6 if index.is_multiple_of(2) => Captured::Lost(index as u64 + 3, LOSSES[index / 2]),
            0..6 => Captured::Frame(Stamp { index, time_ns: 0, captured_ns: Some(0) }),
            6 => Captured::Waiting,
            _ => Captured::End,
        }
    });
    let stop = AtomicBool::new(false);
    let frames = run(simple(camera, Box::new(Null), &stop, Pace::Asap)).unwrap().frames;
    assert!(frames.is_balanced());
    let dropped = frames.dropped;
    assert_eq!((dropped.driver, dropped.corrupt, dropped.evicted, dropped.total()), (3, 5, 7, 15));
    assert_eq!((frames.captured, frames.delivered, frames.in_flight), (18, 3, 0));
}
