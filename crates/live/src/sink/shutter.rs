//! A shutter before a sink: while it is closed, the sink gets the still card instead of pictures.

mod control;

use std::cell::OnceCell;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::time::{Duration, Instant};

use control::Request;
pub use control::{CardNotShown, ShutterControl};

use super::{Ending, OutputWithoutCard, Sink, SinkError, Written, card};
use bokehcam::clock::Clock;
use bokehcam::frame::{ColorImage, YuyvImage};
use bokehcam::link::demand::Demand;

/// A sink whose pictures can be blocked through its [`ShutterControl`]. The card is shown at once, also between two frames;
/// from then on the camera is released: no client counts as watching. After reopening, the card is repeated at the
/// frame rate until the next picture.
pub struct Shutter {
    sink: Box<dyn Sink>,
    closed: Arc<AtomicBool>,
    requests: Receiver<Request>,
    /// Receivers of a copy of the next picture.
    copy_receivers: Vec<SyncSender<ColorImage>>,
    /// Receivers that wait until all outputs show the card, with their deadlines.
    card_waiters: Vec<(SyncSender<Vec<OutputWithoutCard>>, Instant)>,
    demand: Demand,
    /// Whether the demand is withheld.
    withheld: bool,
    /// Whether the card was the last picture sent to the sink.
    shows_card: bool,
    size: (u32, u32),
    /// Created on first use: a shutter that never closes needs no memory for it.
    card: OnceCell<ColorImage>,
    period: Duration,
    clock: Clock,
    /// Time of the last picture, as passed to the sink.
    last_ns: Option<u64>,
    /// When a picture was last sent to the sink.
    sent_ns: u64,
    /// How far the sink's time is ahead of the source's, which stands still while the camera is released; wraps around
    /// for a source whose clock is ahead.
    offset_ns: u64,
    /// Whether the next picture is the first one of another source, whose clock began elsewhere.
    is_first_of_source: bool,
}

/// Longest delay of the card, whatever the time of the next frame; and the period while no pictures come that it would
/// replace.
const TICK: Duration = Duration::from_millis(20);
const IDLE_TICK: Duration = Duration::from_millis(100);

impl Shutter {
    /// Creates a shutter before `sink`, for pictures of `size` pixels every `period`. It is closed while `closed` is
    /// set; `demand` is withheld to release the camera.
    pub fn new(
        sink: Box<dyn Sink>,
        size: (u32, u32),
        period: Duration,
        demand: Demand,
        clock: Clock,
        closed: Arc<AtomicBool>,
    ) -> (Self, ShutterControl) {
        let (request_sender, requests) = mpsc::channel();
        let whole_sink = OutputWithoutCard { output: sink.describe(), is_live: sink.is_live() };
        let shutter = Self {
            sink,
            closed: Arc::clone(&closed),
            requests,
            copy_receivers: Vec::new(),
            card_waiters: Vec::new(),
            demand,
            withheld: false,
            shows_card: false,
            size,
            card: OnceCell::new(),
            period,
            clock,
            last_ns: None,
            sent_ns: 0,
            offset_ns: 0,
            is_first_of_source: false,
        };
        (shutter, ShutterControl { closed, request_sender, whole_sink })
    }

    /// Prepares for the pictures of another source, of `size` pixels every `period`: the sink's time goes on from the last
    /// picture by the time that has passed.
    pub fn begin_source(&mut self, size: (u32, u32), period: Duration) {
        if self.size != size {
            (self.size, self.card) = (size, OnceCell::new());
        }
        (self.period, self.is_first_of_source) = (period, true);
    }

    /// Shows the card until the next picture, because no source is open.
    ///
    /// # Errors
    /// Those of [`Sink::write_frame`].
    pub fn show_card(&mut self) -> Written {
        self.send_card(self.time_now_ns())
    }

    /// Withholds the demand once the card is shown, which releases the camera; returns whether it is closed.
    fn update_demand(&mut self) -> bool {
        let closed = self.closed.load(Ordering::Acquire);
        let withheld = closed && self.shows_card;
        if withheld != self.withheld {
            self.withheld = withheld;
            self.demand.withhold(withheld);
        }
        closed
    }

    /// Sends the sink a picture by `write`, or the card while it is closed.
    fn send_picture(&mut self, time_ns: u64, write: impl FnOnce(&mut Self, u64) -> Written) -> Written {
        let closed = self.update_demand();
        let time_ns = self.convert_time_ns(time_ns);
        if closed {
            return self.send_card(time_ns);
        }
        self.record_sent(time_ns, false);
        write(self, time_ns)
    }

    /// Handles pending requests; answers those that wait for the card once it is shown.
    fn handle_requests(&mut self) {
        for request in self.requests.try_iter() {
            match request {
                Request::CopyPicture(to) => self.copy_receivers.push(to),
                Request::WaitForCard(to, until) => self.card_waiters.push((to, until)),
            }
        }
        if self.card_waiters.is_empty() {
            return;
        }
        // Once it was opened again there is nothing to wait for.
        let is_settled = self.shows_card || !self.closed.load(Ordering::Acquire);
        let without_card = if self.shows_card { self.sink.outputs_without_card() } else { Vec::new() };
        let now = Instant::now();
        self.card_waiters.retain(|(to, until)| {
            let is_waiting = !(is_settled && without_card.is_empty()) && now < *until;
            if !is_waiting {
                let _ = to.try_send(without_card.clone());
            }
            is_waiting
        });
    }

