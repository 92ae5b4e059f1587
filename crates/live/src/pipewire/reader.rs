//! Reads pictures from a PipeWire camera, and recovers when the camera or the daemon disappears and returns.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use pipewire::buffer::Buffer;
use pipewire::properties::properties;
use pipewire::spa::buffer::meta::{MetaHeader, MetaHeaderFlags};
use pipewire::spa::param::ParamType;
use pipewire::spa::pod::Pod;
use pipewire::spa::support::system::IoFlags;
use pipewire::spa::utils::Direction;
use pipewire::stream::{Stream, StreamFlags, StreamRc, StreamState};

use super::graph::{Camera, Graph};
use super::memory::BufferMemory;
use super::mode::{self, Mode, NegotiatedFormat};
use super::param;
use super::session::Session;
use super::wake::{Waker, WokenThread};
use super::{PipeWireError, Result};
use bokehcam::clock::Clock;

/// Longest wait for a camera's first format, from the request on.
const TIMEOUT: Duration = Duration::from_secs(8);
/// Period between attempts to find a camera that has disappeared.
const RETRY_PERIOD: Duration = Duration::from_millis(500);
/// Wait while no pictures are requested: only a stop or a request ends it.
const IDLE_WAIT: Duration = Duration::from_secs(3600);
/// Number of periods, and at least a second, without a picture after which a stream counts as stalled.
const TIMEOUT_PERIODS: u64 = 5;
const MIN_TIMEOUT_NS: u64 = 1_000_000_000;
/// An older capture time does not come from the system's monotonic clock.
const MAX_AGE_NS: u64 = 10_000_000_000;
/// A longer gap in a camera's sequence numbers is a restart of the count, not a loss.
const MAX_MISSED: u64 = 1000;

/// A picture in PipeWire's memory.
pub struct Frame<'a> {
    /// The used bytes of each plane.
    pub planes: &'a [&'a [u8]],
    /// Bytes per row of each plane; 0 if not stated.
    pub strides_bytes: &'a [usize],
    /// Capture time on the system's monotonic clock.
    pub captured_ns: u64,
}

/// Receives a camera's pictures. All methods are called on the reader's thread.
pub trait PictureHandler: Send + 'static {
    /// Selects the mode to request from those that the camera offers.
    ///
    /// # Errors
    /// None of them is usable: a one-line message.
    fn choose_mode(&mut self, modes: &[Mode]) -> Result<NegotiatedFormat, String>;

    /// Sets the format of the following pictures.
    fn set_format(&mut self, negotiated: &NegotiatedFormat);

    /// Receives a picture.
    fn handle_frame(&mut self, frame: &Frame);

    /// Counts pictures that were lost unread and pictures that are damaged.
    fn add_losses(&mut self, missed: u64, stale: u64, corrupt: u64);
}

/// Reads from one camera until it is dropped.
#[derive(Debug)]
pub struct Reader {
    thread: WokenThread,
    is_wanted: Arc<AtomicBool>,
}

/// Channel that receives, once, the camera and its format, or the error.
type Ready = mpsc::Sender<Result<(Camera, NegotiatedFormat)>>;

impl Reader {
    /// Starts to read from the camera that `name` refers to: its identifying name, its label, or a part of either. With
    /// `filters`, its pictures go to the clients that requested this camera, through a node of this program that stands
    /// in for it: they arrive only while that node has readers.
    ///
    /// # Errors
    /// The daemon does not run, no camera matches, or it offers no usable mode.
    pub fn new(name: &str, filters: bool, handler: impl PictureHandler) -> Result<(Self, Camera, NegotiatedFormat)> {
        let is_wanted = Arc::new(AtomicBool::new(true));
        let (ready, is_ready) = mpsc::channel();
        let listener = Listener {
            handler: RefCell::new(Box::new(handler)),
            clock: Clock::system(),
            ready: RefCell::new(Some(ready)),
            camera: RefCell::new(None),
            negotiated: Cell::new(None),
            last_ns: Cell::new(0),
            sequence: Cell::new(None),
            outage_since_ns: Cell::new(None),
            filters,
        };
        let (wanted, owned_name) = (Arc::clone(&is_wanted), name.to_owned());
        let run = move |waker: &Waker, stop: &AtomicBool| Rc::new(listener).run(&owned_name, waker, [stop, &wanted]);
        let reader = Self { thread: WokenThread::start("pipewire", run)?, is_wanted };
        let (camera, negotiated) =
            is_ready.recv_timeout(TIMEOUT).map_err(|_| PipeWireError::NoPictures { name: name.to_owned() })??;
        Ok((reader, camera, negotiated))
    }

