//! Reading from a camera of PipeWire's: its pictures as they come, also after it or the daemon has gone and come back.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use pipewire::buffer::Buffer;
use pipewire::properties::properties;
use pipewire::spa::buffer::ChunkFlags;
use pipewire::spa::buffer::meta::{MetaHeader, MetaHeaderFlags};
use pipewire::spa::param::ParamType;
use pipewire::spa::pod::Pod;
use pipewire::spa::support::system::IoFlags;
use pipewire::spa::utils::Direction;
use pipewire::stream::{Stream, StreamFlags, StreamRc, StreamState};

use super::PipeWireError;
use super::graph::{Camera, Graph};
use super::mode::{self, Agreed, Mode};
use super::param;
use super::session::Session;
use super::wake::Waker;
use crate::clock::Clock;

/// How long a camera may take from the first question to its first word about pictures.
const PATIENCE: Duration = Duration::from_secs(8);
/// From one look for a camera that has gone to the next.
const RETRY: Duration = Duration::from_millis(500);
/// While nobody wants pictures there is nothing to do but to be stopped.
const LONG: Duration = Duration::from_secs(3600);
/// A stream without a picture for so many periods, and at least for a second, has stalled.
const SILENT_PERIODS: u64 = 5;
const LEAST_SILENCE_NS: u64 = 1_000_000_000;
/// A time of capture that is further in the past is no time of the system's monotonic clock.
const OLDEST_NS: u64 = 10_000_000_000;
/// A gap in a camera's numbers that is longer is no loss, but another count.
const MOST_MISSED: u64 = 1000;

/// A picture in PipeWire's memory.
pub struct Frame<'a> {
    /// The used bytes of each plane.
    pub planes: &'a [&'a [u8]],
    /// From row to row of the first plane; 0 where that is not told.
    pub stride_bytes: usize,
    /// By the system's monotonic clock.
    pub captured_ns: u64,
}

/// Takes what a camera gives. Everything is called on the reader's thread.
pub trait Take: Send + 'static {
    /// What to ask the camera for, of what it offers.
    ///
    /// # Errors
    /// Nothing of it can be used: one line.
    fn choose(&mut self, modes: &[Mode]) -> Result<Agreed, String>;

    /// What pictures are like from now on.
    fn begin(&mut self, agreed: &Agreed);

    /// A picture.
    fn frame(&mut self, frame: &Frame);

    /// Pictures that came and went unread, and pictures that are damaged.
    fn lost(&mut self, missed: u64, stale: u64, corrupt: u64);
}

