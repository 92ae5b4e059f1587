//! A shutter before a sink: while it is closed, the sink is given the still card, and nothing of the pictures.

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

/// A sink that others can keep the pictures from, by its [`Release`]. The card comes at once, also between two frames;
/// from then on the camera rests: nobody counts as watching. The card goes on, as often as frames came, until there is a
/// picture again after it was opened.
pub struct Shutter {
    sink: Box<dyn Sink>,
    closed: Arc<AtomicBool>,
    asked: Receiver<Asked>,
    /// Who wants a copy of the next picture.
    copies: Vec<SyncSender<ColorImage>>,
    /// Who waits until all outputs show the card, and until when.
    covers: Vec<(SyncSender<Vec<Uncovered>>, Instant)>,
    demand: Demand,
    /// Whether the demand is withheld.
    rests: bool,
    /// Whether the sink was given the card last.
    shows_card: bool,
    size: (u32, u32),
    /// Made once it is wanted: who is never off needs no memory for it.
    card: OnceCell<ColorImage>,
    period: Duration,
    clock: Clock,
    /// The time of the last picture, as the sink was told it.
    last_ns: Option<u64>,
    /// When the sink was given something last.
    given_ns: u64,
    /// By how much the sink's time is ahead of the source's, which stands still while that rests.
    ahead_ns: u64,
}

/// How soon the card comes, whenever the next frame would; and while there are no pictures that it would replace.
const TICK: Duration = Duration::from_millis(20);
const IDLE_TICK: Duration = Duration::from_millis(100);

/// How long outputs may take to show the card.
const PATIENCE: Duration = Duration::from_secs(1);

/// Closes and opens a [`Shutter`], and takes pictures behind it, from any thread.
#[derive(Clone)]
pub struct Release {
    closed: Arc<AtomicBool>,
    ask: Sender<Asked>,
    /// The sink as one.
    all: Uncovered,
}

/// What others want of a shutter, and where the answer goes. Who gave up waiting misses nothing.
enum Asked {
    Picture(SyncSender<ColorImage>),
    Covered(SyncSender<Vec<Uncovered>>, Instant),
}

/// These outputs, which people see live, may still show a picture though they were to show the card.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no more pictures come, but {0} may still show the last one: it does not take the card")]
pub struct NotCovered(pub String);

impl Shutter {
    /// A shutter before `sink`, for pictures of `size` pixels every `period`. It is closed while `closed` says so; `demand` is
    /// what the camera rests by.
    pub fn new(
        sink: Box<dyn Sink>,
        size: (u32, u32),
        period: Duration,
        demand: Demand,
        clock: Clock,
        closed: Arc<AtomicBool>,
    ) -> (Self, Release) {
        let (ask, asked) = mpsc::channel();
        let all = Uncovered { output: sink.describe(), is_live: sink.is_live() };
        let shutter = Self {
            sink,
            closed: Arc::clone(&closed),
            asked,
            copies: Vec::new(),
            covers: Vec::new(),
            demand,
            rests: false,
            shows_card: false,
            size,
            card: OnceCell::new(),
            period,
            clock,
            last_ns: None,
            given_ns: 0,
            ahead_ns: 0,
        };
        (shutter, Release { closed, ask, all })
    }

    /// Whether it is closed. Once the card is there, the camera follows.
    fn is_closed(&mut self) -> bool {
        let closed = self.closed.load(Ordering::Acquire);
        let rests = closed && self.shows_card;
        if rests != self.rests {
            self.rests = rests;
            self.demand.withhold(rests);
        }
        closed
    }

    /// Gives the sink a picture by `give`, or the card while it is closed.
    fn pass(
        &mut self,
        time_ns: u64,
        give: impl FnOnce(&mut Self, u64) -> Result<ControlFlow<()>, SinkError>,
    ) -> Result<ControlFlow<()>, SinkError> {
        let closed = self.is_closed();
        let time_ns = self.time_ns(time_ns);
        if closed {
            return self.give_card(time_ns);
        }
        self.note(time_ns, false);
        give(self, time_ns)
    }