    /// Sets whether pictures are requested; while they are not, the camera is released.
    pub fn set_wanted(&self, wanted: bool) {
        if self.is_wanted.swap(wanted, Ordering::AcqRel) != wanted {
            self.thread.waker.wake();
        }
    }
}

/// The thread's side of a reader.
struct Listener {
    handler: RefCell<Box<dyn PictureHandler>>,
    clock: Clock,
    /// Set until the first format is negotiated.
    ready: RefCell<Option<Ready>>,
    camera: RefCell<Option<Camera>>,
    negotiated: Cell<Option<NegotiatedFormat>>,
    /// When the last picture arrived, or the stream started.
    last_ns: Cell<u64>,
    /// The camera's sequence number of the last picture.
    sequence: Cell<Option<u64>>,
    /// Start of the current outage, if it was reported.
    outage_since_ns: Cell<Option<u64>>,
    /// Whether the pictures go to the clients that requested the camera.
    filters: bool,
}

impl Listener {
    fn run(self: Rc<Self>, name: &str, waker: &Waker, [stop, wanted]: [&AtomicBool; 2]) {
        while !stop.load(Ordering::Acquire) {
            if !wanted.load(Ordering::Acquire) {
                waker.wait(IDLE_WAIT);
                continue;
            }
            let is_first = self.ready.borrow().is_some();
            let ended = self.run_connection(name, waker, [stop, wanted]);
            // The first connection of a filter only learns the format; the next one is passive.
            if self.filters && is_first && self.ready.borrow().is_none() {
                continue;
            }
            if stop.load(Ordering::Acquire) || !wanted.load(Ordering::Acquire) {
                continue;
            }
            if let Some(ready) = self.ready.take() {
                let error = ended.err().unwrap_or(PipeWireError::NoPictures { name: name.to_owned() });
                return drop(ready.send(Err(error)));
            }
            if self.outage_since_ns.get().is_none() {
                self.outage_since_ns.set(Some(self.clock.now_ns()));
                let why = ended.err().map_or_else(|| "it gives no more pictures".to_owned(), |error| error.to_string());
                tracing::warn!("{}: {why}; waiting for it to come back", self.name());
            }
            waker.wait(RETRY_PERIOD);
        }
    }

    fn name(&self) -> String {
        self.camera.borrow().as_ref().map_or_else(String::new, |camera| format!("pipewire:{}", camera.name))
    }

