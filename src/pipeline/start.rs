//! What a run is made of, and how it begins.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, mpsc};

use super::{Change, Changes, Progress, View, Wanted};
use crate::bokeh::{self, Bokeh, BokehError};
use crate::capture::Camera;
use crate::clock::Clock;
use crate::computing::Computing;
use crate::depth::DepthSource;
use crate::engine::{Blur, Engine, Input, Origin, Time};
use crate::link::Sender;
use crate::link::demand::Demand;
use crate::look::Look;
use crate::names::named;
use crate::sink::Sink;

named! {
    /// Whether frames wait for the program, or the program for frames.
    pub enum Pace default Asap {
        /// As they were recorded; late frames are dropped
        Realtime = "realtime",
        /// As fast as they are delivered; none is dropped
        Asap = "asap",
    }
}

/// How the frames of a run are blurred.
pub struct Blurring {
    /// How they look at first.
    pub look: Look,
    /// What blurs them so: an executor of its [settings](Look::settings). `None` passes them through (effect `none`).
    pub bokeh: Option<Box<dyn Bokeh>>,
    /// Whether that was made for every quality, so that it can follow the time there is.
    pub adaptive: bool,
    /// Where a change of all that comes from; `None` keeps everything as it is.
    pub changes: Option<mpsc::Receiver<Change>>,
}

impl Blurring {
    /// Pictures of `size` pixels in this look, and what changes it later. `make` makes the executor.
    ///
    /// # Errors
    /// That of `make`.
    pub fn begin<E>(
        look: Look,
        (size, adaptive): ((u32, u32), bool),
        make: impl FnOnce(&bokeh::Settings) -> Result<Box<dyn Bokeh>, E>,
    ) -> Result<(Self, Changes), E> {
        let bokeh = look.settings(size, adaptive).as_ref().map(make).transpose()?;
        let (changes, to_come) = Changes::new(look.clone(), size, adaptive);
        Ok((Self { look, bokeh, adaptive, changes: Some(to_come) }, changes))
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
        let size = camera.info().size;
        let bokeh =
            look.settings(size, false).map(|settings| Computing::default().blur(&settings, size)).transpose()?;
        let blurring = Blurring { look, bokeh, adaptive: false, changes: None };
        Ok(Self { measured: depth.is_some(), ..Self::of(camera, depth, blurring, sink, stop) })
    }

    /// The same of frames that are blurred so, whose depth is not taken to be measured.
    pub fn of(
        camera: Box<dyn Camera>,
        depth: Option<Box<dyn DepthSource>>,
        Blurring { look, bokeh, adaptive, changes }: Blurring,
        sink: Box<dyn Sink>,
        stop: &'a AtomicBool,
    ) -> Self {
        Self {
            budget_ns: camera.info().period_ns,
            measured: false,
            threads: Computing::default().threads(),
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
            wanted: None,
            view: None,
            clock: Clock::system(),
            stop,
            progress: &|_| {},
        }
    }

    /// From frame to frame, where they come in real time.
    pub(super) fn live_ns(&self) -> Option<u64> {
        (self.pace == Pace::Realtime).then(|| self.camera.info().period_ns)
    }

    /// What is done to each frame, by the executor, which is taken.
    pub(super) fn engine(&mut self) -> Engine {
        let info = self.camera.info();
        let depth = self.depth.as_ref();
        let input = Input {
            size: info.size,
            frames: info.frames,
            depth: if self.measured { Origin::Measured } else { Origin::Made },
            knows_background: depth.is_some_and(|depth| depth.knows_background()),
            threads: self.threads,
        };
        let time = Time {
            budget_ns: self.budget_ns,
            period_ns: self.live_ns(),
            efforts: depth.map_or(&[1.0], |depth| depth.efforts()),
            shares_depth: depth.is_none_or(|depth| depth.may_be_shared()),
        };
        let blur = Blur::new(self.bokeh.take(), self.look.quality_rule(self.adaptive), time);
        Engine::new(&self.look, input, blur)
    }
}
