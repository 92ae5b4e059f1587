//! Writes to a pipe whose reader may stall, without blocking forever.

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

use bokehcam_files::process::STOP_TIMEOUT;

/// How often a blocked writer checks whether to continue waiting.
const TICK: Duration = Duration::from_millis(50);
/// Minimum free space of a pipe when `poll` reports it as writable (`PIPE_BUF`): writing this much does not block.
const MIN_FREE_BYTES: usize = 4096;

/// A writer with a bounded wait for free space; then writing fails with [`ErrorKind::TimedOut`].
pub struct Pipe {
    file: File,
    /// Maximum bytes of one `write` call; `None` for a file, which is written without polling.
    chunk_bytes: Option<usize>,
    /// Whether to continue waiting, after nothing was written for the given time.
    should_wait: Box<dyn FnMut(Duration) -> bool + Send>,
}

impl Pipe {
    /// Opens standard output. Its reader may be slow until `stop` is set.
    pub(super) fn stdout(stop: &Arc<AtomicBool>) -> io::Result<Self> {
        let file = File::from(io::stdout().as_fd().try_clone_to_owned()?);
        let kind = file.metadata()?.file_type();
        // Not made non-blocking, since it may be shared with other processes: small writes do not block either.
        let chunk_bytes = (kind.is_fifo() || kind.is_socket() || kind.is_char_device()).then_some(MIN_FREE_BYTES);
        let stop = Arc::clone(stop);
        let should_wait = move |blocked: Duration| !stop.load(Ordering::Relaxed) || blocked < STOP_TIMEOUT;
        Ok(Self { file, chunk_bytes, should_wait: Box::new(should_wait) })
    }

    /// Wraps the end of a pipe that only this program uses, and makes it non-blocking.
    pub(super) fn from_owned(
        end: OwnedFd,
        should_wait: impl FnMut(Duration) -> bool + Send + 'static,
    ) -> io::Result<Self> {
        fcntl_setfl(&end, fcntl_getfl(&end)? | OFlags::NONBLOCK)?;
        Ok(Self { file: File::from(end), chunk_bytes: Some(usize::MAX), should_wait: Box::new(should_wait) })
    }

    /// Waits until the reader has read everything written, or has gone, for at most `timeout`. Errors are reported by
    /// the next write.
    pub(super) fn wait_drained(&self, timeout: Duration) -> io::Result<()> {
        const TICK: Timespec = Timespec { tv_sec: 0, tv_nsec: 2_000_000 };
        let started = Instant::now();
        while ioctl_fionread(&self.file)? > 0 && started.elapsed() < timeout {
            // Even without requested events, `poll` reports that the reader has gone.
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
        let started = Instant::now();
        loop {
            if wait_writable(&self.file)? {
                match self.file.write(&bytes[..bytes.len().min(chunk_bytes)]) {
                    Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                    written => return written,
                }
            }
            if !(self.should_wait)(started.elapsed()) {
                return Err(ErrorKind::TimedOut.into());
            }
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Waits up to [`TICK`] for free space; returns whether there is any.
fn wait_writable(file: &File) -> io::Result<bool> {
    let mut ends = [PollFd::new(file, PollFlags::OUT)];
    let tick = Timespec { tv_sec: 0, tv_nsec: TICK.as_nanos() as i64 };
    match poll(&mut ends, Some(&tick)) {
        // Also true if the reader has gone: writing reports that.
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
        let should_wait = move |_| {
            asked += 1;
            asked < 3
        };
        let mut pipe = Pipe::from_owned(writer.into(), should_wait).unwrap();
        let bytes = vec![7; 1 << 20];
        assert_eq!(pipe.write_all(&bytes).unwrap_err().kind(), ErrorKind::TimedOut);
        // The bytes written before the timeout are there.
        let mut first = [0; 100];
        reader.read_exact(&mut first).unwrap();
        assert_eq!(first, [7; 100]);
    }

    #[test]
    fn a_slow_reader_gets_everything() {
        let (mut reader, writer) = io::pipe().unwrap();
        let mut pipe = Pipe::from_owned(writer.into(), |_| true).unwrap();
        let bytes: Vec<u8> = (0..300_000).map(|k| (k % 251) as u8).collect();
        let sent = bytes.clone();
        let writer_thread = std::thread::spawn(move || pipe.write_all(&sent).unwrap());
        let mut all = Vec::new();
        let mut some = [0; 10_000];
        while let Ok(read @ 1..) = reader.read(&mut some) {
            all.extend_from_slice(&some[..read]);
        }
        writer_thread.join().unwrap();
        assert!(all == bytes);
    }

    #[test]
    fn a_pipe_is_settled_once_its_reader_has_taken_all_or_has_gone() {
        const LONG: Duration = Duration::from_secs(60);
        let (mut reader, writer) = io::pipe().unwrap();
        let mut pipe = Pipe::from_owned(writer.into(), |_| true).unwrap();
        pipe.write_all(&[1; 100]).unwrap();
        let started = Instant::now();
        pipe.wait_drained(Duration::from_millis(30)).unwrap();
        assert!(started.elapsed() >= Duration::from_millis(30), "nobody reads");
        let reader_thread = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(50));
            reader.read_exact(&mut [0; 100]).unwrap();
            reader
        });
        pipe.wait_drained(LONG).unwrap();
        assert!(started.elapsed() >= Duration::from_millis(50));
        pipe.write_all(&[1; 100]).unwrap();
        drop(reader_thread.join().unwrap());
        pipe.wait_drained(LONG).unwrap();
        assert!(started.elapsed() < LONG, "neither waits for more");
    }

    #[test]
    fn a_reader_that_has_gone_is_no_wait() {
        let (reader, writer) = io::pipe().unwrap();
        let mut pipe = Pipe::from_owned(writer.into(), |_| panic!("nobody is there to wait for")).unwrap();
        drop(reader);
        assert_eq!(pipe.write(&[1]).unwrap_err().kind(), ErrorKind::BrokenPipe);
    }
}