    /// Reads until the stream ends, or no pictures are requested.
    ///
    /// # Errors
    /// The daemon or the camera is absent, or refuses.
    fn run_connection(self: &Rc<Self>, name: &str, waker: &Waker, [stop, wanted]: [&AtomicBool; 2]) -> Result<()> {
        let session = Session::open()?;
        // Once a camera was found, only that one is accepted.
        let known = self.camera.borrow().as_ref().map(|camera| camera.name.clone());
        let camera = Graph::find_camera(&session, known.as_deref().unwrap_or(name), known.is_some())?;
        let refused = |why| PipeWireError::NoMode { name: camera.name.clone(), why };
        let requested = self.handler.borrow_mut().choose_mode(&camera.modes).map_err(refused)?;
        // A camera states its format only to readers that keep it running.
        let is_passive = self.filters && self.ready.borrow().is_none();
        let stream = self.create_stream(&session, &camera, is_passive)?;
        self.camera.replace(Some(camera));
        let has_ended = Rc::new(Cell::new(false));
        let [formats, pictures] = std::array::from_fn(|_| Rc::clone(self));
        let ended = Rc::clone(&has_ended);
        let memory = Rc::new(RefCell::new(BufferMemory::default()));
        let removed = Rc::clone(&memory);
        let _listener = stream
            .add_local_listener::<()>()
            .state_changed(move |_, (), old, state| {
                let is_pausing = (old, &state) == (StreamState::Streaming, &StreamState::Paused);
                // A passive stream is paused while there are no readers.
                let has_ended_now =
                    matches!(state, StreamState::Error(_) | StreamState::Unconnected) || is_pausing && !is_passive;
                ended.set(ended.get() || has_ended_now);
            })
            .param_changed(move |stream, (), id, format| {
                if let Some(format) = format.filter(|_| id == ParamType::Format.as_raw()) {
                    formats.handle_format(stream, format.as_bytes());
                }
            })
            .remove_buffer(move |_, (), _| removed.borrow_mut().clear())
            .process(move |stream, ()| pictures.receive_newest(stream, &mut memory.borrow_mut()))
            .register()
            .map_err(PipeWireError::refused("to be listened to"))?;
        let format = param::build_format(&requested);
        let mut formats: Vec<&Pod> = Pod::from_bytes(&format).into_iter().collect();
        let flags = StreamFlags::AUTOCONNECT | StreamFlags::DONT_RECONNECT;
        stream.connect(Direction::Input, None, flags, &mut formats).map_err(PipeWireError::refused("a reader"))?;
        let (waker_handle, descriptor) = (waker.clone(), waker.descriptor().map_err(PipeWireError::Thread)?);
        let _wake_source = session.event_loop().add_io(descriptor, IoFlags::IN, move |_| waker_handle.clear());

        self.last_ns.set(self.clock.now_ns());
        self.sequence.set(None);
        while !stop.load(Ordering::Acquire)
            && wanted.load(Ordering::Acquire)
            && self.wait_for_picture(&session, &stream, is_passive, &has_ended)
        {}
        Ok(())
    }

    fn create_stream(&self, session: &Session, camera: &Camera, is_passive: bool) -> Result<StreamRc> {
        let mut props = properties! {
            *pipewire::keys::MEDIA_TYPE => "Video",
            *pipewire::keys::MEDIA_CATEGORY => "Capture",
            *pipewire::keys::MEDIA_ROLE => "Camera",
            // Other programs would take a node with the name `bokehcam` for a camera.
            *pipewire::keys::NODE_NAME => "bokehcam-reader",
            "target.object" => camera.serial.as_str(),
        };
        if self.filters {
            props.insert("node.link-group", super::link_group());
        }
        if is_passive {
            props.insert("node.passive", "in");
        }
        StreamRc::new(session.core.clone(), "bokehcam", props).map_err(PipeWireError::refused("a stream"))
    }

    /// Lets the stream run until a picture came, or is overdue; returns whether it goes on.
    fn wait_for_picture(&self, session: &Session, stream: &Stream, is_passive: bool, has_ended: &Cell<bool>) -> bool {
        if self.filters && !is_passive && self.ready.borrow().is_none() {
            return false;
        }
        let is_alive = || !session.is_lost() && !has_ended.get();
        if is_passive && stream.state() != StreamState::Streaming {
            session.iterate(Some(IDLE_WAIT));
            self.last_ns.set(self.clock.now_ns());
            return is_alive();
        }
        let until_ns = self.last_ns.get() + self.timeout_ns();
        session.iterate(Some(Duration::from_nanos(until_ns.saturating_sub(self.clock.now_ns()))));
        // If this thread was held up, that deadline may be over although a picture has come just now.
        is_alive() && self.clock.now_ns() < until_ns.max(self.last_ns.get() + self.timeout_ns())
    }

