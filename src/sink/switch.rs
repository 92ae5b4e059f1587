//! Adds and removes the sinks of a [`Tee`] while frames go on, and tells what becomes of them.

use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender};

use super::Sink;
#[cfg(doc)]
use super::Tee;
use super::output_thread::{Backpressure, Outcome, OutputThread};

/// Adds members to a [`Tee`] and removes them, from any thread. Both come about with the next frame, or soon after where there
/// are none.
#[derive(Clone)]
pub struct Switchboard {
    to: Sender<Asked>,
    tell: Tell,
}

/// What became of a member.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// The name that it was added by.
    pub member: String,
    /// What became of it.
    pub fate: Fate,
}

/// What becomes of a member: first it begins, then it is completed or fails.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It gets the frames from now on.
    Began,
    /// It is whole.
    Completed {
        /// Frames that it took.
        frames: u64,
    },
    /// It was given up.
    Failed {
        /// Frames that it took.
        frames: u64,
        /// Why: one line.
        why: String,
    },
}

/// There is no run any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the pictures have ended")]
pub struct Over;

type Tell = Arc<dyn Fn(Notice) + Send + Sync>;

/// What a switchboard asks of its tee.
pub(super) enum Asked {
    Add(Joining),
    Remove(String),
}

impl Asked {
    /// The member that it is about.
    pub fn name(&self) -> &str {
        match self {
            Self::Add(member) => &member.life.name,
            Self::Remove(name) => name,
        }
    }
}

impl Switchboard {
    /// A handle, and where its requests come out. `tell` is called for each step in a member's life, among others on the thread
    /// that frames are on: it must be quick.
    pub(super) fn new(tell: impl Fn(Notice) + Send + Sync + 'static) -> (Self, Receiver<Asked>) {
        let (to, asked) = mpsc::channel();
        (Self { to, tell: Arc::new(tell) }, asked)
    }

    /// Adds a sink. A member that has this name already is completed first.
    ///
    /// # Errors
    /// The run is over: the sink was given up, which is told as well.
    pub fn add(&self, name: &str, sink: Box<dyn Sink>) -> Result<(), Over> {
        let life = Life { name: name.into(), over: false, tell: Arc::clone(&self.tell) };
        self.to.send(Asked::Add(Joining { sink, life })).map_err(|_| Over)
    }

    /// Takes the member of this name out and completes it; nothing where there is none.
    pub fn remove(&self, name: &str) {
        // Without a run, there is none.
        let _ = self.to.send(Asked::Remove(name.into()));
    }
}

/// A sink on its way in. Dropped in this order: given up, then told.
pub(super) struct Joining {
    sink: Box<dyn Sink>,
    life: Life,
}

impl Joining {
    /// Starts its thread; `None` where the system gives none, and it is told that the member was given up.
    pub fn start(self) -> Option<OutputThread> {
        let Self { sink, life } = self;
        life.tell(Fate::Began);
        OutputThread::start(sink, Backpressure::DropOldest, |frames, outcome| life.ended(frames, outcome)).ok()
    }
}

/// Tells what becomes of a member, in any case.
struct Life {
    name: String,
    /// Whether its end was told.
    over: bool,
    tell: Tell,
}

impl Life {
    fn tell(&self, fate: Fate) {
        (self.tell)(Notice { member: self.name.clone(), fate });
    }

    /// Tells how a member ended that took so many frames.
    fn ended(mut self, frames: u64, outcome: &Outcome) {
        self.over = true;
        self.tell(match outcome {
            Outcome::Ended(Ok(())) => Fate::Completed { frames },
            Outcome::Failed(error) | Outcome::Ended(Err(error)) => Fate::Failed { frames, why: error.to_string() },
        });
    }
}

impl Drop for Life {
    fn drop(&mut self) {
        if !self.over {
            self.tell(Fate::Failed { frames: 0, why: "it was given up".into() });
        }
    }
}
