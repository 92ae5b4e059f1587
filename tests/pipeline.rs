//! The pipeline with stages that are slow, fail or panic: every frame is accounted for, and the cause is the error.

use std::cell::Cell;
use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::sleep;
use std::time::Duration;

use bokehcam::bokeh::{Bokeh, BokehError, Finished, Job, PassTimes};
use bokehcam::budget::Quality;
use bokehcam::capture::{Camera, CaptureError, Captured, SourceInfo, Stamp};
use bokehcam::clock::Clock;
use bokehcam::depth::focus::FocusRule;
use bokehcam::depth::{DepthError, DepthSource};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::optics::CocField;
use bokehcam::pipeline::{CocAtInfinity, CocRule, Fault, Pace, PipelineError, Progress, Run, run};
use bokehcam::sink::{Null, Sink, SinkError, Target};
use bokehcam::stats::Report;

const SIZE: (u32, u32) = (6, 4);
const PERIOD_NS: u64 = 1_000_000;
const NEVER: usize = usize::MAX;

/// What a fake stage does at one of its frames.
#[derive(Clone, Copy, Default)]
struct Trouble {
    stall: Duration,
    fails_at: Option<usize>,
    panics_at: Option<usize>,
}

impl Trouble {
    fn slow() -> Self {
        Self { stall: Duration::from_millis(3), ..Self::default() }
    }
    fn fails_at(frame: usize) -> Self {
        Self { fails_at: Some(frame), ..Self::default() }
    }
    fn panics_at(frame: usize) -> Self {
        Self { panics_at: Some(frame), ..Self::default() }
    }
    /// Whether this frame fails.
    fn strikes(&self, frame: usize) -> bool {
        sleep(self.stall);
        assert!(self.panics_at != Some(frame), "out of order at frame {frame}");
        self.fails_at == Some(frame)
    }
}

/// Frames whose every byte is their number.
struct FakeCamera {
    frames: usize,
    next: usize,
    corrupt_every: usize,
    exact_depth: bool,
    trouble: Trouble,
}

fn size_error() -> CaptureError {
    CaptureError::Format { width: 0, height: 0, fps: 0.0 }
}

impl Camera for FakeCamera {
    fn info(&self) -> SourceInfo {
        SourceInfo {
            name: "fake camera".into(),
            size: SIZE,
            period_ns: PERIOD_NS,
            frames: Some(self.frames as u64),
            live: false,
            exact_depth: self.exact_depth,
        }
    }

    fn next(&mut self, color: &mut ColorImage, depth: &mut DepthMap) -> Result<Captured, CaptureError> {
        if self.next >= self.frames {
            return Ok(Captured::End);
        }
        let index = self.next;
        self.next += 1;
        if self.trouble.strikes(index) {
            return Err(size_error());
        }
        if index % self.corrupt_every == self.corrupt_every - 1 {
            return Ok(Captured::Corrupt(size_error()));
        }
        color.resize(SIZE.0, SIZE.1);
        color.rgb.fill(index as u8);
        if self.exact_depth {
            depth.resize(SIZE.0, SIZE.1);
            depth.metres.fill(1.0 + index as f32);
        }
        Ok(Captured::Frame(Stamp { index, time_ns: index as u64 * PERIOD_NS }))
    }

    fn skip(&mut self, until_ns: u64) -> u64 {
        let from = self.next;
        self.next = (until_ns.div_ceil(PERIOD_NS) as usize).clamp(from, self.frames);
        (self.next - from) as u64
    }
}

/// Depth of 1 m plus the frame's number, with a hole.
struct FakeDepth(Trouble);

impl DepthSource for FakeDepth {
    fn read(&mut self, index: usize, map: &mut DepthMap) -> Result<(), DepthError> {
        if self.0.strikes(index) {
            return Err(DepthError::NoDepth { source_name: format!("frame {index}") });
        }
        map.resize(SIZE.0, SIZE.1);
        map.metres.fill(1.0 + index as f32);
        map.metres[3] = 0.0;
        Ok(())
    }
}

/// Adds 100 to the picture, and the focus distance to its first byte; holds as many frames as it may.
struct FakeBokeh {
    capacity: usize,
    held: VecDeque<Job>,
    submitted: usize,
    trouble: Trouble,
    collect_fails: bool,
    loses_frames: bool,
}

