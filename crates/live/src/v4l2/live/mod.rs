//! A capture device that delivers frames for hours, with recovery from failures. It may stall, fail, be unplugged or
//! return under another number; frames continue when they can.

pub mod auto_lock;
pub mod error;
mod identity;
mod low_rate;
pub mod negotiate;
mod recover;
mod session;
pub mod user_controls;
mod watchdog;

use std::time::Duration;

pub use error::OpenError;
pub use negotiate::ModeRequest;
pub use session::{NegotiatedMode, Setting};

use identity::CameraIdentity;
use low_rate::LowRateCheck;
use session::Session;
use watchdog::Watchdog;

use crate::layout::Layout;
use crate::v4l2::controls;
use crate::v4l2::node;
use crate::v4l2::queue::{Losses, Planes};
use bokehcam::clock::Clock;

/// A device node that delivers frames.
pub struct LiveDevice {
    identity: CameraIdentity,
    name: String,
    request: ModeRequest,
    settings: Vec<Setting>,
    clock: Clock,
    negotiated: NegotiatedMode,
    state: State,
    watchdog: Watchdog,
    low_rate: LowRateCheck,
    losses: Losses,
    /// Whether the first frame was requested.
    started: bool,
    /// Whether the current frame was passed to the caller.
    is_frame_borrowed: bool,
    /// The last warning about missing frames, so that it is not repeated.
    last_warning: String,
    /// When all nodes were last searched.
    searched_ns: u64,
}

enum State {
    Streaming(Box<Session>),
    /// Closed after a failure; to be reopened at this time.
    Reconnecting {
        retry_ns: u64,
    },
    /// Closed because no client watches.
    Suspended,
}

/// Result of waiting for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// A frame, to be read with [`LiveDevice::planes`] and returned with [`LiveDevice::release_frame`].
    Frame {
        /// Capture time on the system's monotonic clock; the dequeuing time if the driver reports none.
        captured_ns: u64,
    },
    /// Lost frames. Each is reported once, before the frame that follows it.
    Lost(Losses),
    /// No frame yet, or the device is absent: call again.
    Waiting,
}

/// Period between attempts to reopen an absent device.
const RETRY_NS: u64 = 150_000_000;
/// Period between searches of all nodes, each of which has to be opened.
const SEARCH_PERIOD_NS: u64 = 1_000_000_000;
/// Pause after a driver error, to let the driver recover.
const ERROR_PAUSE_NS: u64 = 5_000_000;
/// Number of attempts to open a camera at the start, and the pause between them: another program may need time to close
/// it.
const MAX_TRIES: u32 = 5;
const TRY_PAUSE_NS: u64 = 200_000_000;
/// A frame with an older time stamp than this was stamped by another clock.
const MAX_STAMP_AGE_NS: u64 = 5_000_000_000;

impl LiveDevice {
    /// Opens the device that `name` means (a path, a number, a link's name, part of a card's name), sets the controls
    /// `settings` and starts it.
    ///
    /// # Errors
    /// No device matches, or it cannot be used; a busy or failing one is retried for about a second.
    pub fn open(name: &str, request: ModeRequest, settings: Vec<Setting>, clock: Clock) -> Result<Self, OpenError> {
        let path = node::resolve_node(name)?;
        let mut tries = 1;
        let session = loop {
            match Session::open(&path, &request, &settings, None, &clock) {
                // Another program may just be closing it, or the driver recovering.
                Err(error) if error.is_transient() && tries < MAX_TRIES => {
                    tracing::debug!("{error}; trying again");
                    tries += 1;
                    clock.sleep_until_ns(clock.now_ns() + TRY_PAUSE_NS);
                }
                opened => break opened?,
            }
        };
        let identity = CameraIdentity::new(&path, &session.capability);
        let name = identity.describe();
        let (negotiated, now_ns) = (session.negotiated, clock.now_ns());
        tracing::info!("{name}: {negotiated}");
        Ok(Self {
            identity,
            name,
            request,
            settings,
            negotiated,
            state: State::Streaming(Box::new(session)),
            watchdog: Watchdog::new(negotiated.interval.period_ns(), now_ns),
            low_rate: LowRateCheck::new(negotiated.interval.fps(), now_ns),
            losses: Losses::default(),
            started: false,
            is_frame_borrowed: false,
            last_warning: String::new(),
            searched_ns: now_ns,
            clock,
        })
    }

    /// Its node and card name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The mode last negotiated with the driver.
    pub fn negotiated(&self) -> &NegotiatedMode {
        &self.negotiated
    }

    /// The memory layout of its frames. May change after a reconnection.
    pub fn layout(&self) -> &Layout {
        &self.negotiated.layout
    }

