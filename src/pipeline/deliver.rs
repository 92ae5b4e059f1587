//! Last stage, on the caller's thread: hands pictures to the sink.

use super::{Ended, Frame, Progress};
use crate::clock::Clock;
use crate::frame::ColorImage;
use crate::link::pool::Pooled;
use crate::link::{Received, Receiver};
use crate::sink::Sink;
use crate::stats::{Cause, Histogram, Tally};

pub(super) struct Stage<'a> {
    pub sink: &'a mut dyn Sink,
    pub mirror: bool,
    pub total: Option<u64>,
    pub progress: &'a dyn Fn(Progress),
    pub tally: &'a Tally,
    pub clock: &'a Clock,
    pub times: Times<'a>,
}

pub(super) struct Times<'a> {
    pub sink: &'a mut Histogram,
    pub latency: &'a mut Histogram,
    pub frame: &'a mut Histogram,
    pub repeats: &'a mut u64,
}

impl Stage<'_> {
    pub(super) fn run(self, mut from: Receiver<Frame<Pooled<ColorImage>>>) -> Ended {
        let mut last_ns = None;
        loop {
            let Frame { ticket, item: mut picture, .. } = match self.next(&mut from) {
                Received::Item(frame) => frame,
                Received::Nothing => {
                    if self.sink.repeat()?.is_break() {
                        break;
                    }
                    *self.times.repeats += 1;
                    continue;
                }
                Received::Ended => break,
            };
            let began_ns = self.clock.now_ns();
            if self.mirror {
                mirror(&mut picture);
            }
            match self.sink.put(&picture) {
                Ok(flow) if flow.is_break() => break,
                Ok(_) => {}
                Err(error) => {
                    self.tally.dropped(ticket, Cause::Failed);
                    return Err(error.into());
                }
            }
            let now_ns = self.clock.now_ns();
            self.times.sink.add(now_ns - began_ns);
            self.times.latency.add(now_ns.saturating_sub(ticket.captured_ns));
            if let Some(last_ns) = last_ns.replace(now_ns) {
                self.times.frame.add(now_ns - last_ns);
            }
            self.tally.delivered(ticket);
            let frames = self.tally.frames();
            (self.progress)(Progress {
                captured: frames.captured,
                delivered: frames.delivered,
                dropped: frames.dropped.total(),
                total: self.total,
            });
        }
        Ok(())
    }

    fn next<T>(&self, from: &mut Receiver<T>) -> Received<T> {
        match self.sink.hold() {
            Some(hold) => from.recv_timeout(hold),
            None => from.recv().map_or(Received::Ended, Received::Item),
        }
    }
}

/// Flips a picture left to right.
fn mirror(picture: &mut ColorImage) {
    let row_bytes = picture.width as usize * 3;
    for row in picture.rgb.chunks_exact_mut(row_bytes.max(1)) {
        row.as_chunks_mut::<3>().0.reverse();
    }
}
