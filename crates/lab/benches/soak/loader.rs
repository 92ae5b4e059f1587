//! Another process that occupies a core at intervals: this program once more, by a hidden argument.

use std::io::{self, Read};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// First argument of the other process.
pub const ARGUMENT: &str = "--load-one-core";
const BUSY: Duration = Duration::from_secs(10);
/// Time from one busy phase to the next.
pub const CYCLE: Duration = Duration::from_secs(20);

/// The other process; it ends when this value is dropped, or when this process ends for any reason.
pub struct Loader(Child);

impl Loader {
    /// Starts it with a quiet phase.
    ///
    /// # Errors
    /// Fails if the system cannot create a process.
    pub fn start() -> io::Result<Self> {
        let program = std::env::current_exe()?;
        Command::new(program).arg(ARGUMENT).stdin(Stdio::piped()).spawn().map(Self)
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        // Fails only when it has ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs as the other process.
pub fn run_load() -> ! {
    // Its standard input ends when the process that started it does.
    thread::spawn(|| {
        let _ = io::stdin().read_to_end(&mut Vec::new());
        std::process::exit(0);
    });
    loop {
        let began = Instant::now();
        thread::sleep(CYCLE - BUSY);
        let mut work = 0u64;
        while began.elapsed() < CYCLE {
            (0..10_000u64).for_each(|k| work = std::hint::black_box(work.rotate_left(7) ^ k));
        }
    }
}
