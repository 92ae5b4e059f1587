//! Third stage: drops what is too late, and blurs the rest; takes another executor when one comes.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::depth::Ready;
use super::quality::{LateRule, Picker};
use super::rate::Order;
use super::staging::Taken;
use super::wanted::Wanted;
use super::{Ended, Fault, Frame, MOST_IN_FLIGHT, Trace, hand_on};
use crate::bokeh::{Bokeh, Finished, Job, PassTimes, Picture};
use crate::budget::Quality;
use crate::clock::Clock;
use crate::compute::Place;
use crate::frame::{ColorImage, DepthMap, Stamp, YuyvImage};
use crate::link::pool::{Pool, Pooled};
use crate::link::{Receiver, Sender};
use crate::look::QualityRule;
use crate::optics::CocField;
use crate::stats::{About, Cause, Histogram, PassHistograms, RungCounts, Tally, Ticket};

/// A blurred picture, and what it was made of.
pub(super) struct Blurred {
    pub picture: Picture,
    /// The picture before; `None` where nothing was blurred, or nobody looks at it.
    pub color: Option<Pooled<ColorImage>>,
    pub depth: Option<Pooled<DepthMap>>,
    pub coc: CocField,
}

pub(super) struct Stage<'a> {
    /// `None` passes frames through.
    pub executor: Option<Box<dyn Bokeh>>,
    /// `None` blurs every frame.
    pub late: Option<LateRule>,
    pub outs: &'a Pool<ColorImage>,
    pub yuyvs: &'a Pool<YuyvImage>,
    pub tally: &'a Tally,
    pub clock: &'a Clock,
    pub picker: Picker,
    /// Tells how depth is to be made.
    pub order: &'a Order,
    /// At which rung the executor blurs.
    pub rule: QualityRule,
    /// Told when the executor goes over to another backend.
    pub about: &'a mut About,
    /// Where pictures are wanted; in memory where nobody says.
    pub wanted: Option<Arc<Wanted>>,
    /// Whether those in memory may be YUYV.
    pub wants_yuyv: &'a AtomicBool,
    /// Whether somebody looks at what the pictures were made of.
    pub viewed: bool,
    pub budget_ns: u64,
    pub times: Times<'a>,
}

pub(super) struct Times<'a> {
    pub blur: &'a mut Histogram,
    pub passes: &'a mut PassHistograms,
    pub rungs: &'a mut RungCounts,
    pub misses: &'a mut u64,
}

/// A frame that the executor has in hand.
struct Pending {
    ticket: Ticket,
    stamp: Stamp,
    trace: Trace,
    coc: CocField,
    taken: Option<Pooled<Taken>>,
    began_ns: u64,
    quality: Quality,
}

