//! The only module that knows all stages: the thread graph of a run, and the handling of failures.
//!
//! Three named threads and the caller's, joined by three links; each ends when its input ends. Stop is one flag that
//! only capture reads: frames in flight then drain, and the output is completed. A stage that fails drops both its
//! ends, so that its neighbours end as well, without an error of their own, since only the cause is reported; the
//! output is completed.

mod blur;
mod capture;
mod change;
mod deliver;
mod depth;
mod error;
mod frame;
mod held;
mod late;
mod pacer;
mod places;
mod playout;
mod rate;
mod start;
mod threads;
mod view;
mod wanted;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

pub use change::{Change, Changes, Executor};
pub use error::{Fault, PipelineError};
pub use places::check_room;
use places::{MAX_IN_FLIGHT, Places, Pools};
pub use start::{Blurring, Pace, Run};
use threads::{guard, join, spawn};
pub use view::{Progress, Trace, View};
pub use wanted::Wanted;

use crate::capture::SourceInfo;
use crate::clock::{self, Clock};
use crate::engine::{Blur, Engine};
use crate::link::{self, Receiver, Sender};
use crate::sink::{self, Ending};
use crate::stats::{About, Report, Tally, Timings};

/// State shared by all stages of a run.
struct Shared {
    clock: Clock,
    tally: Tally,
    pools: Pools,
    /// Description of the camera.
    info: SourceInfo,
    /// The frame period, if frames come in real time.
    live_ns: Option<u64>,
    keep_going: bool,
    /// Whether the run has a view, which receives the unblurred pictures and depth, too.
    is_viewed: bool,
    /// Requested place of the pictures, and whether each needs its own depth.
    wanted: Option<Arc<Wanted>>,
    /// The plan for depth, set by the blur stage.
    order: rate::Order,
    /// Whether the sink takes YUYV, and no other reader gets the pictures.
    wants_yuyv: AtomicBool,
    /// Set when any stage ends, so that capture ends, too.
    over: AtomicBool,
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
            tally: Tally::new(),
            pools: Pools::new(&Places { in_blur, viewed: is_viewed }, info.size, info.brings),
            live_ns: run.live_ns(),
            info,
            keep_going: run.keep_going,
            is_viewed,
            wanted: run.wanted.clone(),
            order: rate::Order::new(blur.picker.plan()),
            wants_yuyv: AtomicBool::new(false),
            over: AtomicBool::new(false),
        }
    }
}

/// Runs the pipeline until the frames end, the sink ends or the stop flag is set, and completes the output in any case.
///
/// # Errors
/// Returns the fault of the stage that failed, a panic included, with the report. The output then has the frames
/// delivered so far.
pub fn run(mut run: Run) -> Result<Report, PipelineError> {
    let (began_ns, cpu_ns) = (run.clock.now_ns(), clock::cpu_ns());
    let Engine { preparation, blur } = run.engine();
    let shared = Shared::new(&run, &blur);
    let Shared { info, tally, over, .. } = &shared;
    let mut timings = Timings::default();
    let Timings { decode, depth: of_depth, blur: of_blur, sink: of_sink } = &mut timings;
    let (mut sink, pace, stop) = (run.sink, run.pace, run.stop);
    let about =
        About { source: info.name.clone(), sink: sink.describe(), budget_ns: run.budget_ns, ..About::default() };

    let capture = capture::Stage::new(run.camera, run.demand, stop, &shared, decode);
    let depth = depth::Stage::new(preparation, run.depth, (run.changes, run.adaptive), &shared, of_depth);
    let blur = blur::Stage::new(blur, run.wanted.filter(|_| !run.mirror), run.budget_ns, &shared, of_blur);
    let deliver = deliver::Stage::new(&mut *sink, (run.view, run.progress), run.mirror, &shared, of_sink);
    let ((to_depth, from_capture), (to_blur, from_depth), (to_sink, from_blur)) = (link(pace), link(pace), link(pace));
    let ended = thread::scope(|scope| {
        let upstream = [
            spawn(scope, "capture", over, move || capture.run(to_depth))?,
            spawn(scope, "depth", over, move || depth.run(from_capture, to_blur))?,
            spawn(scope, "blur", over, move || blur.run(from_depth, to_sink))?,
        ];
        let delivered = guard("sink", over, move || deliver.run(from_blur));
        upstream.into_iter().map(join).chain([delivered]).collect::<Result<(), Fault>>()
    });

    // A source with a known number of frames was stopped before its end.
    let is_cut = stop.load(Ordering::Relaxed) && info.frames.is_some_and(|frames| tally.frames().captured < frames);
    let ending = if ended.is_err() || is_cut { Ending::Cut } else { Ending::Whole };
    let (outputs, nodes) = (sink.outputs(), sink.nodes());
    let finished = guard("sink", over, move || Ok(sink.finish(ending)?));
    // Only now have the outputs written all frames.
    let about = About {
        outputs: sink::read(&outputs),
        pipewire: sink::read(&nodes),
        elapsed_ns: shared.clock.now_ns() - began_ns,
        cpu_ns: clock::cpu_ns() - cpu_ns,
        ..about
    };
    let report = Report::new(tally.frames(), &timings, about);
    // The earlier fault is the cause.
    match ended.and(finished) {
        Ok(()) => Ok(report),
        Err(fault) => Err(PipelineError { fault, report: Box::new(report) }),
    }
}

fn link<T>(pace: Pace) -> (Sender<T>, Receiver<T>) {
    match pace {
        Pace::Realtime => link::live(),
        Pace::Asap => link::lossless(),
    }
}

type Ended = Result<(), Fault>;
