//! Whether others read from a virtual camera.
//!
//! From v4l2loopback 0.13 on the module itself tells, by an event: whether a reader streams. (0.13 does not see those
//! that use plain `read()`.) Before, whoever else has the node open is taken for a reader, looked up when the node is
//! opened or closed; readers of other users, and outside of a container, are then seen only with the rights to look.

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;
use std::time::Duration;

use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::fs::inotify;
use rustix::io::Errno;

use super::device::Device;
use super::events::{PRIVATE_START, SEND_INITIAL};
use super::holders::other_holders;

/// The module's event "client usage"; its data begin with a `u32`: 1 while a reader streams, else 0.
const CLIENT_USAGE: u32 = PRIVATE_START + 0x08E0_0000 + 1;
/// Time from an opening to the look at who holds the node: a program that only lists cameras has closed it by then.
const SETTLE: Duration = Duration::from_millis(60);

/// What came of listening.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReaderEvent {
    /// Whether there are readers now.
    Readers(bool),
    Nothing,
    /// The end: [`Stop`] was used or dropped, or the node is gone.
    Stopped,
}

/// Listens for readers of one node.
#[derive(Debug)]
pub struct Audience {
    device: Arc<Device>,
    /// Where the module sends no events: an inotify watch for the node being opened or closed.
    opens: Option<OwnedFd>,
    /// With `opens`: the first answer was not given yet, and needs no waiting.
    fresh: bool,
    stop: OwnedFd,
}

#[derive(Debug)]
pub struct Stop(OwnedFd);

impl Drop for Stop {
    fn drop(&mut self) {
        // It only fails where it was used before.
        let _ = rustix::io::write(&self.0, &1_u64.to_ne_bytes());
    }
}

impl Audience {
    /// Begins to listen.
    ///
    /// # Errors
    /// Neither the module tells of its readers nor the system who opens the node.
    pub fn new(device: Arc<Device>) -> io::Result<(Self, Stop)> {
        let subscribed = device.subscribe(CLIENT_USAGE, SEND_INITIAL);
        let opens = match subscribed {
            Ok(()) => None,
            Err(_) => {
                let watch = inotify::init(inotify::CreateFlags::NONBLOCK | inotify::CreateFlags::CLOEXEC)?;
                let flags = inotify::WatchFlags::OPEN | inotify::WatchFlags::CLOSE;
                inotify::add_watch(&watch, device.path(), flags)?;
                Some(watch)
            }
        };
        let stop = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
        let other_end = stop.try_clone()?;
        Ok((Self { device, opens, fresh: true, stop }, Stop(other_end)))
    }

    /// Whether the module tells of its readers; otherwise whoever opens the node counts as one.
    pub fn has_module_events(&self) -> bool {
        self.opens.is_none()
    }

    /// Sleeps until the readers may have changed, but no longer than `patience` (`None`: for ever).
    pub fn wait(&mut self, patience: Option<Duration>) -> ReaderEvent {
        match &self.opens {
            None => self.next_event(patience),
            Some(opens) => {
                if !std::mem::take(&mut self.fresh) {
                    match self.sleep(opens, PollFlags::IN, patience) {
                        Woken::Ready => {}
                        Woken::Late => return ReaderEvent::Nothing,
                        Woken::Stop => return ReaderEvent::Stopped,
                    }
                    // No flags: only a stop ends this pause early.
                    if let Woken::Stop = self.sleep(&self.stop, PollFlags::empty(), Some(SETTLE)) {
                        return ReaderEvent::Stopped;
                    }
                    drain(opens);
                }
                ReaderEvent::Readers(!other_holders(self.device.path()).is_empty())
            }
        }
    }

