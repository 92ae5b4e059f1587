//! Where frames go.
//!
//! A file appears under its name only when it is complete: it is written beside that name and renamed. Nothing that
//! exists is overwritten unless that was asked for, and then only by what is whole. What has frames and cannot have its
//! name is kept as `NAME.incomplete`.

#[doc(hidden)]
pub mod card;
mod error;
mod ffmpeg;
#[cfg(feature = "camera")]
mod loopback;
mod output;
mod output_thread;
mod pipe;
#[cfg(feature = "pipewire")]
mod pipewire;
mod png;
mod rate;
pub mod raw;
mod shutter;
mod steady;
pub mod switch;
mod target;
mod tee;
mod y4m;
pub mod yuv;
#[doc(hidden)]
pub mod yuyv;

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

#[cfg(feature = "pipewire")]
pub use self::pipewire::PipeWire;
pub use error::SinkError;
pub use ffmpeg::Ffmpeg;
#[cfg(feature = "camera")]
pub use loopback::Loopback;
pub use output::recover_all;
pub use output_thread::Backpressure;
pub use pipe::Pipe;
pub use png::PngFolder;
pub use shutter::{NotCovered, Release, Shutter};
pub use switch::Switchboard;
pub use target::Target;
pub use tee::Tee;
pub use y4m::{Y4m, Y4mFile};

use crate::frame::{ColorImage, YuyvImage};
use crate::link::demand::Demand;
use crate::stats::{NodeUse, OutputUse};

/// Whether all frames came that were to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// They did, as far as anybody knows how many there would be.
    Whole,
    /// A fault came between, or somebody broke off what has an end of its own.
    Cut,
}

/// Takes finished frames, in order.
///
/// Dropping a sink without [`Sink::finish`] gives up its output: no file gets its name, but frames that it has are
/// kept.
pub trait Sink: Send {
    /// Takes one frame, which was captured at `time_ns` by the clock of its source, later than the one before. `Break`
    /// says that the reader at the other end has gone; it did not get this frame.
    ///
    /// # Errors
    /// The frame could not be written. A file then takes no more; what it had is kept, and the error says where.
    fn put(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError>;

    /// Whether pictures are to come by [`Sink::put_yuyv`] from now on, where that is easy. Those that are under way come
    /// as they were wanted before, so whoever has said so once takes both for good.
    fn wants_yuyv(&mut self) -> bool {
        false
    }

    /// [`Sink::put`] of a picture that is YUYV already, for sinks that [wanted](Sink::wants_yuyv) such. The memory of
    /// another picture may be left in its place.
    ///
    /// # Errors
    /// As for [`Sink::put`]; it never wanted such.
    fn put_yuyv(&mut self, frame: &mut YuyvImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        let _ = (frame, time_ns);
        Err(SinkError::Yuyv)
    }

    /// Told before [`Sink::put`] and [`Sink::put_yuyv`] when that frame was captured, by the clock of the run: for outputs
    /// that hand it on.
    fn captured(&mut self, captured_ns: u64) {
        let _ = captured_ns;
    }

    /// How long a live output may go without a picture from now on; whenever that has passed, [`Sink::repeat`] is
    /// called. `None` for everything that stores frames.
    fn hold(&self) -> Option<Duration> {
        None
    }

    /// Shows the last picture again; a still card before the first, and while nobody watches. `Continue` says whether
    /// anything was shown; `Break` as for [`Sink::put`].
    ///
    /// # Errors
    /// It could not be written.
    fn repeat(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        Ok(ControlFlow::Continue(false))
    }

    /// Takes the still card in the place of a picture, so that nothing of the pictures before can be seen any more. Whoever
    /// calls it goes on to do so, at the times of frames, until the next picture.
    ///
    /// # Errors
    /// As for [`Sink::put`].
    fn cover(&mut self, card: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.put(card, time_ns)
    }

    /// Called in place of [`Sink::put`] for a frame that is not in CPU memory: a preview alone gets it.
    fn pass_by(&mut self) {}

    /// Whether frames that are put now go anywhere. While they do not, a frame counts as delivered once a preview shows
    /// it.
    fn keeps(&self) -> bool {
        true
    }

    /// Whether people see pictures as they come, as those of a virtual camera.
    fn is_live(&self) -> bool {
        false
    }

    /// Outputs that were given the card last, by [`Sink::cover`], and have not taken it yet.
    fn uncovered(&self) -> Vec<Uncovered> {
        Vec::new()
    }

    /// What became of the frames that were put, of cameras that were given to PipeWire.
    fn nodes(&self) -> Vec<Counter<NodeUse>> {
        Vec::new()
    }

    /// The same, of several outputs that get their frames at a time of their own.
    fn outputs(&self) -> Vec<Counter<OutputUse>> {
        Vec::new()
    }

    /// Completes the output after the last frame. One that was cut short replaces nothing.
    ///
    /// # Errors
    /// The output could not be completed; what there is of it is then kept, and the error says where. An error of
    /// before is not reported again.
    fn finish(self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        let _ = ending;
        Ok(())
    }

    /// One line for the report: what this is, and where.
    fn describe(&self) -> String {
        "a sink of its own".into()
    }
}

/// Counts what a sink did, also after that has ended.
pub type Counter<T> = Arc<dyn Fn() -> T + Send + Sync>;

/// What the counters say now.
pub(crate) fn read<T>(counters: &[Counter<T>]) -> Vec<T> {
    counters.iter().map(|count| count()).collect()
}

/// An output that may still show a picture in the place of the card.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Uncovered {
    /// What it is, and where.
    pub output: String,
    /// Whether people see its pictures as they come.
    pub is_live: bool,
}

/// Takes frames and forgets them.
pub struct Null;

impl Sink for Null {
    fn put(&mut self, _: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        Ok(ControlFlow::Continue(()))
    }

    fn finish(self: Box<Self>, _: Ending) -> Result<(), SinkError> {
        Ok(())
    }

    fn describe(&self) -> String {
        "null".into()
    }
}

/// What the frames will be like, what may be overwritten, and who is told of readers.
#[derive(Clone, Debug)]
pub struct Options {
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Time from frame to frame, > 0.
    pub period_ns: u64,
    /// How many frames will come at most, where that is known.
    pub frames: Option<u64>,
    /// Overwrite what exists.
    pub force: bool,
    /// Width and height of a virtual camera; `None`: those of the frames, the width made even.
    pub out_size: Option<(u32, u32)>,
    /// Threads that compress a video; `None`: as many as the encoder takes. Its bytes may depend on them.
    pub threads: Option<usize>,
    /// Notice by a virtual camera whether somebody watches.
    pub demand: Option<Demand>,
    /// For a filter: what the camera of PipeWire's is called, or a part of that, whose readers it gives its pictures to.
    pub stands_for: Option<String>,
    /// Once set, the run is to end: nobody is waited for any more who does nothing.
    pub stop: Arc<AtomicBool>,
}

impl Options {
    /// Nothing that exists is overwritten, nobody is told of readers, and nothing stops the run.
    pub fn new(size: (u32, u32), period_ns: u64) -> Self {
        let stop = Arc::default();
        Self {
            size,
            period_ns,
            frames: None,
            force: false,
            out_size: None,
            threads: None,
            demand: None,
            stands_for: None,
            stop,
        }
    }
}

/// The frames of a stream keep the size that its header states.
fn check_size(made_for: (u32, u32), got: (u32, u32)) -> Result<(), SinkError> {
    if got == made_for { Ok(()) } else { Err(SinkError::Size { made_for, got }) }
}
