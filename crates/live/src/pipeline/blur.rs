//! Third stage: drops frames that are too late and blurs the rest; swaps the executor when a frame brings another.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::deadline::DeadlineRule;
use super::depth::Prepared;
use super::frame::Frame;
use super::output_request::OutputRequest;
use super::{Fault, MAX_IN_FLIGHT, Shared, StageResult};
use crate::stats::{BlurTimings, DropCause};
use bokehcam::bokeh::{BlurredFrame, BokehError, Job, PassTimes, Picture};
use bokehcam::compute::PictureLocation;
use bokehcam::engine::{Blur, Composed, Images, OriginalFrame};
use bokehcam::frame::crop::Crop;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::link::pool::Pooled;
use bokehcam::link::{Receiver, Sender};
use bokehcam::optics::CocField;

/// A blurred picture, with its inputs.
pub(super) struct Blurred {
    pub picture: Picture,
    /// The input picture; `None` if nothing was blurred or no viewer wants it.
    pub color: Option<Pooled<ColorImage>>,
    pub depth: Option<Pooled<DepthMap>>,
    pub coc: CocField,
    /// The crop that goes out; `None` is the whole picture.
    pub crop: Option<Crop>,
    /// What is kept of the picture, blurred like it, if its background is transparent.
    pub kept: Option<Pooled<Images>>,
}

pub(super) struct Stage<'a> {
    blur: Blur,
    /// `None` blurs every frame.
    late: Option<DeadlineRule>,
    /// Where pictures are wanted; `None` is in memory.
    output_request: Option<Arc<OutputRequest>>,
    budget_ns: u64,
    shared: &'a Shared,
    times: &'a mut BlurTimings,
    /// The frames that the executor has in flight, oldest first.
    in_flight: VecDeque<Frame<InFlight>>,
    last_swap: u64,
}

/// The data of a frame that stay here while the executor has it.
struct InFlight {
    coc: CocField,
    crop: Option<Crop>,
    original: Option<Pooled<OriginalFrame>>,
    /// What is kept of it, blurred, and how long that took.
    kept: Option<(Pooled<Images>, u64)>,
}

type From = Receiver<Frame<Prepared>>;
type To = Sender<Frame<Blurred>>;

impl<'a> Stage<'a> {
    /// Creates the stage; a blur longer than `budget_ns` counts as a miss.
    pub(super) fn new(
        blur: Blur,
        output_request: Option<Arc<OutputRequest>>,
        budget_ns: u64,
        shared: &'a Shared,
        times: &'a mut BlurTimings,
    ) -> Self {
        times.by = blur.describe_executor();
        let late = shared.realtime_period_ns.map(DeadlineRule::new);
        let in_flight = VecDeque::with_capacity(MAX_IN_FLIGHT);
        Self { blur, late, output_request, budget_ns, shared, times, in_flight, last_swap: 0 }
    }

    /// Runs until the input ends or the output is closed, with as many frames in flight as the executor allows.
    pub(super) fn run(mut self, mut from: From, mut to: To) -> StageResult {
        loop {
            let next = match self.in_flight.len() {
                0 => match from.recv() {
                    None => return Ok(()),
                    next => next,
                },
                len if len < self.blur.capacity() => from.try_recv(),
                _ => None,
            };
            // Nothing to submit: wait for a frame that was submitted.
            let mut wait = next.is_none();
            if let Some(mut frame) = next {
                if !self.swap_executor(&mut frame.item, &mut to)? {
                    return Ok(());
                }
                if self.blur.executor().is_none() {
                    if !self.pass_through(frame, &mut to) {
                        return Ok(());
                    }
                    continue;
                }
                // A transparent background takes a blur of its own, which no other frame may overlap.
                if frame.item.composed.kept.is_some() && !self.collect_all(&mut to)? {
                    return Ok(());
                }
                if !self.submit(frame)? {
                    continue;
                }
                wait = self.in_flight.len() >= self.blur.capacity();
            }
            if self.blur.executor().is_some() {
                if !self.collect(wait, &mut to)? {
                    return Ok(());
                }
                if self.blur.has_changed_backend() {
                    self.times.by = self.blur.describe_executor();
                }
            }
        }
    }

