//! A GPU that fails in the middle of a run.

use std::sync::atomic::AtomicBool;

use bokehcam::bokeh::Bokeh;
use bokehcam::bokeh::fallback::Fallback;
use bokehcam::compute::Backend;
use bokehcam::look::Look;
use bokehcam_live::pipeline::{Pace, Run, run};

use crate::fakes::{FakeBokeh, Received, Trouble, fake_bokeh, fake_camera, fake_sink};
use crate::setup::{simple, uniform};

#[test]
fn a_run_goes_on_without_its_gpu_and_the_report_says_so() {
    const FRAMES: usize = 40;
    for fails_at in [0, 1, 17] {
        let gpu = fake_bokeh(3, Trouble::fails_at(fails_at));
        // A failing GPU returns the frames that it holds.
        let gpu = FakeBokeh { backend: Backend::Gpu, name: "a GPU", collect_fails: true, gives_back: true, ..gpu };
        let cpu = || Box::new(fake_bokeh(1, Trouble::default())) as Box<dyn Bokeh>;
        let (received, stop) = (Received::default(), AtomicBool::new(false));
        let sink = fake_sink(&received);
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
        // The CPU is not given the level `best`.
        assert!(report.quality.fractions.iter().all(|(level, _)| *level != "best") || fails_at > 1);
    }
}
