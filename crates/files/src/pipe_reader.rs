//! Reads from a pipe whose writer may stall, without blocking for long.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::os::fd::{AsFd, OwnedFd};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::pipe::fcntl_setpipe_size;

/// Size of a pipe of ours: the system's default makes a picture of many pixels wait for its reader dozens of times.
const PIPE_BYTES: usize = 1 << 20;

/// The reading end of a pipe.
#[derive(Debug)]
pub struct PipeReader(File);

/// Result of [`PipeReader::fill`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filled {
    /// All bytes are there.
    Whole,
    /// The writer has written nothing for too long; the next call continues.
    Waiting,
    /// The writer has closed the pipe.
    End,
}

impl PipeReader {
    /// Wraps the end of a pipe that only this program uses.
    pub fn from_owned(end: OwnedFd) -> Self {
        // A small pipe is slower, and no more than that.
        let _ = fcntl_setpipe_size(&end, PIPE_BYTES);
        Self(File::from(end))
    }

    /// Opens standard input.
    ///
    /// # Errors
    /// Standard input is closed.
    pub fn stdin() -> io::Result<Self> {
        Ok(Self(File::from(io::stdin().as_fd().try_clone_to_owned()?)))
    }

    /// Reads into `bytes` from `filled` on, which is advanced, until all are filled. Waits for more up to `patience`.
    ///
    /// # Errors
    /// Reading failed.
    pub fn fill(&mut self, bytes: &mut [u8], filled: &mut usize, patience: Duration) -> io::Result<Filled> {
        let wait = Timespec::try_from(patience).map_err(|_| ErrorKind::InvalidInput)?;
        while *filled < bytes.len() {
            match poll(&mut [PollFd::new(&self.0, PollFlags::IN)], Some(&wait)) {
                Ok(0) => return Ok(Filled::Waiting),
                Err(Errno::INTR) => continue,
                // Never blocks: there is something, or the writer has gone.
                Ok(_) => match self.0.read(&mut bytes[*filled..]) {
                    Ok(0) => return Ok(Filled::End),
                    Ok(count) => *filled += count,
                    Err(error) if error.kind() == ErrorKind::Interrupted => {}
                    Err(error) => return Err(error),
                },
                Err(error) => return Err(error.into()),
            }
        }
        Ok(Filled::Whole)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    const SHORT: Duration = Duration::from_millis(1);

    #[test]
    fn a_stalled_writer_is_no_block_and_loses_nothing() {
        let (reader, mut writer) = io::pipe().unwrap();
        let mut reader = PipeReader::from_owned(reader.into());
        let (mut bytes, mut filled) = ([0; 6], 0);
        for part in [&b"ab"[..], b"c", b"def"] {
            assert_eq!(reader.fill(&mut bytes, &mut filled, SHORT).unwrap(), Filled::Waiting);
            writer.write_all(part).unwrap();
        }
        assert_eq!(reader.fill(&mut bytes, &mut filled, SHORT).unwrap(), Filled::Whole);
        assert_eq!((bytes, filled), (*b"abcdef", 6));
        writer.write_all(b"gh").unwrap();
        drop(writer);
        filled = 0;
        assert_eq!(reader.fill(&mut bytes, &mut filled, SHORT).unwrap(), Filled::End);
        assert_eq!((&bytes[..filled], filled), (&b"gh"[..], 2));
    }
}
