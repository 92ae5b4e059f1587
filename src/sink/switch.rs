//! Sinks that come and go while frames go on.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender};
use std::time::Duration;

use super::output_thread::{Backpressure, Outcome, OutputThread, Pictures};
use super::{Counter, Ending, Sink, SinkError, Uncovered};
use crate::frame::ColorImage;
use crate::stats::{NodeUse, OutputUse};

/// A sink of members that others add and remove by its [`Switchboard`], each with a thread of its own, so that none waits
/// for another. One that fails, or whose reader has gone, is taken out, and the others go on.
///
/// What people recorded
/// is theirs however the run ends: without [`Sink::finish`], the members are completed when this is dropped.
pub struct Switch {
    name: String,
    /// With the names that they were added by.
    members: Vec<(String, OutputThread)>,
    asked: Receiver<Asked>,
    /// Those that are being completed.
    ending: Vec<OutputThread>,
    pictures: Pictures,
    captured_ns: u64,
    frames: Vec<Counter<OutputUse>>,
}

/// Adds members to a [`Switch`] and removes them, from any thread. Both come about with the next frame, or after a
/// tenth of a second where there are none.
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

/// There is no switch any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the pictures have ended")]
pub struct Over;

type Tell = Arc<dyn Fn(Notice) + Send + Sync>;

enum Asked {
    Add(Joining),
    Remove(String),
}

/// How often requests are looked for while there are no pictures.
const TICK: Duration = Duration::from_millis(100);

impl Switch {
    /// A switch without members, and its handle. `name` is for the report. `tell` is called for each step in a member's
    /// life, among others on the thread that frames are on: it must be quick.
    pub fn new(name: &str, tell: impl Fn(Notice) + Send + Sync + 'static) -> (Self, Switchboard) {
        let (to, asked) = mpsc::channel();
        let switch = Self {
            name: name.into(),
            members: Vec::new(),
            asked,
            ending: Vec::new(),
            pictures: Pictures::default(),
            captured_ns: 0,
            frames: Vec::new(),
        };
        (switch, Switchboard { to, tell: Arc::new(tell) })
    }

    /// Adds and removes members as was asked by a [`Switchboard`] since the last call, and forgets those that have ended.
    fn take_orders(&mut self) {
        while let Ok(asked) = self.asked.try_recv() {
            let name = match &asked {
                Asked::Add(member) => &member.life.name,
                Asked::Remove(name) => name,
            };
            if let Some(at) = self.members.iter().position(|(member, _)| member == name) {
                self.take_out(at, Ending::Whole);
            }
            if let Asked::Add(Joining { sink, life }) = asked {
                self.add(sink, life);
            }
        }
        self.members.retain_mut(|(_, output)| output.outcome().is_none());
    }

    fn add(&mut self, sink: Box<dyn Sink>, life: Life) {
        let name = life.name.clone();
        life.tell(Fate::Began);
        // If no thread can be started, sink and life are dropped, which tells that the member was given up.
        let started =
            OutputThread::start(sink, Backpressure::DropOldest, |frames, outcome| life.ended(frames, outcome));
        if let Ok(output) = started {
            self.frames.push(output.counter());
            self.members.push((name, output));
        }
    }

    /// Gives a picture to each member.
    fn give(&mut self, frame: &ColorImage, time_ns: u64, is_card: bool) {
        self.take_orders();
        if self.members.is_empty() {
            return;
        }
        let picture = self.pictures.share(frame, time_ns, self.captured_ns, is_card);
        for (_, output) in &mut self.members {
            // It never waits.
            output.send(Arc::clone(&picture), Duration::ZERO);
        }
    }

    /// Completes a member, on its thread.
    fn take_out(&mut self, at: usize, ending: Ending) {
        let (_, mut output) = self.members.remove(at);
        output.close(ending);
        self.ending.push(output);
    }

    /// Takes out all members, and waits until they are completed, which they are in parallel.
    fn end(&mut self, ending: Ending) -> Result<(), SinkError> {
        self.take_orders();
        while !self.members.is_empty() {
            self.take_out(0, ending);
        }
        let ended: Vec<_> = self.ending.drain(..).map(OutputThread::join).collect();
        // One that failed while it ran was told, and is its own affair.
        let errors = ended.into_iter().filter_map(|outcome| match outcome {
            Outcome::Ended(ended) => ended.err(),
            Outcome::Failed(_) => None,
        });
        errors.into_iter().next().map_or(Ok(()), Err)
    }
}

impl Sink for Switch {
    fn put(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.give(frame, time_ns, false);
        Ok(ControlFlow::Continue(()))
    }

    fn cover(&mut self, card: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.give(card, time_ns, true);
        Ok(ControlFlow::Continue(()))
    }

    fn captured(&mut self, captured_ns: u64) {
        self.captured_ns = captured_ns;
    }

    fn uncovered(&self) -> Vec<Uncovered> {
        self.members.iter().filter_map(|(_, output)| output.uncovered()).collect()
    }

    /// Of the members that there are now.
    fn nodes(&self) -> Vec<Counter<NodeUse>> {
        self.members.iter().flat_map(|(_, output)| output.nodes()).cloned().collect()
    }

    /// Of all members that there were.
    fn outputs(&self) -> Vec<Counter<OutputUse>> {
        self.frames.clone()
    }

    /// Requests must be seen. The members repeat their pictures themselves.
    fn hold(&self) -> Option<Duration> {
        Some(TICK)
    }

    fn repeat(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        self.take_orders();
        Ok(ControlFlow::Continue(false))
    }

    fn pass_by(&mut self) {
        self.take_orders();
    }

    fn keeps(&self) -> bool {
        !self.members.is_empty()
    }

    /// Completes all members and waits for those that were taken out; the first error in that is returned, after all
    /// were told.
    fn finish(mut self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        self.end(ending)
    }

    fn describe(&self) -> String {
        self.name.clone()
    }
}

impl Drop for Switch {
    fn drop(&mut self) {
        // The errors were told.
        let _ = self.end(Ending::Cut);
    }
}

impl Switchboard {
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
struct Joining {
    sink: Box<dyn Sink>,
    life: Life,
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

#[cfg(test)]
mod tests;
