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

use super::{Counts, DrawnPicture, PictureMemory, PictureSource, Settings};
use crate::pipewire::buffer::{self, Header};
use crate::pipewire::graph::Graph;
use crate::pipewire::session::Session;
use crate::pipewire::wake::Waker;
use crate::pipewire::{PipeWireError, Result};
use crate::pipewire::{mode, param};
use bokehcam::clock::Clock;

/// Time for which a node still counts as watched after its last reader left: call programs close and open cameras
/// repeatedly.
const WATCH_HOLD_NS: u64 = 500_000_000;
/// Period between attempts to reconnect to the daemon.
const RETRY_PERIOD: Duration = Duration::from_millis(500);

/// Provides the pictures of one node.
pub(super) struct Provider {
    settings: Settings,
    pictures: RefCell<Box<dyn PictureSource>>,
    clock: Clock,
    counts: Arc<Counts>,
    /// The picture for the next process callback, for which the graph was triggered.
    pending: Cell<Option<Pending>>,
    /// Whether the last picture has to be repeated.
    repeat: Cell<bool>,
    is_streaming: Cell<bool>,
    /// The last value passed to [`PictureSource::set_watched`].
    is_watched: Cell<bool>,
    /// While streaming, when the last picture was delivered or streaming started; else when streaming ended.
    since_ns: Cell<u64>,
    /// Stated capture time of the last picture, and when it was delivered.
    last: Cell<Option<(u64, u64)>>,
    sequence: Cell<u64>,
    /// Memory of each picture, as negotiated.
    memory: Cell<PictureMemory>,
}

/// A picture to be delivered.
#[derive(Clone, Copy)]
enum Pending {
    New,
    Again,
}

/// Channel that receives, once, the node's name, or the error.
pub(super) type Ready = mpsc::Sender<Result<String>>;

