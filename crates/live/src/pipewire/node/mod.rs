//! A camera provided by this program: a node that others read from.
//!
//! An independent camera has one format, so that no reader requests another one. It drives the graph, so that readers
//! get each picture at once. A node with readers is `Streaming`, and only that state means that it is watched: its role
//! as the driver does not, since it keeps that until the session manager suspends it, five seconds after the last
//! reader.
//!
//! A *filter* stands in for a camera: WirePlumber, from 0.5 on, connects it to every client that requests that camera,
//! except members of its own link group. It offers the camera's modes, and the camera drives both.

mod provider;

use std::sync::atomic::AtomicU64;
use std::sync::{Arc, mpsc};
use std::time::Duration;

use self::provider::Provider;
use super::mode::{Mode, NegotiatedFormat};
use super::wake::WokenThread;
use super::{PipeWireError, Result};

/// Longest wait for the node to appear in the daemon's graph.
const TIMEOUT: Duration = Duration::from_secs(10);

/// Names and modes of a node.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The name that identifies it; if another node has it already, it becomes `NAME-2`.
    pub name: String,
    /// The name shown to users.
    pub label: String,
    /// The modes that readers may choose from.
    pub modes: Vec<Mode>,
    /// The format for readers without a preference.
    pub best: NegotiatedFormat,
    /// The name of the camera that the node stands in for.
    pub filter_target: Option<String>,
    /// Longest time without a picture for a reader: then the last one is repeated.
    pub hold: Duration,
}

/// Memory of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PictureMemory {
    /// Maximum number of bytes.
    pub bytes: usize,
    /// Bytes per row; 0 if it has no rows.
    pub stride: usize,
}

/// A picture that was drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawnPicture {
    pub bytes: usize,
    /// Capture time on the system's monotonic clock; `None` for repeats and pictures that no camera captured.
    pub captured_ns: Option<u64>,
}

/// The pictures of a node. All methods are called on the node's thread.
pub trait PictureSource: Send + 'static {
    /// Fetches new pictures; returns whether there is one to show now.
    fn update(&mut self) -> bool;

    /// Sets the format of the following pictures, one of the offered ones; returns the memory that each needs.
    fn set_format(&mut self, negotiated: &NegotiatedFormat) -> PictureMemory;

    /// Writes the current picture into `frame`, in the negotiated format.
    fn draw_picture(&mut self, frame: &mut [u8]) -> DrawnPicture;

    /// Reports whether the node is watched.
    fn set_watched(&mut self, is_watched: bool);
}

/// Counts of the pictures, by outcome.
#[derive(Debug, Default)]
pub struct Counts {
    /// Pictures delivered to readers, each counted once.
    pub shown: AtomicU64,
    /// Repeated pictures, the still card included.
    pub repeats: AtomicU64,
    /// Pictures that arrived while no client watched.
    pub unwatched: AtomicU64,
    /// Pictures replaced by a newer one before delivery.
    pub overtaken: AtomicU64,
    /// Pictures without a free buffer: the readers held them all.
    pub no_buffer: AtomicU64,
    /// Reconnections to the daemon.
    pub reconnections: AtomicU64,
}

/// A node, which is removed on drop.
#[derive(Debug)]
pub struct Node {
    name: String,
    counts: Arc<Counts>,
    thread: WokenThread,
}

impl Node {
    /// Creates the node; it outlives the daemon, and reappears when the daemon returns.
    ///
    /// # Errors
    /// The daemon does not run, or refuses.
    pub fn new(settings: Settings, pictures: impl PictureSource) -> Result<Self> {
        let counts = Arc::new(Counts::default());
        let (ready, is_ready) = mpsc::channel();
        let provider = Provider::new(settings, Box::new(pictures), Arc::clone(&counts));
        let thread = WokenThread::start("pipewire", move |waker, stop| provider.run(waker, stop, &ready))?;
        let mut node = Self { name: String::new(), counts, thread };
        node.name = is_ready.recv_timeout(TIMEOUT).map_err(|_| PipeWireError::Silent)??;
        Ok(node)
    }

    /// The name that identifies it.
    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn counts(&self) -> &Arc<Counts> {
        &self.counts
    }

    /// Announces a new picture. Never blocks.
    pub fn wake(&self) {
        self.thread.waker.wake();
    }
}
