//! The thread's side of a node.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use pipewire::properties::properties;
use pipewire::spa::param::ParamType;
use pipewire::spa::pod::Pod;
use pipewire::spa::support::system::IoFlags;
use pipewire::spa::utils::Direction;
use pipewire::stream::{StreamFlags, StreamRc, StreamState};

use super::{Counts, Drawn, Memory, Settings, Show};
use crate::clock::Clock;
use crate::pipewire::PipeWireError;
use crate::pipewire::buffer::{self, Header};
use crate::pipewire::graph::Graph;
use crate::pipewire::session::Session;
use crate::pipewire::wake::Waker;
use crate::pipewire::{mode, param};

/// How long a node still counts as watched after its last reader left: call programs close and open cameras repeatedly.
const LINGER_NS: u64 = 500_000_000;
/// From one look for the daemon to the next, while there is none.
const RETRY: Duration = Duration::from_millis(500);

/// Gives the pictures of one node.
pub(super) struct Provider {
    settings: Settings,
    show: RefCell<Box<dyn Show>>,
    clock: Clock,
    counts: Arc<Counts>,
    /// What the graph was set going for: the next call for a picture is to be answered.
    due: Cell<Option<Due>>,
    /// What is shown already is to be shown again.
    is_again: Cell<bool>,
    is_streaming: Cell<bool>,
    /// As [`Show::watched`] was told.
    is_watched: Cell<bool>,
    /// While streaming, when the last picture was given or streaming began; else when that ended.
    since_ns: Cell<u64>,
    /// When the picture that was given last was captured, as readers were told, and when it was given.
    last: Cell<Option<(u64, u64)>>,
    sequence: Cell<u64>,
    /// Of each picture, as agreed.
    memory: Cell<Memory>,
}

/// A picture that is to be given.
#[derive(Clone, Copy)]
enum Due {
    New,
    Again,
}

/// Who waits for the node: told its name once, or why there is none.
pub(super) type Ready = mpsc::Sender<Result<String, PipeWireError>>;

impl Provider {
    pub(super) fn new(settings: Settings, show: Box<dyn Show>, counts: Arc<Counts>) -> Self {
        Self {
            show: RefCell::new(show),
            clock: Clock::system(),
            counts,
            due: Cell::new(None),
            is_again: Cell::new(false),
            is_streaming: Cell::new(false),
            is_watched: Cell::new(false),
            since_ns: Cell::new(0),
            last: Cell::new(None),
            sequence: Cell::new(0),
            memory: Cell::default(),
            settings,
        }
    }

    /// Keeps a node in the graph until `stop`.
    pub(super) fn run(mut self, waker: &Waker, stop: &AtomicBool, ready: &Ready) {
        match Session::open().and_then(|session| self.free_name(&session)) {
            Ok(name) => self.settings.name = name,
            // Who waits gives up then.
            Err(error) => return drop(ready.send(Err(error))),
        }
        let provider = Rc::new(self);
        let mut ready = Some(ready);
        while !stop.load(Ordering::Acquire) {
            let ended = provider.serve(waker, stop, &mut ready);
            provider.leave();
            match ended {
                Ok(()) if stop.load(Ordering::Acquire) => return,
                Ok(()) => tracing::warn!("PipeWire has gone; the camera {} waits for it", provider.settings.name),
                Err(error) => match ready.take() {
                    Some(ready) => return drop(ready.send(Err(error))),
                    None => tracing::debug!("{error}"),
                },
            }
            waker.wait(RETRY);
        }
    }

    /// The name, with a number where another node has it.
    fn free_name(&self, session: &Session) -> Result<String, PipeWireError> {
        let taken = Graph::of(session, |_| false)?.names;
        let name = &self.settings.name;
        let numbered = (2..).map(|number| format!("{name}-{number}"));
        let free = std::iter::once(name.clone()).chain(numbered).find(|name| !taken.contains(name));
        Ok(free.unwrap_or_else(|| name.clone()))
    }

    /// Nobody can watch any more.
    fn leave(&self) {
        self.is_streaming.set(false);
        count(&self.counts.unwatched, matches!(self.due.take(), Some(Due::New)));
        self.tell(false);
    }

