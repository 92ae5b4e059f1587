//! Sinks that come and go while frames go on.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use super::{Ending, Sink, SinkError};
use crate::frame::ColorImage;
use crate::stats::NodeUse;

/// A sink of members that others add and remove by its [`Switchboard`]. One that fails, or whose reader has gone, is
/// taken out, and the others go on.
///
/// A member that is taken out is completed on a thread of its own, since that may take seconds. What people recorded
/// is theirs however the run ends: without [`Sink::finish`], the members are completed when this is dropped.
pub struct Switch {
    name: String,
    members: Vec<Member>,
    asked: Receiver<Asked>,
    ending: Vec<JoinHandle<Result<(), SinkError>>>,
    /// How long there was no picture, by the times that [`Sink::hold`] gave.
    silent: Duration,
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
        /// Frames that it was given.
        frames: u64,
    },
    /// It was given up.
    Failed {
        /// Frames that it was given.
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
    Add(Member),
    Remove(String),
}

/// How often requests are looked for while there are no pictures.
const TICK: Duration = Duration::from_millis(100);

impl Switch {
    /// A switch without members, and its handle. `name` is for the report. `tell` is called for each step in a member's
    /// life, among others on the thread that frames are on: it must be quick.
    pub fn new(name: &str, tell: impl Fn(Notice) + Send + Sync + 'static) -> (Self, Switchboard) {
        let (to, asked) = mpsc::channel();
        let switch = Self { name: name.into(), members: Vec::new(), asked, ending: Vec::new(), silent: Duration::ZERO };
        (switch, Switchboard { to, tell: Arc::new(tell) })
    }

    /// Adds and removes members as was asked by a [`Switchboard`] since the last call.
    fn take_orders(&mut self) {
        while let Ok(asked) = self.asked.try_recv() {
            let name = match &asked {
                Asked::Add(member) => &member.life.name,
                Asked::Remove(name) => name,
            };
            if let Some(at) = self.members.iter().position(|member| member.life.name == *name) {
                self.take_out(at, Ok(Ending::Whole));
            }
            if let Asked::Add(member) = asked {
                member.life.tell(Fate::Began);
                self.members.push(member);
            }
        }
    }

    /// Calls `give` for each member, and takes out those that fail or whose reader has gone.
    fn each<T>(&mut self, mut give: impl FnMut(&mut Member) -> Result<ControlFlow<(), T>, SinkError>) {
        let mut at = 0;
        while at < self.members.len() {
            match give(&mut self.members[at]) {
                Ok(ControlFlow::Continue(_)) => at += 1,
                Ok(ControlFlow::Break(())) => self.take_out(at, Ok(Ending::Whole)),
                Err(error) => self.take_out(at, Err(error)),
            }
        }
    }

    /// Gives a picture to each member.
    fn give(&mut self, mut give: impl FnMut(&mut dyn Sink) -> Result<ControlFlow<()>, SinkError>) {
        self.take_orders();
        self.silent = Duration::ZERO;
        self.each(|member| {
            let flow = give(&mut *member.sink)?;
            member.life.frames += u64::from(flow.is_continue());
            Ok(flow)
        });
    }

    /// Completes a member, or drops one that has failed, on a thread of its own.
    fn take_out(&mut self, at: usize, ending: Result<Ending, SinkError>) {
        let Member { sink, life } = self.members.remove(at);
        let end = move || match ending {
            Err(error) => {
                drop(sink);
                life.failed(&error.to_string());
                Ok(())
            }
            Ok(ending) => life.ended(sink.finish(ending)),
        };
        // If no thread can be started, sink and life are dropped, which tells that the member was given up.
        self.ending.extend(thread::Builder::new().name("output".into()).spawn(end));
    }

    /// Takes out all members, and waits until they are completed, which they are in parallel.
    fn end(&mut self, ending: Ending) -> Result<(), SinkError> {
        self.take_orders();
        while !self.members.is_empty() {
            self.take_out(0, Ok(ending));
        }
        // A panic was told when its thread dropped the member's life.
        let ended: Vec<_> = self.ending.drain(..).flat_map(JoinHandle::join).collect();
        ended.into_iter().collect()
    }
}

impl Sink for Switch {
    fn put(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.give(|sink| sink.put(frame, time_ns));
        Ok(ControlFlow::Continue(()))
    }

    fn cover(&mut self, card: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.give(|sink| sink.cover(card, time_ns));
        Ok(ControlFlow::Continue(()))
    }

    fn captured(&mut self, captured_ns: u64) {
        self.members.iter_mut().for_each(|member| member.sink.captured(captured_ns));
    }

    /// Of the members that there are now.
    fn nodes(&self) -> Vec<NodeUse> {
        self.members.iter().flat_map(|member| member.sink.nodes()).collect()
    }

    /// Until the first member is due, but never longer than a tick: requests must be seen.
    fn hold(&self) -> Option<Duration> {
        let due = self.members.iter().filter_map(|member| member.sink.hold()).min();
        Some(due.map_or(TICK, |due| due.saturating_sub(self.silent).min(TICK)))
    }

    fn repeat(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        // Called once that has passed.
        self.silent += self.hold().unwrap_or_default();
        self.take_orders();
        let due = self.members.iter().filter_map(|member| member.sink.hold()).min();
        let shown = due.is_some_and(|due| due <= self.silent);
        if shown {
            self.silent = Duration::ZERO;
            self.each(|member| member.sink.repeat());
        }
        Ok(ControlFlow::Continue(shown))
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
        let life = Life { name: name.into(), frames: 0, over: false, tell: Arc::clone(&self.tell) };
        self.to.send(Asked::Add(Member { sink, life })).map_err(|_| Over)
    }

    /// Takes the member of this name out and completes it; nothing where there is none.
    pub fn remove(&self, name: &str) {
        // Without a run, there is none.
        let _ = self.to.send(Asked::Remove(name.into()));
    }
}

/// A sink among others. Dropped in this order: given up, then told.
struct Member {
    sink: Box<dyn Sink>,
    life: Life,
}

/// Tells what becomes of a member, in any case.
struct Life {
    name: String,
    frames: u64,
    /// Whether its end was told.
    over: bool,
    tell: Tell,
}

impl Life {
    fn tell(&self, fate: Fate) {
        (self.tell)(Notice { member: self.name.clone(), fate });
    }

    fn failed(mut self, why: &str) {
        self.over = true;
        self.tell(Fate::Failed { frames: self.frames, why: why.into() });
    }

    /// Tells how completing the member went, and gives that back.
    fn ended(mut self, ended: Result<(), SinkError>) -> Result<(), SinkError> {
        match &ended {
            Ok(()) => {
                self.over = true;
                self.tell(Fate::Completed { frames: self.frames });
            }
            Err(error) => self.failed(&error.to_string()),
        }
        ended
    }
}

impl Drop for Life {
    fn drop(&mut self) {
        if !self.over {
            self.tell(Fate::Failed { frames: self.frames, why: "it was given up".into() });
        }
    }
}

#[cfg(test)]
mod tests;