impl Bokeh for FakeBokeh {
    fn submit(&mut self, job: Job) -> Result<(), BokehError> {
        assert!(self.held.len() < self.capacity, "submitted beyond the capacity");
        let index = self.submitted;
        self.submitted += 1;
        if self.trouble.strikes(index) && !self.collect_fails {
            return Err(BokehError::Gpu("lost".into()));
        }
        self.held.push_back(job);
        Ok(())
    }

    fn collect(&mut self, wait: bool) -> Result<Option<Finished>, BokehError> {
        if self.collect_fails && self.trouble.fails_at.is_some_and(|frame| self.submitted > frame) {
            return Err(BokehError::Gpu("lost".into()));
        }
        if self.loses_frames || !wait && self.held.len() < self.capacity {
            return Ok(None);
        }
        Ok(self.held.pop_front().map(|mut job| {
            job.out.resize(job.color.width, job.color.height);
            for (out, color) in job.out.rgb.iter_mut().zip(&job.color.rgb) {
                *out = color + 100;
            }
            if let CocField::Depth(coc) = job.coc {
                let map = job.depth.as_ref().expect("dof has depth");
                assert!(map.metres.iter().all(|&z_m| z_m == map.metres[0]), "holes are filled");
                job.out.rgb[0] = coc.focus_m.round() as u8;
            }
            let mut times = PassTimes::new();
            times.add("rows", Duration::from_micros(400));
            times.add("columns", Duration::from_micros(300));
            Finished { ticket: job.ticket, out: job.out, times }
        }))
    }

    fn in_flight(&self) -> usize {
        self.held.len()
    }
    fn capacity(&self) -> usize {
        self.capacity
    }
    fn describe(&self) -> String {
        "cpu, fake".into()
    }
}

/// What a sink received, seen from outside.
#[derive(Clone, Default)]
struct Received {
    pictures: Arc<Mutex<Vec<Vec<u8>>>>,
    finished: Arc<AtomicBool>,
}

impl Received {
    fn count(&self) -> u64 {
        self.pictures.lock().unwrap().len() as u64
    }
    fn numbers(&self) -> Vec<usize> {
        self.pictures.lock().unwrap().iter().map(|rgb| rgb[5] as usize % 100).collect()
    }
    fn is_finished(&self) -> bool {
        self.finished.load(Ordering::SeqCst)
    }
}

struct FakeSink {
    received: Received,
    trouble: Trouble,
    closes_at: usize,
    finish_fails: bool,
}

fn exists() -> SinkError {
    SinkError::Exists { path: "fake".into() }
}

impl Sink for FakeSink {
    fn put(&mut self, frame: &ColorImage) -> Result<ControlFlow<()>, SinkError> {
        let index = self.received.count() as usize;
        if self.trouble.strikes(index) {
            return Err(exists());
        }
        if index == self.closes_at {
            return Ok(ControlFlow::Break(()));
        }
        self.received.pictures.lock().unwrap().push(frame.rgb.clone());
        Ok(ControlFlow::Continue(()))
    }
    fn finish(self: Box<Self>) -> Result<(), SinkError> {
        self.received.finished.store(true, Ordering::SeqCst);
        if self.finish_fails { Err(exists()) } else { Ok(()) }
    }
    fn describe(&self) -> String {
        "fake sink".into()
    }
}

/// A run of fakes, good in every way until told otherwise.
struct Setup {
    frames: usize,
    corrupt_every: usize,
    exact_depth: bool,
    camera: Trouble,
    depth: Option<Trouble>,
    bokeh: Option<FakeBokeh>,
    sink: Trouble,
    closes_at: usize,
    finish_fails: bool,
    coc: CocRule,
    pace: Pace,
    keep_going: bool,
    mirror: bool,
    stop_after: u64,
}

fn dof() -> CocRule {
    CocRule::Depth { focus: FocusRule::Point { x: 0.0, y: 0.0 }, lens: CocAtInfinity::Px(8.0), max_coc_px: 20.0 }
}

fn fake_bokeh(capacity: usize, trouble: Trouble) -> FakeBokeh {
    FakeBokeh { capacity, held: VecDeque::new(), submitted: 0, trouble, collect_fails: false, loses_frames: false }
}

impl Setup {
    fn new(frames: usize, pace: Pace) -> Self {
        Self {
            frames,
            corrupt_every: NEVER,
            exact_depth: false,
            camera: Trouble::default(),
            depth: Some(Trouble::default()),
            bokeh: Some(fake_bokeh(2, Trouble::default())),
            sink: Trouble::default(),
            closes_at: NEVER,
            finish_fails: false,
            coc: dof(),
            pace,
            keep_going: false,
            mirror: false,
            stop_after: u64::MAX,
        }
    }

