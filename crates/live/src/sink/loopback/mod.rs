//! A virtual camera: a v4l2loopback node that call programs read.
//!
//! Its format is constant during a run; pictures of another size are scaled into it. A writer never blocks there, so
//! frames are written as they come; while none comes, the last one is repeated, so that readers that connect late, or
//! give up on a silent camera, have a picture.

mod encode;
mod watch;

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use self::encode::Encoder;
use self::watch::ReaderWatcher;
use super::rate::frame_rate;
use super::{Ending, Options, Sink, SinkError, card, check_size};
use crate::v4l2::loopback::{Layout, LoopbackError, Output};
use crate::v4l2::reader_monitor::ReaderMonitor;
use bokehcam::frame::fit::Letterbox;
use bokehcam::frame::{ColorImage, YuyvImage};
use bokehcam::link::demand::Demand;

/// Shortest time after which a picture is repeated.
const MIN_REPEAT_INTERVAL: Duration = Duration::from_millis(100);
/// Period of the card while no client watches, which keeps the node alive.
const IDLE_REPEAT_INTERVAL: Duration = Duration::from_secs(1);

/// A virtual camera opened for writing.
pub struct Loopback {
    output: Output,
    /// Whether YUYV frames of the run can be written unchanged.
    wants_yuyv: bool,
    encoder: Encoder,
    fit: Letterbox,
    fitted: ColorImage,
    /// The last frame written, encoded.
    bytes: Vec<u8>,
    /// Whether that is the still card.
    shows_card: bool,
    /// When the card was last written instead of a picture.
    card_written_ns: u64,
    repeat_interval: Duration,
    demand: Option<Demand>,
    _watcher: Option<ReaderWatcher>,
}

impl Loopback {
    /// Opens the node, and shows a still card until the first picture comes. A demand in the options is kept up to date
    /// with whether the camera is watched.
    ///
    /// # Errors
    /// It is not a free node of v4l2loopback, its format is fixed to one that cannot be written, or the system cannot
    /// detect readers.
    pub fn open(path: &Path, options: &Options) -> Result<Self, SinkError> {
        let size = options.out_size.unwrap_or(options.size);
        // Two pixels share their chroma.
        let even = ((size.0 & !1).max(2), size.1.max(1));
        let output = Output::open(path, even, frame_rate(options.period_ns))?;
        if output.size() != even {
            let (width, height) = output.size();
            tracing::warn!("{} is fixed to {width} x {height} pixels: pictures are fitted into that", path.display());
        }
        let _watcher = options.demand.clone().map(|demand| start_watcher(path, &output, demand)).transpose()?;
        let mut loopback = Self {
            wants_yuyv: output.layout() == Layout::Yuyv && output.size() == options.size,
            encoder: Encoder::new(output.layout()),
            fit: Letterbox::default(),
            fitted: ColorImage::new(output.size().0, output.size().1),
            bytes: Vec::new(),
            shows_card: true,
            card_written_ns: 0,
            repeat_interval: (2 * Duration::from_nanos(options.period_ns))
                .clamp(MIN_REPEAT_INTERVAL, IDLE_REPEAT_INTERVAL),
            demand: options.demand.clone(),
            _watcher,
            output,
        };
        loopback.show_card()?;
        Ok(loopback)
    }

    /// Whether no client watches, as far as that is detected.
    fn is_unwatched(&self) -> bool {
        self.demand.as_ref().is_some_and(|demand| !demand.is_watched())
    }

    fn show_card(&mut self) -> Result<(), SinkError> {
        card::draw_card(&mut self.fitted);
        self.encoder.encode(&self.fitted, &mut self.bytes);
        self.shows_card = true;
        // Fill all buffers of the driver: a new reader first gets their content, which must not be an earlier picture.
        Ok(self.output.fill_buffers(&self.bytes)?)
    }
}

/// Starts a thread that updates `demand` when readers of the camera come and go.
fn start_watcher(path: &Path, output: &Output, demand: Demand) -> Result<ReaderWatcher, SinkError> {
    let system_error = |cause| LoopbackError::System {
        path: path.to_owned(),
        doing: "its readers cannot be detected; leave --on-demand out",
        cause,
    };
    let (monitor, stop) = ReaderMonitor::new(output.device().clone()).map_err(system_error)?;
    if !monitor.has_module_events() {
        tracing::info!(
            "{}: this version of v4l2loopback does not report its readers; every program that has it open counts as one",
            path.display()
        );
    }
    Ok(ReaderWatcher::start((monitor, stop), demand).map_err(system_error)?)
}

impl From<LoopbackError> for SinkError {
    fn from(error: LoopbackError) -> Self {
        Self::Camera(error.into())
    }
}

impl Sink for Loopback {
    fn write_frame(&mut self, frame: &ColorImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        self.encoder.encode(self.fit.fit_if_needed(frame, &mut self.fitted), &mut self.bytes);
        self.shows_card = false;
        self.output.write_frame(&self.bytes)?;
        Ok(ControlFlow::Continue(()))
    }

    fn wants_yuyv(&mut self) -> bool {
        self.wants_yuyv
    }

    fn write_yuyv(&mut self, frame: &mut YuyvImage, _: u64) -> Result<ControlFlow<()>, SinkError> {
        check_size(self.output.size(), frame.size())?;
        std::mem::swap(&mut self.bytes, &mut frame.bytes);
        self.shows_card = false;
        self.output.write_frame(&self.bytes)?;
        Ok(ControlFlow::Continue(()))
    }

    /// The driver keeps the card, so it is rewritten only as often as any last picture.
    fn write_card(&mut self, _: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        if !self.shows_card {
            self.show_card()?;
            self.card_written_ns = time_ns;
        } else if u128::from(time_ns.saturating_sub(self.card_written_ns)) >= self.repeat_interval.as_nanos() {
            self.output.write_frame(&self.bytes)?;
            self.card_written_ns = time_ns;
        }
        Ok(ControlFlow::Continue(()))
    }

    fn is_live(&self) -> bool {
        true
    }

    /// While no client watches, the card soon replaces the last picture, and is then rarely rewritten.
    fn repeat_interval(&self) -> Option<Duration> {
        match (self.is_unwatched(), self.shows_card) {
            (true, true) => Some(IDLE_REPEAT_INTERVAL),
            (true, false) => Some(MIN_REPEAT_INTERVAL),
            (false, _) => Some(self.repeat_interval),
        }
    }

    /// While no client watches, the still card replaces the last frame.
    fn repeat_frame(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        if self.is_unwatched() && !self.shows_card {
            self.show_card()?;
        } else {
            self.output.write_frame(&self.bytes)?;
        }
        Ok(ControlFlow::Continue(true))
    }

    fn finish(self: Box<Self>, _: Ending) -> Result<(), SinkError> {
        Ok(())
    }

    fn describe(&self) -> String {
        let (width, height) = self.output.size();
        let name = self.output.device().path().display();
        format!("virtual camera {name} ({}), {} {width}x{height}", self.output.card(), self.output.layout().fourcc())
    }
}

impl Drop for Loopback {
    fn drop(&mut self) {
        // Otherwise connected readers would show the last picture of a person forever. An error is not reported: it
        // would have occurred with earlier frames.
        if !self.shows_card {
            let _ = self.show_card();
        }
    }
}
