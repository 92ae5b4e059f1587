//! A shutter before a sink: while it is closed, the sink gets the still card instead of pictures.

use std::cell::OnceCell;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender, SyncSender};
use std::time::{Duration, Instant};

use super::{Counter, Ending, Sink, SinkError, Uncovered, card};
use crate::clock::Clock;
use crate::frame::{ColorImage, YuyvImage};
use crate::link::demand::Demand;
use crate::stats::{NodeUse, OutputUse};

/// A sink whose pictures can be blocked through its [`ShutterControl`]. The card is shown at once, also between two frames;
/// from then on the camera is released: no client counts as watching. After reopening, the card is repeated at the
/// frame rate until the next picture.
pub struct Shutter {
    sink: Box<dyn Sink>,
    closed: Arc<AtomicBool>,
    requests: Receiver<Request>,
    /// Receivers of a copy of the next picture.
    copies: Vec<SyncSender<ColorImage>>,
    /// Receivers that wait until all outputs show the card, with their deadlines.
    covers: Vec<(SyncSender<Vec<Uncovered>>, Instant)>,
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
    /// How far the sink's time is ahead of the source's, which stands still while the camera is released.
    offset_ns: u64,
}

/// Longest delay of the card, whatever the time of the next frame; and the period while no pictures come that it would
/// replace.
const TICK: Duration = Duration::from_millis(20);
const IDLE_TICK: Duration = Duration::from_millis(100);

/// Longest wait for outputs to show the card.
const COVER_TIMEOUT: Duration = Duration::from_secs(1);

/// Closes and opens a [`Shutter`], and copies pictures behind it, from any thread.
#[derive(Clone)]
pub struct ShutterControl {
    closed: Arc<AtomicBool>,
    request_sender: Sender<Request>,
    /// The whole sink as one output.
    whole_sink: Uncovered,
}

/// Requests to a shutter, each with its reply channel. A requester that has timed out is ignored.
enum Request {
    Picture(SyncSender<ColorImage>),
    Covered(SyncSender<Vec<Uncovered>>, Instant),
}

/// These live outputs may still show a picture instead of the card.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no more pictures are sent, but {0} may still show the last one: it did not accept the card")]
pub struct CardNotShown(pub String);

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
        let whole_sink = Uncovered { output: sink.describe(), is_live: sink.is_live() };
        let shutter = Self {
            sink,
            closed: Arc::clone(&closed),
            requests,
            copies: Vec::new(),
            covers: Vec::new(),
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
        };
        (shutter, ShutterControl { closed, request_sender, whole_sink })
    }

    /// Whether it is closed. Once the card is shown, the camera is released.
    fn is_closed(&mut self) -> bool {
        let closed = self.closed.load(Ordering::Acquire);
        let withheld = closed && self.shows_card;
        if withheld != self.withheld {
            self.withheld = withheld;
            self.demand.withhold(withheld);
        }
        closed
    }

    /// Sends the sink a picture by `put`, or the card while it is closed.
    fn send_picture(
        &mut self,
        time_ns: u64,
        put: impl FnOnce(&mut Self, u64) -> Result<ControlFlow<()>, SinkError>,
    ) -> Result<ControlFlow<()>, SinkError> {
        let closed = self.is_closed();
        let time_ns = self.time_ns(time_ns);
        if closed {
            return self.send_card(time_ns);
        }
        self.record_sent(time_ns, false);
        put(self, time_ns)
    }

    /// Handles pending requests; answers those that wait for the card once it is shown.
    fn handle_requests(&mut self) {
        for request in self.requests.try_iter() {
            match request {
                Request::Picture(to) => self.copies.push(to),
                Request::Covered(to, until) => self.covers.push((to, until)),
            }
        }
        if self.covers.is_empty() {
            return;
        }
        // Once it was opened again there is nothing to wait for.
        let is_given = self.shows_card || !self.closed.load(Ordering::Acquire);
        let uncovered = if self.shows_card { self.sink.uncovered() } else { Vec::new() };
        let now = Instant::now();
        self.covers.retain(|(to, until)| {
            let waits = !(is_given && uncovered.is_empty()) && now < *until;
            if !waits {
                let _ = to.try_send(uncovered.clone());
            }
            waits
        });
    }

    /// Whether a copy of a picture is requested.
    fn is_copy_requested(&mut self) -> bool {
        self.handle_requests();
        !self.copies.is_empty()
    }

    /// Sends the sink the card.
    fn send_card(&mut self, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.record_sent(time_ns, true);
        let card = self.card.get_or_init(|| {
            let mut card = ColorImage::new(self.size.0, self.size.1);
            card::draw(&mut card);
            card
        });
        let given = self.sink.cover(card, time_ns);
        self.is_closed();
        self.handle_requests();
        given
    }

    fn record_sent(&mut self, time_ns: u64, shows_card: bool) {
        (self.last_ns, self.sent_ns, self.shows_card) = (Some(time_ns), self.clock.now_ns(), shows_card);
    }

    /// Returns the time since a picture was last sent to the sink.
    fn time_since_sent(&self) -> Duration {
        Duration::from_nanos(self.clock.now_ns().saturating_sub(self.sent_ns))
    }

    /// Converts the source's time to the sink's: later than the previous one.
    fn time_ns(&mut self, time_ns: u64) -> u64 {
        let period_ns = self.period.as_nanos() as u64;
        match self.last_ns {
            Some(last_ns) if self.shows_card && time_ns + self.offset_ns <= last_ns => {
                self.offset_ns = last_ns + period_ns - time_ns;
            }
            _ => {}
        }
        time_ns + self.offset_ns
    }
}