impl Provider {
    pub(super) fn new(settings: Settings, pictures: Box<dyn PictureSource>, counts: Arc<Counts>) -> Self {
        Self {
            pictures: RefCell::new(pictures),
            clock: Clock::system(),
            counts,
            pending: Cell::new(None),
            repeat: Cell::new(false),
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
        match Session::open().and_then(|session| self.find_free_name(&session)) {
            Ok(name) => self.settings.name = name,
            // The receiver then gives up.
            Err(error) => return drop(ready.send(Err(error))),
        }
        let provider = Rc::new(self);
        let mut ready = Some(ready);
        while !stop.load(Ordering::Acquire) {
            let ended = provider.run_connection(waker, stop, &mut ready);
            provider.handle_disconnect();
            match ended {
                Ok(()) if stop.load(Ordering::Acquire) => return,
                Ok(()) => {
                    tracing::warn!("PipeWire has stopped; the camera {} waits for its return", provider.settings.name)
                }
                Err(error) => match ready.take() {
                    Some(ready) => return drop(ready.send(Err(error))),
                    None => tracing::debug!("{error}"),
                },
            }
            waker.wait(RETRY_PERIOD);
        }
    }

    /// Returns the name, with a number appended if another node has it.
    fn find_free_name(&self, session: &Session) -> Result<String> {
        let taken = Graph::list_objects(session, |_| false)?.names;
        let name = &self.settings.name;
        let numbered = (2..).map(|number| format!("{name}-{number}"));
        let free = std::iter::once(name.clone()).chain(numbered).find(|name| !taken.contains(name));
        Ok(free.unwrap_or_else(|| name.clone()))
    }

    /// Marks the node as unwatched, since it left the graph.
    fn handle_disconnect(&self) {
        self.is_streaming.set(false);
        count_if(&self.counts.unwatched, matches!(self.pending.take(), Some(Pending::New)));
        self.set_watched(false);
    }

    fn set_watched(&self, is_watched: bool) {
        if self.is_watched.replace(is_watched) != is_watched {
            tracing::info!(
                "{}: {}",
                self.settings.name,
                if is_watched { "a program reads the camera" } else { "no program reads the camera" }
            );
            self.pictures.borrow_mut().set_watched(is_watched);
        }
    }

    /// Keeps the node in the graph until `stop`, or until the connection is lost.
    ///
    /// # Errors
    /// The daemon does not run, or refuses.
    fn run_connection(self: &Rc<Self>, waker: &Waker, stop: &AtomicBool, ready: &mut Option<&Ready>) -> Result<()> {
        let session = Session::open()?;
        let stream = self.create_stream(&session)?;
        let failure = Rc::new(RefCell::new(None));
        let [states, formats, pictures] = std::array::from_fn(|_| Rc::clone(self));
        let failed = Rc::clone(&failure);
        let _listener = stream
            .add_local_listener::<()>()
            .state_changed(move |_, (), _, state| {
                states.handle_state(&state);
                if let StreamState::Error(cause) = state {
                    failed.replace(Some(PipeWireError::Refused { doing: "the node", cause }));
                }
            })
            .param_changed(move |stream, (), id, format| {
                // Without a format, the node is suspended; a format is negotiated before the next reader.
                if let Some(format) = format.filter(|_| id == ParamType::Format.as_raw()) {
                    formats.handle_format(stream, format.as_bytes());
                }
            })
            .process(move |stream, ()| pictures.deliver_picture(stream))
            .register()
            .map_err(PipeWireError::refused("to be listened to"))?;
        let Settings { modes, best, filter_target, .. } = &self.settings;
        let formats: Vec<Vec<u8>> = modes.iter().map(|mode| param::build_offer(mode, best)).collect();
        let mut formats: Vec<&Pod> = formats.iter().filter_map(|format| Pod::from_bytes(format)).collect();
        // A filter runs at the pace of the camera, which drives both.
        let driver_flag = if filter_target.is_none() { StreamFlags::DRIVER } else { StreamFlags::empty() };
        let flags = driver_flag | StreamFlags::MAP_BUFFERS;
        stream.connect(Direction::Output, None, flags, &mut formats).map_err(PipeWireError::refused("a node"))?;

        let (provider, waker_handle, woken) = (Rc::clone(self), waker.clone(), stream.clone());
        let descriptor = waker.descriptor().map_err(PipeWireError::Thread)?;
        let _wake_source = session.event_loop().add_io(descriptor, IoFlags::IN, move |_| {
            waker_handle.clear();
            provider.trigger_graph(&woken);
        });
        let mut is_ready_reported = false;
        while !stop.load(Ordering::Acquire) && !session.is_lost() {
            session.iterate(self.next_timeout());
            if let Some(error) = failure.take().filter(|_| !session.is_lost()) {
                return Err(error);
            }
            if !is_ready_reported && matches!(stream.state(), StreamState::Paused | StreamState::Streaming) {
                is_ready_reported = true;
                self.report_ready(ready.take());
            }
            if self.next_timeout().is_some_and(|timeout| timeout.is_zero()) {
                self.handle_timeout(waker);
            }
        }
        Ok(())
    }

    /// Repeats the last picture for the readers, or notes that there are none any more.
    fn handle_timeout(&self, waker: &Waker) {
        if self.is_streaming.get() {
            // Only the loop delivers pictures, so it has to be woken.
            self.repeat.set(true);
            self.since_ns.set(self.clock.now_ns());
            waker.wake();
        } else {
            self.set_watched(false);
        }
    }

    fn create_stream(&self, session: &Session) -> Result<StreamRc> {
        let Settings { name, label, filter_target, .. } = &self.settings;
        let mut props = properties! {
            *pipewire::keys::MEDIA_CLASS => "Video/Source",
            *pipewire::keys::MEDIA_ROLE => "Camera",
            *pipewire::keys::NODE_NAME => name.as_str(),
            *pipewire::keys::NODE_DESCRIPTION => label.as_str(),
        };
        if let Some(camera) = filter_target {
            props.insert("node.link-group", crate::pipewire::link_group());
            props.insert("filter.smart", "true");
            props.insert("filter.smart.target", serde_json::json!({ "node.name": camera }).to_string());
        }
        StreamRc::new(session.core.clone(), name, props).map_err(PipeWireError::refused("a stream"))
    }

    /// Reports that the node is in the graph: to the receiver for the first time, or in the log after a reconnection.
    fn report_ready(&self, ready: Option<&Ready>) {
        match ready {
            // The receiver may have timed out.
            Some(ready) => drop(ready.send(Ok(self.settings.name.clone()))),
            None => {
                tracing::info!("PipeWire is back, and the camera {} with it", self.settings.name);
                count_if(&self.counts.reconnections, true);
            }
        }
    }

    /// Returns how long the loop may sleep: until the last picture has to be repeated, or the node no longer counts as
    /// watched.
    fn next_timeout(&self) -> Option<Duration> {
        let wait_ns = match (self.is_streaming.get(), self.is_watched.get()) {
            (true, _) => self.settings.hold.as_nanos() as u64,
            (false, true) => WATCH_HOLD_NS,
            (false, false) => return None,
        };
        let at_ns = self.since_ns.get() + wait_ns;
        Some(Duration::from_nanos(at_ns.saturating_sub(self.clock.now_ns())))
    }

    fn handle_state(&self, state: &StreamState) {
        let is_streaming = *state == StreamState::Streaming;
        if self.is_streaming.replace(is_streaming) != is_streaming {
            self.since_ns.set(self.clock.now_ns());
        }
        if is_streaming {
            self.set_watched(true);
        }
    }

    /// Applies the format that a reader negotiated.
    fn handle_format(&self, stream: &pipewire::stream::Stream, format: &[u8]) {
        let Some(negotiated) = mode::parse_negotiated(format) else { return };
        let memory = self.pictures.borrow_mut().set_format(&negotiated);
        self.memory.set(memory);
        let pods = [param::build_buffers(memory.bytes as i32, memory.stride as i32), param::build_header_request()];
        let mut pods: Vec<&Pod> = pods.iter().filter_map(|pod| Pod::from_bytes(pod)).collect();
        if let Err(error) = stream.update_params(&mut pods) {
            tracing::warn!("{}: PipeWire refused the buffers: {error}", self.settings.name);
        }
    }

    /// Triggers the graph if there is a picture to show and a reader.
    fn trigger_graph(&self, stream: &StreamRc) {
        let is_new = self.pictures.borrow_mut().update();
        let pending = match (is_new, self.repeat.take()) {
            (true, _) => Pending::New,
            (false, true) => Pending::Again,
            (false, false) => return,
        };
        if !self.is_streaming.get() {
            return count_if(&self.counts.unwatched, is_new);
        }
        // Where another node drives the graph, the previous picture may not have been requested yet.
        let is_overtaken = matches!((self.pending.get(), pending), (Some(Pending::New), Pending::New));
        count_if(&self.counts.overtaken, is_overtaken);
        if is_new || self.pending.get().is_none() {
            self.pending.set(Some(pending));
        }
        // Calls `deliver_picture` before it returns, or requests a cycle from the driver.
        if let Err(error) = stream.trigger_process() {
            tracing::debug!("{}: PipeWire refused a picture: {error}", self.settings.name);
        }
    }

    /// Delivers the picture that is due.
    fn deliver_picture(&self, stream: &pipewire::stream::Stream) {
        let Some(pending) = self.pending.take() else { return };
        let PictureMemory { bytes, stride } = self.memory.get();
        let delivered = buffer::write_frame(stream, bytes, stride as i32, |frame| {
            let DrawnPicture { bytes, captured_ns } = self.pictures.borrow_mut().draw_picture(frame);
            (bytes, self.next_header(captured_ns))
        });
        match (pending, delivered) {
            (Pending::New, true) => count_if(&self.counts.shown, true),
            (Pending::New, false) => count_if(&self.counts.no_buffer, true),
            (Pending::Again, _) => count_if(&self.counts.repeats, delivered),
        }
        self.since_ns.set(self.clock.now_ns());
    }

    /// Creates the header of the next picture. Times strictly increase: a repeated picture's time advances by the time
    /// since its last delivery.
    fn next_header(&self, captured_ns: Option<u64>) -> Header {
        let now_ns = self.clock.now_ns();
        let stamp_ns = match (captured_ns, self.last.get()) {
            (Some(captured_ns), _) => captured_ns,
            (None, Some((stamp_ns, delivered_ns))) => stamp_ns + (now_ns - delivered_ns),
            (None, None) => now_ns,
        };
        let stamp_ns = self.last.get().map_or(stamp_ns, |(last_ns, _)| stamp_ns.max(last_ns + 1));
        self.last.set(Some((stamp_ns, now_ns)));
        let sequence = self.sequence.get();
        self.sequence.set(sequence + 1);
        Header { captured_ns: stamp_ns, sequence }
    }
}

fn count_if(counter: &AtomicU64, is_one: bool) {
    counter.fetch_add(u64::from(is_one), Ordering::Relaxed);
}
