//! Detects whether other programs read from a virtual camera.
//!
//! From v4l2loopback 0.13 on, the module itself sends an event when a reader starts or stops streaming. (0.13 misses
//! readers that use plain `read()`.) With earlier versions, every other process that has the node open counts as a
//! reader; they are looked up when the node is opened or closed. Processes of other users, and outside of a container,
//! are then visible only with sufficient rights.

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;
use std::time::Duration;

use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::fs::inotify;
use rustix::io::Errno;

use super::device::Device;
use super::events::{PRIVATE_START, SEND_INITIAL};
use super::holders::has_other_holders;

/// The module's event "client usage"; its data begin with a `u32`: 1 while a reader streams, else 0.
const CLIENT_USAGE: u32 = PRIVATE_START + 0x08E0_0000 + 1;
/// Delay from an open to the search for holders: a program that only lists cameras has closed the node by then.
const SETTLE_TIME: Duration = Duration::from_millis(60);

/// Result of waiting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReaderEvent {
    /// Whether there are readers now.
    Readers(bool),
    Nothing,
    /// The end: [`StopHandle`] was dropped, or the node is gone.
    Stopped,
}

/// Watches for readers of one node.
#[derive(Debug)]
pub struct ReaderMonitor {
    device: Arc<Device>,
    /// An inotify watch for the node being opened or closed, if the module sends no events.
    open_watch: Option<OwnedFd>,
    /// With `open_watch`: the first result is still due, and needs no waiting.
    first_result: bool,
    stop: OwnedFd,
}

#[derive(Debug)]
pub struct StopHandle(OwnedFd);

impl Drop for StopHandle {
    fn drop(&mut self) {
        // Fails only if it was written before.
        let _ = rustix::io::write(&self.0, &1_u64.to_ne_bytes());
    }
}

impl ReaderMonitor {
    /// Starts to watch.
    ///
    /// # Errors
    /// The module sends no events, and the system cannot watch the node either.
    pub fn new(device: Arc<Device>) -> io::Result<(Self, StopHandle)> {
        let subscribed = device.subscribe(CLIENT_USAGE, SEND_INITIAL);
        let open_watch = match subscribed {
            Ok(()) => None,
            Err(_) => {
                let watch = inotify::init(inotify::CreateFlags::NONBLOCK | inotify::CreateFlags::CLOEXEC)?;
                let flags = inotify::WatchFlags::OPEN | inotify::WatchFlags::CLOSE;
                inotify::add_watch(&watch, device.path(), flags)?;
                Some(watch)
            }
        };
        let stop = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?;
        let stop_writer = stop.try_clone()?;
        Ok((Self { device, open_watch, first_result: true, stop }, StopHandle(stop_writer)))
    }

    /// Whether the module reports its readers; otherwise every process that opens the node counts as one.
    pub fn has_module_events(&self) -> bool {
        self.open_watch.is_none()
    }

    /// Waits until the readers may have changed, for at most `timeout` (`None`: forever).
    pub fn wait(&mut self, timeout: Option<Duration>) -> ReaderEvent {
        match &self.open_watch {
            None => self.next_event(timeout),
            Some(open_watch) => {
                if !std::mem::take(&mut self.first_result) {
                    match self.poll_fd(open_watch, PollFlags::IN, timeout) {
                        Poll::Ready => {}
                        Poll::TimedOut => return ReaderEvent::Nothing,
                        Poll::Stop => return ReaderEvent::Stopped,
                    }
                    // Without flags, only a stop ends this wait early.
                    if let Poll::Stop = self.poll_fd(&self.stop, PollFlags::empty(), Some(SETTLE_TIME)) {
                        return ReaderEvent::Stopped;
                    }
                    drain_events(open_watch);
                }
                ReaderEvent::Readers(has_other_holders(self.device.path()))
            }
        }
    }

