//! The parts of a run, and how it begins.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, mpsc};

use super::{Change, ChangeSender, OutputRequest, Progress, View};
use crate::capture::Camera;
use crate::sink::Sink;
use bokehcam::bokeh::{self, Backend, Bokeh, BokehError};
use bokehcam::clock::Clock;
use bokehcam::computing::ComputeOptions;
use bokehcam::depth::DepthSource;
use bokehcam::engine::{Blur, Engine, Input, Origin, Playback, TimeBudget};
use bokehcam::link::Sender;
use bokehcam::link::demand::Demand;
use bokehcam::look::{Look, Reuse};
use bokehcam::names::named;

named! {
    /// Whether frames wait for the program, or the program for frames.
    pub enum Pace default Asap {
        /// With their recorded timing; late frames are dropped
        Realtime = "realtime",
        /// As fast as they can be delivered; none is dropped
        Asap = "asap",
    }
}

/// How the frames of a run are blurred.
pub struct BlurSetup {
    /// The initial look.
    pub look: Look,
    /// The executor for the [settings](Look::blur_settings) of that look. `None` passes frames through (effect `none`).
    pub bokeh: Option<Box<dyn Bokeh>>,
    /// Whether the executor supports every quality, so that it can follow the time available.
    pub adaptive: bool,
    /// The changes of the blur; `None` keeps everything as it is.
    pub changes: Option<mpsc::Receiver<Change>>,
}

impl BlurSetup {
    /// Creates the initial blur for pictures of `size` pixels, and the sender of later changes. Calls `make` for the
    /// executor.
    ///
    /// # Errors
    /// Returns the error of `make`.
    pub fn create<E>(
        look: Look,
        (size, adaptive): ((u32, u32), bool),
        make: impl FnOnce(&bokeh::Settings) -> Result<Box<dyn Bokeh>, E>,
    ) -> Result<(Self, ChangeSender), E> {
        let bokeh = look.blur_settings(size, adaptive).as_ref().map(make).transpose()?;
        if look.reuse == Reuse::On && bokeh.as_ref().is_some_and(|bokeh| bokeh.backend() != Backend::Cpu) {
            tracing::warn!(
                "without effect here: --reuse on (the GPU blurs every frame on its own; --backend cpu steadies what is behind)"
            );
        }
        let (changes, to_come) = ChangeSender::new(look.clone(), size, adaptive);
        Ok((Self { look, bokeh, adaptive, changes: Some(to_come) }, changes))
    }
}

/// Where the frames of a run go.
pub enum Destination<'a> {
    /// A sink that is completed at the end of the run.
    Owned(Box<dyn Sink>),
    /// A sink that outlives the run: it is not completed, and other runs may follow.
    Lent(&'a mut dyn Sink),
}

impl<'a> Destination<'a> {
    /// Returns the sink, for the frames.
    pub(super) fn sink(&mut self) -> &mut (dyn Sink + 'a) {
        match self {
            Self::Owned(sink) => &mut **sink,
            Self::Lent(sink) => &mut **sink,
        }
    }
}

/// Everything a run consists of.
pub struct Run<'a> {
    /// The source of the frames.
    pub camera: Box<dyn Camera>,
    /// The source of depth, unless the camera brings it; read only if the look follows depth.
    pub depth: Option<Box<dyn DepthSource>>,
    /// The executor; `None` passes frames through (effect `none`).
    pub bokeh: Option<Box<dyn Bokeh>>,
    /// How frames are blurred; `bokeh` is an executor for its [settings](Look::blur_settings).
    pub look: Look,
    /// Whether `bokeh` supports every quality, so that it can follow the time available.
    pub adaptive: bool,
    /// Whether depth is measured, so that refinement improves it ([`Look::refines_depth`]).
    pub measured: bool,
    /// Number of threads that finish depth.
    pub threads: usize,
    /// The changes of the blur; `None` keeps everything as it is.
    pub changes: Option<mpsc::Receiver<Change>>,
    /// The destination of the frames.
    pub sink: Destination<'a>,
    /// Real time, or all frames.
    pub pace: Pace,
    /// Time that a frame's blur may take, in nanoseconds; more is counted as a miss. In real time, if depth and blur do
    /// not fit the frame period, depth is computed with less effort, then shared by several frames.
    pub budget_ns: u64,
    /// Whether to count unreadable frames and go on; otherwise the first one ends the run.
    pub keep_going: bool,
    /// Whether the sink has viewers; the camera pauses while there are none. `None` always captures.
    pub demand: Option<Demand>,
    /// Whether to mirror the output left to right.
    pub mirror: bool,
    /// Where blurred pictures are wanted; `None` is in memory, and a mirrored picture always is. The sink only receives
    /// pictures in memory.
    pub output_request: Option<Arc<OutputRequest>>,
    /// Receives each frame that the sink took, with its inputs; the newest wins. If the sink has [no outputs](Sink::has_outputs),
    /// a frame counts as delivered once it was received here.
    pub view: Option<Sender<View>>,
    /// The clock.
    pub clock: Clock,
    /// Once set, no more frames are captured.
    pub stop: &'a AtomicBool,
    /// Called after each delivered frame, on the caller's thread.
    pub progress: &'a dyn Fn(Progress),
}