    /// Takes note of who wants something; tells those who wait for the card where it is.
    fn hear(&mut self) {
        for asked in self.asked.try_iter() {
            match asked {
                Asked::Picture(to) => self.copies.push(to),
                Asked::Covered(to, until) => self.covers.push((to, until)),
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

    /// Whether anybody waits for a copy.
    fn is_asked(&mut self) -> bool {
        self.hear();
        !self.copies.is_empty()
    }

    /// Gives the sink the card.
    fn give_card(&mut self, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.note(time_ns, true);
        let card = self.card.get_or_init(|| {
            let mut card = ColorImage::new(self.size.0, self.size.1);
            card::draw(&mut card);
            card
        });
        let given = self.sink.cover(card, time_ns);
        self.is_closed();
        self.hear();
        given
    }

    fn note(&mut self, time_ns: u64, shows_card: bool) {
        (self.last_ns, self.given_ns, self.shows_card) = (Some(time_ns), self.clock.now_ns(), shows_card);
    }

    /// How long ago the sink was given something.
    fn silent(&self) -> Duration {
        Duration::from_nanos(self.clock.now_ns().saturating_sub(self.given_ns))
    }

    /// A time of the source's as the sink is told it: later than the one before.
    fn time_ns(&mut self, time_ns: u64) -> u64 {
        let period_ns = self.period.as_nanos() as u64;
        match self.last_ns {
            Some(last_ns) if self.shows_card && time_ns + self.ahead_ns <= last_ns => {
                self.ahead_ns = last_ns + period_ns - time_ns;
            }
            _ => {}
        }
        time_ns + self.ahead_ns
    }
}

impl Sink for Shutter {
    fn put(&mut self, frame: &ColorImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.pass(time_ns, |shutter, time_ns| {
            if shutter.is_asked() {
                shutter.copies.drain(..).for_each(|to| drop(to.try_send(frame.clone())));
            }
            shutter.sink.put(frame, time_ns)
        })
    }

    /// Copies are in full colour.
    fn wants_yuyv(&mut self) -> bool {
        !self.is_asked() && self.sink.wants_yuyv()
    }

    fn put_yuyv(&mut self, frame: &mut YuyvImage, time_ns: u64) -> Result<ControlFlow<()>, SinkError> {
        self.pass(time_ns, |shutter, time_ns| shutter.sink.put_yuyv(frame, time_ns))
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

    /// Until the sink or the card is due, but never longer than a tick: it may be closed meanwhile.
    fn hold(&self) -> Option<Duration> {
        let due = if self.shows_card { Some(self.period) } else { self.sink.hold() };
        let rests = self.shows_card || !self.demand.is_watched();
        let tick = if rests && self.covers.is_empty() { IDLE_TICK } else { TICK };
        Some(due.map_or(tick, |due| due.saturating_sub(self.silent()).min(tick)))
    }

    fn repeat(&mut self) -> Result<ControlFlow<(), bool>, SinkError> {
        let (closed, silent) = (self.is_closed(), self.silent());
        self.hear();
        if closed || self.shows_card && self.demand.is_watched() {
            if self.shows_card && silent < self.period {
                return Ok(ControlFlow::Continue(false));
            }
            let time_ns = self.last_ns.map_or(0, |last_ns| last_ns + (silent.as_nanos() as u64).max(1));
            return Ok(self.give_card(time_ns)?.map_continue(|()| true));
        }
        if self.sink.hold().is_none_or(|due| silent < due) {
            return Ok(ControlFlow::Continue(false));
        }
        self.given_ns = self.clock.now_ns();
        self.sink.repeat()
    }

    fn pass_by(&mut self) {
        // The sink is given nothing, so there is no card to wait for.
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

impl Release {
    /// No picture passes from now on, or pictures do again.
    pub fn close(&self, closed: bool) {
        self.closed.store(closed, Ordering::Release);
    }

    /// Whether it is closed.
    pub fn is_closed(&self) -> bool {
        self.closed.load(Ordering::Acquire)
    }

    /// A copy of the next picture that passes; `None` where none does in time.
    pub fn picture(&self, patience: Duration) -> Option<ColorImage> {
        let (to, take) = mpsc::sync_channel(1);
        self.ask.send(Asked::Picture(to)).ok()?;
        take.recv_timeout(patience).ok()
    }

    /// Waits until every output has taken the card, after [`Release::close`]. Gives a note back where one that nobody sees
    /// live has not yet.
    ///
    /// # Errors
    /// One may still show a picture.
    pub fn wait_covered(&self) -> Result<Option<String>, NotCovered> {
        let (to, take) = mpsc::sync_channel(1);
        // A run that has ended shows nothing.
        let asked = self.ask.send(Asked::Covered(to, Instant::now() + PATIENCE));
        let uncovered = match asked.map(|()| take.recv_timeout(2 * PATIENCE)) {
            Ok(Ok(uncovered)) => uncovered,
            // What gives the outputs their pictures waits for one of them.
            Ok(Err(RecvTimeoutError::Timeout)) => vec![self.all.clone()],
            Ok(Err(RecvTimeoutError::Disconnected)) | Err(_) => Vec::new(),
        };
        let names = |is_live: bool| {
            let names = uncovered.iter().filter(|left| left.is_live == is_live).map(|left| left.output.as_str());
            names.collect::<Vec<_>>().join(", ")
        };
        match [names(true), names(false)] {
            [live, _] if !live.is_empty() => Err(NotCovered(live)),
            [_, others] if !others.is_empty() => Ok(Some(format!("{others}: busy, so the card comes there later"))),
            _ => Ok(None),
        }
    }
}

#[cfg(test)]
mod tests;
