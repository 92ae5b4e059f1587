//! Several sinks as one.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::output_thread::{Backpressure, Outcome, OutputThread, Pictures};
use super::{Counter, Ending, Sink, SinkError, Uncovered};
use crate::frame::ColorImage;
use crate::stats::{NodeUse, OutputUse};

/// Gives every frame to each of its sinks, which have a thread each, so that none waits for another one in real time.
/// One whose reader has gone is completed and removed; once all are, [`Sink::put`] says `Break`. One that fails is
/// removed, too, which is logged, and its error is returned at the end; the error of a live one is returned at once,
/// which ends the run.
pub struct Tee {
    outputs: Vec<OutputThread>,
    name: String,
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

/// How often it is looked whether an output has ended, and for room where frames wait for it.
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
        Ok(Self {
            name,
            frames: outputs.iter().map(OutputThread::counter).collect(),
            nodes: outputs.iter().flat_map(OutputThread::nodes).cloned().collect(),
            outputs,
            backpressure,
            closed,
            pictures: Pictures::default(),
            captured_ns: 0,
            failed: None,
        })
    }

    /// Hands a picture to each output.
    fn give(&mut self, frame: &ColorImage, time_ns: u64, is_card: bool) -> Result<ControlFlow<()>, SinkError> {
        let picture = self.pictures.share(frame, time_ns, self.captured_ns, is_card);
        for output in &mut self.outputs {
            let mut left = output.send(Arc::clone(&picture), TICK);
            while let Some(picture) = left {
                if self.closed.load(Ordering::Acquire) {
                    output.lose();
                    break;
                }
                left = output.send(picture, TICK);
            }
        }
        self.look()
    }

    /// Removes outputs that have ended. `Break` where none takes frames any more.
    fn look(&mut self) -> Result<ControlFlow<()>, SinkError> {
        let mut at = 0;
        while at < self.outputs.len() {
            let Some(outcome) = self.outputs[at].outcome() else {
                at += 1;
                continue;
            };
            let is_live = self.outputs.remove(at).is_live;
            match outcome {
                Outcome::Failed(error) if is_live => return Err(error),
                outcome => self.note(outcome.error()),
            }
        }
        if self.outputs.iter().any(OutputThread::is_open) {
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
        self.outputs.iter().any(|output| output.is_live)
    }

    fn uncovered(&self) -> Vec<Uncovered> {
        self.outputs.iter().filter_map(OutputThread::uncovered).collect()
    }

    fn nodes(&self) -> Vec<Counter<NodeUse>> {
        self.nodes.clone()
    }

    fn outputs(&self) -> Vec<Counter<OutputUse>> {
        self.frames.clone()
    }

    /// The outputs repeat their pictures themselves; what is to be noticed is that they end.
    fn hold(&self) -> Option<Duration> {
        (self.backpressure == Backpressure::DropOldest || self.is_live()).then_some(TICK)
    }

    fn repeat(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        Ok(self.look()?.map_continue(|()| false))
    }

    /// Completes them all, also after one could not be. The first error of all is returned, the others are logged: each says
    /// what is kept of its output.
    fn finish(self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        let Self { mut outputs, failed, .. } = *self;
        outputs.iter_mut().for_each(|output| output.close(ending));
        let ended: Vec<_> = outputs.into_iter().map(|output| output.join().error()).collect();
        let mut errors = failed.into_iter().chain(ended.into_iter().flatten());
        let first = errors.next();
        errors.for_each(|error| tracing::error!("{error}"));
        first.map_or(Ok(()), Err)
    }

    fn describe(&self) -> String {
        self.name.clone()
    }
}

#[cfg(test)]
mod tests;
