//! An output on a thread of its own, so that none waits for another.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, TryRecvError};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use std::{io, mem};

use super::{Counter, Ending, Sink, SinkError, Uncovered};
use crate::frame::ColorImage;
use crate::link::{self, Abandoned, Received, Sender, Sent};
use crate::stats::{NodeUse, OutputUse};

/// An output that takes longer than this to complete is named to the user, who waits for it.
const PATIENCE: Duration = Duration::from_secs(3);

/// A sink on a thread of its own, and the link that it gets its pictures by.
pub(super) struct OutputThread {
    pub name: String,
    /// Whether people see its pictures as they come.
    pub is_live: bool,
    /// `None` once no more pictures will come.
    to: Option<Sender<Arc<Picture>>>,
    shared: Arc<Shared>,
    outcome: Receiver<Outcome>,
    thread: Option<JoinHandle<()>>,
    nodes: Vec<Counter<NodeUse>>,
}

/// A picture that several outputs share.
pub(super) struct Picture {
    image: ColorImage,
    /// By the clock of the source.
    time_ns: u64,
    /// By the clock of the run.
    captured_ns: u64,
    /// Whether this is the still card.
    is_card: bool,
}

/// How an output ended.
pub(super) enum Outcome {
    /// Its sink failed while frames came.
    Failed(SinkError),
    /// Its sink was completed, or its reader had gone.
    Ended(Result<(), SinkError>),
}

impl Outcome {
    /// What went wrong, if anything did.
    pub fn error(self) -> Option<SinkError> {
        match self {
            Self::Failed(error) | Self::Ended(Err(error)) => Some(error),
            Self::Ended(Ok(())) => None,
        }
    }
}

/// What an output and its thread know of each other.
#[derive(Default)]
struct Shared {
    /// How the run ended; unset, the sink is given up.
    ending: OnceLock<Ending>,
    /// Whether what it was given last is the still card.
    shows_card: AtomicBool,
    frames: AtomicU64,
    repeats: AtomicU64,
    lost: AtomicU64,
}

/// What becomes of pictures that come faster than an output takes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backpressure {
    /// They wait, and all other outputs with them.
    Block,
    /// A newer one takes the place of the one that waits.
    DropOldest,
}

impl OutputThread {
    /// Starts a thread that gives `sink` its pictures. `told` is called there once that has ended, with the number of
    /// frames that it took.
    ///
    /// # Errors
    /// The system gives no thread; the sink is given up.
    pub fn start(
        sink: Box<dyn Sink>,
        backpressure: Backpressure,
        told: impl FnOnce(u64, &Outcome) + Send + 'static,
    ) -> io::Result<Self> {
        let (to, from) = if backpressure == Backpressure::DropOldest { link::live() } else { link::lossless() };
        let (name, is_live, nodes) = (sink.describe(), sink.is_live(), sink.nodes());
        let (shared, own) = (Arc::<Shared>::default(), name.clone());
        let (tell, outcome) = mpsc::channel();
        let mine = Arc::clone(&shared);
        let serve = move || {
            // A panic is the error of this output alone.
            let ended = catch_unwind(AssertUnwindSafe(|| serve(sink, from, &mine)));
            let outcome = ended.unwrap_or_else(|panic| {
                let text = panic.downcast_ref::<&str>().copied().or(panic.downcast_ref::<String>().map(String::as_str));
                Outcome::Failed(SinkError::Panic { sink: own, what: text.unwrap_or("no reason given").into() })
            });
            told(mine.frames.load(Ordering::Relaxed), &outcome);
            // Who does not ask needs no answer.
            let _ = tell.send(outcome);
        };
        let thread = Some(thread::Builder::new().name("output".into()).spawn(serve)?);
        Ok(Self { name, is_live, to: Some(to), shared, outcome, thread, nodes })
    }

    /// Hands a picture over. Gives it back where one that blocks had no room for so long.
    pub fn send(&mut self, picture: Arc<Picture>, patience: Duration) -> Option<Arc<Picture>> {
        let sent = self.to.as_mut().map_or(Err(Abandoned), |to| to.send_timeout(picture, patience));
        match sent {
            Ok(Sent::Taken) => None,
            Ok(Sent::Displaced(_)) => {
                self.lose();
                None
            }
            Ok(Sent::Full(picture)) => Some(picture),
            Err(Abandoned) => {
                self.to = None;
                None
            }
        }
    }

    /// Counts a picture that it did not get.
    pub fn lose(&self) {
        self.shared.lost.fetch_add(1, Ordering::Relaxed);
    }

    /// Whether it still takes pictures, as far as that is known.
    pub fn is_open(&self) -> bool {
        self.to.is_some()
    }

    /// Itself, if it may still show a picture in the place of the card.
    pub fn uncovered(&self) -> Option<Uncovered> {
        let is_covered = self.shared.shows_card.load(Ordering::Acquire);
        (!is_covered).then(|| Uncovered { output: self.name.clone(), is_live: self.is_live })
    }

