//! The outputs of a session: virtual cameras and recordings. They go on from source to source, each with the size with
//! which it was opened.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use std::{io, mem};

use super::super::services::Services;
use super::super::state::{Output, Update};
use super::{EventSender, SessionConfig};
use bokehcam::clock::Clock;
use bokehcam::frame::ColorImage;
use bokehcam::link::demand::{Demand, Watch};
use bokehcam_files::user_folders as folders;
use bokehcam_live::sink::card::draw_card;
use bokehcam_live::sink::tee_control::{MemberEvent, MemberState};
use bokehcam_live::sink::{self, Ending, Shutter, ShutterControl, Sink, SinkError, Target, Tee, TeeControl};

/// Size and period of the pictures before the first source is open; nothing shows them.
const FIRST_SIZE: (u32, u32) = (16, 16);
const FIRST_PERIOD: Duration = Duration::from_millis(33);

/// The outputs, and the sink through which each run writes to all of them.
pub(super) struct Outputs {
    sink: SharedSink,
    control: TeeControl,
    opened: Vec<OpenedOutput>,
    /// Number of outputs that were ever opened.
    count: u64,
    /// Frame size and period of the last source; `None` before the first one.
    source: Option<((u32, u32), u64)>,
    demand: Demand,
    /// Set at the end: from then on, stalled processes and readers are no longer waited for.
    stop: Arc<AtomicBool>,
    ticker: Ticker,
}

/// The sink of all runs. A run holds the lock from its first frame to its last; the ticker and the session use it between
/// runs.
#[derive(Clone)]
pub(super) struct SharedSink(Arc<Mutex<Shutter>>);

impl SharedSink {
    /// Locks the sink; waits for the end of the run that has it.
    pub fn lock(&self) -> MutexGuard<'_, Shutter> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An output that was opened.
struct OpenedOutput {
    output: Output,
    number: u64,
    size: (u32, u32),
    /// Counts the programs that read a virtual camera.
    readers: Demand,
    /// Held where readers are unknown, and for recordings, to keep the source from pausing.
    _watch: Option<Watch>,
    /// Whether the user switched it off while a program was reading: it shows the card until the last one has left.
    is_withheld: bool,
}

impl OpenedOutput {
    fn is_watched(&self) -> bool {
        self.output.is_camera && self.readers.has_watchers()
    }
}

impl Outputs {
    /// Creates a session's outputs, without any yet, and the switch that withholds pictures from them. `report` is called
    /// for each event of an output, also on the thread of the frames.
    ///
    /// # Errors
    /// The system refuses a thread.
    pub fn new(
        config: &SessionConfig,
        report: impl Fn(MemberEvent) + Send + Sync + 'static,
    ) -> io::Result<(Self, ShutterControl)> {
        let (tee, control) = Tee::with_control("window", report);
        let (demand, off) = (config.demand.clone(), Arc::clone(&config.off));
        let (shutter, shutter_control) =
            Shutter::new(Box::new(tee), FIRST_SIZE, FIRST_PERIOD, demand.clone(), Clock::system(), off);
        let sink = SharedSink(Arc::new(Mutex::new(shutter)));
        let ticker = Ticker::start(sink.clone())?;
        let (opened, stop) = (Vec::new(), Arc::default());
        Ok((Self { sink, control, opened, count: 0, source: None, demand, stop, ticker }, shutter_control))
    }

    /// Returns the sink for a run of a source with frames of `size` pixels every `period_ns`.
    pub fn begin_source(&mut self, size: (u32, u32), period_ns: u64) -> SharedSink {
        self.source = Some((size, period_ns));
        self.sink.lock().begin_source(size, Duration::from_nanos(period_ns));
        self.sink.clone()
    }

    /// Shows the card, because no source is open: recordings are completed.
    pub fn end_source(&mut self) {
        let recordings: Vec<_> = self.list().into_iter().filter(|output| !output.is_camera).collect();
        recordings.iter().for_each(|recording| self.remove(recording));
        // Its own outputs never fail a tee with a control.
        let _ = self.sink.lock().show_card();
    }

    /// Opens an output for the pictures of the current source, or shows them again in a virtual camera that still has
    /// readers.
    ///
    /// # Errors
    /// Returns a one-line message if there was no source yet, or the output cannot be opened.
    pub fn add(&mut self, output: Output, services: &mut dyn Services) -> Result<(), String> {
        if let Some(opened) = self.opened.iter_mut().find(|opened| opened.output == output) {
            if mem::take(&mut opened.is_withheld) {
                self.control.withhold(&output.name, None);
            }
            return Ok(());
        }
        let (size, period_ns) = self.source.ok_or("There is no source to record.")?;
        let readers = self.demand.new_part();
        let options = sink::Options { stop: Arc::clone(&self.stop), ..sink::Options::new(size, period_ns) };
        let with_readers = sink::Options { demand: Some(readers.clone()), ..options.clone() };
        let (sink, watch) = match output.is_camera.then(|| services.open_output(&output.name, with_readers)) {
            Some(Ok(sink)) => (sink, None),
            // Some cameras cannot tell their readers.
            Some(Err(_)) | None => (services.open_output(&output.name, options)?, Some(readers.watch())),
        };
        self.count += 1;
        // The tee lives as long as this.
        let _ = self.control.add(&output.name, self.count, size, sink);
        let (number, is_withheld) = (self.count, false);
        self.opened.push(OpenedOutput { output, number, size, readers, _watch: watch, is_withheld });
        Ok(())
    }

