//! A connection to PipeWire's daemon, on the thread that makes it.

use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

use pipewire::context::ContextRc;
use pipewire::core::{CoreRc, Listener};
use pipewire::loop_::Timeout;
use pipewire::main_loop::MainLoopRc;

use super::PipeWireError;

/// A connection. Dropped in this order: what listens, what is connected, what runs it.
pub struct Session {
    _listener: Listener,
    is_lost: Rc<Cell<bool>>,
    /// The last answer to a [`Session::ask`].
    answered: Rc<Cell<Option<i32>>>,
    pub core: CoreRc,
    _context: ContextRc,
    main_loop: MainLoopRc,
}

/// The core object has this number; an error of its own with this code is the end of the connection.
const CORE: u32 = 0;
const BROKEN_PIPE: i32 = -rustix::io::Errno::PIPE.raw_os_error();

impl Session {
    /// Connects to the daemon of this session.
    ///
    /// # Errors
    /// There is none.
    pub fn open() -> Result<Self, PipeWireError> {
        pipewire::init();
        super::quiet::silence();
        let main_loop = MainLoopRc::new(None).map_err(PipeWireError::refused("a loop"))?;
        let context = ContextRc::new(&main_loop, None).map_err(PipeWireError::refused("a context"))?;
        let core = context.connect_rc(None).map_err(|_| PipeWireError::NoDaemon { socket: socket() })?;
        let is_lost = Rc::new(Cell::new(false));
        let answered = Rc::new(Cell::new(None));
        let (lost, answer) = (Rc::clone(&is_lost), Rc::clone(&answered));
        let listener = core
            .add_listener_local()
            .done(move |id, seq| {
                if id == CORE {
                    answer.set(Some(seq.seq()));
                }
            })
            .error(move |id, _, code, message| {
                tracing::debug!("PipeWire: object {id}: {message} ({code})");
                if id == CORE && code == BROKEN_PIPE {
                    lost.set(true);
                }
            })
            .register();
        // SAFETY: it is left when this is dropped, on the same thread, as nothing here is `Send`.
        #[allow(unsafe_code)]
        unsafe {
            main_loop.loop_().enter();
        }
        Ok(Self { _listener: listener, is_lost, answered, core, _context: context, main_loop })
    }

    /// The loop, to add what it waits for.
    pub fn event_loop(&self) -> &pipewire::loop_::Loop {
        self.main_loop.loop_()
    }

    /// Whether the daemon has gone.
    pub fn is_lost(&self) -> bool {
        self.is_lost.get()
    }

    /// Serves what comes, for `patience` at most (`None`: until something does).
    pub fn serve(&self, patience: Option<Duration>) {
        // The loop counts whole milliseconds: rounded up, or it would be asked again and again until the time has come.
        let whole = |patience: Duration| Duration::from_millis(patience.as_micros().div_ceil(1000).min(60_000) as u64);
        let patience = patience.map_or(Timeout::Infinite, |patience| Timeout::Finite(whole(patience)));
        self.event_loop().iterate(patience);
    }

    /// Asks the daemon to answer, and returns the number that [`Session::has_answered`] is to be asked with.
    pub fn ask(&self) -> Result<i32, PipeWireError> {
        self.core.sync(0).map(|seq| seq.seq()).map_err(PipeWireError::refused("a question"))
    }

    /// Whether all was done that was asked for before this question.
    pub fn has_answered(&self, question: i32) -> bool {
        self.answered.get() == Some(question)
    }
}

/// From its making on, the loop belongs to this thread, also between two calls of [`Session::serve`]: PipeWire's own thread
/// runs callbacks of a loop that belongs to nobody by itself, beside those of this one.
impl Drop for Session {
    fn drop(&mut self) {
        // SAFETY: it was entered by `open`, on the same thread.
        #[allow(unsafe_code)]
        unsafe {
            self.main_loop.loop_().leave();
        }
    }
}

/// Where the daemon is looked for, as its library does.
pub fn socket() -> String {
    let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    let name = variable("PIPEWIRE_REMOTE").unwrap_or_else(|| "pipewire-0".into());
    let folder = ["PIPEWIRE_RUNTIME_DIR", "XDG_RUNTIME_DIR", "USERPROFILE"].into_iter().find_map(variable);
    match folder {
        _ if name.starts_with('/') => name,
        Some(folder) => format!("{folder}/{name}"),
        None => format!("{name} (XDG_RUNTIME_DIR is not set)"),
    }
}
