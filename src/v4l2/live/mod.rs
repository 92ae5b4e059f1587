//! A device that gives frames for hours: once it was opened, it is recovered from whatever happens to it. It may stall,
//! fail, be unplugged, come back under another number; frames go on when they can.

mod address;
pub mod error;
pub mod hold;
pub mod knobs;
mod low_rate;
pub mod negotiate;
mod recover;
mod session;
mod watchdog;

use std::time::Duration;

pub use error::OpenError;
pub use negotiate::Wish;
pub use session::{Agreed, Setting};

use address::Address;
use low_rate::LowRateCheck;
use session::Session;
use watchdog::Watchdog;

use crate::clock::Clock;
use crate::layout::Layout;
use crate::v4l2::controls;
use crate::v4l2::node;
use crate::v4l2::queue::{Losses, Planes};

/// A device node that gives frames.
pub struct Live {
    address: Address,
    name: String,
    wish: Wish,
    settings: Vec<Setting>,
    clock: Clock,
    agreed: Agreed,
    state: State,
    watchdog: Watchdog,
    low_rate: LowRateCheck,
    losses: Losses,
    /// The first frame was asked for.
    begun: bool,
    /// The current frame was given out.
    given: bool,
    /// What was said last about why there are no frames, so that it is said once.
    said: String,
    /// When all nodes were searched last.
    searched_ns: u64,
}

enum State {
    Streaming(Box<Session>),
    /// Closed after a failure; to be opened again at this time.
    Away {
        retry_ns: u64,
    },
    /// Closed because nobody watches.
    Resting,
}

/// What came of waiting for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// A frame, to be read with [`Live::planes`] and given back with [`Live::release`].
    Frame {
        /// When it was taken, on the system's monotonic clock; when it was dequeued, where the driver does not tell.
        captured_ns: u64,
    },
    /// Frames that nobody will see. Each is told once, before the frame that follows them.
    Lost(Losses),
    /// No frame yet, or the device is away: ask again.
    Waiting,
}

/// How often a device that is away is looked for.
const LOOK_NS: u64 = 150_000_000;
/// How often among all nodes: each is opened for that.
const SEARCH_NS: u64 = 1_000_000_000;
/// Pause after an error of the driver, for it to recover.
const ERROR_NAP_NS: u64 = 5_000_000;
/// How often a camera is tried at the start, and how long between: whoever closes it may take a while.
const TRIES: u32 = 5;
const TRY_NAP_NS: u64 = 200_000_000;
/// A frame with an older time stamp than this was stamped by another clock than ours.
const CREDIBLE_AGE_NS: u64 = 5_000_000_000;

impl Live {
    /// Opens the device that `name` means (a path, a number, a link's name, part of a card's name), sets the controls
    /// `settings` and starts it.
    ///
    /// # Errors
    /// There is none, or it cannot be used; one that is busy or fails was given a second.
    pub fn open(name: &str, wish: Wish, settings: Vec<Setting>, clock: Clock) -> Result<Self, OpenError> {
        let path = node::resolve(name)?;
        let mut tries = 1;
        let session = loop {
            match Session::open(&path, &wish, &settings, None, &clock) {
                Err(error) if error.is_transient() && tries < TRIES => {
                    tracing::debug!("{error}; trying again");
                    tries += 1;
                    clock.sleep_until_ns(clock.now_ns() + TRY_NAP_NS);
                }
                opened => break opened?,
            }
        };
        let address = Address::new(&path, &session.capability);
        let name = format!("{} ({})", path.display(), address.card());
        let (agreed, now_ns) = (session.agreed, clock.now_ns());
        tracing::info!("{name}: {agreed}");
        Ok(Self {
            address,
            name,
            wish,
            settings,
            agreed,
            state: State::Streaming(Box::new(session)),
            watchdog: Watchdog::new(agreed.interval.period_ns(), now_ns),
            low_rate: LowRateCheck::new(agreed.interval.fps(), now_ns),
            losses: Losses::default(),
            begun: false,
            given: false,
            said: String::new(),
            searched_ns: now_ns,
            clock,
        })
    }

    /// Its node and its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What was agreed on last.
    pub fn agreed(&self) -> &Agreed {
        &self.agreed
    }

    /// How its pictures look in memory. May change whenever it was away.
    pub fn layout(&self) -> &Layout {
        &self.agreed.layout
    }