    /// Whether a copy of a picture is requested.
    fn is_copy_requested(&mut self) -> bool {
        self.handle_requests();
        !self.copy_receivers.is_empty()
    }

    /// Sends copies of a picture to those who asked for one.
    fn answer_copy_requests(&mut self, frame: &ColorImage) {
        if self.is_copy_requested() {
            self.copy_receivers.drain(..).for_each(|to| drop(to.try_send(frame.clone())));
        }
    }

    /// Sends the sink the card.
    fn send_card(&mut self, time_ns: u64) -> Written {
        self.record_sent(time_ns, true);
        let card = self.card.get_or_init(|| {
            let mut card = ColorImage::new(self.size.0, self.size.1);
            card::draw_card(&mut card);
            card
        });
        let sent = self.sink.write_card(card, time_ns);
        self.update_demand();
        self.handle_requests();
        sent
    }

    fn record_sent(&mut self, time_ns: u64, shows_card: bool) {
        (self.last_ns, self.sent_ns, self.shows_card) = (Some(time_ns), self.clock.now_ns(), shows_card);
    }

    /// Returns the time since a picture was last sent to the sink.
    fn time_since_sent(&self) -> Duration {
        Duration::from_nanos(self.clock.now_ns().saturating_sub(self.sent_ns))
    }

    /// Returns the sink's time now: later than that of the last picture.
    fn time_now_ns(&self) -> u64 {
        self.last_ns.map_or(0, |last_ns| last_ns + (self.time_since_sent().as_nanos() as u64).max(1))
    }

    /// Converts the source's time to the sink's: later than the previous one.
    fn convert_time_ns(&mut self, time_ns: u64) -> u64 {
        let is_first_of_source = std::mem::take(&mut self.is_first_of_source);
        if let Some(last_ns) = self.last_ns {
            if is_first_of_source {
                self.offset_ns = self.time_now_ns().wrapping_sub(time_ns);
            } else if self.shows_card && time_ns.wrapping_add(self.offset_ns) <= last_ns {
                self.offset_ns = (last_ns + self.period.as_nanos() as u64).wrapping_sub(time_ns);
            }
        }
        time_ns.wrapping_add(self.offset_ns)
    }
}

impl Sink for Shutter {
    fn write_frame(&mut self, frame: &ColorImage, time_ns: u64) -> Written {
        self.send_picture(time_ns, |shutter, time_ns| {
            shutter.answer_copy_requests(frame);
            shutter.sink.write_frame(frame, time_ns)
        })
    }

    /// Requested copies need full colour.
    fn wants_yuyv(&mut self) -> bool {
        !self.is_copy_requested() && self.sink.wants_yuyv()
    }

    fn write_yuyv(&mut self, frame: &mut YuyvImage, time_ns: u64) -> Written {
        self.send_picture(time_ns, |shutter, time_ns| shutter.sink.write_yuyv(frame, time_ns))
    }

    fn inner(&self) -> Option<&dyn Sink> {
        Some(&*self.sink)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn Sink> {
        Some(&mut *self.sink)
    }

    fn write_with_alpha(&mut self, frame: &ColorImage, alpha: &[u8], time_ns: u64) -> Written {
        self.send_picture(time_ns, |shutter, time_ns| {
            shutter.answer_copy_requests(frame);
            shutter.sink.write_with_alpha(frame, alpha, time_ns)
        })
    }

    fn write_card(&mut self, card: &ColorImage, time_ns: u64) -> Written {
        self.sink.write_card(card, time_ns)
    }

    /// Waits until the sink or the card is due, but at most a tick: it may be closed meanwhile.
    fn repeat_interval(&self) -> Option<Duration> {
        let due = if self.shows_card { Some(self.period) } else { self.sink.repeat_interval() };
        let is_idle = self.shows_card || !self.demand.is_watched();
        let tick = if is_idle && self.card_waiters.is_empty() { IDLE_TICK } else { TICK };
        Some(due.map_or(tick, |due| due.saturating_sub(self.time_since_sent()).min(tick)))
    }

    fn repeat_frame(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        let (closed, time_since_sent) = (self.update_demand(), self.time_since_sent());
        self.handle_requests();
        if closed || self.shows_card && self.demand.is_watched() {
            if self.shows_card && time_since_sent < self.period {
                return Ok(ControlFlow::Continue(false));
            }
            return Ok(self.send_card(self.time_now_ns())?.map_continue(|()| true));
        }
        if self.sink.repeat_interval().is_none_or(|due| time_since_sent < due) {
            return Ok(ControlFlow::Continue(false));
        }
        self.sent_ns = self.clock.now_ns();
        self.sink.repeat_frame()
    }

    fn skip_frame(&mut self) {
        // The sink gets nothing, so there is no card to wait for.
        self.shows_card = self.closed.load(Ordering::Acquire);
        self.update_demand();
        self.sink.skip_frame();
    }

    fn finish(self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        self.sink.finish(ending)
    }

    fn describe(&self) -> String {
        self.sink.describe()
    }
}

#[cfg(test)]
mod tests;
