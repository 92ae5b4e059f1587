//! Third stage: drops frames that are too late and blurs the rest; swaps the executor when a frame brings another.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::depth::Ready;
use super::frame::Frame;
use super::late::LateRule;
use super::wanted::Wanted;
use super::{Ended, Fault, MAX_IN_FLIGHT, Shared};
use crate::bokeh::{Finished, Job, PassTimes, Picture};
use crate::compute::Place;
use crate::engine::{Blur, OriginalFrame, Staged};
use crate::frame::crop::Crop;
use crate::frame::{ColorImage, DepthMap};
use crate::link::pool::Pooled;
use crate::link::{Receiver, Sender};
use crate::optics::CocField;
use crate::stats::{BlurTimings, Cause};

/// A blurred picture, with its inputs.
pub(super) struct Blurred {
    pub picture: Picture,
    /// The input picture; `None` if nothing was blurred or no viewer wants it.
    pub color: Option<Pooled<ColorImage>>,
    pub depth: Option<Pooled<DepthMap>>,
    pub coc: CocField,
    /// The crop that goes out; `None` is the whole picture.
    pub part: Option<Crop>,
}

pub(super) struct Stage<'a> {
    blur: Blur,
    /// `None` blurs every frame.
    late: Option<LateRule>,
    /// Where pictures are wanted; `None` is in memory.
    wanted: Option<Arc<Wanted>>,
    budget_ns: u64,
    shared: &'a Shared,
    times: &'a mut BlurTimings,
    /// The frames that the executor has in flight, oldest first.
    in_hand: VecDeque<Frame<InHand>>,
    last_swap: u64,
}

/// The data of a frame that stay here while the executor has it.
struct InHand {
    coc: CocField,
    part: Option<Crop>,
    original: Option<Pooled<OriginalFrame>>,
}

type From = Receiver<Frame<Ready>>;
type To = Sender<Frame<Blurred>>;

impl<'a> Stage<'a> {
    /// Creates the stage; a blur longer than `budget_ns` counts as a miss.
    pub(super) fn new(
        blur: Blur,
        wanted: Option<Arc<Wanted>>,
        budget_ns: u64,
        shared: &'a Shared,
        times: &'a mut BlurTimings,
    ) -> Self {
        times.by = blur.describe_executor();
        let late = shared.live_ns.map(LateRule::new);
        let in_hand = VecDeque::with_capacity(MAX_IN_FLIGHT);
        Self { blur, late, wanted, budget_ns, shared, times, in_hand, last_swap: 0 }
    }

    /// Runs until the input ends or the output is closed, with as many frames in flight as the executor allows.
    pub(super) fn run(mut self, mut from: From, mut to: To) -> Ended {
        loop {
            let next = match self.in_hand.len() {
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
                if !self.swap(&mut frame.item, &mut to)? {
                    return Ok(());
                }
                if self.blur.executor().is_none() {
                    if !self.pass_through(frame, &mut to) {
                        return Ok(());
                    }
                    continue;
                }
                if !self.submit(frame)? {
                    continue;
                }
                wait = self.in_hand.len() >= self.blur.capacity();
            }
            if self.blur.executor().is_some() {
                if !self.collect(wait, &mut to)? {
                    return Ok(());
                }
                if self.blur.has_moved() {
                    self.times.by = self.blur.describe_executor();
                }
            }
        }
    }

    /// Switches to another executor if a frame brings one: later frames carry the same one, and only the first counts.
    /// First collects the frames that the old one has in flight. Returns whether the output is still open.
    fn swap(&mut self, ready: &mut Ready, to: &mut To) -> Result<bool, Fault> {
        let Some(swap) = ready.swap.take().filter(|swap| swap.number != self.last_swap) else { return Ok(true) };
        self.last_swap = swap.number;
        while !self.in_hand.is_empty() {
            if !self.collect(true, to)? {
                return Ok(false);
            }
        }
        if let Some((executor, rule)) = swap.take() {
            self.blur.replace(executor, rule);
        }
        Ok(true)
    }

    /// Forwards a frame unblurred, unless it is late; returns whether the output is still open.
    fn pass_through(&mut self, frame: Frame<Ready>, to: &mut To) -> bool {
        let Shared { clock, tally, is_viewed, .. } = self.shared;
        let (frame, Ready { color, depth, coc, staged, .. }) = frame.take_item(clock.now_ns());
        if self.is_late(&frame, 0) {
            tally.dropped(frame.ticket, Cause::Late);
            return true;
        }
        let (picture, depth) = (Picture::in_memory(color), depth.filter(|_| *is_viewed));
        frame.with(Blurred { picture, color: None, depth, coc, part: staged.part }).send_to(to, tally)
    }

