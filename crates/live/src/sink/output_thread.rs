//! An output on a thread of its own, so that no output waits for another.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, TryRecvError};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use std::{io, mem};

use super::{Counter, Ending, OutputWithoutCard, Sink, SinkError, Written};
use crate::stats::{NodeCounts, OutputCounts};
use bokehcam::compute::panic_message;
use bokehcam::frame::ColorImage;
use bokehcam::frame::fit::Letterbox;
use bokehcam::link::{self, Abandoned, Received, Sender, Sent};

/// An output that takes longer than this to complete is reported to the user, who waits for it.
const WAIT_NOTICE_DELAY: Duration = Duration::from_secs(3);

/// A sink on a thread of its own, and the link that delivers its pictures.
pub(super) struct OutputThread {
    pub name: String,
    /// Whether its pictures are seen as they come.
    pub is_live: bool,
    /// Whether its sink keeps an alpha channel.
    pub keeps_alpha: bool,
    /// `None` once no more pictures will come.
    sender: Option<Sender<Arc<Picture>>>,
    shared: Arc<Shared>,
    outcome: Receiver<Outcome>,
    thread: Option<JoinHandle<()>>,
    node_counters: Vec<Counter<NodeCounts>>,
}

/// A picture shared by several outputs.
pub(super) struct Picture {
    image: ColorImage,
    /// Its alpha channel; empty if it has none.
    alpha: Vec<u8>,
    /// Time by the clock of the source.
    time_ns: u64,
    /// Capture time by the clock of the run.
    captured_ns: u64,
    /// Whether this is the still card.
    is_card: bool,
}

/// How an output ended.
pub(super) enum Outcome {
    /// The sink failed while frames came.
    Failed(SinkError),
    /// The sink was completed, or its reader had gone.
    Ended(Result<(), SinkError>),
}

impl Outcome {
    /// Returns the error, if there was one.
    pub fn error(self) -> Option<SinkError> {
        match self {
            Self::Failed(error) | Self::Ended(Err(error)) => Some(error),
            Self::Ended(Ok(())) => None,
        }
    }
}

/// State shared by an output and its thread.
#[derive(Default)]
struct Shared {
    /// How the run ended; if unset, the sink is aborted.
    ending: OnceLock<Ending>,
    /// Whether the last picture was the still card.
    shows_card: AtomicBool,
    frames: AtomicU64,
    repeats: AtomicU64,
    lost: AtomicU64,
}

/// Policy for pictures that come faster than an output accepts them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backpressure {
    /// They wait, and all other outputs with them.
    Block,
    /// A newer picture replaces the waiting one.
    DropOldest,
}

impl OutputThread {
    /// Starts a thread that passes pictures to `sink`, and calls `on_end` once the sink has ended, with the number of
    /// frames received. Pictures of another size than `size` are scaled into it.
    ///
    /// # Errors
    /// The system refuses the thread; the sink is aborted.
    pub fn start(
        sink: Box<dyn Sink>,
        backpressure: Backpressure,
        size: Option<(u32, u32)>,
        on_end: impl FnOnce(u64, &Outcome) + Send + 'static,
    ) -> io::Result<Self> {
        let (sender, receiver) = if backpressure == Backpressure::DropOldest { link::live() } else { link::lossless() };
        let (name, is_live, node_counters) = (sink.describe(), sink.is_live(), sink.node_counters());
        let keeps_alpha = sink.keeps_alpha();
        let (shared, sink_name) = (Arc::<Shared>::default(), name.clone());
        let (outcome_sender, outcome) = mpsc::channel();
        let thread_shared = Arc::clone(&shared);
        // A live output scales pictures itself, into the size that its readers ask for.
        let fit = size.filter(|_| !is_live).map(Fit::new);
        let run = move || {
            // A panic is an error of this output only.
            let ended = catch_unwind(AssertUnwindSafe(|| serve_sink(sink, receiver, fit, &thread_shared)));
            let outcome = ended.unwrap_or_else(|panic| {
                Outcome::Failed(SinkError::Panic { sink: sink_name, what: panic_message(&*panic).into() })
            });
            on_end(thread_shared.frames.load(Ordering::Relaxed), &outcome);
            // The receiver may be gone.
            let _ = outcome_sender.send(outcome);
        };
        let thread = Some(thread::Builder::new().name("output".into()).spawn(run)?);
        Ok(Self { name, is_live, keeps_alpha, sender: Some(sender), shared, outcome, thread, node_counters })
    }

