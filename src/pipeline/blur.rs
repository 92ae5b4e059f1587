//! Third stage: drops what is too late, and blurs the rest.

use std::collections::VecDeque;

use super::depth::Ready;
use super::{Ended, Fault, Frame, hand_on};
use crate::bokeh::{Bokeh, Job};
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
    pub quality: Quality,
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
                if self.is_late(&ticket, began_ns) {
                    self.tally.dropped(ticket, Cause::Late);
                    continue;
                }
                let Ready { color, depth, coc } = item;
                let job = Job { ticket: ticket.id.0, color, depth, coc, out: self.outs.take() };
                pending.push_back(Pending { ticket, stamp, began_ns });
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
            self.measure(&done, &finished.times);
            let frame = Frame { ticket: done.ticket, stamp: done.stamp, item: finished.out };
            if !hand_on(&mut to, frame, self.tally) {
                return Ok(());
            }
        }
    }

    fn pass_through(mut self, mut from: Receiver<Frame<Ready>>, mut to: Sender<Frame<Picture>>) -> Ended {
        while let Some(Frame { ticket, stamp, item }) = from.recv() {
            if self.is_late(&ticket, self.clock.now_ns()) {
                self.tally.dropped(ticket, Cause::Late);
            } else if !hand_on(&mut to, Frame { ticket, stamp, item: item.color }, self.tally) {
                break;
            }
        }
        Ok(())
    }

    fn is_late(&mut self, ticket: &Ticket, now_ns: u64) -> bool {
        self.late.as_mut().is_some_and(|late| late.is_late(ticket.captured_ns, now_ns))
    }

    fn fail(&self, frame: Option<Pending>, fault: Fault) -> Ended {
        if let Some(frame) = frame {
            self.tally.dropped(frame.ticket, Cause::Failed);
        }
        Err(fault)
    }

    fn measure(&mut self, done: &Pending, passes: &crate::bokeh::PassTimes) {
        let mut blur_ns = 0;
        for (name, time) in passes.iter() {
            let time_ns = time.as_nanos() as u64;
            self.times.passes.add(name, time_ns);
            blur_ns += time_ns;
        }
        if blur_ns == 0 {
            blur_ns = self.clock.now_ns() - done.began_ns;
        }
        self.times.blur.add(blur_ns);
        self.times.rungs.add(self.quality.name());
        *self.times.misses += u64::from(blur_ns > self.budget_ns);
    }
}

/// When a frame is no longer worth blurring: two periods after capture its successors are there. But rather ten
/// pictures a second, old as they are, than none.
pub(super) struct LateRule {
    max_age_ns: u64,
    last_passed_ns: Option<u64>,
}

const STARVED_NS: u64 = 100_000_000;

impl LateRule {
    pub(super) fn new(period_ns: u64) -> Self {
        Self { max_age_ns: 2 * period_ns, last_passed_ns: None }
    }

    fn is_late(&mut self, captured_ns: u64, now_ns: u64) -> bool {
        let old = now_ns.saturating_sub(captured_ns) > self.max_age_ns;
        let starved = self.last_passed_ns.is_none_or(|last_ns| now_ns.saturating_sub(last_ns) >= STARVED_NS);
        if old && !starved {
            return true;
        }
        self.last_passed_ns = Some(now_ns);
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_frames_are_late_but_pictures_never_stop() {
        const MS: u64 = 1_000_000;
        let mut rule = LateRule::new(33 * MS);
        assert!(!rule.is_late(0, 500 * MS), "the first frame always passes");
        assert!(!rule.is_late(450 * MS, 510 * MS));
        assert!(rule.is_late(440 * MS, 520 * MS));
        assert!(rule.is_late(440 * MS, 609 * MS));
        assert!(!rule.is_late(440 * MS, 610 * MS), "nothing passed for 100 ms");
        assert!(rule.is_late(450 * MS, 611 * MS));
        assert!(!rule.is_late(900 * MS, 800 * MS), "a frame from the future is not old");
    }
}
