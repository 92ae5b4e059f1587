//! Writes to a pipe whose reader may stall, without blocking for ever.

use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::FileTypeExt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::{Errno, ioctl_fionread};

/// How long a reader that takes nothing is waited for once the run is to stop.
pub(super) const LAST_PATIENCE: Duration = Duration::from_secs(1);
/// How often a blocked writer checks whether to go on waiting.
const TICK: Duration = Duration::from_millis(50);
/// Room that a pipe has at least when `poll` says that it has any (`PIPE_BUF`): writing so much does not block.
const ROOM_BYTES: usize = 4096;

/// A writer that waits for room only as long as that makes sense; then writing fails with [`ErrorKind::TimedOut`].
pub struct Pipe {
    file: File,
    /// Most bytes of one `write` call; `None` for a file, which is written without waiting for room.
    chunk_bytes: Option<usize>,
    /// Whether to go on waiting, after nothing was taken for the given time.
    waits_on: Box<dyn FnMut(Duration) -> bool + Send>,
}

impl Pipe {
    /// Standard output. Its reader may take its time until `stop` is set.
    pub(super) fn stdout(stop: &Arc<AtomicBool>) -> io::Result<Self> {
        let file = File::from(io::stdout().as_fd().try_clone_to_owned()?);
        let kind = file.metadata()?.file_type();
        // Not made non-blocking, since it may be shared with other processes: small writes do not block either.
        let chunk_bytes = (kind.is_fifo() || kind.is_socket() || kind.is_char_device()).then_some(ROOM_BYTES);
        let stop = Arc::clone(stop);
        let waits_on = move |blocked: Duration| !stop.load(Ordering::Relaxed) || blocked < LAST_PATIENCE;
        Ok(Self { file, chunk_bytes, waits_on: Box::new(waits_on) })
    }

    /// The end of a pipe that is ours alone, which is made non-blocking.
    pub(super) fn own(end: OwnedFd, waits_on: impl FnMut(Duration) -> bool + Send + 'static) -> io::Result<Self> {
        fcntl_setfl(&end, fcntl_getfl(&end)? | OFlags::NONBLOCK)?;
        Ok(Self { file: File::from(end), chunk_bytes: Some(usize::MAX), waits_on: Box::new(waits_on) })
    }

    /// Waits until the reader has taken all that was written, or has gone, but no longer than `patience`. What is wrong then
    /// is said by the next write.
    pub(super) fn settle(&self, patience: Duration) -> io::Result<()> {
        const TICK: Timespec = Timespec { tv_sec: 0, tv_nsec: 2_000_000 };
        let began = Instant::now();
        while ioctl_fionread(&self.file)? > 0 && began.elapsed() < patience {
            // Asked for nothing, it still tells that the reader has gone.
            match poll(&mut [PollFd::new(&self.file, PollFlags::empty())], Some(&TICK)) {
                Ok(0) | Err(Errno::INTR) => {}
                Ok(_) => break,
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}

impl Write for Pipe {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let Some(chunk_bytes) = self.chunk_bytes else { return self.file.write(bytes) };
        let began = Instant::now();
        loop {
            if wait_for_room(&self.file)? {
                match self.file.write(&bytes[..bytes.len().min(chunk_bytes)]) {
                    Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                    written => return written,
                }
            }
            if !(self.waits_on)(began.elapsed()) {
                return Err(ErrorKind::TimedOut.into());
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Waits up to [`TICK`] for room; gives back whether there is any.
fn wait_for_room(file: &File) -> io::Result<bool> {
    let mut ends = [PollFd::new(file, PollFlags::OUT)];
    let tick = Timespec { tv_sec: 0, tv_nsec: TICK.as_nanos() as i64 };
    match poll(&mut ends, Some(&tick)) {
        // Also where there is nobody any more: writing says so.
        Ok(ready) => Ok(ready > 0),
        Err(Errno::INTR) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    #[test]
    fn a_reader_that_takes_nothing_is_left_when_nobody_waits_any_more() {
        let (mut reader, writer) = io::pipe().unwrap();
        let mut asked = 0;
        let waits_on = move |_| {
            asked += 1;
            asked < 3
        };
        let mut pipe = Pipe::own(writer.into(), waits_on).unwrap();
        let bytes = vec![7; 1 << 20];
        assert_eq!(pipe.write_all(&bytes).unwrap_err().kind(), ErrorKind::TimedOut);
        // What was taken before is there.
        let mut first = [0; 100];
        reader.read_exact(&mut first).unwrap();
        assert_eq!(first, [7; 100]);
    }

    #[test]
    fn a_slow_reader_gets_everything() {
        let (mut reader, writer) = io::pipe().unwrap();
        let mut pipe = Pipe::own(writer.into(), |_| true).unwrap();
        let bytes: Vec<u8> = (0..300_000).map(|k| (k % 251) as u8).collect();
        let sent = bytes.clone();
        let writes = std::thread::spawn(move || pipe.write_all(&sent).unwrap());
        let mut all = Vec::new();
        let mut some = [0; 10_000];
        while let Ok(read @ 1..) = reader.read(&mut some) {
            all.extend_from_slice(&some[..read]);
        }
        writes.join().unwrap();
        assert!(all == bytes);
    }

    #[test]
    fn a_pipe_is_settled_once_its_reader_has_taken_all_or_has_gone() {
        const LONG: Duration = Duration::from_secs(60);
        let (mut reader, writer) = io::pipe().unwrap();
        let mut pipe = Pipe::own(writer.into(), |_| true).unwrap();
        pipe.write_all(&[1; 100]).unwrap();
        let began = Instant::now();
        pipe.settle(Duration::from_millis(30)).unwrap();
        assert!(began.elapsed() >= Duration::from_millis(30), "nobody reads");
        let reads = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(50));
            reader.read_exact(&mut [0; 100]).unwrap();
            reader
        });
        pipe.settle(LONG).unwrap();
        assert!(began.elapsed() >= Duration::from_millis(50));
        pipe.write_all(&[1; 100]).unwrap();
        drop(reads.join().unwrap());
        pipe.settle(LONG).unwrap();
        assert!(began.elapsed() < LONG, "neither waits for more");
    }

    #[test]
    fn a_reader_that_has_gone_is_no_wait() {
        let (reader, writer) = io::pipe().unwrap();
        let mut pipe = Pipe::own(writer.into(), |_| panic!("nobody is there to wait for")).unwrap();
        drop(reader);
        assert_eq!(pipe.write(&[1]).unwrap_err().kind(), ErrorKind::BrokenPipe);
    }
}
