//! A GPU that fails in the middle of a run.

use std::sync::atomic::AtomicBool;

use bokehcam::bokeh::fallback::Fallback;
use bokehcam::bokeh::{Bokeh, BokehError, Finished, Job};
use bokehcam::compute::Backend;
use bokehcam::look::Look;
use bokehcam::pipeline::{Pace, Run, run};

use crate::fakes::{FakeBokeh, FakeSink, NEVER, Received, Trouble};
use crate::setup::{fake_bokeh, fake_camera, simple, uniform};

/// Gives back what it has when it fails.
struct Gpu(FakeBokeh);

impl Bokeh for Gpu {
    fn submit(&mut self, job: Job) -> Result<(), BokehError> {
        self.0.submit(job)
    }
    fn collect(&mut self, wait: bool) -> Result<Option<Finished>, BokehError> {
        self.0.collect(wait)
    }
    fn take_back(&mut self) -> Option<Job> {
        self.0.held.pop_front()
    }
    fn in_flight(&self) -> usize {
        self.0.in_flight()
    }
    fn capacity(&self) -> usize {
        self.0.capacity()
    }
    fn backend(&self) -> Backend {
        Backend::Gpu
    }
    fn describe(&self) -> String {
        "a GPU".into()
    }
}

#[test]
fn a_run_goes_on_without_its_gpu_and_the_report_says_so() {
    const FRAMES: usize = 40;
    for fails_at in [0, 1, 17] {
        let trouble = Trouble { fails_at: Some(fails_at), ..Trouble::default() };
        let gpu = Gpu(FakeBokeh { collect_fails: true, ..fake_bokeh(3, trouble) });
        let cpu = || Box::new(fake_bokeh(1, Trouble::default())) as Box<dyn Bokeh>;
        let (received, stop) = (Received::default(), AtomicBool::new(false));
        let sink =
            FakeSink { received: received.clone(), trouble: Trouble::default(), closes_at: NEVER, finish_fails: false };
        let report = run(Run {
            bokeh: Some(Box::new(Fallback::new(Box::new(gpu), Box::new(cpu)))),
            look: Look { quality: None, ..uniform(3.0) },
            adaptive: true,
            ..simple(Box::new(fake_camera(FRAMES)), Box::new(sink), &stop, Pace::Asap)
        });
        let report = report.unwrap();
        assert_eq!((report.frames.captured, report.frames.delivered), (FRAMES as u64, FRAMES as u64));
        assert_eq!(received.numbers(), (0..FRAMES).collect::<Vec<_>>());
        let ran = (report.backend.as_str(), report.adapter.as_str());
        assert_eq!(ran, ("gpu, then cpu", "GPU: lost; then cpu, fake"));
        // Finer is more than the CPU is given.
        assert!(report.quality.share.iter().all(|(level, _)| !["high", "best"].contains(level)) || fails_at > 1);
    }
}