    /// Waits for the module's next event; an event of another kind is [`ReaderEvent::Nothing`].
    fn next_event(&self, patience: Option<Duration>) -> ReaderEvent {
        match self.sleep(&*self.device, PollFlags::PRI, patience) {
            Woken::Ready => {}
            Woken::Late => return ReaderEvent::Nothing,
            Woken::Stop => return ReaderEvent::Stopped,
        }
        match self.device.dequeue_event() {
            Ok(event) if event.kind == CLIENT_USAGE => ReaderEvent::Readers(event.data[..4] != [0; 4]),
            Ok(_) => ReaderEvent::Nothing,
            Err(error) => match Errno::from_io_error(&error) {
                // Woken for nothing: no event is pending.
                Some(Errno::NOENT | Errno::AGAIN) => ReaderEvent::Nothing,
                _ => ReaderEvent::Stopped,
            },
        }
    }

    /// Polls `on` for `flags`, and for the stop, no longer than `patience` (`None`: for ever).
    fn sleep(&self, on: impl AsFd, flags: PollFlags, patience: Option<Duration>) -> Woken {
        let patience = patience.and_then(|patience| Timespec::try_from(patience).ok());
        let mut fds = [PollFd::new(&on, flags), PollFd::new(&self.stop, PollFlags::IN)];
        match poll(&mut fds, patience.as_ref()) {
            Ok(0) | Err(Errno::INTR) => Woken::Late,
            Ok(_) if fds[1].revents().is_empty() && fds[0].revents().intersects(flags) => Woken::Ready,
            // Neither what was waited for nor the end: the node is gone.
            _ => Woken::Stop,
        }
    }
}

enum Woken {
    Ready,
    Late,
    Stop,
}

/// Discards all pending inotify events: what they were does not matter, as the holders are looked up afterwards.
fn drain(opens: &OwnedFd) {
    let mut events = [0_u8; 1024];
    while rustix::io::read(opens, &mut events).is_ok_and(|bytes| bytes > 0) {}
}

#[cfg(test)]
mod tests {
    use std::process::{Command, Stdio};
    use std::time::Instant;

    use super::*;

    /// A device that is no virtual camera does not tell; any file's holders can be looked up.
    fn listen(file: &std::path::Path) -> (Audience, Stop) {
        Audience::new(Arc::new(Device::open(file).unwrap())).unwrap()
    }

    #[test]
    fn the_number_of_the_event_is_the_modules() {
        assert_eq!(CLIENT_USAGE, 283_115_521);
    }

    #[test]
    fn another_process_that_keeps_the_node_open_is_a_reader_until_it_ends() {
        // The system's only device that every user may open and nobody else keeps open.
        let node = std::path::Path::new("/dev/full");
        let (mut audience, _stop) = listen(node);
        assert!(!audience.has_module_events());
        assert_eq!(audience.wait(None), ReaderEvent::Readers(false));
        // Looked at and left: no reader.
        drop(std::fs::File::open(node).unwrap());
        assert_eq!(audience.wait(Some(Duration::from_secs(20))), ReaderEvent::Readers(false));
        assert_eq!(audience.wait(Some(Duration::from_millis(1))), ReaderEvent::Nothing);
        let file = std::fs::File::open(node).unwrap();
        let mut reader = Command::new("sleep").arg("60").stdin(Stdio::from(file)).spawn().unwrap();
        assert_eq!(audience.wait(Some(Duration::from_secs(20))), ReaderEvent::Readers(true));
        reader.kill().unwrap();
        reader.wait().unwrap();
        let heard = std::iter::repeat_with(|| audience.wait(Some(Duration::from_secs(20))));
        assert!(heard.take(3).any(|heard| heard == ReaderEvent::Readers(false)));
    }

    #[test]
    fn listening_ends_when_it_is_told_to() {
        let node = tempfile::NamedTempFile::new().unwrap();
        let (mut audience, stop) = listen(node.path());
        assert!(matches!(audience.wait(None), ReaderEvent::Readers(_)));
        let began = Instant::now();
        let listener = std::thread::spawn(move || audience.wait(None));
        drop(stop);
        assert_eq!(listener.join().unwrap(), ReaderEvent::Stopped);
        assert!(began.elapsed() < Duration::from_secs(20));
    }
}