    /// Waits for the module's next event; other events return [`ReaderEvent::Nothing`].
    fn next_event(&self, timeout: Option<Duration>) -> ReaderEvent {
        match self.poll_fd(&*self.device, PollFlags::PRI, timeout) {
            Poll::Ready => {}
            Poll::TimedOut => return ReaderEvent::Nothing,
            Poll::Stop => return ReaderEvent::Stopped,
        }
        match self.device.dequeue_event() {
            Ok(event) if event.kind == CLIENT_USAGE => ReaderEvent::Readers(event.data[..4] != [0; 4]),
            Ok(_) => ReaderEvent::Nothing,
            Err(error) => match Errno::from_io_error(&error) {
                // A spurious wake-up: no event is pending.
                Some(Errno::NOENT | Errno::AGAIN) => ReaderEvent::Nothing,
                _ => ReaderEvent::Stopped,
            },
        }
    }

    /// Polls `fd` for `flags`, and for the stop, for at most `timeout` (`None`: forever).
    fn poll_fd(&self, fd: impl AsFd, flags: PollFlags, timeout: Option<Duration>) -> Poll {
        let timeout = timeout.and_then(|timeout| Timespec::try_from(timeout).ok());
        let mut fds = [PollFd::new(&fd, flags), PollFd::new(&self.stop, PollFlags::IN)];
        match poll(&mut fds, timeout.as_ref()) {
            Ok(0) | Err(Errno::INTR) => Poll::TimedOut,
            Ok(_) if fds[1].revents().is_empty() && fds[0].revents().intersects(flags) => Poll::Ready,
            // Neither the requested flags nor a stop: the node is gone.
            _ => Poll::Stop,
        }
    }
}

enum Poll {
    Ready,
    TimedOut,
    Stop,
}

/// Discards all pending inotify events: their content does not matter, since the holders are looked up afterwards.
fn drain_events(open_watch: &OwnedFd) {
    let mut events = [0_u8; 1024];
    while rustix::io::read(open_watch, &mut events).is_ok_and(|bytes| bytes > 0) {}
}

#[cfg(test)]
mod tests {
    use std::process::{Command, Stdio};
    use std::time::Instant;

    use super::*;

    /// A device that is not a virtual camera sends no events; the holders of any file can be looked up.
    fn start_monitor(file: &std::path::Path) -> (ReaderMonitor, StopHandle) {
        ReaderMonitor::new(Arc::new(Device::open(file).unwrap())).unwrap()
    }

    #[test]
    fn the_number_of_the_event_is_the_modules() {
        assert_eq!(CLIENT_USAGE, 283_115_521);
    }

    #[test]
    fn another_process_that_keeps_the_node_open_is_a_reader_until_it_ends() {
        // The only system device that every user may open and that no other process keeps open.
        let node = std::path::Path::new("/dev/full");
        let (mut monitor, _stop) = start_monitor(node);
        assert!(!monitor.has_module_events());
        assert_eq!(monitor.wait(None), ReaderEvent::Readers(false));
        // Opened and closed again: no reader.
        drop(std::fs::File::open(node).unwrap());
        assert_eq!(monitor.wait(Some(Duration::from_secs(20))), ReaderEvent::Readers(false));
        assert_eq!(monitor.wait(Some(Duration::from_millis(1))), ReaderEvent::Nothing);
        let file = std::fs::File::open(node).unwrap();
        let mut reader = Command::new("sleep").arg("60").stdin(Stdio::from(file)).spawn().unwrap();
        assert_eq!(monitor.wait(Some(Duration::from_secs(20))), ReaderEvent::Readers(true));
        reader.kill().unwrap();
        reader.wait().unwrap();
        let events = std::iter::repeat_with(|| monitor.wait(Some(Duration::from_secs(20))));
        assert!(events.take(3).any(|event| event == ReaderEvent::Readers(false)));
    }

    #[test]
    fn listening_ends_when_it_is_told_to() {
        let node = tempfile::NamedTempFile::new().unwrap();
        let (mut monitor, stop) = start_monitor(node.path());
        assert!(matches!(monitor.wait(None), ReaderEvent::Readers(_)));
        let began = Instant::now();
        let listener = std::thread::spawn(move || monitor.wait(None));
        drop(stop);
        assert_eq!(listener.join().unwrap(), ReaderEvent::Stopped);
        assert!(began.elapsed() < Duration::from_secs(20));
    }
}
