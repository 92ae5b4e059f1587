//! Live sources and outputs: without viewers the camera stops, and the output continues.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use bokehcam::clock::Clock;
use bokehcam::frame::{ColorImage, Stamp};
use bokehcam::link::demand::{Demand, Watch};
use bokehcam_live::capture::{Camera, CaptureError, Captured, FrameBuffers, FrameData, SourceInfo};
use bokehcam_live::pipeline::{Destination, Pace, Run, run};
use bokehcam_live::sink::{Sink, SinkError};

use crate::fakes::{PERIOD_NS, SIZE};
use crate::setup::dof;

/// A camera that opens when a frame is requested, and counts how often.
struct Sleeper {
    opened: Arc<AtomicUsize>,
    open: bool,
    index: usize,
}

impl Camera for Sleeper {
    fn info(&self) -> SourceInfo {
        let name = "sleeper".into();
        SourceInfo { name, size: SIZE, period_ns: PERIOD_NS, frames: None, live: true, frame_data: FrameData::Color }
    }

    fn next(&mut self, FrameBuffers { color, .. }: FrameBuffers) -> Result<Captured, CaptureError> {
        if !std::mem::replace(&mut self.open, true) {
            self.opened.fetch_add(1, Ordering::SeqCst);
            return Ok(Captured::Waiting);
        }
        std::thread::sleep(Duration::from_nanos(PERIOD_NS));
        color.resize(SIZE.0, SIZE.1);
        let (index, time_ns) = (self.index, self.index as u64 * PERIOD_NS);
        self.index += 1;
        Ok(Captured::Frame(Stamp { index, time_ns, captured_ns: Some(Clock::system().now_ns()) }))
    }

    fn suspend(&mut self) {
        self.open = false;
    }
}

/// An output with four phases: without a viewer, watched, without, watched.
struct Screen {
    demand: Demand,
    watch: Option<Watch>,
    /// Pictures and repetitions since the last change of phase.
    shown: usize,
    phases: Arc<AtomicUsize>,
}

const IN_A_PHASE: usize = 5;

impl Screen {
    fn show(&mut self) -> ControlFlow<()> {
        self.shown += 1;
        if self.shown < IN_A_PHASE {
            return ControlFlow::Continue(());
        }
        self.shown = 0;
        self.watch = if self.watch.is_some() { None } else { Some(self.demand.watch()) };
        if self.phases.fetch_add(1, Ordering::SeqCst) == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

impl Sink for Screen {
    fn write_frame(&mut self, _: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        // Frames under way when the last viewer left are not shown.
        Ok(if self.watch.is_some() { self.show() } else { ControlFlow::Continue(()) })
    }

    fn repeat_interval(&self) -> Option<Duration> {
        Some(if self.watch.is_some() { Duration::from_secs(600) } else { Duration::from_millis(20) })
    }

    fn repeat_frame(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        assert!(self.watch.is_none(), "the camera's pictures come before the hold is over");
        Ok(self.show().map_continue(|()| true))
    }
}

#[test]
fn the_camera_rests_while_nobody_watches_and_the_output_goes_on() {
    let (opened, phases) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)));
    let demand = Demand::new();
    let began = Instant::now();
    let report = run(Run {
        camera: Box::new(Sleeper { opened: Arc::clone(&opened), open: false, index: 0 }),
        depth: None,
        bokeh: None,
        look: dof(),
        adaptive: false,
        measured: false,
        threads: 1,
        changes: None,
        sink: Destination::Owned(Box::new(Screen {
            demand: demand.clone(),
            watch: None,
            shown: 0,
            phases: Arc::clone(&phases),
        })),
        pace: Pace::Realtime,
        budget_ns: PERIOD_NS,
        keep_going: false,
        demand: Some(demand),
        mirror: false,
        output_request: None,
        view: None,
        clock: Clock::system(),
        stop: &AtomicBool::new(false),
        progress: &|_| {},
    })
    .unwrap();
    assert_eq!(phases.load(Ordering::SeqCst), 4);
    assert_eq!(opened.load(Ordering::SeqCst), 2, "once for each time that somebody came");
    assert!(report.frames.is_balanced(), "{:?}", report.frames);
    // The frame at which the sink ended the run was not delivered.
    assert!(report.frames.delivered >= 2 * IN_A_PHASE as u64 - 1, "{:?}", report.frames);
    assert!(began.elapsed() < Duration::from_secs(300), "a hold is asked for anew each time");
}