    fn tell(&self, is_watched: bool) {
        if self.is_watched.replace(is_watched) != is_watched {
            tracing::info!(
                "{}: {}",
                self.settings.name,
                if is_watched { "somebody watches" } else { "nobody watches" }
            );
            self.show.borrow_mut().watched(is_watched);
        }
    }

    /// Has the node in the graph until `stop`, or until the daemon has gone.
    ///
    /// # Errors
    /// There is no daemon, or it refuses.
    fn serve(
        self: &Rc<Self>,
        waker: &Waker,
        stop: &AtomicBool,
        ready: &mut Option<&Ready>,
    ) -> Result<(), PipeWireError> {
        let session = Session::open()?;
        let Settings { name, label, modes, best, stands_for, .. } = &self.settings;
        let mut about = properties! {
            *pipewire::keys::MEDIA_CLASS => "Video/Source",
            *pipewire::keys::MEDIA_ROLE => "Camera",
            *pipewire::keys::NODE_NAME => name.as_str(),
            *pipewire::keys::NODE_DESCRIPTION => label.as_str(),
        };
        if let Some(camera) = stands_for {
            about.insert("node.link-group", crate::pipewire::group());
            about.insert("filter.smart", "true");
            about.insert("filter.smart.target", serde_json::json!({ "node.name": camera }).to_string());
        }
        let stream = StreamRc::new(session.core.clone(), name, about).map_err(PipeWireError::refused("a stream"))?;
        let failure = Rc::new(RefCell::new(None));
        let [states, formats, pictures] = std::array::from_fn(|_| Rc::clone(self));
        let failed = Rc::clone(&failure);
        let _listener = stream
            .add_local_listener::<()>()
            .state_changed(move |_, (), _, state| {
                states.state_changed(&state);
                if let StreamState::Error(cause) = state {
                    failed.replace(Some(PipeWireError::Refused { doing: "the node", cause }));
                }
            })
            .param_changed(move |stream, (), id, format| {
                // Without a format, the node is suspended, and asked again before the next reader.
                if let Some(format) = format.filter(|_| id == ParamType::Format.as_raw()) {
                    formats.agree(stream, format.as_bytes());
                }
            })
            .process(move |stream, ()| pictures.give(stream))
            .register()
            .map_err(PipeWireError::refused("to be listened to"))?;
        let formats: Vec<Vec<u8>> = modes.iter().map(|mode| param::offer(mode, best)).collect();
        let mut formats: Vec<&Pod> = formats.iter().filter_map(|format| Pod::from_bytes(format)).collect();
        // The pace of a filter is that of the camera, which drives them both.
        let drives = if stands_for.is_none() { StreamFlags::DRIVER } else { StreamFlags::empty() };
        let flags = drives | StreamFlags::MAP_BUFFERS;
        stream.connect(Direction::Output, None, flags, &mut formats).map_err(PipeWireError::refused("a node"))?;

        let (provider, bell, woken) = (Rc::clone(self), waker.clone(), stream.clone());
        let descriptor = waker.descriptor().map_err(PipeWireError::Thread)?;
        let _bell = session.event_loop().add_io(descriptor, IoFlags::IN, move |_| {
            bell.silence();
            provider.show_now(&woken);
        });
        let mut is_there = false;
        while !stop.load(Ordering::Acquire) && !session.is_lost() {
            session.serve(self.patience());
            if let Some(error) = failure.take().filter(|_| !session.is_lost()) {
                return Err(error);
            }
            if !is_there && matches!(stream.state(), StreamState::Paused | StreamState::Streaming) {
                is_there = true;
                self.arrived(ready.take());
            }
            if self.patience().is_some_and(|patience| patience.is_zero()) {
                if self.is_streaming.get() {
                    // Pictures are given by the loop alone, which has to be woken for that.
                    self.is_again.set(true);
                    self.since_ns.set(self.clock.now_ns());
                    waker.wake();
                } else {
                    self.tell(false);
                }
            }
        }
        Ok(())
    }

    /// The node is in the graph: for the first time, where somebody waits for that, or again.
    fn arrived(&self, ready: Option<&Ready>) {
        match ready {
            // Who waits may have given up.
            Some(ready) => drop(ready.send(Ok(self.settings.name.clone()))),
            None => {
                tracing::info!("PipeWire is back, and the camera {} with it", self.settings.name);
                count(&self.counts.returns, true);
            }
        }
    }

