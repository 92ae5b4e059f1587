//! Locks of folders between programs.

use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;

const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// Locks a folder against other programs that lock it, until the returned file is dropped. Waits for them for at most
/// `timeout`.
///
/// # Errors
/// Another program holds the lock for longer, or the folder cannot be opened or locked.
pub fn lock_folder(folder: &Path, timeout: Duration) -> io::Result<File> {
    let lock = File::open(folder)?;
    let until = Instant::now() + timeout;
    while let Err(error) = flock(&lock, FlockOperation::NonBlockingLockExclusive) {
        if error != Errno::WOULDBLOCK {
            return Err(error.into());
        }
        if Instant::now() >= until {
            return Err(io::Error::new(ErrorKind::WouldBlock, "it is locked by another program"));
        }
        thread::sleep(POLL_INTERVAL);
    }
    Ok(lock)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_program_at_a_time_holds_a_folder_and_the_next_waits_for_it() {
        let folder = tempfile::tempdir().unwrap();
        let held = lock_folder(folder.path(), Duration::ZERO).unwrap();
        let refused = lock_folder(folder.path(), Duration::ZERO).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::WouldBlock);
        thread::scope(|scope| {
            let waiting = scope.spawn(|| lock_folder(folder.path(), Duration::from_secs(60)));
            thread::sleep(5 * POLL_INTERVAL);
            drop(held);
            waiting.join().unwrap().unwrap();
        });
    }
}
