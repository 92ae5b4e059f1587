//! Adds and removes the sinks of a [`Tee`] while frames flow, withholds the frames from them, and reports their outcome.

use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender};

use super::Sink;
#[cfg(doc)]
use super::Tee;
use super::output_thread::{Backpressure, Outcome, OutputThread};
use bokehcam::frame::ColorImage;

/// Adds, removes and withholds frames from members of a [`Tee`], from any thread. All take effect with the next frame, or soon after if there
/// are no frames.
#[derive(Clone)]
pub struct TeeControl {
    request_sender: Sender<Request>,
    report: ReportFn,
}

/// A change in a member's state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MemberEvent {
    /// The name under which it was added.
    pub member: String,
    /// The number under which it was added: tells it from an earlier member of the same name.
    pub number: u64,
    /// Its new state.
    pub state: MemberState,
}

/// States of a member: first it starts, then it is completed or fails.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MemberState {
    /// It gets the frames from now on.
    Started,
    /// It is complete.
    Completed {
        /// Number of frames it received.
        frames: u64,
    },
    /// It was aborted.
    Failed {
        /// Number of frames it received.
        frames: u64,
        /// The reason, in one line.
        why: String,
    },
}

/// The run has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the pictures have ended")]
pub struct RunEnded;

type ReportFn = Arc<dyn Fn(MemberEvent) + Send + Sync>;

/// Requests of a control to its tee.
pub(super) enum Request {
    Add(NewMember),
    Remove(String),
    /// Withholds the frames from a member and shows it the card, or passes them again.
    Withhold(String, Option<Box<ColorImage>>),
}

impl Request {
    /// Name of the member concerned.
    pub fn name(&self) -> &str {
        match self {
            Self::Add(member) => &member.reporter.name,
            Self::Remove(name) | Self::Withhold(name, _) => name,
        }
    }
}

impl TeeControl {
    /// Creates a control, and the receiver of its requests. `report` is called for each state change of a member,
    /// also on the thread of the frames: it must be quick.
    pub(super) fn new(report: impl Fn(MemberEvent) + Send + Sync + 'static) -> (Self, Receiver<Request>) {
        let (request_sender, requests) = mpsc::channel();
        (Self { request_sender, report: Arc::new(report) }, requests)
    }

    /// Adds a sink that was opened for pictures of `size` pixels; those of another size are scaled into it. A member with
    /// the same name is completed first. `number` comes back in its events.
    ///
    /// # Errors
    /// The run has ended: the sink was aborted, which is reported as well.
    pub fn add(&self, name: &str, number: u64, size: (u32, u32), sink: Box<dyn Sink>) -> Result<(), RunEnded> {
        let reporter = Reporter { name: name.into(), number, is_reported: false, report: Arc::clone(&self.report) };
        self.request_sender.send(Request::Add(NewMember { sink, size, reporter })).map_err(|_| RunEnded)
    }

    /// Withholds the frames from the live member with this name: it shows `card` from now on. `None` passes the frames
    /// again. Does nothing if there is no such member.
    pub fn withhold(&self, name: &str, card: Option<ColorImage>) {
        // Without a run, there are no members.
        let _ = self.request_sender.send(Request::Withhold(name.into(), card.map(Box::new)));
    }

    /// Removes the member with this name and completes it; does nothing if it does not exist.
    pub fn remove(&self, name: &str) {
        // Without a run, there are no members.
        let _ = self.request_sender.send(Request::Remove(name.into()));
    }
}

/// A sink to be added. Fields drop in this order: first the sink, then the report.
pub(super) struct NewMember {
    sink: Box<dyn Sink>,
    size: (u32, u32),
    reporter: Reporter,
}

impl NewMember {
    /// Starts its thread; `None` if the system refuses the thread, and the member is reported as failed.
    pub fn start(self) -> Option<OutputThread> {
        let Self { sink, size, reporter } = self;
        reporter.report(MemberState::Started);
        let on_end = |frames, outcome: &Outcome| reporter.report_end(frames, outcome);
        OutputThread::start(sink, Backpressure::DropOldest, Some(size), on_end).ok()
    }
}

/// Reports a member's outcome exactly once.
struct Reporter {
    name: String,
    number: u64,
    /// Whether its end was reported.
    is_reported: bool,
    report: ReportFn,
}

impl Reporter {
    fn report(&self, state: MemberState) {
        (self.report)(MemberEvent { member: self.name.clone(), number: self.number, state });
    }

    /// Reports how a member ended that received `frames` frames.
    fn report_end(mut self, frames: u64, outcome: &Outcome) {
        self.is_reported = true;
        self.report(match outcome {
            Outcome::Ended(Ok(())) => MemberState::Completed { frames },
            Outcome::Failed(error) | Outcome::Ended(Err(error)) => {
                MemberState::Failed { frames, why: error.to_string() }
            }
        });
    }
}

impl Drop for Reporter {
    fn drop(&mut self) {
        if !self.is_reported {
            self.report(MemberState::Failed { frames: 0, why: "it was given up".into() });
        }
    }
}