    /// Waits for a frame, not much longer than `patience`. The newest one counts, the others are lost. Opens the device
    /// if it is closed.
    pub fn next(&mut self, patience: Duration) -> Next {
        if self.given {
            self.release();
        }
        match &mut self.state {
            State::Streaming(session) => {
                if !std::mem::replace(&mut self.begun, true) {
                    // Frames that came while the program got ready are nobody's loss.
                    session.queue.begin();
                    self.watchdog.started(self.clock.now_ns());
                    self.low_rate.restarted(self.clock.now_ns());
                }
                // A frame may be there already: the last call told losses instead.
                if session.queue.current().is_none() {
                    match session.queue.wait_newest(patience) {
                        Ok(true) => self.frame_came(),
                        Ok(false) => {
                            let remedy = self.watchdog.silence(self.clock.now_ns());
                            self.apply(remedy, "no frames");
                        }
                        Err(error) => self.failed(&error),
                    }
                }
            }
            State::Away { retry_ns } => {
                let (now_ns, until_ns) = (self.clock.now_ns(), *retry_ns);
                if now_ns < until_ns {
                    self.clock.sleep_until_ns(until_ns.min(now_ns + patience.as_nanos() as u64));
                } else {
                    self.reopen();
                }
            }
            State::Resting => {
                self.watchdog.started(self.clock.now_ns());
                self.reopen();
            }
        }
        self.report()
    }

    /// What [`Live::next`] returns: losses before the frame that follows them.
    fn report(&mut self) -> Next {
        if let State::Streaming(session) = &mut self.state {
            add(&mut self.losses, session.queue.take_losses());
        }
        if self.losses.total() > 0 {
            return Next::Lost(std::mem::take(&mut self.losses));
        }
        let State::Streaming(session) = &self.state else { return Next::Waiting };
        let Some((frame, _)) = session.queue.current() else { return Next::Waiting };
        let now_ns = self.clock.now_ns();
        let credible = |stamp_ns: &u64| now_ns.saturating_sub(*stamp_ns) < CREDIBLE_AGE_NS;
        self.given = true;
        // Never in the future, by however little clocks differ.
        Next::Frame { captured_ns: frame.stamp_ns.filter(credible).unwrap_or(now_ns).min(now_ns) }
    }

    /// The planes of the frame that was given last; nothing after it went back.
    pub fn planes(&self) -> Option<Planes<'_>> {
        match &self.state {
            State::Streaming(session) if self.given => session.queue.current().map(|(_, planes)| planes),
            _ => None,
        }
    }

    /// The frame that was given last was read: its memory goes back to the driver.
    pub fn release(&mut self) {
        self.given = false;
        if let State::Streaming(session) = &mut self.state {
            session.queue.release();
        }
    }

    /// Closes the device until [`Live::next`] is called again.
    pub fn rest(&mut self) {
        if matches!(self.state, State::Streaming(_)) {
            tracing::debug!("{}: closed, nobody watches", self.name);
        }
        self.close(State::Resting);
        self.said.clear();
    }

    /// A frame was dequeued: tells the watchdog and the check for a low rate, and counts what was lost before it.
    fn frame_came(&mut self) {
        let State::Streaming(session) = &mut self.state else { return };
        let now_ns = self.clock.now_ns();
        let losses = session.queue.take_losses();
        add(&mut self.losses, losses);
        if let Some(trouble) = self.watchdog.frame(now_ns) {
            tracing::warn!("{}: frames again after {:.1} s", self.name, trouble.as_secs_f64());
        }
        self.said.clear();
        // The rate of a virtual camera is the business of the program that writes to it.
        let low_fps = if session.is_loopback() {
            None
        } else {
            // Frames that came in vain are part of the camera's rate.
            self.low_rate.frames(1 + losses.stale + losses.corrupt, losses.missed, now_ns)
        };
        if let Some(fps) = low_fps {
            self.warn_of_low_rate(fps);
        }
    }

    fn warn_of_low_rate(&self, fps: f64) {
        let State::Streaming(session) = &self.state else { return };
        const CONTROL: &str = "exposure_dynamic_framerate";
        let controls = controls::list(session.device()).unwrap_or_default();
        let what = match controls::find(&controls, CONTROL) {
            Some(control) => format!(
                "in low light it exposes longer; more light helps, or --control {}=0 (a darker picture)",
                control.name
            ),
            None => "low light makes cameras expose longer, and a shared USB port slows them down".to_owned(),
        };
        tracing::warn!("{}: {fps:.1} frames a second instead of {}: {what}", self.name, self.agreed.interval);
    }

    fn close(&mut self, state: State) {
        self.given = false;
        if let State::Streaming(session) = &mut self.state {
            session.queue.stop();
            add(&mut self.losses, session.queue.take_losses());
        }
        self.state = state;
    }

    /// Warns, but not of the same twice in a row.
    fn say(&mut self, what: String) {
        if self.said != what {
            tracing::warn!("{}: {what}", self.name);
            self.said = what;
        }
    }
}

fn add(sum: &mut Losses, losses: Losses) {
    sum.missed += losses.missed;
    sum.stale += losses.stale;
    sum.corrupt += losses.corrupt;
}