    /// Waits for a frame, not much longer than `timeout`. Only the newest one is returned, the others are lost.
    /// Reopens the device if it is closed.
    pub fn next(&mut self, timeout: Duration) -> Next {
        if self.is_frame_borrowed {
            self.release_frame();
        }
        match &mut self.state {
            State::Streaming(session) => {
                if !std::mem::replace(&mut self.started, true) {
                    // Frames captured while the program was starting do not count as lost.
                    session.queue.reset_losses();
                    self.watchdog.on_start(self.clock.now_ns());
                    self.low_rate.restart(self.clock.now_ns());
                }
                // A frame may be available already if the last call reported losses instead.
                if session.queue.current().is_none() {
                    match session.queue.wait_newest(timeout) {
                        Ok(true) => self.handle_frame(),
                        Ok(false) => {
                            let remedy = self.watchdog.on_silence(self.clock.now_ns());
                            self.apply_remedy(remedy, "no frames");
                        }
                        Err(error) => self.handle_error(&error),
                    }
                }
            }
            State::Reconnecting { retry_ns } => {
                let (now_ns, until_ns) = (self.clock.now_ns(), *retry_ns);
                if now_ns < until_ns {
                    self.clock.sleep_until_ns(until_ns.min(now_ns + timeout.as_nanos() as u64));
                } else {
                    self.reopen();
                }
            }
            State::Suspended => {
                self.watchdog.on_start(self.clock.now_ns());
                self.reopen();
            }
        }
        self.next_result()
    }

    /// Returns the result of [`LiveDevice::next`]: losses before the frame that follows them.
    fn next_result(&mut self) -> Next {
        if let State::Streaming(session) = &mut self.state {
            add_losses(&mut self.losses, session.queue.take_losses());
        }
        if self.losses.total() > 0 {
            return Next::Lost(std::mem::take(&mut self.losses));
        }
        let State::Streaming(session) = &self.state else { return Next::Waiting };
        let Some((frame, _)) = session.queue.current() else { return Next::Waiting };
        let now_ns = self.clock.now_ns();
        let plausible = |stamp_ns: &u64| now_ns.saturating_sub(*stamp_ns) < MAX_STAMP_AGE_NS;
        self.is_frame_borrowed = true;
        // Never in the future, however little the clocks differ.
        Next::Frame { captured_ns: frame.stamp_ns.filter(plausible).unwrap_or(now_ns).min(now_ns) }
    }

    /// The planes of the frame returned last; `None` after its release.
    pub fn planes(&self) -> Option<Planes<'_>> {
        match &self.state {
            State::Streaming(session) if self.is_frame_borrowed => session.queue.current().map(|(_, planes)| planes),
            _ => None,
        }
    }

    /// Returns the memory of the last frame, which was read, to the driver.
    pub fn release_frame(&mut self) {
        self.is_frame_borrowed = false;
        if let State::Streaming(session) = &mut self.state {
            session.queue.release();
        }
    }

    /// Closes the device until [`LiveDevice::next`] is called again.
    pub fn suspend(&mut self) {
        if matches!(self.state, State::Streaming(_)) {
            tracing::debug!("{}: closed, as no program reads it", self.name);
        }
        self.close(State::Suspended);
        self.last_warning.clear();
    }

    /// Handles a dequeued frame: updates the watchdog and the low-rate check, and counts the losses before it.
    fn handle_frame(&mut self) {
        let State::Streaming(session) = &mut self.state else { return };
        let now_ns = self.clock.now_ns();
        let losses = session.queue.take_losses();
        add_losses(&mut self.losses, losses);
        if let Some(trouble) = self.watchdog.on_frame(now_ns) {
            tracing::warn!("{}: frames again after {:.1} s", self.name, trouble.as_secs_f64());
        }
        self.last_warning.clear();
        // A virtual camera's rate depends on the program that writes to it.
        let low_fps = if session.is_loopback() {
            None
        } else {
            // Discarded frames, too, are part of the camera's rate.
            self.low_rate.count_frames(1 + losses.stale + losses.corrupt, losses.missed, now_ns)
        };
        if let Some(fps) = low_fps {
            self.warn_of_low_rate(fps);
        }
    }

    fn warn_of_low_rate(&self, fps: f64) {
        let State::Streaming(session) = &self.state else { return };
        const CONTROL: &str = "exposure_dynamic_framerate";
        let controls = controls::list_controls(session.device()).unwrap_or_default();
        let what = match controls::find_control(&controls, CONTROL) {
            Some(control) => format!(
                "in low light it exposes longer; more light helps, or --control {}=0 (a darker picture)",
                control.name
            ),
            None => "low light makes cameras expose longer, and a shared USB port slows them down".to_owned(),
        };
        tracing::warn!("{}: {fps:.1} frames a second instead of {}: {what}", self.name, self.negotiated.interval);
    }

    fn close(&mut self, state: State) {
        self.is_frame_borrowed = false;
        if let State::Streaming(session) = &mut self.state {
            session.queue.stop();
            add_losses(&mut self.losses, session.queue.take_losses());
        }
        self.state = state;
    }

    /// Warns, unless the last warning was the same.
    fn warn_once(&mut self, what: String) {
        if self.last_warning != what {
            tracing::warn!("{}: {what}", self.name);
            self.last_warning = what;
        }
    }
}

fn add_losses(sum: &mut Losses, losses: Losses) {
    sum.missed += losses.missed;
    sum.stale += losses.stale;
    sum.corrupt += losses.corrupt;
}
