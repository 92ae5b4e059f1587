//! Last stage, on the caller's thread: hands pictures to the sink.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use super::blur::Blurred;
use super::playout::Playout;
use super::{Ended, Frame, Progress, Trace, View};
use crate::bokeh::Picture;
use crate::budget::Quality;
use crate::clock::Clock;
use crate::frame::ColorImage;
use crate::frame::crop::Cropper;
use crate::link::{self, Received, Receiver, Sender};
use crate::optics::CocField;
use crate::sink::{Sink, SinkError};
use crate::stats::{Cause, Histogram, Tally, Ticket};

pub(super) struct Stage<'a> {
    pub sink: &'a mut dyn Sink,
    /// A viewer that is sent every frame as well.
    pub view: Option<Sender<View>>,
    pub mirror: bool,
    /// Told before each frame whether pictures may be YUYV: where the sink wants that, and nobody else gets them.
    pub wants_yuyv: &'a AtomicBool,
    /// Frames to be captured in all, where that is known.
    pub total: Option<u64>,
    pub progress: &'a dyn Fn(Progress),
    pub tally: &'a Tally,
    pub clock: &'a Clock,
    /// When pictures are due; `None` shows them as they come.
    pub playout: Option<Playout>,
    pub times: Times<'a>,
    pub cropper: Cropper,
    /// The part of the picture that goes out.
    pub cropped: ColorImage,
}

pub(super) struct Times<'a> {
    pub sink: &'a mut Histogram,
    /// Waits of finished pictures for their turn.
    pub playout: &'a mut Histogram,
    /// From capture to delivery.
    pub latency: &'a mut Histogram,
    /// From one delivery to the next.
    pub frame: &'a mut Histogram,
    /// Pictures shown again, as no new one came.
    pub repeats: &'a mut u64,
}