    /// Runs, and checks what holds for every run.
    fn run(self) -> (Result<Report, PipelineError>, Received) {
        let received = Received::default();
        let stop = AtomicBool::new(false);
        let last = Cell::new(None::<Progress>);
        let result = run(Run {
            camera: Box::new(FakeCamera {
                frames: self.frames,
                next: 0,
                corrupt_every: self.corrupt_every,
                exact_depth: self.exact_depth,
                trouble: self.camera,
            }),
            depth: self.depth.map(|trouble| Box::new(FakeDepth(trouble)) as _),
            bokeh: self.bokeh.map(|bokeh| Box::new(bokeh) as _),
            quality: Quality::Fast,
            coc: self.coc,
            sink: Box::new(FakeSink {
                received: received.clone(),
                trouble: self.sink,
                closes_at: self.closes_at,
                finish_fails: self.finish_fails,
            }),
            pace: self.pace,
            budget_ns: 500_000,
            keep_going: self.keep_going,
            mirror: self.mirror,
            clock: Clock::system(),
            stop: &stop,
            progress: &|progress| {
                last.set(Some(progress));
                if progress.delivered >= self.stop_after {
                    stop.store(true, Ordering::Relaxed);
                }
            },
        });
        let report = match &result {
            Ok(report) => report,
            Err(error) => &error.report,
        };
        assert!(report.frames.balance(), "{:?}", report.frames);
        assert_eq!(report.frames.delivered, received.count());
        assert!(received.numbers().is_sorted_by(|a, b| a < b), "frames keep their order");
        assert_eq!(last.get().map_or(0, |progress| progress.delivered), received.count());
        if result.is_ok() {
            assert!(received.is_finished());
        }
        (result, received)
    }
}

#[test]
fn lossless_delivers_every_frame_however_slow_a_stage_is() {
    let setup = || Setup::new(40, Pace::Asap);
    for (name, setup) in [
        ("nothing", setup()),
        ("capture", Setup { camera: Trouble::slow(), ..setup() }),
        ("depth", Setup { depth: Some(Trouble::slow()), ..setup() }),
        ("blur", Setup { bokeh: Some(fake_bokeh(2, Trouble::slow())), ..setup() }),
        ("blur of one", Setup { bokeh: Some(fake_bokeh(1, Trouble::slow())), ..setup() }),
        ("sink", Setup { sink: Trouble::slow(), ..setup() }),
    ] {
        let (result, received) = setup.run();
        let report = result.unwrap();
        assert_eq!((report.frames.captured, report.frames.delivered), (40, 40), "slow: {name}");
        assert!(received.numbers().into_iter().eq(0..40));
    }
}

#[test]
fn live_accounts_for_every_frame_however_slow_a_stage_is() {
    let setup = || Setup::new(90, Pace::Realtime);
    for (name, setup) in [
        ("nothing", setup()),
        ("capture", Setup { camera: Trouble::slow(), ..setup() }),
        ("depth", Setup { depth: Some(Trouble::slow()), ..setup() }),
        ("blur", Setup { bokeh: Some(fake_bokeh(1, Trouble::slow())), ..setup() }),
        ("sink", Setup { sink: Trouble::slow(), ..setup() }),
    ] {
        let (result, received) = setup.run();
        let frames = result.unwrap().frames;
        assert_eq!((frames.captured, frames.in_flight), (90, 0), "slow {name}: {frames:?}");
        assert!(received.count() > 0, "pictures never stop");
        if name == "capture" {
            assert!(frames.dropped.driver > 0, "what cannot be read in time is the driver's: {frames:?}");
        }
    }
}

/// Waits with its first frame until the camera is through with all of its own.
struct GatedSink(Arc<AtomicUsize>, usize);

impl Sink for GatedSink {
    fn put(&mut self, _: &ColorImage) -> Result<ControlFlow<()>, SinkError> {
        while self.0.load(Ordering::SeqCst) < self.1 {
            sleep(Duration::from_millis(1));
        }
        Ok(ControlFlow::Continue(()))
    }
    fn finish(self: Box<Self>) -> Result<(), SinkError> {
        Ok(())
    }
    fn describe(&self) -> String {
        "gated".into()
    }
}

/// Comes live, and counts what was asked of it.
struct LiveCamera(FakeCamera, Arc<AtomicUsize>);

