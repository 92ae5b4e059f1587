//! A camera that this program gives: a node that others read from.
//!
//! A camera of its own has one format, so that no reader asks for another one. It drives the graph, so that readers get a
//! picture when there is one. A node with readers is `Streaming`, which is the only state in which anybody watches: whether it
//! drives tells nothing, as that stays so until the session manager suspends it, five seconds after the last reader.
//!
//! A *filter* stands in for a camera: WirePlumber, from 0.5 on, gives it to everybody who asks for that camera, but for those
//! who are in one group with it. It offers what the camera offers, and the camera drives both.

mod provider;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use self::provider::Provider;
use super::PipeWireError;
use super::mode::{Agreed, Mode};
use super::wake::Waker;

/// How long the daemon may take to have the node in its graph.
const PATIENCE: Duration = Duration::from_secs(10);

/// What a node is called, and what it shows.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The name that programs remember it by; another node that has it already makes it `NAME-2`.
    pub name: String,
    /// The name that people see.
    pub label: String,
    /// What readers may choose from.
    pub modes: Vec<Mode>,
    /// What they are given where they have no wish.
    pub best: Agreed,
    /// The name of the camera whose readers are given this one.
    pub stands_for: Option<String>,
    /// The longest time that a reader is left without a picture: then the last one is given again.
    pub hold: Duration,
}

/// Memory of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// Bytes, at most.
    pub bytes: usize,
    /// From row to row; 0 where it has no rows.
    pub stride: usize,
}

/// A picture that was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drawn {
    pub bytes: usize,
    /// When it was captured, by the system's monotonic clock, or `None` where it was shown before, or is none of a camera's.
    pub captured_ns: Option<u64>,
}

/// What a node shows. Everything is called on the node's thread.
pub trait Show: Send + 'static {
    /// Takes over what is new; returns whether there is something to be shown now.
    fn update(&mut self) -> bool;

    /// What pictures are to be like from now on, of what was offered; returns the memory that each takes.
    fn begin(&mut self, agreed: &Agreed) -> Memory;

    /// Writes the picture that is to be shown into `frame`, as agreed.
    fn draw(&mut self, frame: &mut [u8]) -> Drawn;

    /// Somebody watches from now on, or nobody.
    fn watched(&mut self, is_watched: bool);
}

/// What became of the pictures.
#[derive(Debug, Default)]
pub struct Counts {
    /// Pictures that readers were given, once each.
    pub shown: AtomicU64,
    /// Pictures that they were given again, the still card included.
    pub repeats: AtomicU64,
    /// Pictures that came while nobody watched.
    pub unwatched: AtomicU64,
    /// Pictures that a newer one overtook on their way.
    pub overtaken: AtomicU64,
    /// Pictures for which there was no buffer: the readers held them all.
    pub no_buffer: AtomicU64,
    /// Times that the daemon went and came back.
    pub returns: AtomicU64,
}

/// A node, until this is dropped.
#[derive(Debug)]
pub struct Node {
    name: String,
    waker: Waker,
    stop: Arc<AtomicBool>,
    counts: Arc<Counts>,
    thread: Option<JoinHandle<()>>,
}

impl Node {
    /// Makes the node; it outlives the daemon, and is there again when that comes back.
    ///
    /// # Errors
    /// There is no daemon, or it refuses.
    pub fn new(settings: Settings, show: impl Show) -> Result<Self, PipeWireError> {
        let waker = Waker::new().map_err(PipeWireError::Thread)?;
        let (stop, counts) = (Arc::new(AtomicBool::new(false)), Arc::new(Counts::default()));
        let (ready, is_ready) = mpsc::channel();
        let provider = Provider::new(settings, Box::new(show), Arc::clone(&counts));
        let (bell, end) = (waker.clone(), Arc::clone(&stop));
        let thread = thread::Builder::new().name("pipewire".into()).spawn(move || provider.run(&bell, &end, &ready));
        let thread = Some(thread.map_err(PipeWireError::Thread)?);
        let mut node = Self { name: String::new(), waker, stop, counts, thread };
        node.name = is_ready.recv_timeout(PATIENCE).map_err(|_| PipeWireError::Silent)??;
        Ok(node)
    }

    /// What programs remember it by.
    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn counts(&self) -> &Arc<Counts> {
        &self.counts
    }

    /// There is something new to show. Never waits.
    pub fn wake(&self) {
        self.waker.wake();
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        self.waker.wake();
        // A panic of the thread was printed; there is nothing left to do about it.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
