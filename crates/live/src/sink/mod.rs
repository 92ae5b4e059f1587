//! Outputs for frames.
//!
//! A file appears under its name only when it is complete: it is written beside that name and renamed. Existing files
//! are overwritten only on request, and only by complete ones. An output that has frames but cannot get its name is
//! kept as `NAME.incomplete`.

#[doc(hidden)]
pub mod card;
mod error;
mod ffmpeg;
#[cfg(feature = "camera")]
pub mod loopback;
mod output;
mod output_thread;
mod pipe;
#[cfg(feature = "pipewire")]
pub mod pipewire;
mod png;
mod rate;
mod rate_converter;
pub mod raw;
mod shutter;
mod target;
mod tee;
pub mod tee_control;
mod y4m;
pub mod yuv;
#[doc(hidden)]
pub mod yuyv;

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

pub use error::SinkError;
pub use ffmpeg::Ffmpeg;
pub use output::recover_videos;
pub use output_thread::Backpressure;
pub use pipe::Pipe;
pub use png::PngFolder;
pub use shutter::{CardNotShown, Shutter, ShutterControl};
pub use target::Target;
pub use tee::Tee;
pub use tee_control::TeeControl;
pub use y4m::{Y4m, Y4mFile};

use crate::stats::{NodeCounts, OutputCounts};
use bokehcam::frame::{ColorImage, YuyvImage};
use bokehcam::link::demand::Demand;

/// Whether the output has all frames of the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It has, as far as the number of frames is known.
    Complete,
    /// A fault or an interrupt ended the run before its own end.
    Truncated,
}

/// Result of writing a picture: `Break` if the reader at the other end has gone.
pub type Written = Result<ControlFlow<()>, SinkError>;

/// Receives finished frames, in order.
///
/// Dropping a sink without [`Sink::finish`] aborts its output: no file gets its name, but frames already written are
/// kept.
pub trait Sink: Send {
    /// Writes one frame, captured at `time_ns` by the clock of its source, later than the previous one. `Break` means
    /// that the reader at the other end has gone; it did not get this frame.
    ///
    /// # Errors
    /// The frame could not be written. A file then accepts no more; its content is kept, and the error says where.
    fn write_frame(&mut self, frame: &ColorImage, time_ns: u64) -> Written;

    /// Whether pictures should come through [`Sink::write_yuyv`] from now on, where that is cheap. Pictures in flight
    /// still arrive in the earlier form, so a sink that has once returned true must accept both from then on.
    fn wants_yuyv(&mut self) -> bool {
        false
    }

    /// Writes a picture that is YUYV already, for sinks that [want](Sink::wants_yuyv) it, like [`Sink::write_frame`]. May swap
    /// the picture's memory for another buffer.
    ///
    /// # Errors
    /// Those of [`Sink::write_frame`]; the sink never wanted YUYV.
    fn write_yuyv(&mut self, frame: &mut YuyvImage, time_ns: u64) -> Written {
        let _ = (frame, time_ns);
        Err(SinkError::Yuyv)
    }

    /// Whether it keeps the alpha channel of [`Sink::write_with_alpha`].
    fn keeps_alpha(&self) -> bool {
        self.inner().is_some_and(|inner| inner.keeps_alpha())
    }

    /// Writes a picture with straight colours and an alpha channel, one byte per pixel row by row, 255 opaque, like
    /// [`Sink::write_frame`], for sinks that [keep](Sink::keeps_alpha) it.
    ///
    /// # Errors
    /// Those of [`Sink::write_frame`]; the sink keeps no alpha.
    fn write_with_alpha(&mut self, frame: &ColorImage, alpha: &[u8], time_ns: u64) -> Written {
        let _ = (frame, alpha, time_ns);
        Err(SinkError::Alpha)
    }

    /// Sets the capture time, by the clock of the run, of the frame in the next [`Sink::write_frame`] or [`Sink::write_yuyv`]:
    /// for outputs that pass it on.
    fn set_capture_time(&mut self, captured_ns: u64) {
        self.inner_mut().into_iter().for_each(|inner| inner.set_capture_time(captured_ns));
    }

    /// Longest time that a live output may go without a picture; whenever it has passed, [`Sink::repeat_frame`] is called.
    /// `None` for outputs that store frames.
    fn repeat_interval(&self) -> Option<Duration> {
        None
    }

    /// Shows the last picture again; a still card before the first one, and while no client watches. `Continue` holds
    /// whether anything was shown; `Break` is as for [`Sink::write_frame`].
    ///
    /// # Errors
    /// The picture could not be written.
    fn repeat_frame(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        Ok(ControlFlow::Continue(false))
    }

    /// Shows the still card instead of a picture, so that earlier pictures are no longer visible. The caller repeats
    /// it, at frame times, until the next picture.
    ///
    /// # Errors
    /// Those of [`Sink::write_frame`].
    fn write_card(&mut self, card: &ColorImage, time_ns: u64) -> Written {
        self.write_frame(card, time_ns)
    }

    /// Called instead of [`Sink::write_frame`] for a frame that is not in CPU memory: only a preview gets it.
    fn skip_frame(&mut self) {}

    /// Whether frames currently reach an output. While they do not, a frame counts as delivered once a preview shows
    /// it.
    fn has_outputs(&self) -> bool {
        self.inner().is_none_or(|inner| inner.has_outputs())
    }

