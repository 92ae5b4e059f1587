//! Recovery of a device that fails, stalls or disappears.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::error::{self, OpenError};
use super::negotiate::{ModeRequest, NoMode};
use super::session::Session;
use super::watchdog::Remedy;
use super::{ERROR_PAUSE_NS, LiveDevice, RETRY_NS, SEARCH_PERIOD_NS, State};
use crate::v4l2::queue::QueueError;

impl LiveDevice {
    /// Handles a driver error.
    pub(super) fn handle_error(&mut self, error: &QueueError) {
        let now_ns = self.clock.now_ns();
        if error::is_gone(error) {
            self.watchdog.on_gone(now_ns);
            self.warn_once("it is gone (unplugged?); waiting for it to come back".to_owned());
            self.close(State::Reconnecting { retry_ns: now_ns });
            return;
        }
        tracing::debug!("{}: {error}", self.name);
        self.clock.sleep_until_ns(now_ns + ERROR_PAUSE_NS);
        let remedy = self.watchdog.on_error(self.clock.now_ns());
        self.apply_remedy(remedy, &error.to_string());
    }

    /// Applies a remedy; `reason` is its reason, for the log. If a restart fails, the next remedy follows at once.
    pub(super) fn apply_remedy(&mut self, remedy: Remedy, reason: &str) {
        let now_ns = self.clock.now_ns();
        match remedy {
            Remedy::Wait => {}
            Remedy::Restart => {
                self.warn_once(format!("{reason}; starting its stream again"));
                let State::Streaming(session) = &mut self.state else { return };
                session.queue.stop();
                let started = session.queue.start();
                // Frames stop during a restart, which must count neither as a stall nor as a low rate.
                self.watchdog.on_start(self.clock.now_ns());
                self.low_rate.restart(self.clock.now_ns());
                if let Err(error) = started {
                    if error::is_gone(&error) {
                        self.handle_error(&error);
                    } else {
                        let reason = self.explain(&OpenError::from_queue(self.identity.node(), error));
                        let remedy = self.watchdog.escalate(now_ns);
                        self.apply_remedy(remedy, &reason);
                    }
                }
            }
            Remedy::Reopen(pause) => {
                let again = match pause {
                    Duration::ZERO => "opening it again".to_owned(),
                    pause => format!("opening it again every {:.1} s", pause.as_secs_f32()),
                };
                self.warn_once(format!("{reason}; {again}"));
                self.close(State::Reconnecting { retry_ns: now_ns + pause.as_nanos() as u64 });
            }
        }
    }

    /// Tries once to open the device at its current node; if that fails, schedules a later attempt.
    pub(super) fn reopen(&mut self) {
        let opened = match self.find_node() {
            Some(path) => self.open_session(&path),
            None => Err(OpenError::Gone(self.identity.node().to_owned())),
        };
        let now_ns = self.clock.now_ns();
        match opened {
            Ok(session) => {
                if session.negotiated != self.negotiated {
                    tracing::warn!("{}: now it gives {}", self.name, session.negotiated);
                    self.negotiated = session.negotiated;
                }
                self.state = State::Streaming(Box::new(session));
                self.watchdog.on_start(now_ns);
                self.low_rate.restart(now_ns);
            }
            Err(error) if error.is_gone() => {
                self.watchdog.on_gone(now_ns);
                self.warn_once("it is gone (unplugged?); waiting for it to come back".to_owned());
                self.state = State::Reconnecting { retry_ns: now_ns + RETRY_NS };
            }
            Err(error) => {
                self.watchdog.on_gone(now_ns);
                // It is closed already, so only the remedy's pause matters.
                let pause = match self.watchdog.escalate(now_ns) {
                    Remedy::Reopen(pause) => pause.as_nanos() as u64,
                    Remedy::Restart | Remedy::Wait => 0,
                };
                self.warn_once(format!("{}; trying again", self.explain(&error)));
                self.state = State::Reconnecting { retry_ns: now_ns + pause.max(RETRY_NS) };
            }
        }
    }

    /// Returns what `error` says without the node, which every warning names.
    fn explain(&self, error: &OpenError) -> String {
        let (said, node) = (error.to_string(), format!("{}: ", self.identity.node().display()));
        said.strip_prefix(&node).unwrap_or(&said).to_owned()
    }

    /// Opens the device again. One that came back without the requested format is taken with the nearest one, as waiting
    /// would not bring it.
    fn open_session(&self, path: &Path) -> Result<Session, OpenError> {
        let open =
            |request: &ModeRequest| Session::open(path, request, &self.settings, Some(&self.negotiated), &self.clock);
        match open(&self.request) {
            Err(OpenError::NoMode { source: NoMode::Format { wanted, .. }, .. }) => {
                let session = open(&ModeRequest { fourcc: None, ..self.request })?;
                tracing::warn!("{}: it came back without {wanted}", self.name);
                Ok(session)
            }
            opened => opened,
        }
    }

    /// Finds the current node of the device; searches all nodes only every [`SEARCH_PERIOD_NS`].
    fn find_node(&mut self) -> Option<PathBuf> {
        let now_ns = self.clock.now_ns();
        let search_all = now_ns.saturating_sub(self.searched_ns) >= SEARCH_PERIOD_NS;
        if search_all {
            self.searched_ns = now_ns;
        }
        let before = self.identity.node().to_owned();
        let found = self.identity.find_node(search_all);
        if let Some(path) = found.as_ref().filter(|path| **path != before) {
            tracing::info!("{}: it is {} now", self.name, path.display());
            self.name = self.identity.describe();
        }
        found
    }
}
