//! The one place that knows all stages: the thread graph of a run, and what becomes of a failure.
//!
//! Three named threads and the caller's, joined by three links; all end because their input ended. Stop is one flag
//! that only capture reads: what is under way then drains, and the output is completed. A stage that fails drops both
//! its ends, so that its neighbours end as well: quietly, since only the cause is an error; its output is completed.

mod blur;
mod capture;
mod change;
mod coc;
mod deliver;
mod depth;
mod error;
mod fit_check;
mod held;
mod pacer;
mod places;
mod playout;
mod prepare;
mod quality;
mod rate;
mod staging;
mod stepper;
pub mod still;
mod threads;
mod view;
mod wanted;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;

pub use change::{Change, Changes, Executor};
pub use coc::{CocMaker, Finish};
pub use places::check_room;
use places::{MOST_IN_FLIGHT, Places};
use threads::{guard, join, spawn};

pub use error::{Fault, PipelineError};
pub use stepper::Stepper;
pub use view::{Progress, Trace, View};
pub use wanted::Wanted;

use crate::bokeh::{Bokeh, BokehError};
use crate::budget::Quality;
use crate::capture::{Brings, Camera};
use crate::clock::{self, Clock};
use crate::compute::Backend;
use crate::computing::Computing;
use crate::depth::DepthSource;
use crate::frame::crop::Cropper;
use crate::frame::{ColorImage, DepthMap, GrayImage, Stamp, YuyvImage};
use crate::link::demand::Demand;
use crate::link::pool::Pool;
use crate::link::{self, Receiver, Sender};
use crate::look::{Effect, Look};
use crate::names::named;
use crate::sink::{self, Ending, Sink};
use crate::stats::{About, Cause, Report, Tally, Ticket, Timings};

named! {
    /// Whether frames wait for the program, or the program for frames.
    pub enum Pace default Asap {
        /// As they were recorded; late frames are dropped
        Realtime = "realtime",
        /// As fast as they are delivered; none is dropped
        Asap = "asap",
    }
}

/// Everything a run is made of.
pub struct Run<'a> {
    /// Where frames come from.
    pub camera: Box<dyn Camera>,
    /// Where their depth comes from, unless they bring it with them; read only where the look follows it.
    pub depth: Option<Box<dyn DepthSource>>,
    /// What blurs them; `None` passes them through (effect `none`).
    pub bokeh: Option<Box<dyn Bokeh>>,
    /// How they are blurred: `bokeh` is an executor of its [settings](Look::settings).
    pub look: Look,
    /// Whether `bokeh` was made for every quality, so that it can follow the time there is.
    pub adaptive: bool,
    /// Whether depth was measured, so that refining it makes it better ([`Look::refines`]).
    pub measured: bool,
    /// Threads that finish depth.
    pub threads: usize,
    /// Where a change of all that comes from; `None` keeps everything as it is.
    pub changes: Option<mpsc::Receiver<Change>>,
    /// Where they go.
    pub sink: Box<dyn Sink>,
    /// Real time, or all frames.
    pub pace: Pace,
    /// Time that a frame's blur may take, in nanoseconds; more is counted as a miss. In real time, depth is made with less
    /// effort, and then for fewer frames, where both do not fit the time until a frame is due.
    pub budget_ns: u64,
    /// Count frames that cannot be read, and go on; otherwise the first one ends the run.
    pub keep_going: bool,
    /// Where the sink tells whether anybody watches; the camera rests while nobody does.
    pub demand: Option<Demand>,
    /// Flip the pictures left to right on their way out.
    pub mirror: bool,
    /// Where blurred pictures are wanted; `None` is in memory, as is a mirrored picture always. The sink is given none
    /// that is not in memory.
    pub wanted: Option<Arc<Wanted>>,
    /// Who is shown each frame that the sink took, with what it was made of; the newest wins. Where the sink
    /// [keeps](Sink::keeps) nothing, a frame is delivered once it was taken from here.
    pub view: Option<Sender<View>>,
    /// What measures time.
    pub clock: Clock,
    /// Once set, no more frames are captured.
    pub stop: &'a AtomicBool,
    /// Told after each delivered frame, on the caller's thread.
    pub progress: &'a dyn Fn(Progress),
}