impl Camera for LiveCamera {
    fn info(&self) -> SourceInfo {
        // So slow that no frame is ever late.
        SourceInfo { live: true, period_ns: 3_600_000_000_000, ..self.0.info() }
    }
    fn next(&mut self, color: &mut ColorImage, depth: &mut DepthMap) -> Result<Captured, CaptureError> {
        self.1.fetch_add(1, Ordering::SeqCst);
        self.0.next(color, depth)
    }
}

fn simple<'a>(camera: Box<dyn Camera>, sink: Box<dyn Sink>, stop: &'a AtomicBool, pace: Pace) -> Run<'a> {
    Run {
        camera,
        depth: None,
        bokeh: None,
        quality: Quality::Fast,
        coc: CocRule::Fixed(CocField::Uniform { radius_px: 3.0 }),
        sink,
        pace,
        budget_ns: PERIOD_NS,
        keep_going: false,
        mirror: false,
        clock: Clock::system(),
        stop,
        progress: &|_| {},
    }
}

fn fake_camera(frames: usize) -> FakeCamera {
    FakeCamera { frames, next: 0, corrupt_every: NEVER, exact_depth: false, trouble: Trouble::default() }
}

#[test]
fn a_live_link_evicts_behind_a_sink_that_stands_still() {
    let asked = Arc::new(AtomicUsize::new(0));
    let camera = LiveCamera(fake_camera(200), asked.clone());
    let stop = AtomicBool::new(false);
    let sink = GatedSink(asked, 200);
    let report = run(simple(Box::new(camera), Box::new(sink), &stop, Pace::Realtime)).unwrap();
    assert!(report.frames.balance());
    assert!(report.frames.dropped.evicted > 180, "{:?}", report.frames);
    assert_eq!(report.frames.dropped.driver, 0, "a live camera is not asked to skip");
}

#[test]
fn the_fault_of_a_stage_is_the_error_of_the_run() {
    for pace in [Pace::Asap, Pace::Realtime] {
        for frame in [0, 7] {
            let setup = || Setup::new(500, pace);
            let trouble = Trouble::fails_at(frame);
            let collect = FakeBokeh { collect_fails: true, ..fake_bokeh(2, trouble) };
            type Expected = fn(&Fault) -> bool;
            let cases: [(&str, Setup, Expected); 5] = [
                ("capture", Setup { camera: trouble, ..setup() }, |fault| matches!(fault, Fault::Capture(_))),
                ("depth", Setup { depth: Some(trouble), ..setup() }, |fault| matches!(fault, Fault::Depth(_))),
                ("submit", Setup { bokeh: Some(fake_bokeh(2, trouble)), ..setup() }, |fault| {
                    matches!(fault, Fault::Bokeh(_))
                }),
                ("collect", Setup { bokeh: Some(collect), ..setup() }, |fault| matches!(fault, Fault::Bokeh(_))),
                ("sink", Setup { sink: trouble, ..setup() }, |fault| matches!(fault, Fault::Sink(_))),
            ];
            for (stage, setup, expected) in cases {
                // In real time a frame may be passed over: only the first of a stage is sure to come, and depth goes
                // by the frame's number.
                let certain = pace == Pace::Asap || frame == 0 && stage != "depth";
                let (result, received) = setup.run();
                let Err(error) = result else {
                    assert!(!certain, "{stage} at {frame}");
                    continue;
                };
                assert!(expected(&error.fault), "{stage} at {frame}: {error}");
                assert!(!received.is_finished(), "the output is given up");
                if pace == Pace::Asap {
                    assert!(error.report.frames.captured < 500, "{stage} at {frame} ended the run");
                    assert!(received.count() <= frame as u64);
                }
                if ["submit", "collect", "sink"].contains(&stage) {
                    assert_eq!(error.report.frames.dropped.failed, 1, "{stage}");
                }
            }
        }
    }
}

#[test]
fn a_panic_is_the_error_of_its_stage() {
    let setup = || Setup::new(300, Pace::Asap);
    let trouble = Trouble::panics_at(5);
    for (stage, setup) in [
        ("capture", Setup { camera: trouble, ..setup() }),
        ("depth", Setup { depth: Some(trouble), ..setup() }),
        ("blur", Setup { bokeh: Some(fake_bokeh(2, trouble)), ..setup() }),
        ("sink", Setup { sink: trouble, ..setup() }),
    ] {
        let (result, received) = setup.run();
        let text = result.unwrap_err().to_string();
        assert_eq!(text, format!("the {stage} stage panicked: out of order at frame 5; please report this"));
        assert!(!received.is_finished());
    }
}