    /// Submits a frame to the executor, unless it is too late; returns whether it was submitted.
    fn submit(&mut self, frame: Frame<Ready>) -> Result<bool, Fault> {
        let Shared { clock, tally, pools, order, wants_yuyv, .. } = self.shared;
        let (mut frame, Ready { color, depth, coc, staged, times, .. }) = frame.take_item(clock.now_ns());
        times.into_iter().for_each(|times| self.blur.picker.note_depth(times));
        // The frame queues behind those in flight.
        let expected_ns = self.blur.picker.expected_ns() * (self.in_hand.len() as u64 + 1);
        if self.is_late(&frame, expected_ns) {
            tally.dropped(frame.ticket, Cause::Late);
            self.blur.picker.note_late();
            order.set(self.blur.picker.plan());
            return Ok(false);
        }
        let Staged { part, original, on_device } = staged;
        frame.trace.quality = self.blur.quality();
        let place = self.wanted.as_ref().map_or(Place::Memory, |wanted| wanted.place());
        // A crop is cut out of the full-colour picture, so YUYV is of no use then.
        let is_yuyv = part.is_none() && wants_yuyv.load(Ordering::Relaxed);
        let (ticket, quality) = (frame.ticket.id.0, frame.trace.quality.unwrap_or_default());
        let (out, yuyv) = (pools.outs.take(), is_yuyv.then(|| pools.yuyvs.take()));
        let job = Job { ticket, color, depth, coc, quality, place, out, yuyv, on_device };
        let submitted = self.blur.submit(job);
        if let Err(error) = submitted {
            tally.dropped(frame.ticket, Cause::Failed);
            return Err(error.into());
        }
        self.in_hand.push_back(frame.with(InHand { coc, part, original }));
        Ok(true)
    }

    /// Forwards the oldest frame if it is finished; with `wait`, waits until it is. Returns whether the output is still
    /// open.
    fn collect(&mut self, wait: bool, to: &mut To) -> Result<bool, Fault> {
        let Shared { clock, tally, is_viewed, .. } = self.shared;
        let finished = match self.blur.collect(wait) {
            Ok(Some(finished)) => finished,
            Ok(None) if wait => return Err(Fault::LostFrame),
            Ok(None) => return Ok(true),
            Err(error) => {
                self.in_hand.pop_front().into_iter().for_each(|frame| tally.dropped(frame.ticket, Cause::Failed));
                return Err(error.into());
            }
        };
        let Some(done) = self.in_hand.pop_front().filter(|oldest| oldest.ticket.id.0 == finished.ticket) else {
            return Err(Fault::LostFrame);
        };
        // Time in flight splits into the blur itself and the wait behind other frames.
        let Finished { picture, mut color, mut depth, times, .. } = finished;
        let (now_ns, began_ns, between_ns) = (clock.now_ns(), done.since_ns, done.trace.between_ns);
        let (mut frame, InHand { coc, part, original }) = done.take_item(now_ns);
        frame.trace.blur_ns = self.measure(&frame, &times, now_ns - began_ns);
        frame.trace.between_ns = between_ns + (now_ns - began_ns).saturating_sub(frame.trace.blur_ns);
        frame.trace.passes = times;
        if let (Some(mut original), Some(map)) = (original, &mut depth) {
            original.restore(&mut color, map);
        }
        let (color, depth) = (Some(color).filter(|_| *is_viewed), depth.filter(|_| *is_viewed));
        Ok(frame.with(Blurred { picture, color, depth, coc, part }).send_to(to, tally))
    }

    /// Returns whether a frame is too late if its blur takes `expected_ns`; a frame that was sought never is.
    fn is_late(&mut self, frame: &Frame<()>, expected_ns: u64) -> bool {
        let late = self.late.as_mut().filter(|_| !frame.is_seek_target);
        late.is_some_and(|late| late.is_late(frame.ticket.captured_ns, frame.since_ns, expected_ns))
    }

    /// Records the times of a finished frame that was in flight for `in_hand_ns`; returns how long its blur took.
    fn measure(&mut self, done: &Frame<()>, passes: &PassTimes, in_hand_ns: u64) -> u64 {
        let mut in_passes_ns = 0;
        for (name, time) in passes.iter() {
            let time_ns = time.as_nanos() as u64;
            self.times.passes.add(name, time_ns);
            in_passes_ns += time_ns;
        }
        // If the executor times no passes, the time in flight stands for the blur.
        let blur_ns = if in_passes_ns == 0 { in_hand_ns } else { in_passes_ns };
        let quality = done.trace.quality.unwrap_or_default();
        self.times.took.add(blur_ns);
        self.times.rungs.add(quality.name());
        self.times.misses += u64::from(blur_ns > self.budget_ns);
        // With overlapping frames, wall time says nothing about a single one.
        let took_ns = if self.blur.capacity() > 1 { in_passes_ns } else { blur_ns };
        self.blur.picker.note(quality, took_ns, done.since_ns);
        self.shared.order.set(self.blur.picker.plan());
        blur_ns
    }
}
