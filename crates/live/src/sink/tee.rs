//! Several sinks as one.

use std::mem;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::Duration;

use super::output_thread::{Backpressure, Outcome, OutputThread, PicturePool};
use super::tee_control::{MemberEvent, Request, TeeControl};
use super::{Counter, Ending, OutputWithoutCard, Sink, SinkError, Written};
use crate::stats::{NodeCounts, OutputCounts};
use bokehcam::frame::ColorImage;

/// Sends every frame to each of its sinks, each on a thread of its own, so that in real time none waits for another.
///
/// The sinks passed to [`Tee::new`] stay until their reader has gone: they are then completed and removed; once all
/// are, [`Sink::write_frame`] returns `Break`. A sink that fails is removed, too, which is logged, and its error is returned at
/// the end; the error of a live one is returned at once, which ends the run.
///
/// The sinks that a [`TeeControl`] adds and removes are managed by its owner, who receives their outcomes; frames
/// continue without any sink. Recordings are always kept: without [`Sink::finish`], these sinks are completed on drop.
pub struct Tee {
    name: String,
    outputs: Vec<Member>,
    /// Removed outputs that are being completed.
    closing: Vec<OutputThread>,
    /// Requests of the control, if there is one.
    requests: Option<Receiver<Request>>,
    backpressure: Backpressure,
    /// Whether pictures are blocked: then a full output is not waited for.
    closed: Arc<AtomicBool>,
    picture_pool: PicturePool,
    captured_ns: u64,
    /// Time of the last picture.
    last_ns: u64,
    /// The first error of an output.
    first_error: Option<SinkError>,
    output_counters: Vec<Counter<OutputCounts>>,
    node_counters: Vec<Counter<NodeCounts>>,
}

/// An output, with the name under which it was added.
struct Member {
    name: String,
    output: OutputThread,
    /// Whether frames are withheld from it: it shows the card.
    is_withheld: bool,
}

/// Period of checks for ended outputs, for requests, and for space where frames wait.
const TICK: Duration = Duration::from_millis(50);

impl Tee {
    /// Combines several sinks. With [`Backpressure::Block`], those that are not live get every frame, unless `closed`
    /// blocks the pictures.
    ///
    /// # Errors
    /// The system refuses threads; the sinks are aborted.
    pub fn new(
        sinks: Vec<Box<dyn Sink>>,
        backpressure: Backpressure,
        closed: Arc<AtomicBool>,
    ) -> Result<Self, SinkError> {
        let start = |sink: Box<dyn Sink>| {
            // Live outputs never wait.
            let policy = if sink.is_live() { Backpressure::DropOldest } else { backpressure };
            let name = sink.describe();
            OutputThread::start(sink, policy, None, |_, _| {}).map_err(|cause| SinkError::Thread { sink: name, cause })
        };
        let mut outputs = sinks.into_iter().map(start).collect::<Result<Vec<_>, _>>()?;
        let name = outputs.iter().map(|output| output.name.as_str()).collect::<Vec<_>>().join(", ");
        // Outputs that never wait come first.
        outputs.sort_by_key(|output| !output.is_live);
        let mut tee = Self::empty(name, backpressure, closed, None);
        outputs.into_iter().for_each(|output| tee.add_output(output.name.clone(), output));
        Ok(tee)
    }

    /// Creates a tee without sinks, and the handle that adds and removes them. `name` is for the report. `report` is
    /// called for each state change of a sink, also on the thread of the frames: it must be quick.
    pub fn with_control(name: &str, report: impl Fn(MemberEvent) + Send + Sync + 'static) -> (Self, TeeControl) {
        let (control, requests) = TeeControl::new(report);
        (Self::empty(name.into(), Backpressure::DropOldest, Arc::default(), Some(requests)), control)
    }