#[test]
fn an_executor_that_loses_frames_is_found_out() {
    let bokeh = FakeBokeh { loses_frames: true, ..fake_bokeh(2, Trouble::default()) };
    let (result, _) = Setup { bokeh: Some(bokeh), ..Setup::new(20, Pace::Asap) }.run();
    assert!(matches!(result.unwrap_err().fault, Fault::LostFrame));
}

#[test]
fn a_sink_that_cannot_be_completed_is_an_error() {
    let (result, received) = Setup { finish_fails: true, ..Setup::new(5, Pace::Asap) }.run();
    let error = result.unwrap_err();
    assert!(matches!(error.fault, Fault::Sink(_)) && received.count() == 5);
    assert_eq!(error.report.frames.delivered, 5);
}

#[test]
fn a_reader_that_goes_ends_the_run_cleanly() {
    let (result, received) = Setup { closes_at: 6, ..Setup::new(300, Pace::Asap) }.run();
    let frames = result.unwrap().frames;
    assert_eq!((frames.delivered, received.count(), frames.dropped.total()), (6, 6, 0));
    assert!(frames.captured < 300 && frames.in_flight > 0, "what was under way stays in flight: {frames:?}");
}

#[test]
fn stop_finishes_what_is_in_hand() {
    for pace in [Pace::Asap, Pace::Realtime] {
        let (result, received) = Setup { stop_after: 8, ..Setup::new(5000, pace) }.run();
        let frames = result.unwrap().frames;
        assert_eq!(frames.in_flight, 0);
        assert!(frames.delivered >= 8 && frames.captured < 5000, "{frames:?}");
        assert!(received.is_finished());
    }
}

#[test]
fn corrupt_frames_end_the_run_or_are_counted() {
    let setup = |keep_going| Setup { corrupt_every: 4, keep_going, ..Setup::new(20, Pace::Asap) };
    let (result, received) = setup(false).run();
    let error = result.unwrap_err();
    assert!(matches!(error.fault, Fault::Capture(_)) && !received.is_finished());
    assert_eq!((error.report.frames.captured, error.report.frames.dropped.corrupt), (4, 1));

    let (result, received) = setup(true).run();
    let frames = result.unwrap().frames;
    assert_eq!((frames.captured, frames.delivered, frames.dropped.corrupt), (20, 15, 5));
    assert!(received.numbers().iter().all(|number| number % 4 != 3));

    let depth = Some(Trouble::fails_at(9));
    let (result, received) = Setup { depth, keep_going: true, ..Setup::new(20, Pace::Asap) }.run();
    let frames = result.unwrap().frames;
    assert_eq!((frames.captured, frames.delivered, frames.dropped.corrupt), (20, 19, 1));
    assert!(!received.numbers().contains(&9));
}

#[test]
fn depth_comes_with_the_frame_it_belongs_to() {
    // Focus is eased over media time, and all of these frames come within 20 ms: the first one rules.
    for (exact_depth, depth) in [(false, Some(Trouble::default())), (true, None)] {
        let (result, received) = Setup { exact_depth, depth, ..Setup::new(20, Pace::Asap) }.run();
        result.unwrap();
        assert!(received.pictures.lock().unwrap().iter().all(|rgb| rgb[0] == 1 && rgb[1] >= 100));
    }
    let (result, _) = Setup { depth: None, ..Setup::new(20, Pace::Asap) }.run();
    let error = result.unwrap_err();
    assert!(matches!(error.fault, Fault::NoDepth { .. }) && error.to_string().contains("fake camera"), "{error}");
}

#[test]
fn a_fixed_coc_and_no_blur_ask_for_no_depth() {
    let never = Some(Trouble::panics_at(0));
    let coc = CocRule::Fixed(CocField::Uniform { radius_px: 4.0 });
    let (result, received) = Setup { depth: never, coc, ..Setup::new(10, Pace::Asap) }.run();
    result.unwrap();
    assert!(
        received.pictures.lock().unwrap().iter().enumerate().all(|(i, rgb)| rgb.iter().all(|&b| b == 100 + i as u8))
    );

    let (result, received) = Setup { depth: never, bokeh: None, ..Setup::new(10, Pace::Asap) }.run();
    let report = result.unwrap();
    assert!(received.pictures.lock().unwrap().iter().enumerate().all(|(i, rgb)| rgb.iter().all(|&b| b == i as u8)));
    assert_eq!((report.backend.as_str(), report.quality.share.len()), ("none", 0));
}

