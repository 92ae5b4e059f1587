//! Third stage: drops what is too late, and blurs the rest.

use std::collections::VecDeque;

use super::depth::Ready;
use super::quality::{LateRule, Picker};
use super::{Ended, Fault, Frame, hand_on};
use crate::bokeh::{Bokeh, Job, PassTimes};
use crate::budget::Quality;
use crate::clock::Clock;
use crate::frame::{ColorImage, Stamp};
use crate::link::pool::{Pool, Pooled};
use crate::link::{Receiver, Sender};
use crate::stats::{Cause, Histogram, PassHistograms, RungCounts, Tally, Ticket};

type Picture = Pooled<ColorImage>;

pub(super) struct Stage<'a> {
    /// `None` passes frames through.
    pub executor: Option<Box<dyn Bokeh>>,
    /// `None` blurs every frame.
    pub late: Option<LateRule>,
    pub outs: &'a Pool<ColorImage>,
    pub tally: &'a Tally,
    pub clock: &'a Clock,
    pub picker: Picker,
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
    began_ns: u64,
    quality: Quality,
}

impl Stage<'_> {
    pub(super) fn run(mut self, mut from: Receiver<Frame<Ready>>, mut to: Sender<Frame<Picture>>) -> Ended {
        let Some(mut executor) = self.executor.take() else { return self.pass_through(from, to) };
        let capacity = executor.capacity().max(1);
        let mut pending = VecDeque::with_capacity(capacity);
        loop {
            let next = match pending.len() {
                0 => match from.recv() {
                    None => return Ok(()),
                    next => next,
                },
                len if len < capacity => from.try_recv(),
                _ => None,
            };
            // With nothing to submit, there is time to wait for what was.
            let mut wait = next.is_none();
            if let Some(Frame { ticket, stamp, item }) = next {
                let began_ns = self.clock.now_ns();
                // Behind those that are under way.
                let expected_ns = self.picker.expected_ns() * (pending.len() as u64 + 1);
                if self.is_late(&ticket, began_ns, expected_ns) {
                    self.tally.dropped(ticket, Cause::Late);
                    continue;
                }
                self.picker.begin(began_ns.saturating_sub(ticket.captured_ns));
                let quality = self.picker.quality();
                let Ready { color, depth, coc } = item;
                let job = Job { ticket: ticket.id.0, color, depth, coc, quality, out: self.outs.take() };
                pending.push_back(Pending { ticket, stamp, began_ns, quality });
                if let Err(error) = executor.submit(job) {
                    return self.fail(pending.pop_back(), error.into());
                }
                wait = pending.len() == capacity;
            }
            let finished = match executor.collect(wait) {
                Ok(Some(finished)) => finished,
                Ok(None) if wait => return Err(Fault::LostFrame),
                Ok(None) => continue,
                Err(error) => return self.fail(pending.pop_front(), error.into()),
            };
            let Some(done) = pending.pop_front().filter(|oldest| oldest.ticket.id.0 == finished.ticket) else {
                return Err(Fault::LostFrame);
            };
            self.measure(&done, &finished.times, capacity);
            let frame = Frame { ticket: done.ticket, stamp: done.stamp, item: finished.out };
            if !hand_on(&mut to, frame, self.tally) {
                return Ok(());
            }
        }
    }

    fn pass_through(mut self, mut from: Receiver<Frame<Ready>>, mut to: Sender<Frame<Picture>>) -> Ended {
        while let Some(Frame { ticket, stamp, item }) = from.recv() {
            if self.is_late(&ticket, self.clock.now_ns(), 0) {
                self.tally.dropped(ticket, Cause::Late);
            } else if !hand_on(&mut to, Frame { ticket, stamp, item: item.color }, self.tally) {
                break;
            }
        }
        Ok(())
    }

    fn is_late(&mut self, ticket: &Ticket, now_ns: u64, expected_ns: u64) -> bool {
        self.late.as_mut().is_some_and(|late| late.is_late(ticket.captured_ns, now_ns, expected_ns))
    }

    fn fail(&self, frame: Option<Pending>, fault: Fault) -> Ended {
        if let Some(frame) = frame {
            self.tally.dropped(frame.ticket, Cause::Failed);
        }
        Err(fault)
    }

    fn measure(&mut self, done: &Pending, passes: &PassTimes, capacity: usize) {
        let now_ns = self.clock.now_ns();
        let mut in_passes_ns = 0;
        for (name, time) in passes.iter() {
            let time_ns = time.as_nanos() as u64;
            self.times.passes.add(name, time_ns);
            in_passes_ns += time_ns;
        }
        let blur_ns = if in_passes_ns == 0 { now_ns - done.began_ns } else { in_passes_ns };
        self.times.blur.add(blur_ns);
        self.times.rungs.add(done.quality.name());
        *self.times.misses += u64::from(blur_ns > self.budget_ns);
        // Where frames overlap, wall time says nothing of a single one.
        let took_ns = if capacity > 1 { in_passes_ns } else { blur_ns };
        self.picker.note(done.quality, took_ns, now_ns);
    }
}
