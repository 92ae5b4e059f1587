//! Watches PipeWire for sources of video that come and go.

use std::cell::RefCell;
use std::collections::HashSet;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use pipewire::spa::support::system::IoFlags;
use pipewire::types::ObjectType;

use super::session::Session;
use super::wake::{Waker, WokenThread};
use super::{PipeWireError, Result};

/// Period between attempts to reach a daemon that does not run: each one only looks for its socket.
const RETRY_PERIOD: Duration = Duration::from_secs(2);

/// A thread that listens to the daemon's registry until it is dropped. Without a daemon it waits for one.
#[derive(Debug)]
pub struct SourceWatch {
    changed: Arc<AtomicBool>,
    _thread: WokenThread,
}

impl SourceWatch {
    /// Starts to watch.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn new() -> Result<Self> {
        let changed = Arc::<AtomicBool>::default();
        let change = Arc::clone(&changed);
        let run = move |waker: &Waker, stop: &AtomicBool| {
            while !stop.load(Ordering::Acquire) {
                if super::is_available()
                    && let Err(error) = watch_connection(waker, stop, &change)
                {
                    tracing::debug!("cameras of PipeWire are not watched: {error}");
                }
                waker.wait(RETRY_PERIOD);
            }
        };
        Ok(Self { changed, _thread: WokenThread::start("pipewire-watch", run)? })
    }

    /// Whether sources came or went since the last call; those that are there at the start came.
    pub fn take_change(&self) -> bool {
        self.changed.swap(false, Ordering::AcqRel)
    }
}

/// Watches until `stop` is set or the connection is lost; sets `changed` with every source that comes or goes.
fn watch_connection(waker: &Waker, stop: &AtomicBool, changed: &Arc<AtomicBool>) -> Result<()> {
    let session = Session::open()?;
    let registry = session.core.get_registry_rc().map_err(PipeWireError::refused("its registry"))?;
    let sources: Rc<RefCell<HashSet<u32>>> = Rc::default();
    let (found, came, went) = (Rc::clone(&sources), Arc::clone(changed), Arc::clone(changed));
    let _listener = registry
        .add_listener_local()
        .global(move |object| {
            let class = object.props.and_then(|properties| properties.get("media.class"));
            if object.type_ == ObjectType::Node && class == Some("Video/Source") {
                found.borrow_mut().insert(object.id);
                came.store(true, Ordering::Release);
            }
        })
        .global_remove(move |id| {
            if sources.borrow_mut().remove(&id) {
                went.store(true, Ordering::Release);
            }
        })
        .register();
    let (clearer, descriptor) = (waker.clone(), waker.descriptor().map_err(PipeWireError::Thread)?);
    let _wake_source = session.event_loop().add_io(descriptor, IoFlags::IN, move |_| clearer.clear());
    while !stop.load(Ordering::Acquire) && !session.is_lost() {
        session.iterate(None);
    }
    // With the daemon, its sources have gone.
    changed.store(true, Ordering::Release);
    Ok(())
}
