//! Another process that wants a core for itself, now and then: this program once more, by a hidden argument.

use std::io::{self, Read};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// First argument of the other process.
pub const ARGUMENT: &str = "--load-one-core";
const BUSY: Duration = Duration::from_secs(10);
/// From one busy phase to the next.
pub const CYCLE: Duration = Duration::from_secs(20);

/// The other process; it ends with this value, or with this process, however that ends.
pub struct Loader(Child);

impl Loader {
    /// Starts it: the first quiet phase begins.
    ///
    /// # Errors
    /// The system gives no process.
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

/// The other process itself.
pub fn load() -> ! {
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