    /// Sends a picture. Returns it if a blocking output had no space within `timeout`.
    pub fn send(&mut self, picture: Arc<Picture>, timeout: Duration) -> Option<Arc<Picture>> {
        let sent = self.sender.as_mut().map_or(Err(Abandoned), |sender| sender.send_timeout(picture, timeout));
        match sent {
            Ok(Sent::Taken) => None,
            Ok(Sent::Displaced(_)) => {
                self.count_lost();
                None
            }
            Ok(Sent::Full(picture)) => Some(picture),
            Err(Abandoned) => {
                self.sender = None;
                None
            }
        }
    }

    /// Counts a picture that it did not get.
    pub fn count_lost(&self) {
        self.shared.lost.fetch_add(1, Ordering::Relaxed);
    }

    /// Whether it still accepts pictures, as far as is known.
    pub fn is_open(&self) -> bool {
        self.sender.is_some()
    }

    /// Returns this output, if it may still show a picture instead of the card.
    pub fn without_card(&self) -> Option<OutputWithoutCard> {
        let shows_card = self.shared.shows_card.load(Ordering::Acquire);
        (!shows_card).then(|| OutputWithoutCard { output: self.name.clone(), is_live: self.is_live })
    }

    /// Whether its thread has ended.
    #[cfg(test)]
    pub fn has_ended(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Returns how it ended, if it has.
    pub fn try_outcome(&mut self) -> Option<Outcome> {
        match self.outcome.try_recv() {
            Ok(outcome) => Some(outcome),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Outcome::Ended(Ok(()))),
        }
    }

    /// Signals that no more pictures will come: its thread completes the sink.
    pub fn close(&mut self, ending: Ending) {
        let _ = self.shared.ending.set(ending);
        self.sender = None;
    }

    /// Waits until it has ended; logs a long wait.
    pub fn join(mut self) -> Outcome {
        self.sender = None;
        let outcome = match self.outcome.recv_timeout(WAIT_NOTICE_DELAY) {
            Err(RecvTimeoutError::Timeout) => {
                tracing::warn!("{}: waiting until it is complete; press Ctrl-C again to give up", self.name);
                self.outcome.recv().ok()
            }
            outcome => outcome.ok(),
        };
        outcome.unwrap_or(Outcome::Ended(Ok(())))
    }

    /// Creates a counter of its frames, which stays valid after its end.
    pub fn create_counter(&self) -> Counter<OutputCounts> {
        let (output, shared) = (self.name.clone(), Arc::clone(&self.shared));
        Arc::new(move || OutputCounts {
            output: output.clone(),
            frames: shared.frames.load(Ordering::Relaxed),
            repeats: shared.repeats.load(Ordering::Relaxed),
            lost: shared.lost.load(Ordering::Relaxed),
        })
    }

    pub fn node_counters(&self) -> &[Counter<NodeCounts>] {
        &self.node_counters
    }
}