impl Stage<'_> {
    /// Runs until the frames end or nobody takes the results, with as many frames in hand as the executor has room for.
    pub(super) fn run(mut self, mut from: Receiver<Frame<Ready>>, mut to: Sender<Frame<Blurred>>) -> Ended {
        let mut executor = self.executor.take();
        let mut backends = executor.as_deref().map(Bokeh::backends);
        let mut pending = VecDeque::with_capacity(MOST_IN_FLIGHT);
        let mut last_swap = 0;
        loop {
            let capacity = executor.as_ref().map_or(1, |executor| executor.capacity().max(1));
            let next = match pending.len() {
                0 => match from.recv() {
                    None => return Ok(()),
                    next => next,
                },
                len if len < capacity => from.try_recv(),
                _ => None,
            };
            // Nothing to submit: wait for a frame that was submitted.
            let mut wait = next.is_none();
            if let Some(mut frame) = next {
                if let Some(swap) = frame.item.swap.take().filter(|swap| swap.number != last_swap) {
                    // Later frames carry the same one: only the first counts. What the old executor has goes out first.
                    last_swap = swap.number;
                    while let Some(old) = executor.as_mut().filter(|_| !pending.is_empty()) {
                        if !self.collect(&mut **old, &mut pending, true, &mut to)? {
                            return Ok(());
                        }
                    }
                    if let Some((new, quality)) = swap.take() {
                        executor = new;
                        backends = executor.as_deref().map(Bokeh::backends);
                        self.rule = quality;
                        self.picker = self.picker.with(quality, super::finest_quality(executor.as_deref()));
                    }
                }
                let Some(executor) = &mut executor else {
                    if !self.pass(frame, &mut to) {
                        return Ok(());
                    }
                    continue;
                };
                if !self.submit(&mut **executor, frame, &mut pending)? {
                    continue;
                }
                wait = pending.len() >= executor.capacity().max(1);
            }
            if let Some(executor) = &mut executor {
                if !self.collect(&mut **executor, &mut pending, wait, &mut to)? {
                    return Ok(());
                }
                // It has moved to another backend (GPU to processor): finest quality and times are others there.
                if backends.replace(executor.backends()) != Some(executor.backends()) {
                    (self.about.backend, self.about.adapter) = (executor.backends().into(), executor.describe());
                    self.picker = self.picker.with(self.rule, super::finest_quality(Some(&**executor)));
                }
            }
        }
    }

    /// Hands a frame on unblurred, unless it is late; returns whether there is anybody to take more.
    fn pass(&mut self, frame: Frame<Ready>, to: &mut Sender<Frame<Blurred>>) -> bool {
        let Frame { ticket, stamp, mut trace, since_ns, item: Ready { color, depth, coc, .. } } = frame;
        let now_ns = self.clock.now_ns();
        trace.between_ns += now_ns.saturating_sub(since_ns);
        if !trace.asked && self.is_late(&ticket, now_ns, 0) {
            self.tally.dropped(ticket, Cause::Late);
            return true;
        }
        let item =
            Blurred { picture: Picture::in_memory(color), color: None, depth: depth.filter(|_| self.viewed), coc };
        hand_on(to, Frame { ticket, stamp, trace, since_ns: now_ns, item }, self.tally)
    }

    /// Gives a frame to the executor, unless it is too late for that; returns whether it did.
    fn submit(
        &mut self,
        executor: &mut dyn Bokeh,
        frame: Frame<Ready>,
        pending: &mut VecDeque<Pending>,
    ) -> Result<bool, Fault> {
        let Frame { ticket, stamp, mut trace, since_ns, item } = frame;
        let Ready { color, depth, coc, taken, times, on_device, .. } = item;
        let began_ns = self.clock.now_ns();
        trace.between_ns += began_ns.saturating_sub(since_ns);
        times.into_iter().for_each(|times| self.picker.note_depth(times));
        // The frame waits for those that are under way.
        let expected_ns = self.picker.expected_ns() * (pending.len() as u64 + 1);
        if !trace.asked && self.is_late(&ticket, began_ns, expected_ns) {
            self.tally.dropped(ticket, Cause::Late);
            self.picker.note_late();
            self.order.set(self.picker.plan());
            return Ok(false);
        }
        let quality = self.picker.quality();
        let place = self.wanted.as_ref().map_or(Place::Memory, |wanted| wanted.place());
        // A part is cut out of the picture in full colour.
        let is_yuyv = trace.part.is_none() && self.wants_yuyv.load(Ordering::Relaxed);
        let (out, yuyv) = (self.outs.take(), is_yuyv.then(|| self.yuyvs.take()));
        let job = Job { ticket: ticket.id.0, color, depth, coc, quality, place, out, yuyv, on_device };
        pending.push_back(Pending { ticket, stamp, trace, coc, taken, began_ns, quality });
        match executor.submit(job) {
            Ok(()) => Ok(true),
            Err(error) => Err(self.failed(pending.pop_back(), error.into())),
        }
    }

    /// Hands on the oldest frame if it is done; with `wait`, waits until it is. Returns whether there is anybody to
    /// take more.
    fn collect(
        &mut self,
        executor: &mut dyn Bokeh,
        pending: &mut VecDeque<Pending>,
        wait: bool,
        to: &mut Sender<Frame<Blurred>>,
    ) -> Result<bool, Fault> {
        let finished = match executor.collect(wait) {
            Ok(Some(finished)) => finished,
            Ok(None) if wait => return Err(Fault::LostFrame),
            Ok(None) => return Ok(true),
            Err(error) => return Err(self.failed(pending.pop_front(), error.into())),
        };
        let Some(done) = pending.pop_front().filter(|oldest| oldest.ticket.id.0 == finished.ticket) else {
            return Err(Fault::LostFrame);
        };
        let Finished { picture, mut color, mut depth, times, .. } = finished;
        let since_ns = self.clock.now_ns();
        let blur_ns = self.measure(&done, &times, executor.capacity(), since_ns);
        let Pending { ticket, stamp, trace, coc, taken, quality, began_ns } = done;
        if let (Some(mut taken), Some(map)) = (taken, &mut depth) {
            taken.restore(&mut color, map);
        }
        let item =
            Blurred { picture, color: Some(color).filter(|_| self.viewed), depth: depth.filter(|_| self.viewed), coc };
        let between_ns = trace.between_ns + (since_ns - began_ns).saturating_sub(blur_ns);
        let trace = Trace { blur_ns, between_ns, passes: times, quality: Some(quality), ..trace };
        Ok(hand_on(to, Frame { ticket, stamp, trace, since_ns, item }, self.tally))
    }

    fn is_late(&mut self, ticket: &Ticket, now_ns: u64, expected_ns: u64) -> bool {
        self.late.as_mut().is_some_and(|late| late.is_late(ticket.captured_ns, now_ns, expected_ns))
    }

    /// Counts the frame that failed, if it is known; returns the fault.
    fn failed(&self, frame: Option<Pending>, fault: Fault) -> Fault {
        if let Some(frame) = frame {
            self.tally.dropped(frame.ticket, Cause::Failed);
        }
        fault
    }

    /// Records the times of a finished frame; returns how long its blur took.
    fn measure(&mut self, done: &Pending, passes: &PassTimes, capacity: usize, now_ns: u64) -> u64 {
        let mut in_passes_ns = 0;
        for (name, time) in passes.iter() {
            let time_ns = time.as_nanos() as u64;
            self.times.passes.add(name, time_ns);
            in_passes_ns += time_ns;
        }
        // An executor that times no passes is measured from outside.
        let blur_ns = if in_passes_ns == 0 { now_ns - done.began_ns } else { in_passes_ns };
        self.times.blur.add(blur_ns);
        self.times.rungs.add(done.quality.name());
        *self.times.misses += u64::from(blur_ns > self.budget_ns);
        // Where frames overlap, wall time says nothing of a single one.
        let took_ns = if capacity > 1 { in_passes_ns } else { blur_ns };
        self.picker.note(done.quality, took_ns, now_ns);
        self.order.set(self.picker.plan());
        blur_ns
    }
}
