//! A connection to PipeWire's daemon, on the thread that opens it.

use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

use pipewire::context::ContextRc;
use pipewire::core::{CoreRc, Listener};
use pipewire::loop_::Timeout;
use pipewire::main_loop::MainLoopRc;

use super::{PipeWireError, Result};

/// A connection. The fields are dropped in this order: the listener, the connection, the loop that runs it.
pub struct Session {
    _listener: Listener,
    is_lost: Rc<Cell<bool>>,
    /// Number of the last completed [`Session::sync`].
    last_sync: Rc<Cell<Option<i32>>>,
    pub core: CoreRc,
    _context: ContextRc,
    main_loop: MainLoopRc,
}

/// Id of the core object; an error on it with this code means that the connection has ended.
const CORE: u32 = 0;
const BROKEN_PIPE: i32 = -rustix::io::Errno::PIPE.raw_os_error();

impl Session {
    /// Connects to the daemon of this session.
    ///
    /// # Errors
    /// The daemon does not run, or refuses.
    pub fn open() -> Result<Self> {
        pipewire::init();
        super::log::disable_log();
        let main_loop = MainLoopRc::new(None).map_err(PipeWireError::refused("a loop"))?;
        let context = ContextRc::new(&main_loop, None).map_err(PipeWireError::refused("a context"))?;
        let core = context.connect_rc(None).map_err(|_| PipeWireError::NoDaemon { socket: socket_path() })?;
        let is_lost = Rc::new(Cell::new(false));
        let last_sync = Rc::new(Cell::new(None));
        let (lost, done) = (Rc::clone(&is_lost), Rc::clone(&last_sync));
        let listener = core
            .add_listener_local()
            .done(move |id, seq| {
                if id == CORE {
                    done.set(Some(seq.seq()));
                }
            })
            .error(move |id, _, code, message| {
                tracing::debug!("PipeWire: object {id}: {message} ({code})");
                if id == CORE && code == BROKEN_PIPE {
                    lost.set(true);
                }
            })
            .register();
        // SAFETY: `drop` leaves it on the same thread, as nothing here is `Send`.
        #[allow(unsafe_code)]
        unsafe {
            main_loop.loop_().enter();
        }
        Ok(Self { _listener: listener, is_lost, last_sync, core, _context: context, main_loop })
    }

    /// The event loop, to which further sources can be added.
    pub fn event_loop(&self) -> &pipewire::loop_::Loop {
        self.main_loop.loop_()
    }

    /// Whether the connection to the daemon is lost.
    pub fn is_lost(&self) -> bool {
        self.is_lost.get()
    }

    /// Runs one iteration of the loop, for at most `timeout` (`None`: until an event arrives).
    pub fn iterate(&self, timeout: Option<Duration>) {
        // The loop counts whole milliseconds: rounded up, or it would spin until the deadline.
        let round_up = |timeout: Duration| Duration::from_millis(timeout.as_micros().div_ceil(1000).min(60_000) as u64);
        let timeout = timeout.map_or(Timeout::Infinite, |timeout| Timeout::Finite(round_up(timeout)));
        self.event_loop().iterate(timeout);
    }

    /// Requests a round trip to the daemon, and returns its number for [`Session::is_synced`].
    pub fn sync(&self) -> Result<i32> {
        self.core.sync(0).map(|seq| seq.seq()).map_err(PipeWireError::refused("a question"))
    }

    /// Whether all requests made before this round trip are done.
    pub fn is_synced(&self, round_trip: i32) -> bool {
        self.last_sync.get() == Some(round_trip)
    }
}

/// Until then, the loop belongs to this thread, also between two calls of [`Session::iterate`]: PipeWire's own thread
/// would run the callbacks of a loop without an owner itself, concurrently with this thread.
impl Drop for Session {
    fn drop(&mut self) {
        // SAFETY: `open` entered it on the same thread.
        #[allow(unsafe_code)]
        unsafe {
            self.main_loop.loop_().leave();
        }
    }
}

/// Returns the path of the daemon's socket, by the rules of its library.
pub fn socket_path() -> String {
    let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    let name = variable("PIPEWIRE_REMOTE").unwrap_or_else(|| "pipewire-0".into());
    let folder = ["PIPEWIRE_RUNTIME_DIR", "XDG_RUNTIME_DIR", "USERPROFILE"].into_iter().find_map(variable);
    match folder {
        _ if name.starts_with('/') => name,
        Some(folder) => format!("{folder}/{name}"),
        None => format!("{name} (XDG_RUNTIME_DIR is not set)"),
    }
}