impl Sink for Shutter {
    fn put(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.send_picture(time_ns, |shutter, time_ns| {
            if shutter.is_copy_requested() {
                shutter.copies.drain(..).for_each(|to| drop(to.try_send(frame.clone())));
            }
            shutter.sink.put(frame, time_ns)
        })
    }

    /// Requested copies need full colour.
    fn wants_yuyv(&mut self) -> bool {
        !self.is_copy_requested() && self.sink.wants_yuyv()
    }

    fn put_yuyv(&mut self, frame: &mut YuyvImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.send_picture(time_ns, |shutter, time_ns| shutter.sink.put_yuyv(frame, time_ns))
    }

    fn cover(&mut self, card: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.sink.cover(card, time_ns)
    }

    fn captured(&mut self, captured_ns: u64) {
        self.sink.captured(captured_ns);
    }

    fn is_live(&self) -> bool {
        self.sink.is_live()
    }

    fn uncovered(&self) -> Vec<Uncovered> {
        self.sink.uncovered()
    }

    fn nodes(&self) -> Vec<Counter<NodeUse>> {
        self.sink.nodes()
    }

    fn outputs(&self) -> Vec<Counter<OutputUse>> {
        self.sink.outputs()
    }

    /// Waits until the sink or the card is due, but at most a tick: it may be closed meanwhile.
    fn hold(&self) -> Option<Duration> {
        let due = if self.shows_card { Some(self.period) } else { self.sink.hold() };
        let is_idle = self.shows_card || !self.demand.is_watched();
        let tick = if is_idle && self.covers.is_empty() { IDLE_TICK } else { TICK };
        Some(due.map_or(tick, |due| due.saturating_sub(self.time_since_sent()).min(tick)))
    }

    fn repeat(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        let (closed, time_since_sent) = (self.is_closed(), self.time_since_sent());
        self.handle_requests();
        if closed || self.shows_card && self.demand.is_watched() {
            if self.shows_card && time_since_sent < self.period {
                return Ok(ControlFlow::Continue(false));
            }
            let time_ns = self.last_ns.map_or(0, |last_ns| last_ns + (time_since_sent.as_nanos() as u64).max(1));
            return Ok(self.send_card(time_ns)?.map_continue(|()| true));
        }
        if self.sink.hold().is_none_or(|due| time_since_sent < due) {
            return Ok(ControlFlow::Continue(false));
        }
        self.sent_ns = self.clock.now_ns();
        self.sink.repeat()
    }

    fn pass_by(&mut self) {
        // The sink gets nothing, so there is no card to wait for.
        self.shows_card = self.closed.load(Ordering::Acquire);
        self.is_closed();
        self.sink.pass_by();
    }

    fn keeps(&self) -> bool {
        self.sink.keeps()
    }

    fn finish(self: Box<Self>, ending: Ending) -> Result<(), SinkError> {
        self.sink.finish(ending)
    }

    fn describe(&self) -> String {
        self.sink.describe()
    }
}

impl ShutterControl {
    /// Blocks pictures from now on, or lets them pass again.
    pub fn close(&self, closed: bool) {
        self.closed.store(closed, Ordering::Release);
    }

    /// Whether it is closed.
    pub fn is_closed(&self) -> bool {
        self.closed.load(Ordering::Acquire)
    }

    /// Returns a copy of the next picture that passes; `None` if none does in time.
    pub fn picture(&self, timeout: Duration) -> Option<ColorImage> {
        let (to, reply) = mpsc::sync_channel(1);
        self.request_sender.send(Request::Picture(to)).ok()?;
        reply.recv_timeout(timeout).ok()
    }

    /// Waits until every output shows the card, after [`ShutterControl::close`]. Returns a note about outputs that do not yet,
    /// if they are not live.
    ///
    /// # Errors
    /// A live output may still show a picture.
    pub fn wait_covered(&self) -> Result<Option<String>, CardNotShown> {
        let (to, reply) = mpsc::sync_channel(1);
        // A run that has ended shows nothing.
        let sent = self.request_sender.send(Request::Covered(to, Instant::now() + COVER_TIMEOUT));
        let uncovered = match sent.map(|()| reply.recv_timeout(2 * COVER_TIMEOUT)) {
            Ok(Ok(uncovered)) => uncovered,
            // The thread that sends the pictures is blocked by one of the outputs.
            Ok(Err(RecvTimeoutError::Timeout)) => vec![self.whole_sink.clone()],
            Ok(Err(RecvTimeoutError::Disconnected)) | Err(_) => Vec::new(),
        };
        let names = |is_live: bool| {
            let names = uncovered.iter().filter(|left| left.is_live == is_live).map(|left| left.output.as_str());
            names.collect::<Vec<_>>().join(", ")
        };
        match [names(true), names(false)] {
            [live, _] if !live.is_empty() => Err(CardNotShown(live)),
            [_, others] if !others.is_empty() => Ok(Some(format!("{others}: busy, so the card appears there later"))),
            _ => Ok(None),
        }
    }
}

#[cfg(test)]
mod tests;
