//! Several sinks as one.

use std::mem;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::Duration;

use super::output_thread::{Backpressure, Outcome, OutputThread, Pictures};
use super::switch::{Asked, Notice, Switchboard};
use super::{Counter, Ending, Sink, SinkError, Uncovered};
use crate::frame::ColorImage;
use crate::stats::{NodeUse, OutputUse};

/// Gives every frame to each of its sinks, which have a thread each, so that none waits for another one in real time.
///
/// Those that it is [made of](Tee::new) stay until their reader has gone: they are then completed and removed; once all are,
/// [`Sink::put`] says `Break`. One that fails is removed, too, which is logged, and its error is returned at the end; the error
/// of a live one is returned at once, which ends the run.
///
/// Those that a [`Switchboard`] adds and removes are their owner's affair, who is told what becomes of each; frames go on
/// without any. What people recorded is theirs however the run ends: without [`Sink::finish`], they are completed when this is
/// dropped.
pub struct Tee {
    name: String,
    /// With the names that they were added by.
    outputs: Vec<(String, OutputThread)>,
    /// Those that were taken out, and are being completed.
    ending: Vec<OutputThread>,
    /// What its switchboard asks for, where it has one.
    asked: Option<Receiver<Asked>>,
    backpressure: Backpressure,
    /// Whether pictures are kept away: then nobody waits for one that has no room.
    closed: Arc<AtomicBool>,
    pictures: Pictures,
    captured_ns: u64,
    /// The error of the first one that failed.
    failed: Option<SinkError>,
    frames: Vec<Counter<OutputUse>>,
    nodes: Vec<Counter<NodeUse>>,
}

/// How often it is looked whether an output has ended, for requests, and for room where frames wait for it.
const TICK: Duration = Duration::from_millis(50);

impl Tee {
    /// One sink of several. With [`Backpressure::Block`] those that are not live get every frame, unless `closed` says that
    /// pictures are kept away.
    ///
    /// # Errors
    /// The system gives no threads; the sinks are given up.
    pub fn new(
        sinks: Vec<Box<dyn Sink>>,
        backpressure: Backpressure,
        closed: Arc<AtomicBool>,
    ) -> Result<Self, SinkError> {
        let start = |sink: Box<dyn Sink>| {
            // What people see as it comes waits for nothing.
            let own = if sink.is_live() { Backpressure::DropOldest } else { backpressure };
            let name = sink.describe();
            OutputThread::start(sink, own, |_, _| {}).map_err(|cause| SinkError::Thread { sink: name, cause })
        };
        let mut outputs = sinks.into_iter().map(start).collect::<Result<Vec<_>, _>>()?;
        let name = outputs.iter().map(|output| output.name.as_str()).collect::<Vec<_>>().join(", ");
        // Those that never wait come first.
        outputs.sort_by_key(|output| !output.is_live);
        let mut tee = Self::empty(name, backpressure, closed, None);
        outputs.into_iter().for_each(|output| tee.add(output.name.clone(), output));
        Ok(tee)
    }

    /// One without sinks, and the handle that adds and removes them. `name` is for the report. `tell` is called for each step
    /// in the life of a sink, among others on the thread that frames are on: it must be quick.
    pub fn switched(name: &str, tell: impl Fn(Notice) + Send + Sync + 'static) -> (Self, Switchboard) {
        let (board, asked) = Switchboard::new(tell);
        (Self::empty(name.into(), Backpressure::DropOldest, Arc::default(), Some(asked)), board)
    }

    fn empty(
        name: String,
        backpressure: Backpressure,
        closed: Arc<AtomicBool>,
        asked: Option<Receiver<Asked>>,
    ) -> Self {
        Self {
            name,
            outputs: Vec::new(),
            ending: Vec::new(),
            asked,
            backpressure,
            closed,
            pictures: Pictures::default(),
            captured_ns: 0,
            failed: None,
            frames: Vec::new(),
            nodes: Vec::new(),
        }
    }

    fn add(&mut self, name: String, output: OutputThread) {
        self.frames.push(output.counter());
        self.nodes.extend_from_slice(output.nodes());
        self.outputs.push((name, output));
    }

    /// Adds and removes sinks as its switchboard asked since the last call, and forgets those that have ended.
    fn take_orders(&mut self) {
        while let Some(asked) = self.asked.as_ref().and_then(|asked| asked.try_recv().ok()) {
            let name = asked.name().to_owned();
            if let Some(at) = self.outputs.iter().position(|(output, _)| *output == name) {
                let (_, mut output) = self.outputs.remove(at);
                output.close(Ending::Whole);
                self.ending.push(output);
            }
            if let Asked::Add(member) = asked
                && let Some(output) = member.start()
            {
                self.add(name, output);
            }
        }
        if self.asked.is_some() {
            self.outputs.retain_mut(|(_, output)| output.outcome().is_none());
        }
    }