impl<'a> Run<'a> {
    /// A run of every frame of `camera`, blurred as `look` says, into `sink`, as fast as it goes. `depth` gives their
    /// measured depth in metres where the look follows depth and the camera does not bring it. `stop` ends the run.
    ///
    /// # Errors
    /// The blur is too wide for the pictures, or there is no such GPU.
    pub fn new(
        camera: Box<dyn Camera>,
        depth: Option<Box<dyn DepthSource>>,
        look: Look,
        sink: Box<dyn Sink>,
        stop: &'a AtomicBool,
    ) -> Result<Self, BokehError> {
        let info = camera.info();
        let settings = look.settings(info.size, false);
        Ok(Self {
            bokeh: settings.map(|settings| Computing::default().blur(&settings, info.size)).transpose()?,
            measured: depth.is_some(),
            threads: Computing::default().threads(),
            camera,
            depth,
            look,
            adaptive: false,
            changes: None,
            sink,
            pace: Pace::Asap,
            budget_ns: info.period_ns,
            keep_going: false,
            demand: None,
            mirror: false,
            wanted: None,
            view: None,
            clock: Clock::system(),
            stop,
            progress: &|_| {},
        })
    }
}

/// A frame on its way: what identifies it, what it took, and what there is of it at this point.
struct Frame<T> {
    ticket: Ticket,
    stamp: Stamp,
    trace: Trace,
    /// When the last stage was through with it.
    since_ns: u64,
    item: T,
}

