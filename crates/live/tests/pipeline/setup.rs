//! A run of fake stages, and looks for it.

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};

use bokehcam::budget::Quality;
use bokehcam::depth::focus::FocusRule;
use bokehcam::look::{Effect, Look, Strength};
use bokehcam_live::capture::{Camera, FrameData};
use bokehcam_live::pipeline::{BlurSetup, Destination, Pace, PipelineError, Progress, Run, run};
use bokehcam_live::sink::Sink;
use bokehcam_live::stats::Report;

use super::fakes::*;

/// A run of fake stages without faults by default.
pub struct Setup {
    pub frames: usize,
    pub corrupt_every: usize,
    pub frame_data: FrameData,
    pub camera: Trouble,
    pub depth: Option<Trouble>,
    pub bokeh: Option<FakeBokeh>,
    pub sink: Trouble,
    pub closes_at: usize,
    pub finish_fails: bool,
    pub look: Look,
    pub pace: Pace,
    pub keep_going: bool,
    pub stop_after: u64,
}

/// Returns a blur that follows depth, limited to `max_coc_px`.
pub fn dof_with(focus: FocusRule, max_coc_px: f32) -> Look {
    Look {
        focus,
        strength: Strength::AtInfinity(8.0),
        max_coc_px: Some(max_coc_px),
        quality: Some(Quality::Draft),
        ..Look::with_effect(Effect::Dof)
    }
}

pub fn dof() -> Look {
    dof_with(FocusRule::Point { x: 0.0, y: 0.0 }, 20.0)
}

/// Returns a blur of one radius everywhere.
pub fn uniform(radius_px: f32) -> Look {
    Look { strength: Strength::AtInfinity(radius_px), quality: Some(Quality::Draft), ..Look::with_effect(Effect::Blur) }
}

impl Setup {
    pub fn new(frames: usize, pace: Pace) -> Self {
        Self {
            frames,
            corrupt_every: NEVER,
            frame_data: FrameData::Color,
            camera: Trouble::default(),
            depth: Some(Trouble::default()),
            bokeh: Some(fake_bokeh(2, Trouble::default())),
            sink: Trouble::default(),
            closes_at: NEVER,
            finish_fails: false,
            look: dof(),
            pace,
            keep_going: false,
            stop_after: u64::MAX,
        }
    }

    /// Runs, and checks the invariants of every run.
    pub fn run(self) -> (Result<Report, PipelineError>, Received) {
        let received = Received::default();
        let stop = AtomicBool::new(false);
        let last = Cell::new(None::<Progress>);
        let (corrupt_every, frame_data, trouble) = (self.corrupt_every, self.frame_data, self.camera);
        let camera = FakeCamera { corrupt_every, frame_data, trouble, ..fake_camera(self.frames) };
        let depth = self.depth.map(fake_depth);
        let bokeh = self.bokeh.map(|bokeh| Box::new(bokeh) as _);
        let blurring = BlurSetup { look: self.look, bokeh, adaptive: false, changes: None };
        let (trouble, closes_at, finish_fails) = (self.sink, self.closes_at, self.finish_fails);
        let sink = FakeSink { trouble, closes_at, finish_fails, ..fake_sink(&received) };
        let result = run(Run {
            threads: 2,
            pace: self.pace,
            budget_ns: 500_000,
            keep_going: self.keep_going,
            progress: &|progress| {
                last.set(Some(progress));
                if progress.delivered >= self.stop_after {
                    stop.store(true, Ordering::Relaxed);
                }
            },
            ..Run::with_blur(Box::new(camera), depth, blurring, Destination::Owned(Box::new(sink)), &stop)
        });
        let report = match &result {
            Ok(report) => report,
            Err(error) => &error.report,
        };
        assert!(report.frames.is_balanced(), "{:?}", report.frames);
        assert_eq!(report.frames.delivered, received.count());
        assert!(received.numbers().is_sorted_by(|a, b| a < b), "frames keep their order");
        assert_eq!(last.get().map_or(0, |progress| progress.delivered), received.count());
        assert!(received.ending().is_some(), "the output is completed, whatever happens");
        (result, received)
    }
}

pub fn simple<'a>(camera: Box<dyn Camera>, sink: Box<dyn Sink>, stop: &'a AtomicBool, pace: Pace) -> Run<'a> {
    let run = Run::new(camera, None, Look::with_effect(Effect::None), sink, stop).unwrap();
    Run { look: uniform(3.0), pace, budget_ns: PERIOD_NS, ..run }
}