impl<'a> Run<'a> {
    /// Creates a run of every frame of `camera`, blurred as `look` says, into `sink`, as fast as possible. `depth`
    /// provides measured depth in metres if the look follows depth and the camera does not bring it. `stop` ends the
    /// run.
    ///
    /// # Errors
    /// The blur is too wide for the pictures, or the requested GPU does not exist.
    pub fn new(
        camera: Box<dyn Camera>,
        depth: Option<Box<dyn DepthSource>>,
        look: Look,
        sink: Box<dyn Sink>,
        stop: &'a AtomicBool,
    ) -> Result<Self, BokehError> {
        let size = camera.info().size;
        let bokeh = look
            .blur_settings(size, false)
            .map(|settings| ComputeOptions::default().create_blur(&settings, size))
            .transpose()?;
        let blurring = BlurSetup { look, bokeh, adaptive: false, changes: None };
        Ok(Self {
            measured: depth.is_some(),
            ..Self::with_blur(camera, depth, blurring, Destination::Owned(sink), stop)
        })
    }

    /// Creates a run like [`Run::new`] with a given blur; depth is not assumed to be measured.
    pub fn with_blur(
        camera: Box<dyn Camera>,
        depth: Option<Box<dyn DepthSource>>,
        BlurSetup { look, bokeh, adaptive, changes }: BlurSetup,
        sink: Destination<'a>,
        stop: &'a AtomicBool,
    ) -> Self {
        Self {
            budget_ns: camera.info().period_ns,
            measured: false,
            threads: ComputeOptions::default().thread_count(),
            camera,
            depth,
            bokeh,
            look,
            adaptive,
            changes,
            sink,
            pace: Pace::Asap,
            keep_going: false,
            demand: None,
            mirror: false,
            output_request: None,
            view: None,
            clock: Clock::system(),
            stop,
            progress: &|_| {},
        }
    }

    /// Returns the frame period if frames come in real time.
    pub(super) fn realtime_period_ns(&self) -> Option<u64> {
        (self.pace == Pace::Realtime).then(|| self.camera.info().period_ns)
    }

    /// Creates the engine; takes the executor.
    pub(super) fn create_engine(&mut self) -> Engine {
        let info = self.camera.info();
        let depth = self.depth.as_ref();
        let input = Input {
            size: info.size,
            frames: info.frames,
            depth: if self.measured { Origin::Measured } else { Origin::Synthesized },
            knows_background: depth.is_some_and(|depth| depth.knows_background()),
            playback: match (info.frames, self.pace) {
                (Some(1), _) => Playback::Still,
                (_, Pace::Asap) => Playback::EveryPicture,
                (_, Pace::Realtime) => Playback::Realtime,
            },
            threads: self.threads,
        };
        let time = TimeBudget {
            budget_ns: self.budget_ns,
            period_ns: self.realtime_period_ns(),
            efforts: depth.map_or(&[1.0], |depth| depth.efforts()),
            shares_depth: depth.is_none_or(|depth| depth.is_reusable()),
        };
        let blur = Blur::new(self.bokeh.take(), self.look.quality_rule(self.adaptive), time);
        Engine::new(&self.look, input, blur)
    }
}