    /// How long the loop may sleep: until the last picture is to be shown again, or nobody counts as watching any more.
    fn patience(&self) -> Option<Duration> {
        let wait_ns = match (self.is_streaming.get(), self.is_watched.get()) {
            (true, _) => self.settings.hold.as_nanos() as u64,
            (false, true) => LINGER_NS,
            (false, false) => return None,
        };
        let at_ns = self.since_ns.get() + wait_ns;
        Some(Duration::from_nanos(at_ns.saturating_sub(self.clock.now_ns())))
    }

    fn state_changed(&self, state: &StreamState) {
        let is_streaming = *state == StreamState::Streaming;
        if self.is_streaming.replace(is_streaming) != is_streaming {
            self.since_ns.set(self.clock.now_ns());
        }
        if is_streaming {
            self.tell(true);
        }
    }

    /// A reader says what its pictures are to be like.
    fn agree(&self, stream: &pipewire::stream::Stream, format: &[u8]) {
        let Some(agreed) = mode::agreed(format) else { return };
        let memory = self.show.borrow_mut().begin(&agreed);
        self.memory.set(memory);
        let pods = [param::buffers(memory.bytes as i32, memory.stride as i32), param::header()];
        let mut pods: Vec<&Pod> = pods.iter().filter_map(|pod| Pod::from_bytes(pod)).collect();
        if let Err(error) = stream.update_params(&mut pods) {
            tracing::warn!("{}: PipeWire refused the buffers: {error}", self.settings.name);
        }
    }

    /// Sets the graph going if there is something to show, and somebody to see it.
    fn show_now(&self, stream: &StreamRc) {
        let is_new = self.show.borrow_mut().update();
        let due = match (is_new, self.is_again.take()) {
            (true, _) => Due::New,
            (false, true) => Due::Again,
            (false, false) => return,
        };
        if !self.is_streaming.get() {
            return count(&self.counts.unwatched, is_new);
        }
        // Where another node drives the graph, one may not have been asked for yet.
        let is_overtaken = matches!((self.due.get(), due), (Some(Due::New), Due::New));
        count(&self.counts.overtaken, is_overtaken);
        if is_new || self.due.get().is_none() {
            self.due.set(Some(due));
        }
        // Calls `give` before it returns, or asks who drives the graph.
        if let Err(error) = stream.trigger_process() {
            tracing::debug!("{}: PipeWire refused a picture: {error}", self.settings.name);
        }
    }

    /// Gives the picture that is due.
    fn give(&self, stream: &pipewire::stream::Stream) {
        let Some(due) = self.due.take() else { return };
        let Memory { bytes, stride } = self.memory.get();
        let is_given = buffer::give(stream, bytes, stride as i32, |frame| {
            let Drawn { bytes, captured_ns } = self.show.borrow_mut().draw(frame);
            (bytes, self.header(captured_ns))
        });
        match (due, is_given) {
            (Due::New, true) => count(&self.counts.shown, true),
            (Due::New, false) => count(&self.counts.no_buffer, true),
            (Due::Again, _) => count(&self.counts.repeats, is_given),
        }
        self.since_ns.set(self.clock.now_ns());
    }

    /// Number and time of the next picture. Times only go on: what is shown again is as much later as it is shown later.
    fn header(&self, captured_ns: Option<u64>) -> Header {
        let now_ns = self.clock.now_ns();
        let told_ns = match (captured_ns, self.last.get()) {
            (Some(captured_ns), _) => captured_ns,
            (None, Some((told_ns, given_ns))) => told_ns + (now_ns - given_ns),
            (None, None) => now_ns,
        };
        let told_ns = self.last.get().map_or(told_ns, |(last_ns, _)| told_ns.max(last_ns + 1));
        self.last.set(Some((told_ns, now_ns)));
        let sequence = self.sequence.get();
        self.sequence.set(sequence + 1);
        Header { captured_ns: told_ns, sequence }
    }
}

fn count(counter: &AtomicU64, it_is: bool) {
    counter.fetch_add(u64::from(it_is), Ordering::Relaxed);
}