#[test]
fn lossless_twice_is_the_same_twice() {
    let bytes = || {
        let (result, received) = Setup::new(60, Pace::Asap).run();
        result.unwrap();
        Arc::try_unwrap(received.pictures).unwrap().into_inner().unwrap()
    };
    assert_eq!(bytes(), bytes());
}

#[test]
fn the_report_tells_what_ran() {
    let (result, _) = Setup { mirror: true, ..Setup::new(10, Pace::Asap) }.run();
    let report = result.unwrap();
    assert_eq!((report.backend.as_str(), report.adapter.as_str()), ("cpu", "cpu, fake"));
    assert_eq!((report.source.as_str(), report.sink.as_str()), ("fake camera", "fake sink"));
    assert_eq!(report.quality.share, [("fast", 1.0)]);
    assert_eq!((report.budget_ms, report.misses), (0.5, 10), "0.7 ms of passes each");
    let stages: Vec<_> = report.stages_ms.0.iter().map(|stage| stage.0.as_str()).collect();
    assert_eq!(stages, ["decode", "depth", "blur", "blur.rows", "blur.columns", "sink"]);
    assert!((report.stages_ms.0[2].1.p50 - 0.7).abs() < 0.007);
    assert!(report.latency_ms.is_some() && report.frame_ms.is_some());
}

/// A picture whose columns differ.
struct Columns(bool);

impl Camera for Columns {
    fn info(&self) -> SourceInfo {
        fake_camera(1).info()
    }
    fn next(&mut self, color: &mut ColorImage, _: &mut DepthMap) -> Result<Captured, CaptureError> {
        if std::mem::replace(&mut self.0, true) {
            return Ok(Captured::End);
        }
        color.resize(SIZE.0, SIZE.1);
        (0..).zip(&mut color.rgb).for_each(|(index, byte)| *byte = index);
        Ok(Captured::Frame(Stamp { index: 0, time_ns: 0 }))
    }
}

#[test]
fn mirror_flips_pixels_and_keeps_channels() {
    let received = Received::default();
    let sink =
        FakeSink { received: received.clone(), trouble: Trouble::default(), closes_at: NEVER, finish_fails: false };
    let stop = AtomicBool::new(false);
    run(Run { mirror: true, ..simple(Box::new(Columns(false)), Box::new(sink), &stop, Pace::Asap) }).unwrap();
    let rgb = &received.pictures.lock().unwrap()[0];
    assert_eq!(rgb[..6], [15, 16, 17, 12, 13, 14]);
    assert_eq!(rgb[18..21], [33, 34, 35]);
}

#[test]
fn stop_before_the_first_frame_still_makes_a_whole_file() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("clip.y4m");
    let options = bokehcam::sink::Options { size: SIZE, period_ns: PERIOD_NS, force: false };
    let stop = AtomicBool::new(true);
    let sink = Target::Y4m(name.clone()).open(&options).unwrap();
    let report = run(simple(Box::new(fake_camera(9)), sink, &stop, Pace::Asap)).unwrap();
    assert_eq!(report.frames.captured, 0);
    assert!(name.exists());
}

#[test]
fn a_failed_run_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let options = bokehcam::sink::Options { size: SIZE, period_ns: PERIOD_NS, force: false };
    let stop = AtomicBool::new(false);
    let failing = || FakeCamera { trouble: Trouble::fails_at(5), ..fake_camera(9) };
    let sink = Target::Y4m(folder.path().join("clip.y4m")).open(&options).unwrap();
    assert!(run(simple(Box::new(failing()), sink, &stop, Pace::Asap)).is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);

    let sink = Target::Folder(folder.path().join("out")).open(&options).unwrap();
    assert!(run(simple(Box::new(failing()), sink, &stop, Pace::Asap)).is_err());
    let names: Vec<_> = std::fs::read_dir(folder.path().join("out")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(names.len() <= 5 && names.iter().all(|name| !name.to_string_lossy().contains("part")), "{names:?}");
    for name in names {
        assert!(image::open(folder.path().join("out").join(Path::new(&name))).is_ok(), "each picture is whole");
    }
}

#[test]
fn an_empty_source_is_an_empty_run() {
    let stop = AtomicBool::new(false);
    let report = run(simple(Box::new(fake_camera(0)), Box::new(Null), &stop, Pace::Realtime)).unwrap();
    assert_eq!((report.frames.captured, report.latency_ms), (0, None));
}