/// Reads from one camera until it is dropped.
#[derive(Debug)]
pub struct Reader {
    waker: Waker,
    stop: Arc<AtomicBool>,
    is_wanted: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// Who waits for the camera: told once which it is and what it gives, or why there is none.
type Ready = mpsc::Sender<Result<(Camera, Agreed), PipeWireError>>;

impl Reader {
    /// Begins to read from the camera that `name` means: what programs remember it by, what people see, or a part of
    /// one of them. With `filters`, its pictures go to those who asked for this camera, by a node of this program's that
    /// stands in for it: then they come while that has readers.
    ///
    /// # Errors
    /// There is no daemon, no such camera, or it offers nothing that can be used.
    pub fn new(name: &str, filters: bool, take: impl Take) -> Result<(Self, Camera, Agreed), PipeWireError> {
        let waker = Waker::new().map_err(PipeWireError::Thread)?;
        let (stop, is_wanted) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(true)));
        let (ready, is_ready) = mpsc::channel();
        let listener = Listener {
            take: RefCell::new(Box::new(take)),
            clock: Clock::system(),
            ready: RefCell::new(Some(ready)),
            camera: RefCell::new(None),
            agreed: Cell::new(None),
            last_ns: Cell::new(0),
            sequence: Cell::new(None),
            is_away: Cell::new(None),
            filters,
        };
        let (bell, end, wanted, meant) = (waker.clone(), Arc::clone(&stop), Arc::clone(&is_wanted), name.to_owned());
        let run = move || Rc::new(listener).run(&meant, &bell, [&end, &wanted]);
        let thread = Some(thread::Builder::new().name("pipewire".into()).spawn(run).map_err(PipeWireError::Thread)?);
        let reader = Self { waker, stop, is_wanted, thread };
        let (camera, agreed) =
            is_ready.recv_timeout(PATIENCE).map_err(|_| PipeWireError::NoPictures { name: name.to_owned() })??;
        Ok((reader, camera, agreed))
    }

    /// Whether pictures are wanted; while they are not, the camera is let go of.
    pub fn want(&self, wanted: bool) {
        if self.is_wanted.swap(wanted, Ordering::AcqRel) != wanted {
            self.waker.wake();
        }
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        self.waker.wake();
        // A panic of the thread was printed; there is nothing left to do about it.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// The thread's side of a reader.
struct Listener {
    take: RefCell<Box<dyn Take>>,
    clock: Clock,
    /// Until the first agreement.
    ready: RefCell<Option<Ready>>,
    camera: RefCell<Option<Camera>>,
    agreed: Cell<Option<Agreed>>,
    /// When the last picture came, or the stream began.
    last_ns: Cell<u64>,
    /// The camera's number of the last picture.
    sequence: Cell<Option<u64>>,
    /// Since when there are no pictures, if that was said.
    is_away: Cell<Option<u64>>,
    /// Whether the pictures go to those who asked for the camera.
    filters: bool,
}

impl Listener {
    fn run(self: Rc<Self>, meant: &str, waker: &Waker, [stop, wanted]: [&AtomicBool; 2]) {
        while !stop.load(Ordering::Acquire) {
            if !wanted.load(Ordering::Acquire) {
                waker.wait(LONG);
                continue;
            }
            let is_first = self.ready.borrow().is_some();
            let ended = self.serve(meant, waker, [stop, wanted]);
            if self.filters && is_first && self.ready.borrow().is_none() {
                continue;
            }
            if stop.load(Ordering::Acquire) || !wanted.load(Ordering::Acquire) {
                continue;
            }
            if let Some(ready) = self.ready.take() {
                let error = ended.err().unwrap_or(PipeWireError::NoPictures { name: meant.to_owned() });
                return drop(ready.send(Err(error)));
            }
            if self.is_away.get().is_none() {
                self.is_away.set(Some(self.clock.now_ns()));
                let why = ended.err().map_or_else(|| "it gives no more pictures".to_owned(), |error| error.to_string());
                tracing::warn!("{}: {why}; waiting for it to come back", self.name());
            }
            waker.wait(RETRY);
        }
    }

    fn name(&self) -> String {
        self.camera.borrow().as_ref().map_or_else(String::new, |camera| format!("pipewire:{}", camera.name))
    }

    /// Reads until there is nothing to be read, or nobody wants it.
    ///
    /// # Errors
    /// The daemon or the camera is not there, or refuses.
    fn serve(
        self: &Rc<Self>,
        meant: &str,
        waker: &Waker,
        [stop, wanted]: [&AtomicBool; 2],
    ) -> Result<(), PipeWireError> {
        let session = Session::open()?;
        // Once it was found, it is that one which is waited for.
        let known = self.camera.borrow().as_ref().map(|camera| camera.name.clone());
        let camera = Graph::camera(&session, known.as_deref().unwrap_or(meant), known.is_some())?;
        let refused = |why| PipeWireError::NoMode { name: camera.name.clone(), why };
        let asked = self.take.borrow_mut().choose(&camera.modes).map_err(refused)?;
        // A camera tells its format to those alone who keep it going.
        let is_passive = self.filters && self.ready.borrow().is_none();
        let mut about = properties! {
            *pipewire::keys::MEDIA_TYPE => "Video",
            *pipewire::keys::MEDIA_CATEGORY => "Capture",
            *pipewire::keys::MEDIA_ROLE => "Camera",
            // The name `bokehcam` is that of a camera that others look for.
            *pipewire::keys::NODE_NAME => "bokehcam-reader",
            "target.object" => camera.serial.as_str(),
        };
        if self.filters {
            about.insert("node.link-group", super::group());
        }
        if is_passive {
            about.insert("node.passive", "in");
        }
        let stream =
            StreamRc::new(session.core.clone(), "bokehcam", about).map_err(PipeWireError::refused("a stream"))?;
        self.camera.replace(Some(camera));
        let has_ended = Rc::new(Cell::new(false));
        let [formats, pictures] = std::array::from_fn(|_| Rc::clone(self));
        let ended = Rc::clone(&has_ended);
        let _listener = stream
            .add_local_listener::<()>()
            .state_changed(move |_, (), old, state| {
                let rests = (old, &state) == (StreamState::Streaming, &StreamState::Paused);
                // One that is passive rests while nobody reads.
                let has_gone =
                    matches!(state, StreamState::Error(_) | StreamState::Unconnected) || rests && !is_passive;
                ended.set(ended.get() || has_gone);
            })
            .param_changed(move |stream, (), id, format| {
                if let Some(format) = format.filter(|_| id == ParamType::Format.as_raw()) {
                    formats.agree(stream, format.as_bytes());
                }
            })
            .process(move |stream, ()| pictures.take(stream))
            .register()
            .map_err(PipeWireError::refused("to be listened to"))?;
        let format = param::format(&asked);
        let mut formats: Vec<&Pod> = Pod::from_bytes(&format).into_iter().collect();
        let flags = StreamFlags::AUTOCONNECT | StreamFlags::DONT_RECONNECT | StreamFlags::MAP_BUFFERS;
        stream.connect(Direction::Input, None, flags, &mut formats).map_err(PipeWireError::refused("a reader"))?;
        let (bell, descriptor) = (waker.clone(), waker.descriptor().map_err(PipeWireError::Thread)?);
        let _bell = session.event_loop().add_io(descriptor, IoFlags::IN, move |_| bell.silence());

        self.last_ns.set(self.clock.now_ns());
        self.sequence.set(None);
        while !stop.load(Ordering::Acquire) && wanted.load(Ordering::Acquire) {
            if self.filters && !is_passive && self.ready.borrow().is_none() {
                break;
            }
            if is_passive && stream.state() != StreamState::Streaming {
                session.serve(Some(LONG));
                self.last_ns.set(self.clock.now_ns());
                if session.is_lost() || has_ended.get() {
                    break;
                }
                continue;
            }
            let until_ns = self.last_ns.get() + self.longest_silence_ns();
            session.serve(Some(Duration::from_nanos(until_ns.saturating_sub(self.clock.now_ns()))));
            if session.is_lost() || has_ended.get() || self.clock.now_ns() >= until_ns.max(self.last_ns.get()) {
                break;
            }
        }
        Ok(())
    }

    fn longest_silence_ns(&self) -> u64 {
        let period_ns = |Agreed { rate: (num, denom), .. }| 1_000_000_000 * u64::from(denom) / u64::from(num).max(1);
        // A camera takes its time for the first picture.
        let least_ns = if self.sequence.get().is_none() { 3 * LEAST_SILENCE_NS } else { LEAST_SILENCE_NS };
        self.agreed.get().map_or(least_ns, |agreed| (SILENT_PERIODS * period_ns(agreed)).max(least_ns))
    }

    /// The camera says what its pictures are like.
    fn agree(&self, stream: &Stream, format: &[u8]) {
        let Some(agreed) = mode::agreed(format) else {
            return tracing::warn!("{}: its pictures cannot be read", self.name());
        };
        self.agreed.set(Some(agreed));
        self.take.borrow_mut().begin(&agreed);
        let pods = [param::any_buffers(), param::header()];
        let mut pods: Vec<&Pod> = pods.iter().filter_map(|pod| Pod::from_bytes(pod)).collect();
        if let Err(error) = stream.update_params(&mut pods) {
            tracing::warn!("{}: PipeWire refused the buffers: {error}", self.name());
        }
        let camera = self.camera.borrow().clone();
        if let Some((ready, camera)) = self.ready.take().zip(camera) {
            // Who waits may have given up.
            let _ = ready.send(Ok((camera, agreed)));
        }
    }

    /// Takes the newest picture.
    fn take(&self, stream: &Stream) {
        let mut newest: Option<Buffer> = None;
        let mut stale = 0;
        while let Some(buffer) = stream.dequeue_buffer() {
            stale += u64::from(newest.replace(buffer).is_some());
        }
        let Some(mut buffer) = newest else { return };
        let now_ns = self.clock.now_ns();
        self.last_ns.set(now_ns);
        if let Some(since_ns) = self.is_away.take() {
            let away_s = (now_ns - since_ns) as f64 / 1e9;
            tracing::info!("{}: it is back after {away_s:.1} s", self.name());
        }
        let header = buffer.find_meta::<MetaHeader>().cloned();
        let sequence = header.as_ref().map_or(0, MetaHeader::seq);
        let gap =
            self.sequence.replace(Some(sequence)).map_or(0, |last| sequence.saturating_sub(last.saturating_add(1)));
        let missed = if gap > MOST_MISSED { 0 } else { gap.saturating_sub(stale) };
        let mut is_corrupt = header.as_ref().is_some_and(|header| header.flags().contains(MetaHeaderFlags::CORRUPTED));
        let told_ns = header.as_ref().and_then(|header| u64::try_from(header.pts()).ok());
        let is_time = |told_ns: &u64| (now_ns.saturating_sub(OLDEST_NS)..=now_ns).contains(told_ns);
        let mut planes: [&[u8]; 3] = [&[]; 3];
        let (mut count, mut stride_bytes) = (0, 0);
        for (plane, data) in planes.iter_mut().zip(buffer.datas_mut()) {
            let (offset, size) = (data.chunk().offset() as usize, data.chunk().size() as usize);
            is_corrupt |= data.chunk().flags().contains(ChunkFlags::CORRUPTED);
            if count == 0 {
                stride_bytes = usize::try_from(data.chunk().stride()).unwrap_or(0);
            }
            let used = |bytes: &'_ mut [u8]| offset..offset.saturating_add(size).min(bytes.len());
            let Some(bytes) = data.data() else { break };
            let used = used(bytes);
            *plane = bytes.get(used).unwrap_or(&[]);
            count += 1;
        }
        let is_empty = planes[0].is_empty();
        let mut take = self.take.borrow_mut();
        if missed + stale > 0 || is_corrupt || is_empty {
            take.lost(missed, stale, u64::from(is_corrupt || is_empty));
        }
        if !is_corrupt && !is_empty {
            let captured_ns = told_ns.filter(is_time).unwrap_or(now_ns);
            take.frame(&Frame { planes: &planes[..count], stride_bytes, captured_ns });
        }
    }
}