    /// Removes an output, which completes a recording. A virtual camera that is being read shows the card until its last
    /// reader has left; returns whether it does.
    pub fn switch_off(&mut self, output: &Output) -> bool {
        let Some(opened) = self.opened.iter_mut().find(|opened| opened.output == *output) else { return false };
        if !opened.is_watched() {
            self.remove(output);
            return false;
        }
        opened.is_withheld = true;
        let mut card = ColorImage::new(opened.size.0, opened.size.1);
        draw_card(&mut card);
        self.control.withhold(&output.name, Some(card));
        true
    }

    fn remove(&mut self, output: &Output) {
        self.control.remove(&output.name);
        self.opened.retain(|opened| opened.output != *output);
    }

    /// Removes the virtual cameras that were switched off and have no more readers.
    pub fn remove_unread(&mut self) {
        let is_unread = |opened: &&OpenedOutput| opened.is_withheld && !opened.is_watched();
        let unread: Vec<_> = self.opened.iter().filter(is_unread).map(|opened| opened.output.clone()).collect();
        unread.iter().for_each(|output| self.remove(output));
    }

    /// Forgets an output that has failed.
    pub fn forget(&mut self, number: u64) {
        self.opened.retain(|opened| opened.number != number);
    }

    /// Returns the outputs that are on.
    pub fn list(&self) -> Vec<Output> {
        self.opened.iter().filter(|opened| !opened.is_withheld).map(|opened| opened.output.clone()).collect()
    }

    /// Whether there is a virtual camera, also one that shows the card and may be switched on again.
    pub fn has_virtual_camera(&self) -> bool {
        self.opened.iter().any(|opened| opened.output.is_camera)
    }

    /// Whether a program reads a virtual camera.
    pub fn is_watched(&self) -> bool {
        self.opened.iter().any(|opened| !opened.is_withheld && opened.is_watched())
    }

    /// Completes all outputs; no run may have the sink any more.
    ///
    /// # Errors
    /// The first error of an output.
    pub fn finish(self) -> Result<(), SinkError> {
        self.stop.store(true, Ordering::Relaxed);
        self.ticker.join();
        let sink = Arc::into_inner(self.sink.0).and_then(|sink| sink.into_inner().ok());
        sink.map_or(Ok(()), |sink| Box::new(sink).finish(Ending::Complete))
    }
}

/// A thread that repeats pictures and switches outputs while no run does.
struct Ticker {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Ticker {
    fn start(sink: SharedSink) -> io::Result<Self> {
        let stop = Arc::<AtomicBool>::default();
        let stopped = Arc::clone(&stop);
        let tick = move || {
            while !stopped.load(Ordering::Acquire) {
                let interval = {
                    let mut sink = sink.lock();
                    // Its own outputs never fail a tee with a control.
                    let _ = sink.repeat_frame();
                    sink.repeat_interval().unwrap_or(FIRST_PERIOD)
                };
                thread::park_timeout(interval);
            }
        };
        Ok(Self { stop, thread: thread::Builder::new().name("outputs".into()).spawn(tick)? })
    }

    fn join(self) {
        self.stop.store(true, Ordering::Release);
        self.thread.thread().unpark();
        // A panic was printed already.
        let _ = self.thread.join();
    }
}

impl EventSender {
    /// Reports an event of an output to the user; returns the reason if the output has failed.
    pub(super) fn report_output_event(&self, MemberEvent { member, state, .. }: MemberEvent) -> Option<String> {
        match state {
            MemberState::Started => self.note(match virtual_camera_name(&member) {
                Some(camera) => format!("Calls have this picture now: choose the camera {camera}"),
                None => format!("Recording to {}", folders::format_output(&member)),
            }),
            // A virtual camera leaves no file to report.
            MemberState::Completed { .. } if virtual_camera_name(&member).is_some() => {}
            MemberState::Completed { frames } => {
                self.note(format!("Complete: {}, {frames} frames", folders::format_output(&member)));
                self.report_saved(Path::new(&member));
            }
            MemberState::Failed { why, .. } => {
                tracing::error!("{why}");
                self.send_update(Update::OutputFailure(why.clone()));
                return Some(why);
            }
        }
        None
    }
}

/// Returns the name that other programs display for a virtual camera; `None` if the output is no camera.
fn virtual_camera_name(output: &str) -> Option<String> {
    let target: Target = output.parse().ok().filter(Target::is_camera)?;
    Some(match target {
        Target::PipeWire(label) => label.unwrap_or_else(|| "bokehcam".to_owned()),
        other => other.to_string(),
    })
}