    fn empty(
        name: String,
        backpressure: Backpressure,
        closed: Arc<AtomicBool>,
        requests: Option<Receiver<Request>>,
    ) -> Self {
        Self {
            name,
            outputs: Vec::new(),
            closing: Vec::new(),
            requests,
            backpressure,
            closed,
            picture_pool: PicturePool::default(),
            captured_ns: 0,
            last_ns: 0,
            first_error: None,
            output_counters: Vec::new(),
            node_counters: Vec::new(),
        }
    }

    fn add_output(&mut self, name: String, output: OutputThread) {
        self.output_counters.push(output.create_counter());
        self.node_counters.extend_from_slice(output.node_counters());
        self.outputs.push(Member { name, output, is_withheld: false });
    }

    /// Handles the control's pending requests, and forgets outputs that have ended.
    fn handle_requests(&mut self) {
        while let Some(request) = self.requests.as_ref().and_then(|requests| requests.try_recv().ok()) {
            let name = request.name().to_owned();
            let at = self.outputs.iter().position(|member| member.name == name);
            if let Request::Withhold(_, card) = request {
                at.into_iter().for_each(|at| self.withhold_frames(at, card.as_deref()));
                continue;
            }
            if let Some(at) = at {
                let mut output = self.outputs.remove(at).output;
                output.close(Ending::Complete);
                self.closing.push(output);
            }
            if let Request::Add(member) = request
                && let Some(output) = member.start()
            {
                self.add_output(name, output);
            }
        }
        if self.requests.is_some() {
            self.outputs.retain_mut(|member| member.output.try_outcome().is_none());
            self.closing.retain_mut(|output| output.try_outcome().is_none());
        }
    }

    /// Sends output number `at` the card, which it repeats, and no frames from now on; `None` sends it frames again.
    fn withhold_frames(&mut self, at: usize, card: Option<&ColorImage>) {
        self.outputs[at].is_withheld = card.is_some();
        if let Some(card) = card {
            let picture = self.picture_pool.copy_frame((card, &[]), (self.last_ns, self.captured_ns), true);
            self.outputs[at].output.send(picture, TICK);
        }
    }

    /// Sends a picture to each output, with its alpha channel if that is not empty.
    fn send_frame(&mut self, frame: (&ColorImage, &[u8]), time_ns: u64, is_card: bool) -> Written {
        self.handle_requests();
        if !self.outputs.is_empty() {
            let picture = self.picture_pool.copy_frame(frame, (time_ns, self.captured_ns), is_card);
            self.last_ns = time_ns;
            for Member { output, .. } in self.outputs.iter_mut().filter(|member| !member.is_withheld) {
                let mut unsent = output.send(Arc::clone(&picture), TICK);
                while let Some(picture) = unsent {
                    if self.closed.load(Ordering::Acquire) {
                        output.count_lost();
                        break;
                    }
                    unsent = output.send(picture, TICK);
                }
            }
        }
        self.remove_ended()
    }

    /// Removes outputs that have ended, unless a control manages them. Returns `Break` if none accepts frames any
    /// more.
    fn remove_ended(&mut self) -> Written {
        if self.requests.is_some() {
            return Ok(ControlFlow::Continue(()));
        }
        let mut at = 0;
        while at < self.outputs.len() {
            let Some(outcome) = self.outputs[at].output.try_outcome() else {
                at += 1;
                continue;
            };
            let is_live = self.outputs.remove(at).output.is_live;
            match outcome {
                Outcome::Failed(error) if is_live => return Err(error),
                outcome => self.record_error(outcome.error()),
            }
        }
        if self.outputs.iter().any(|member| member.output.is_open()) {
            return Ok(ControlFlow::Continue(()));
        }
        match self.first_error.take_if(|_| self.outputs.is_empty()) {
            Some(error) => Err(error),
            None => Ok(ControlFlow::Break(())),
        }
    }