    fn timeout_ns(&self) -> u64 {
        let period_ns =
            |NegotiatedFormat { rate: (num, denom), .. }| 1_000_000_000 * u64::from(denom) / u64::from(num).max(1);
        // A camera needs longer for its first picture.
        let min_ns = if self.sequence.get().is_none() { 3 * MIN_TIMEOUT_NS } else { MIN_TIMEOUT_NS };
        self.negotiated.get().map_or(min_ns, |negotiated| (TIMEOUT_PERIODS * period_ns(negotiated)).max(min_ns))
    }

    /// Accepts the negotiated format (PipeWire's `param_changed`), and answers with the buffers that are needed.
    fn handle_format(&self, stream: &Stream, format: &[u8]) {
        let Some(negotiated) = mode::parse_negotiated(format) else {
            return tracing::warn!("{}: its pictures cannot be read", self.name());
        };
        self.negotiated.set(Some(negotiated));
        self.handler.borrow_mut().set_format(&negotiated);
        let [memory, dma_bufs] = param::build_any_buffers();
        let pods = [memory, dma_bufs, param::build_header_request()];
        let mut pods: Vec<&Pod> = pods.iter().filter_map(|pod| Pod::from_bytes(pod)).collect();
        if let Err(error) = stream.update_params(&mut pods) {
            tracing::warn!("{}: PipeWire refused the buffers: {error}", self.name());
        }
        let camera = self.camera.borrow().clone();
        if let Some((ready, camera)) = self.ready.take().zip(camera) {
            // The receiver may have timed out.
            let _ = ready.send(Ok((camera, negotiated)));
        }
    }

    /// Dequeues the newest picture.
    fn receive_newest(&self, stream: &Stream, memory: &mut BufferMemory) {
        let mut newest: Option<Buffer> = None;
        let mut stale = 0;
        while let Some(buffer) = stream.dequeue_buffer() {
            stale += u64::from(newest.replace(buffer).is_some());
        }
        let Some(mut buffer) = newest else { return };
        let now_ns = self.clock.now_ns();
        self.last_ns.set(now_ns);
        if let Some(since_ns) = self.outage_since_ns.take() {
            let away_s = (now_ns - since_ns) as f64 / 1e9;
            tracing::info!("{}: it is back after {away_s:.1} s", self.name());
        }
        let header = buffer.find_meta::<MetaHeader>().cloned();
        let sequence = header.as_ref().map_or(0, MetaHeader::seq);
        let gap =
            self.sequence.replace(Some(sequence)).map_or(0, |last| sequence.saturating_sub(last.saturating_add(1)));
        // The camera did deliver the stale ones.
        let missed = if gap > MAX_MISSED { 0 } else { gap.saturating_sub(stale) };
        let is_corrupt = header.as_ref().is_some_and(|header| header.flags().contains(MetaHeaderFlags::CORRUPTED));
        let stamp_ns = header.as_ref().and_then(|header| u64::try_from(header.pts()).ok());
        let is_plausible = |stamp_ns: &u64| (now_ns.saturating_sub(MAX_AGE_NS)..=now_ns).contains(stamp_ns);
        let picture = if is_corrupt { None } else { memory.read(buffer.datas_mut()) };
        let mut handler = self.handler.borrow_mut();
        if missed + stale > 0 || picture.is_none() {
            handler.add_losses(missed, stale, u64::from(picture.is_none()));
        }
        if let Some(picture) = picture {
            let captured_ns = stamp_ns.filter(is_plausible).unwrap_or(now_ns);
            let (planes, strides_bytes) = (picture.planes(), picture.strides_bytes());
            handler.handle_frame(&Frame { planes, strides_bytes, captured_ns });
        }
    }
}
