//! What is done about a device that fails, stalls or is gone.

use std::path::PathBuf;
use std::time::Duration;

use super::error::{self, OpenError};
use super::session::Session;
use super::watchdog::Remedy;
use super::{ERROR_NAP_NS, LOOK_NS, Live, SEARCH_NS, State};
use crate::v4l2::queue::QueueError;

impl Live {
    /// The driver gave an error instead of a frame.
    pub(super) fn failed(&mut self, error: &QueueError) {
        let now_ns = self.clock.now_ns();
        if error::is_gone(error) {
            self.watchdog.gone(now_ns);
            self.say("it is gone (unplugged?); waiting for it to come back".to_owned());
            self.close(State::Away { retry_ns: now_ns });
            return;
        }
        tracing::debug!("{}: {error}", self.name);
        self.clock.sleep_until_ns(now_ns + ERROR_NAP_NS);
        let remedy = self.watchdog.error(self.clock.now_ns());
        self.apply(remedy, &error.to_string());
    }

    /// Carries out a remedy; `because` is its reason, for the log. If a restart fails, the next remedy follows at once.
    pub(super) fn apply(&mut self, remedy: Remedy, because: &str) {
        let now_ns = self.clock.now_ns();
        match remedy {
            Remedy::Wait => {}
            Remedy::Restart => {
                self.say(format!("{because}; starting its stream again"));
                let State::Streaming(session) = &mut self.state else { return };
                session.queue.stop();
                let started = session.queue.start();
                self.watchdog.started(self.clock.now_ns());
                self.low_rate.restarted(self.clock.now_ns());
                if let Err(error) = started {
                    if error::is_gone(&error) {
                        self.failed(&error);
                    } else {
                        let remedy = self.watchdog.remedy(now_ns);
                        self.apply(remedy, &error.to_string());
                    }
                }
            }
            Remedy::Reopen(pause) => {
                let again = match pause {
                    Duration::ZERO => "opening it again".to_owned(),
                    pause => format!("opening it again every {:.1} s", pause.as_secs_f32()),
                };
                self.say(format!("{because}; {again}"));
                self.close(State::Away { retry_ns: now_ns + pause.as_nanos() as u64 });
            }
        }
    }

    /// Tries once to open the device wherever it is now; if that fails, it is away until a later try.
    pub(super) fn reopen(&mut self) {
        let opened = match self.find() {
            Some(path) => Session::open(&path, &self.wish, &self.settings, Some(&self.agreed), &self.clock),
            None => Err(OpenError::Gone(self.address.node().to_owned())),
        };
        let now_ns = self.clock.now_ns();
        match opened {
            Ok(session) => {
                if session.agreed != self.agreed {
                    tracing::warn!("{}: now it gives {}", self.name, session.agreed);
                    self.agreed = session.agreed;
                }
                self.state = State::Streaming(Box::new(session));
                self.watchdog.started(now_ns);
                self.low_rate.restarted(now_ns);
            }
            Err(error) if error.is_gone() => {
                self.watchdog.gone(now_ns);
                self.say("it is gone (unplugged?); waiting for it to come back".to_owned());
                self.state = State::Away { retry_ns: now_ns + LOOK_NS };
            }
            Err(error) => {
                self.watchdog.gone(now_ns);
                // It is closed already, so of a remedy only the pause counts.
                let pause = match self.watchdog.remedy(now_ns) {
                    Remedy::Reopen(pause) => pause.as_nanos() as u64,
                    Remedy::Restart | Remedy::Wait => 0,
                };
                self.say(format!("{error}; trying again"));
                self.state = State::Away { retry_ns: now_ns + pause.max(LOOK_NS) };
            }
        }
    }

    /// The node of the device now; searches all nodes only every [`SEARCH_NS`].
    fn find(&mut self) -> Option<PathBuf> {
        let now_ns = self.clock.now_ns();
        let everywhere = now_ns.saturating_sub(self.searched_ns) >= SEARCH_NS;
        if everywhere {
            self.searched_ns = now_ns;
        }
        let before = self.address.node().to_owned();
        let found = self.address.find(everywhere);
        if let Some(path) = found.as_ref().filter(|path| **path != before) {
            tracing::info!("{}: it is {} now", self.name, path.display());
        }
        found
    }
}