    /// Hands a picture to each output.
    fn give(&mut self, frame: &ColorImage, time_ns: u64, is_card: bool) -> Result<ControlFlow<()>, SinkError> {
        self.take_orders();
        if !self.outputs.is_empty() {
            let picture = self.pictures.share(frame, time_ns, self.captured_ns, is_card);
            for (_, output) in &mut self.outputs {
                let mut left = output.send(Arc::clone(&picture), TICK);
                while let Some(picture) = left {
                    if self.closed.load(Ordering::Acquire) {
                        output.lose();
                        break;
                    }
                    left = output.send(picture, TICK);
                }
            }
        }
        self.look()
    }

    /// Removes outputs that have ended, where no switchboard does. `Break` where none takes frames any more, nor ever will.
    fn look(&mut self) -> Result<ControlFlow<()>, SinkError> {
        if self.asked.is_some() {
            return Ok(ControlFlow::Continue(()));
        }
        let mut at = 0;
        while at < self.outputs.len() {
            let Some(outcome) = self.outputs[at].1.outcome() else {
                at += 1;
                continue;
            };
            let is_live = self.outputs.remove(at).1.is_live;
            match outcome {
                Outcome::Failed(error) if is_live => return Err(error),
                outcome => self.note(outcome.error()),
            }
        }
        if self.outputs.iter().any(|(_, output)| output.is_open()) {
            return Ok(ControlFlow::Continue(()));
        }
        match self.failed.take_if(|_| self.outputs.is_empty()) {
            Some(error) => Err(error),
            None => Ok(ControlFlow::Break(())),
        }
    }

    /// Logs an error, and keeps the first one for the end.
    fn note(&mut self, error: Option<SinkError>) {
        let Some(error) = error else { return };
        if !self.outputs.is_empty() {
            tracing::warn!("{error}; going on without it");
        } else if self.failed.is_some() {
            tracing::error!("{error}");
        }
        self.failed.get_or_insert(error);
    }

    /// Completes all outputs, which they are in parallel, and waits for them; the first error of all is returned, the others are
    /// logged where nobody was told.
    fn end(&mut self, ending: Ending) -> Result<(), SinkError> {
        self.take_orders();
        self.outputs.iter_mut().for_each(|(_, output)| output.close(ending));
        let is_told = self.asked.is_some();
        let all = mem::take(&mut self.ending)
            .into_iter()
            .chain(mem::take(&mut self.outputs).into_iter().map(|(_, output)| output));
        let ended: Vec<_> = all.map(OutputThread::join).collect();
        // A failure while frames came that was told is whose it was told to.
        let ended = ended.into_iter().filter(|outcome| !(is_told && matches!(outcome, Outcome::Failed(_))));
        let mut errors = self.failed.take().into_iter().chain(ended.filter_map(Outcome::error));
        let first = errors.next();
        errors.filter(|_| !is_told).for_each(|error| tracing::error!("{error}"));
        first.map_or(Ok(()), Err)
    }
}

impl Sink for Tee {
    fn put(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.give(frame, time_ns, false)
    }

    fn cover(&mut self, card: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.give(card, time_ns, true)
    }

    fn captured(&mut self, captured_ns: u64) {
        self.captured_ns = captured_ns;
    }

    fn is_live(&self) -> bool {
        self.asked.is_none() && self.outputs.iter().any(|(_, output)| output.is_live)
    }

    fn uncovered(&self) -> Vec<Uncovered> {
        self.outputs.iter().filter_map(|(_, output)| output.uncovered()).collect()
    }

    /// Of all outputs that there were, but where they come and go of those that there are.
    fn nodes(&self) -> Vec<Counter<NodeUse>> {
        match self.asked {
            Some(_) => self.outputs.iter().flat_map(|(_, output)| output.nodes()).cloned().collect(),
            None => self.nodes.clone(),
        }
    }

    /// Of all that there were.
    fn outputs(&self) -> Vec<Counter<OutputUse>> {
        self.frames.clone()
    }

    /// The outputs repeat their pictures themselves; what is to be noticed is that they end, and requests.
    fn hold(&self) -> Option<Duration> {
        (self.backpressure == Backpressure::DropOldest || self.is_live()).then_some(TICK)
    }

    fn repeat(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        self.take_orders();
        Ok(self.look()?.map_continue(|()| false))
    }

    fn pass_by(&mut self) {
        self.take_orders();
    }

    fn keeps(&self) -> bool {
        self.asked.is_none() || !self.outputs.is_empty()
    }

    fn finish(mut self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        self.end(ending)
    }

    fn describe(&self) -> String {
        self.name.clone()
    }
}

impl Drop for Tee {
    fn drop(&mut self) {
        if self.asked.is_some() {
            // The errors were told.
            let _ = self.end(Ending::Cut);
        }
    }
}

#[cfg(test)]
mod switched;
#[cfg(test)]
mod tests;