impl Drop for OutputThread {
    /// Waits for the sink's end before the caller continues, for example to the program's end.
    fn drop(&mut self) {
        self.sender = None;
        // It catches its panics.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Passes pictures to a sink until no more come, and completes it.
fn serve_sink(
    mut sink: Box<dyn Sink>,
    mut receiver: link::Receiver<Arc<Picture>>,
    mut fit: Option<Fit>,
    shared: &Shared,
) -> Outcome {
    loop {
        let received = match sink.repeat_interval() {
            Some(interval) => receiver.recv_timeout(interval),
            None => receiver.recv().map_or(Received::Ended, Received::Item),
        };
        let flow = match received {
            Received::Item(picture) => write_picture(&mut *sink, &picture, fit.as_mut(), shared),
            Received::Nothing => sink.repeat_frame().map(|flow| {
                let repeats = u64::from(flow == ControlFlow::Continue(true));
                shared.repeats.fetch_add(repeats, Ordering::Relaxed);
                flow.map_continue(|_| ())
            }),
            Received::Ended => match shared.ending.get() {
                Some(ending) => return Outcome::Ended(sink.finish(*ending)),
                None => return Outcome::Ended(Ok(())),
            },
        };
        match flow {
            Ok(ControlFlow::Continue(())) => {}
            Ok(ControlFlow::Break(())) => {
                drop(receiver);
                return Outcome::Ended(sink.finish(Ending::Complete));
            }
            // Not finished: a sink that fails has kept its output itself.
            Err(error) => return Outcome::Failed(error),
        }
    }
}

fn write_picture(sink: &mut dyn Sink, picture: &Picture, fit: Option<&mut Fit>, shared: &Shared) -> Written {
    let Picture { image, alpha, time_ns, captured_ns, is_card } = picture;
    sink.set_capture_time(*captured_ns);
    let fitted = fit.map_or(image, |fit| fit.apply(image));
    // A picture that had to be scaled is of another source, and comes without its alpha channel.
    let has_alpha = !alpha.is_empty() && fitted.size() == image.size();
    let flow = match (*is_card, has_alpha) {
        (true, _) => sink.write_card(fitted, *time_ns)?,
        (false, false) => sink.write_frame(fitted, *time_ns)?,
        (false, true) => sink.write_with_alpha(fitted, alpha, *time_ns)?,
    };
    if flow.is_continue() {
        shared.frames.fetch_add(1, Ordering::Relaxed);
        // ShutterControl: a reader that sees the card here also sees that the sink has received it.
        shared.shows_card.store(*is_card, Ordering::Release);
    }
    Ok(flow)
}

/// Scales the pictures of later sources to the size of the first one, with which the output was opened.
struct Fit {
    size: (u32, u32),
    letterbox: Letterbox,
    fitted: ColorImage,
}

impl Fit {
    fn new(size: (u32, u32)) -> Self {
        Self { size, letterbox: Letterbox::default(), fitted: ColorImage::default() }
    }

    fn apply<'a>(&'a mut self, image: &'a ColorImage) -> &'a ColorImage {
        if image.size() == self.size {
            return image;
        }
        self.fitted.resize(self.size.0, self.size.1);
        self.letterbox.fit(image, &mut self.fitted);
        &self.fitted
    }
}

/// A pool of pictures, sized by the number that the outputs hold at a time; each is copied once for all outputs.
#[derive(Default)]
pub(super) struct PicturePool {
    pictures: Vec<Arc<Picture>>,
}

impl PicturePool {
    /// Copies `frame`, with its alpha channel if that is not empty, to a picture that outputs can share. Reuses a picture
    /// that no output holds any more, if there is one.
    pub fn copy_frame(
        &mut self,
        (frame, frame_alpha): (&ColorImage, &[u8]),
        (time_ns, captured_ns): (u64, u64),
        is_card: bool,
    ) -> Arc<Picture> {
        let free = self.pictures.iter_mut().position(|picture| Arc::get_mut(picture).is_some());
        let at = free.unwrap_or_else(|| {
            let (image, alpha) = Default::default();
            self.pictures.push(Arc::new(Picture { image, alpha, time_ns, captured_ns, is_card }));
            self.pictures.len() - 1
        });
        if let Some(picture) = Arc::get_mut(&mut self.pictures[at]) {
            let (mut image, mut alpha) = (mem::take(&mut picture.image), mem::take(&mut picture.alpha));
            image.copy_from(frame);
            alpha.clear();
            alpha.extend_from_slice(frame_alpha);
            *picture = Picture { image, alpha, time_ns, captured_ns, is_card };
        }
        Arc::clone(&self.pictures[at])
    }
}