    /// Whether its pictures are seen as they come, like those of a virtual camera.
    fn is_live(&self) -> bool {
        self.inner().is_some_and(|inner| inner.is_live())
    }

    /// Lists outputs that [`Sink::write_card`] has sent the card, and that have not shown it yet.
    fn outputs_without_card(&self) -> Vec<OutputWithoutCard> {
        self.inner().map_or_else(Vec::new, |inner| inner.outputs_without_card())
    }

    /// Returns the counters of frames sent to PipeWire cameras.
    fn node_counters(&self) -> Vec<Counter<NodeCounts>> {
        self.inner().map_or_else(Vec::new, |inner| inner.node_counters())
    }

    /// Returns the counters of outputs that get their frames asynchronously.
    fn output_counters(&self) -> Vec<Counter<OutputCounts>> {
        self.inner().map_or_else(Vec::new, |inner| inner.output_counters())
    }

    /// Returns the sink that this one passes pictures on to, if it does: what it does not answer itself, that sink
    /// does.
    fn inner(&self) -> Option<&dyn Sink> {
        None
    }

    /// Returns [`Sink::inner`] to be changed.
    fn inner_mut(&mut self) -> Option<&mut dyn Sink> {
        None
    }

    /// Completes the output after the last frame. A truncated one replaces nothing.
    ///
    /// # Errors
    /// The output could not be completed; its content is then kept, and the error says where. An earlier error is not
    /// reported again.
    fn finish(self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        let _ = ending;
        Ok(())
    }

    /// Describes the output and its location, in one line for the report.
    fn describe(&self) -> String {
        "a sink of its own".into()
    }
}

/// Reads the counts of a sink, also after it has ended.
pub type Counter<T> = Arc<dyn Fn() -> T + Send + Sync>;

/// Reads all counters.
pub(crate) fn read_counters<T>(counters: &[Counter<T>]) -> Vec<T> {
    counters.iter().map(|count| count()).collect()
}

/// An output that may still show a picture instead of the card.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputWithoutCard {
    /// Description of the output.
    pub output: String,
    /// Whether its pictures are seen as they come.
    pub is_live: bool,
}

/// Discards all frames.
pub struct Null;

impl Sink for Null {
    fn write_frame(&mut self, _: &ColorImage, _: u64) -> Written {
        Ok(ControlFlow::Continue(()))
    }

    fn keeps_alpha(&self) -> bool {
        true
    }

    fn write_with_alpha(&mut self, _: &ColorImage, _: &[u8], _: u64) -> Written {
        Ok(ControlFlow::Continue(()))
    }

    fn finish(self: Box<Self>, _: Ending) -> Result<(), SinkError> {
        Ok(())
    }

    fn describe(&self) -> String {
        "null".into()
    }
}

/// What belongs to the pictures of a video file: its sound, title, date and place.
#[derive(Clone, Debug, PartialEq)]
pub struct Sound {
    /// The file that has it.
    pub path: PathBuf,
    /// Time in that file at which the pictures begin, in seconds.
    pub start_s: f64,
}

/// Parameters for opening a sink.
#[derive(Clone, Debug)]
pub struct Options {
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Time between frames, > 0.
    pub period_ns: u64,
    /// Whether existing outputs may be overwritten.
    pub force: bool,
    /// Width and height of a virtual camera; `None`: those of the frames, with the width rounded down to even.
    pub out_size: Option<(u32, u32)>,
    /// Number of encoder threads of a video; `None`: the encoder's default. The resulting bytes may depend on it.
    pub threads: Option<usize>,
    /// Whether pictures may have an alpha channel.
    pub alpha: bool,
    /// Receives whether a virtual camera is watched.
    pub demand: Option<Demand>,
    /// For a filter: the name of the PipeWire camera whose readers get the pictures, or a part of it.
    pub filter_target: Option<String>,
    /// The sound to copy into a video that ffmpeg writes.
    pub sound: Option<Sound>,
    /// Set when the run has to end: from then on, stalled processes and readers are no longer waited for.
    pub stop: Arc<AtomicBool>,
}

impl Options {
    /// Creates options that overwrite nothing, report no readers, and never stop.
    pub fn new(size: (u32, u32), period_ns: u64) -> Self {
        let stop = Arc::default();
        Self {
            size,
            period_ns,
            force: false,
            out_size: None,
            threads: None,
            alpha: false,
            demand: None,
            filter_target: None,
            sound: None,
            stop,
        }
    }
}

/// Checks that a frame has the size that the stream's header states.
fn check_size(made_for: (u32, u32), got: (u32, u32)) -> Result<(), SinkError> {
    if got == made_for { Ok(()) } else { Err(SinkError::Size { made_for, got }) }
}

/// Writes the pixels of a picture with its alpha to `rgba`, four bytes each.
fn interleave_alpha<'a>(frame: &ColorImage, alpha: impl IntoIterator<Item = &'a u8>, rgba: &mut Vec<u8>) {
    rgba.clear();
    rgba.reserve(frame.rgb.len() / 3 * 4);
    let pixels = frame.rgb.as_chunks::<3>().0.iter().zip(alpha);
    pixels.for_each(|(&[r, g, b], &alpha)| rgba.extend_from_slice(&[r, g, b, alpha]));
}