/// Runs the pipeline until its frames or its sink end or the stop flag is set, and completes the output in any case.
///
/// # Errors
/// The fault of the stage that failed; a panic is one. The output then has the frames until there. The error has the
/// report.
pub fn run(run: Run) -> Result<Report, PipelineError> {
    let Run { camera, depth: source, bokeh: executor, mut sink, pace, clock, .. } = run;
    let info = camera.info();
    let mut about = About {
        backend: executor.as_ref().map_or("none", |executor| executor.backends()).into(),
        adapter: executor.as_ref().map_or_else(|| "none".into(), |executor| executor.describe()),
        source: info.name.clone(),
        sink: sink.describe(),
        budget_ns: run.budget_ns,
        ..About::default()
    };
    let tally = Tally::new();
    let mut timings = Timings::default();
    let Timings {
        decode,
        depth: depth_times,
        held,
        blur,
        passes,
        rungs,
        misses,
        sink: sink_times,
        playout,
        latency,
        frame,
        repeats,
    } = &mut timings;
    let finest = finest_quality(executor.as_deref());
    let quality = run.look.quality_rule(run.adaptive);
    let live_ns = (pace == Pace::Realtime).then_some(info.period_ns);
    let (began_ns, cpu_ns) = (clock.now_ns(), clock::cpu_ns());
    // Set when any stage ends, so that capture does, too.
    let over = AtomicBool::new(false);
    let in_blur = match (&executor, &run.changes) {
        (_, Some(_)) => MOST_IN_FLIGHT,
        (Some(executor), None) => executor.capacity(),
        (None, None) => 0,
    };
    let places = Places { in_blur, viewed: run.view.is_some() };
    let colors = Pool::new(places.colors(), || ColorImage::new(info.size.0, info.size.1));
    let depths = Pool::new(places.depths(), DepthMap::default);
    let rights = Pool::new(if info.brings == Brings::RightEye { places.rights() } else { 0 }, GrayImage::default);
    let taken = Pool::new(places.taken(), staging::Taken::default);
    let outs = Pool::new(places.outs(), || ColorImage::new(info.size.0, info.size.1));
    let yuyvs = Pool::new(places.outs(), YuyvImage::default);
    // Whether the sink takes pictures as YUYV, and nobody else is given them.
    let wants_yuyv = AtomicBool::new(false);

    let (to_depth, from_capture) = link(pace);
    let (to_blur, from_depth) = link(pace);
    let (to_sink, from_blur) = link(pace);
    let capture = capture::Stage {
        pacer: pacer::Pacer::new(clock.clone(), pace == Pace::Realtime && !info.live, info.period_ns),
        brings: info.brings,
        camera,
        keep_going: run.keep_going,
        demand: run.demand,
        stop: [run.stop, &over],
        colors: &colors,
        depths: &depths,
        rights: &rights,
        tally: &tally,
        clock: &clock,
        times: decode,
    };
    let choices = source.as_ref().map_or((&[1.0][..], true), |source| (source.efforts(), source.may_be_shared()));
    let picker = quality::Picker::new((quality, finest), run.budget_ns, live_ns, choices);
    let order = rate::Order::new(picker.plan());
    // Without a blur nobody asks for depth.
    let look = if executor.is_some() { run.look } else { Look::plain(Effect::None) };
    let knows_background = source.as_ref().is_some_and(|source| source.knows_background());
    let pictures = (info.size, info.frames);
    let mut preparation = prepare::Preparation::new(&look, pictures, run.measured, knows_background, run.threads);
    preparation.beside(executor.as_deref());
    let (mut refined_by, mut matted_by) = (None, None);
    let depth = depth::Stage {
        adaptive: run.adaptive,
        changes: run.changes,
        rate: live_ns.map(|_| rate::Rate::new(&order)),
        wanted: run.wanted.clone(),
        source,
        source_name: &info.name,
        keep_going: run.keep_going,
        depths: &depths,
        taken: Some(&taken).filter(|_| places.viewed),
        tally: &tally,
        clock: &clock,
        times: depth_times,
        held,
        refined_by: &mut refined_by,
        matted_by: &mut matted_by,
    };
    let blur = blur::Stage {
        executor,
        late: live_ns.map(quality::LateRule::new),
        order: &order,
        picker,
        rule: quality,
        about: &mut about,
        outs: &outs,
        yuyvs: &yuyvs,
        wanted: run.wanted.filter(|_| !run.mirror),
        wants_yuyv: &wants_yuyv,
        viewed: places.viewed,
        tally: &tally,
        clock: &clock,
        budget_ns: run.budget_ns,
        times: blur::Times { blur, passes, rungs, misses },
    };
    let deliver = deliver::Stage {
        sink: &mut *sink,
        view: run.view,
        mirror: run.mirror,
        wants_yuyv: &wants_yuyv,
        total: info.frames,
        progress: run.progress,
        playout: live_ns.map(playout::Playout::new),
        tally: &tally,
        clock: &clock,
        times: deliver::Times { sink: sink_times, playout, latency, frame, repeats },
        cropper: Cropper::default(),
        cropped: ColorImage::default(),
    };

    let ended = thread::scope(|scope| {
        let upstream = [
            spawn(scope, "capture", &over, move || capture.run(to_depth))?,
            spawn(scope, "depth", &over, move || depth.run(preparation, from_capture, to_blur))?,
            spawn(scope, "blur", &over, move || blur.run(from_depth, to_sink))?,
        ];
        let delivered = guard("sink", &over, move || deliver.run(from_blur));
        upstream.into_iter().map(join).chain([delivered]).collect::<Result<(), Fault>>()
    });
    // A source that has an end of its own was broken off before it.
    let is_cut = run.stop.load(Ordering::Relaxed) && info.frames.is_some_and(|frames| tally.frames().captured < frames);
    let ending = if ended.is_err() || is_cut { Ending::Cut } else { Ending::Whole };
    let (outputs, nodes) = (sink.outputs(), sink.nodes());
    [about.refined_by, about.matted_by] = [refined_by, matted_by].map(|by| by.unwrap_or("none").into());
    let finished = guard("sink", &over, move || Ok(sink.finish(ending)?));
    // What came first is the cause. Only now have the outputs taken all that was under way.
    let ended = ended.and(finished);
    (about.outputs, about.pipewire) = (sink::read(&outputs), sink::read(&nodes));
    about.elapsed_ns = clock.now_ns() - began_ns;
    about.cpu_ns = clock::cpu_ns() - cpu_ns;
    let report = Report::new(tally.frames(), &timings, about);
    match ended {
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

/// The finest level that an executor is given as the time allows.
fn finest_quality(executor: Option<&dyn Bokeh>) -> Quality {
    // On the processor a finer level takes twice the time for half a decibel, and other programs need it, too.
    match executor.map(Bokeh::backend) {
        Some(Backend::Cpu) => Quality::Balanced,
        _ => Quality::Best,
    }
}

/// Hands a frame on, and counts an older one that it displaced; returns whether there is anybody to take more.
fn hand_on<T>(to: &mut Sender<Frame<T>>, frame: Frame<T>, tally: &Tally) -> bool {
    match to.send(frame) {
        Ok(None) => true,
        Ok(Some(older)) => {
            tally.dropped(older.ticket, Cause::Evicted);
            true
        }
        // Nobody knows the frame's fate: it stays in flight.
        Err(link::Abandoned) => false,
    }
}

type Ended = Result<(), Fault>;
