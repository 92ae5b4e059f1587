//! The only module that knows all stages: the thread graph of a run, and the handling of failures.
//!
//! Three named threads and the caller's, joined by three links; each ends when its input ends. Stop is one flag that
//! only capture reads: frames in flight then drain, and the output is completed. A stage that fails drops both its
//! ends, so that its neighbours end as well, without an error of their own, since only the cause is reported; the
//! output is completed.

mod blur;
mod buffers;
mod capture;
mod change;
mod deadline;
mod deliver;
mod depth;
mod depth_schedule;
mod error;
mod frame;
mod output_request;
mod pacer;
mod playout;
mod reused_depth;
mod start;
mod threads;
mod view;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

pub use buffers::check_memory;
use buffers::{BufferCounts, MAX_IN_FLIGHT, Pools};
pub use change::{Change, ChangeSender, ExecutorChange};
pub use error::{Fault, PipelineError};
pub use output_request::OutputRequest;
pub use start::{BlurSetup, Destination, Pace, Run};
use threads::{join_stage, run_guarded, spawn_stage};
pub use view::{Progress, Trace, View};

use crate::capture::SourceInfo;
use crate::sink::{self, Ending};
use crate::stats::{EnergyMeter, FrameCounter, LiveSource, Report, RunInfo, Timings};
use bokehcam::clock::{self, Clock};
use bokehcam::engine::{Blur, Engine};
use bokehcam::link::{self, Receiver, Sender};

/// State shared by all stages of a run.
struct Shared {
    clock: Clock,
    counter: FrameCounter,
    pools: Pools,
    /// Description of the camera.
    info: SourceInfo,
    /// The frame period, if frames come in real time.
    realtime_period_ns: Option<u64>,
    keep_going: bool,
    /// Whether the run has a view, which receives the unblurred pictures and depth, too.
    is_viewed: bool,
    /// Requested place of the pictures, and whether each needs its own depth.
    output_request: Option<Arc<OutputRequest>>,
    /// The plan for depth, set by the blur stage.
    plan: depth_schedule::SharedPlan,
    /// Whether the sink takes YUYV, and no other reader gets the pictures.
    wants_yuyv: AtomicBool,
    /// Set when any stage ends, so that capture ends, too.
    has_ended: AtomicBool,
}

impl Shared {
    fn new(run: &Run, blur: &Blur) -> Self {
        let info = run.camera.info();
        let in_blur = match (&run.changes, blur.executor()) {
            (Some(_), _) => MAX_IN_FLIGHT,
            (None, executor) => executor.map_or(0, |executor| executor.capacity()),
        };
        let is_viewed = run.view.is_some();
        Self {
            clock: run.clock.clone(),
            counter: FrameCounter::new(),
            pools: Pools::new(&BufferCounts { in_blur, is_viewed }, info.size, info.frame_data),
            realtime_period_ns: run.realtime_period_ns(),
            info,
            keep_going: run.keep_going,
            is_viewed,
            output_request: run.output_request.clone(),
            plan: depth_schedule::SharedPlan::new(blur.picker.plan()),
            wants_yuyv: AtomicBool::new(false),
            has_ended: AtomicBool::new(false),
        }
    }
}

/// Runs the pipeline until the frames end, the sink ends or the stop flag is set, and completes an owned output in any case.
///
/// # Errors
/// Returns the fault of the stage that failed, a panic included, with the report. The output then has the frames
/// delivered so far.
pub fn run(mut run: Run) -> Result<Report, PipelineError> {
    let (began_ns, cpu_ns, energy) = (run.clock.now_ns(), clock::program_cpu_ns(), EnergyMeter::start());
    let Engine { preprocessor, blur } = run.create_engine();
    let shared = Shared::new(&run, &blur);
    let Shared { info, counter, has_ended, .. } = &shared;
    let mut timings = Timings::default();
    let Timings { decode, depth: of_depth, blur: of_blur, sink: of_sink } = &mut timings;
    let (mut destination, pace, stop) = (run.sink, run.pace, run.stop);
    let sink = destination.sink();
    let about =
        RunInfo { source: info.name.clone(), sink: sink.describe(), budget_ns: run.budget_ns, ..RunInfo::default() };

    let capture = capture::Stage::new(run.camera, run.demand, stop, &shared, decode);
    let depth = depth::Stage::new(preprocessor, run.depth, (run.changes, run.adaptive), &shared, of_depth);
    let blur = blur::Stage::new(blur, run.output_request.filter(|_| !run.mirror), run.budget_ns, &shared, of_blur);
    let deliver = deliver::Stage::new(sink, (run.view, run.progress), run.mirror, &shared, of_sink);
    let ((to_depth, from_capture), (to_blur, from_depth), (to_sink, from_blur)) =
        (create_link(pace), create_link(pace), create_link(pace));
    let ended = thread::scope(|scope| {
        let upstream = [
            spawn_stage(scope, "capture", has_ended, move || capture.run(to_depth))?,
            spawn_stage(scope, "depth", has_ended, move || depth.run(from_capture, to_blur))?,
            spawn_stage(scope, "blur", has_ended, move || blur.run(from_depth, to_sink))?,
        ];
        let delivered = run_guarded("sink", has_ended, move || deliver.run(from_blur));
        upstream.into_iter().map(join_stage).chain([delivered]).collect::<Result<(), Fault>>()
    });

    // A source with a known number of frames was stopped before its end.
    let counts = counter.frame_counts();
    let done = if info.live { counts.delivered } else { counts.captured };
    let is_cut = stop.load(Ordering::Relaxed) && info.frames.is_some_and(|frames| done < frames);
    let ending = if ended.is_err() || is_cut { Ending::Truncated } else { Ending::Complete };
    let sink = destination.sink();
    let (outputs, nodes) = (sink.output_counters(), sink.node_counters());
    let finished = run_guarded("sink", has_ended, move || match destination {
        Destination::Owned(sink) => Ok(sink.finish(ending)?),
        Destination::Lent(_) => Ok(()),
    });
    // Only now have the outputs written all frames.
    let about = RunInfo {
        outputs: sink::read_counters(&outputs),
        pipewire: sink::read_counters(&nodes),
        elapsed_ns: shared.clock.now_ns() - began_ns,
        cpu_ns: clock::program_cpu_ns() - cpu_ns,
        energy_j: Some(energy.joules()),
        live: info.live.then(|| LiveSource { size: info.size, fps: 1e9 / info.period_ns as f64 }),
        ..about
    };
    let report = Report::new(counter.frame_counts(), &timings, about);
    // The earlier fault is the cause.
    match ended.and(finished) {
        Ok(()) => Ok(report),
        Err(fault) => Err(PipelineError { fault, report: Box::new(report) }),
    }
}

fn create_link<T>(pace: Pace) -> (Sender<T>, Receiver<T>) {
    match pace {
        Pace::Realtime => link::live(),
        Pace::Asap => link::lossless(),
    }
}

type StageResult = Result<(), Fault>;