    /// Switches to another executor if a frame brings one: later frames carry the same one, and only the first counts.
    /// First collects the frames that the old one has in flight. Returns whether the output is still open.
    fn swap_executor(&mut self, prepared: &mut Prepared, to: &mut To) -> Result<bool, Fault> {
        let Some(swap) = prepared.swap.take().filter(|swap| swap.number != self.last_swap) else { return Ok(true) };
        self.last_swap = swap.number;
        if !self.collect_all(to)? {
            return Ok(false);
        }
        if let Some((executor, rule)) = swap.take() {
            self.blur.replace_executor(executor, rule);
        }
        Ok(true)
    }

    /// Forwards all frames that the executor has in flight; returns whether the output is still open.
    fn collect_all(&mut self, to: &mut To) -> Result<bool, Fault> {
        while !self.in_flight.is_empty() {
            if !self.collect(true, to)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Blurs the foreground mask of a frame, while no frame is in flight; returns the time it took, in nanoseconds.
    fn blur_kept(&mut self, kept: &mut Images, coc: CocField) -> Result<u64, BokehError> {
        let began_ns = self.shared.clock.now_ns();
        self.blur.blur(kept, coc)?;
        Ok(self.shared.clock.now_ns() - began_ns)
    }

    /// Forwards a frame unblurred, unless it is late; returns whether the output is still open.
    fn pass_through(&mut self, frame: Frame<Prepared>, to: &mut To) -> bool {
        let Shared { clock, counter, is_viewed, .. } = self.shared;
        let (frame, Prepared { color, depth, coc, composed, .. }) = frame.take_item(clock.now_ns());
        if self.is_late(&frame, 0) {
            counter.count_dropped(frame.ticket, DropCause::Late);
            return true;
        }
        let (picture, depth) = (Picture::from_memory(color), depth.filter(|_| *is_viewed));
        frame
            .with_item(Blurred { picture, color: None, depth, coc, crop: composed.crop, kept: None })
            .send_to(to, counter)
    }

    /// Submits a frame to the executor, unless it is too late; returns whether it was submitted.
    fn submit(&mut self, frame: Frame<Prepared>) -> Result<bool, Fault> {
        let Shared { clock, counter, pools, plan, wants_yuyv, .. } = self.shared;
        let (mut frame, Prepared { color, depth, coc, composed, times, .. }) = frame.take_item(clock.now_ns());
        times.into_iter().for_each(|times| self.blur.picker.record_depth(times));
        // The frame queues behind those in flight.
        let expected_ns = self.blur.picker.expected_blur_ns() * (self.in_flight.len() as u64 + 1);
        if self.is_late(&frame, expected_ns) {
            counter.count_dropped(frame.ticket, DropCause::Late);
            self.blur.picker.record_late_frame();
            plan.set(self.blur.picker.plan());
            return Ok(false);
        }
        let Composed { crop, original, kept, on_device } = composed;
        frame.trace.quality = self.blur.quality();
        let place =
            self.output_request.as_ref().map_or(PictureLocation::Memory, |output_request| output_request.place());
        // A crop is cut out of the full-colour picture, so YUYV is of no use then.
        let is_yuyv = crop.is_none() && wants_yuyv.load(Ordering::Relaxed);
        let (ticket, quality) = (frame.ticket.id.0, frame.trace.quality.unwrap_or_default());
        let kept = kept.map(|mut kept| self.blur_kept(&mut kept, coc).map(|took_ns| (kept, took_ns))).transpose();
        let kept = match kept {
            Ok(kept) => kept,
            Err(error) => {
                counter.count_dropped(frame.ticket, DropCause::Failed);
                return Err(error.into());
            }
        };
        let (out, yuyv) = (pools.outs.take(), is_yuyv.then(|| pools.yuyvs.take()));
        let job = Job { ticket, color, depth, coc, quality, place, out, yuyv, on_device };
        let submitted = self.blur.submit(job);
        if let Err(error) = submitted {
            counter.count_dropped(frame.ticket, DropCause::Failed);
            return Err(error.into());
        }
        self.in_flight.push_back(frame.with_item(InFlight { coc, crop, original, kept }));
        Ok(true)
    }

    /// Forwards the oldest frame if it is finished; with `wait`, waits until it is. Returns whether the output is still
    /// open.
    fn collect(&mut self, wait: bool, to: &mut To) -> Result<bool, Fault> {
        let Shared { clock, counter, is_viewed, .. } = self.shared;
        let finished = match self.blur.collect(wait) {
            Ok(Some(finished)) => finished,
            Ok(None) if wait => return Err(Fault::LostFrame),
            Ok(None) => return Ok(true),
            Err(error) => {
                self.in_flight
                    .pop_front()
                    .into_iter()
                    .for_each(|frame| counter.count_dropped(frame.ticket, DropCause::Failed));
                return Err(error.into());
            }
        };
        let Some(done) = self.in_flight.pop_front().filter(|oldest| oldest.ticket.id.0 == finished.ticket) else {
            return Err(Fault::LostFrame);
        };
        let BlurredFrame { picture, mut color, mut depth, times, .. } = finished;
        let (now_ns, began_ns) = (clock.now_ns(), done.since_ns);
        let (mut frame, InFlight { coc, crop, original, kept }) = done.take_item(now_ns);
        let (kept, kept_ns) = kept.unzip();
        frame.trace.blur_ns = self.record_times(&frame, &times, now_ns - began_ns, kept_ns.unwrap_or(0));
        if let (Some(mut original), Some(map)) = (original, &mut depth) {
            original.restore(&mut color, map);
        }
        let (color, depth) = (Some(color).filter(|_| *is_viewed), depth.filter(|_| *is_viewed));
        Ok(frame.with_item(Blurred { picture, color, depth, coc, crop, kept }).send_to(to, counter))
    }

    /// Returns whether a frame is too late if its blur takes `expected_ns`; a frame that was sought never is.
    fn is_late(&mut self, frame: &Frame<()>, expected_ns: u64) -> bool {
        let late = self.late.as_mut().filter(|_| !frame.is_seek_target);
        late.is_some_and(|late| late.is_late(frame.ticket.captured_ns, frame.since_ns, expected_ns))
    }

    /// Records the times of a finished frame that was in flight for `in_flight_ns`, after `kept_ns` for its mask;
    /// returns how long its blur took.
    fn record_times(&mut self, done: &Frame<()>, passes: &PassTimes, in_flight_ns: u64, kept_ns: u64) -> u64 {
        let mut in_passes_ns = 0;
        for (name, time) in passes.iter() {
            let time_ns = time.as_nanos() as u64;
            self.times.passes.add(name, time_ns);
            in_passes_ns += time_ns;
        }
        // If the executor times no passes, the time in flight stands for the blur.
        let blur_ns = kept_ns + if in_passes_ns == 0 { in_flight_ns } else { in_passes_ns };
        let quality = done.trace.quality.unwrap_or_default();
        self.times.took.add(blur_ns);
        self.times.quality_counts.add(quality.name());
        self.times.misses += u64::from(blur_ns > self.budget_ns);
        // With overlapping frames, wall time says nothing about a single one.
        let took_ns = if self.blur.capacity() > 1 { kept_ns + in_passes_ns } else { blur_ns };
        self.blur.picker.record_blur(quality, took_ns, done.since_ns);
        self.shared.plan.set(self.blur.picker.plan());
        blur_ns
    }
}