impl Stage<'_> {
    /// Delivers frames until they end, the sink wants no more, or the viewer is gone.
    pub(super) fn run(mut self, mut from: Receiver<Frame<Blurred>>) -> Ended {
        let mut last_ns = None;
        // Ticket of the frame that was sent to the viewer last, where that decides whether it was delivered.
        let mut at_viewer = None;
        loop {
            let wants_yuyv = self.view.is_none() && !self.mirror && self.sink.wants_yuyv();
            self.wants_yuyv.store(wants_yuyv, Ordering::Relaxed);
            let Frame { ticket, stamp, mut trace, since_ns, item: mut frame } = match self.next(&mut from) {
                Received::Item(frame) => frame,
                Received::Nothing => match self.sink.repeat()? {
                    ControlFlow::Continue(shown) => {
                        *self.times.repeats += u64::from(shown);
                        continue;
                    }
                    ControlFlow::Break(()) => break,
                },
                Received::Ended => break,
            };
            let part = trace.part.zip(frame.picture.memory());
            let is_cropped = part.map(|(part, whole)| self.cropper.crop(whole, &part, &mut self.cropped)).is_some();
            if self.mirror {
                let out = if is_cropped { Some(&mut self.cropped) } else { frame.picture.memory_mut() };
                out.map(mirror);
            }
            let ready_ns = self.clock.now_ns();
            trace.between_ns += ready_ns.saturating_sub(since_ns);
            if let Some(playout) = &mut self.playout {
                self.clock.sleep_until_ns(playout.due_ns(ticket.captured_ns, ready_ns));
                trace.playout_ns = self.clock.now_ns() - ready_ns;
                self.times.playout.add(trace.playout_ns);
            }
            let began_ns = ready_ns + trace.playout_ns;
            trace.age_ns = began_ns.saturating_sub(ticket.captured_ns);
            let was_given = match self.give(&mut frame.picture, is_cropped, ticket.captured_ns, stamp.time_ns) {
                Ok(ControlFlow::Continue(was_given)) => was_given,
                Ok(ControlFlow::Break(())) => break,
                Err(error) => {
                    self.tally.dropped(ticket, Cause::Failed);
                    return Err(error.into());
                }
            };
            let now_ns = self.clock.now_ns();
            self.times.sink.add(now_ns - began_ns);
            self.times.latency.add(now_ns.saturating_sub(ticket.captured_ns));
            if let Some(last_ns) = last_ns.replace(now_ns) {
                self.times.frame.add(now_ns - last_ns);
            }
            let captured_ns = ticket.captured_ns;
            note(stamp.index, &frame.coc, &trace);
            // What the sink does not keep is delivered once the viewer took it.
            let kept = was_given && self.sink.keeps();
            let (done, open) = if self.view.is_none() || kept { (Some(ticket), None) } else { (None, Some(ticket)) };
            done.into_iter().for_each(|ticket| self.tally.delivered(ticket));
            if let Some(view) = &mut self.view {
                let Blurred { picture, color, depth, coc } = frame;
                let frames = self.tally.frames();
                let item = View { picture, color, depth, coc, stamp, captured_ns, trace, frames };
                match view.send(item) {
                    // A displaced frame is the one before, which the viewer did not take.
                    Ok(displaced) => self.count_viewed(displaced.is_none(), std::mem::replace(&mut at_viewer, open)),
                    // Nobody knows the fate of this frame, nor of the one before: they stay in flight.
                    Err(link::Abandoned) => return Ok(()),
                }
            }
            let frames = self.tally.frames();
            (self.progress)(Progress {
                captured: frames.captured,
                delivered: frames.delivered,
                dropped: frames.dropped.total(),
                total: self.total,
                quality: trace.quality,
            });
        }
        // The viewer still takes the last one.
        self.count_viewed(true, at_viewer);
        Ok(())
    }

    /// Gives the sink a picture, where that is in memory; `Continue` says whether it was.
    fn give(
        &mut self,
        picture: &mut Picture,
        is_cropped: bool,
        captured_ns: u64,
        time_ns: u64,
    ) -> Result<ControlFlow<(), bool>, SinkError> {
        let flow = if let Some(yuyv) = picture.yuyv_mut() {
            self.sink.captured(captured_ns);
            self.sink.put_yuyv(yuyv, time_ns)?
        } else if let Some(whole) = picture.memory() {
            self.sink.captured(captured_ns);
            self.sink.put(if is_cropped { &self.cropped } else { whole }, time_ns)?
        } else {
            self.sink.pass_by();
            return Ok(ControlFlow::Continue(false));
        };
        Ok(flow.map_continue(|()| true))
    }

    /// Counts a frame whose delivery was up to the viewer: delivered if that took it, else evicted.
    fn count_viewed(&self, taken: bool, ticket: Option<Ticket>) {
        match ticket {
            Some(ticket) if taken => self.tally.delivered(ticket),
            Some(ticket) => self.tally.dropped(ticket, Cause::Evicted),
            None => {}
        }
    }

    /// The next frame; `Nothing` when the sink is to repeat its last picture before one comes.
    fn next<T>(&self, from: &mut Receiver<T>) -> Received<T> {
        match self.sink.hold() {
            Some(hold) => from.recv_timeout(hold),
            None => from.recv().map_or(Received::Ended, Received::Item),
        }
    }
}

/// Tells of a frame that went out, to who asks for that.
fn note(index: usize, coc: &CocField, trace: &Trace) {
    let ms = |ns: u64| ns as f64 / 1e6;
    let focus_m = if let CocField::Depth(lens) = coc { Some(lens.focus_m) } else { None };
    let quality = trace.quality.map(Quality::name);
    let (depth_ms, blur_ms, age_ms, depth_held) =
        (ms(trace.depth_ns), ms(trace.blur_ns), ms(trace.age_ns), trace.depth_held);
    tracing::trace!(index, focus_m, quality, depth_held, depth_ms, blur_ms, age_ms, "frame");
}

/// Flips a picture left to right.
fn mirror(picture: &mut ColorImage) {
    let row_bytes = picture.width as usize * 3;
    for row in picture.rgb.chunks_exact_mut(row_bytes.max(1)) {
        row.as_chunks_mut::<3>().0.reverse();
    }
}