    /// Whether nothing more becomes of it.
    #[cfg(test)]
    pub fn has_ended(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// How it ended, if it has.
    pub fn outcome(&mut self) -> Option<Outcome> {
        match self.outcome.try_recv() {
            Ok(outcome) => Some(outcome),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Outcome::Ended(Ok(()))),
        }
    }

    /// No more pictures will come: its thread completes it.
    pub fn close(&mut self, ending: Ending) {
        let _ = self.shared.ending.set(ending);
        self.to = None;
    }

    /// Waits until it has ended. Who waits for long is told for what.
    pub fn join(mut self) -> Outcome {
        self.to = None;
        let outcome = match self.outcome.recv_timeout(PATIENCE) {
            Err(RecvTimeoutError::Timeout) => {
                tracing::warn!("{}: waiting until it is complete; Ctrl-C once more gives it up", self.name);
                self.outcome.recv().ok()
            }
            outcome => outcome.ok(),
        };
        outcome.unwrap_or(Outcome::Ended(Ok(())))
    }

    /// Reads what it did with its frames, also after its end.
    pub fn counter(&self) -> Counter<OutputUse> {
        let (output, shared) = (self.name.clone(), Arc::clone(&self.shared));
        Arc::new(move || OutputUse {
            output: output.clone(),
            frames: shared.frames.load(Ordering::Relaxed),
            repeats: shared.repeats.load(Ordering::Relaxed),
            lost: shared.lost.load(Ordering::Relaxed),
        })
    }

    pub fn nodes(&self) -> &[Counter<NodeUse>] {
        &self.nodes
    }
}

impl Drop for OutputThread {
    /// What its sink does in the end comes before whoever drops it goes on, such as to the program's end.
    fn drop(&mut self) {
        self.to = None;
        // It catches its panics.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Gives a sink what comes until nothing more does, and completes it.
fn serve(mut sink: Box<dyn Sink>, mut from: link::Receiver<Arc<Picture>>, shared: &Shared) -> Outcome {
    loop {
        let received = match sink.hold() {
            Some(hold) => from.recv_timeout(hold),
            None => from.recv().map_or(Received::Ended, Received::Item),
        };
        let flow = match received {
            Received::Item(picture) => give(&mut *sink, &picture, shared),
            Received::Nothing => sink.repeat().map(|flow| {
                let repeats = u64::from(flow == ControlFlow::Continue(true));
                shared.repeats.fetch_add(repeats, Ordering::Relaxed);
                flow.map_continue(|_| ())
            }),
            Received::Ended => break,
        };
        match flow {
            Ok(ControlFlow::Continue(())) => {}
            Ok(ControlFlow::Break(())) => {
                drop(from);
                return Outcome::Ended(sink.finish(Ending::Whole));
            }
            // Not finished: a sink that fails has kept its output itself.
            Err(error) => return Outcome::Failed(error),
        }
    }
    match shared.ending.get() {
        Some(ending) => Outcome::Ended(sink.finish(*ending)),
        None => Outcome::Ended(Ok(())),
    }
}

fn give(sink: &mut dyn Sink, picture: &Picture, shared: &Shared) -> Result<ControlFlow<()>, SinkError> {
    let Picture { image, time_ns, captured_ns, is_card } = picture;
    sink.captured(*captured_ns);
    let flow = if *is_card { sink.cover(image, *time_ns)? } else { sink.put(image, *time_ns)? };
    if flow.is_continue() {
        shared.frames.fetch_add(1, Ordering::Relaxed);
        // Release: who sees the card there sees that the sink has taken it.
        shared.shows_card.store(*is_card, Ordering::Release);
    }
    Ok(flow)
}

/// Pictures that go round: as many as all outputs hold at a time, each copied once for all of them.
#[derive(Default)]
pub(super) struct Pictures {
    all: Vec<Arc<Picture>>,
}

impl Pictures {
    /// A copy of `frame` that outputs can share. Its memory is that of a picture which none has any more, once there are
    /// such.
    pub fn share(&mut self, frame: &ColorImage, time_ns: u64, captured_ns: u64, is_card: bool) -> Arc<Picture> {
        let free = self.all.iter_mut().position(|picture| Arc::get_mut(picture).is_some());
        let at = free.unwrap_or_else(|| {
            self.all.push(Arc::new(Picture { image: ColorImage::default(), time_ns, captured_ns, is_card }));
            self.all.len() - 1
        });
        if let Some(picture) = Arc::get_mut(&mut self.all[at]) {
            let mut image = mem::take(&mut picture.image);
            image.copy_from(frame);
            *picture = Picture { image, time_ns, captured_ns, is_card };
        }
        Arc::clone(&self.all[at])
    }
}