    /// Logs an error, and keeps the first one for the end.
    fn record_error(&mut self, error: Option<SinkError>) {
        let Some(error) = error else { return };
        if !self.outputs.is_empty() {
            tracing::warn!("{error}; continuing without it");
        } else if self.first_error.is_some() {
            tracing::error!("{error}");
        }
        self.first_error.get_or_insert(error);
    }

    /// Completes all outputs in parallel, and waits for them; returns the first error, and logs the others unless they
    /// were reported to a control's owner.
    fn finish_outputs(&mut self, ending: Ending) -> Result<(), SinkError> {
        self.handle_requests();
        self.outputs.iter_mut().for_each(|member| member.output.close(ending));
        let is_reported = self.requests.is_some();
        let all = mem::take(&mut self.closing)
            .into_iter()
            .chain(mem::take(&mut self.outputs).into_iter().map(|member| member.output));
        let ended: Vec<_> = all.map(OutputThread::join).collect();
        // Failures during the run that were reported to the control's owner are not errors of the run.
        let ended = ended.into_iter().filter(|outcome| !(is_reported && matches!(outcome, Outcome::Failed(_))));
        let mut errors = self.first_error.take().into_iter().chain(ended.filter_map(Outcome::error));
        let first = errors.next();
        errors.filter(|_| !is_reported).for_each(|error| tracing::error!("{error}"));
        first.map_or(Ok(()), Err)
    }
}

impl Sink for Tee {
    fn write_frame(&mut self, frame: &ColorImage, time_ns: u64) -> Written {
        self.send_frame((frame, &[]), time_ns, false)
    }

    fn write_card(&mut self, card: &ColorImage, time_ns: u64) -> Written {
        self.send_frame((card, &[]), time_ns, true)
    }

    /// Its outputs all do, or none does: a run is refused otherwise.
    fn keeps_alpha(&self) -> bool {
        !self.outputs.is_empty() && self.outputs.iter().all(|member| member.output.keeps_alpha)
    }

    fn write_with_alpha(&mut self, frame: &ColorImage, alpha: &[u8], time_ns: u64) -> Written {
        self.send_frame((frame, alpha), time_ns, false)
    }

    fn set_capture_time(&mut self, captured_ns: u64) {
        self.captured_ns = captured_ns;
    }

    fn is_live(&self) -> bool {
        self.requests.is_none() && self.outputs.iter().any(|member| member.output.is_live)
    }

    fn outputs_without_card(&self) -> Vec<OutputWithoutCard> {
        self.outputs.iter().filter_map(|member| member.output.without_card()).collect()
    }

    /// Counters of all outputs ever added; with a control, only of the current ones.
    fn node_counters(&self) -> Vec<Counter<NodeCounts>> {
        match self.requests {
            Some(_) => self.outputs.iter().flat_map(|member| member.output.node_counters()).cloned().collect(),
            None => self.node_counters.clone(),
        }
    }

    /// Counters of all outputs ever added.
    fn output_counters(&self) -> Vec<Counter<OutputCounts>> {
        self.output_counters.clone()
    }

    /// The outputs repeat their pictures themselves; this tick is for ended outputs and requests.
    fn repeat_interval(&self) -> Option<Duration> {
        (self.backpressure == Backpressure::DropOldest || self.is_live()).then_some(TICK)
    }

    fn repeat_frame(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        self.handle_requests();
        Ok(self.remove_ended()?.map_continue(|()| false))
    }

    fn skip_frame(&mut self) {
        self.handle_requests();
    }

    fn has_outputs(&self) -> bool {
        self.requests.is_none() || !self.outputs.is_empty()
    }

    fn finish(mut self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        self.finish_outputs(ending)
    }

    fn describe(&self) -> String {
        self.name.clone()
    }
}

impl Drop for Tee {
    fn drop(&mut self) {
        if self.requests.is_some() {
            // The errors were reported.
            let _ = self.finish_outputs(Ending::Truncated);
        }
    }
}

#[cfg(test)]
mod switched;
#[cfg(test)]
mod tests;
