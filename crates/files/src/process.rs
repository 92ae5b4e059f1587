//! A child process that is killed when it hangs.

use std::collections::VecDeque;
use std::fs;
use std::io::{self, BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process_group};

/// How long a stalled process or reader is waited for once the run has to stop.
pub const STOP_TIMEOUT: Duration = Duration::from_secs(1);
/// Number of error lines that are kept: the cause comes last, but not always alone.
const MAX_STDERR_LINES: usize = 4;
/// A process that is idle for this long although it has work counts as hung; [`STOP_TIMEOUT`] once the run has to
/// stop.
const HANG_TIMEOUT: Duration = Duration::from_secs(10);
/// How often a process is polled while waiting for it.
const TICK: Duration = Duration::from_millis(10);

/// A process in a group of its own. Dropping it kills the group.
pub struct Process {
    child: Child,
    /// Its last lines on standard error, sent once it has closed that.
    stderr: Receiver<VecDeque<String>>,
    stop: Arc<AtomicBool>,
}

/// How a process ended.
pub struct ProcessEnd {
    /// `None` for a process that hung and was killed.
    pub status: Option<ExitStatus>,
    /// Its last error lines, joined by ` | `.
    pub stderr: String,
}

impl Process {
    /// Starts a command in a group of its own, whose standard error is piped. `stop` is set once the run has to stop.
    ///
    /// # Errors
    /// The program is missing, or the system refuses the process or its thread.
    pub fn start(command: &mut Command, stop: &Arc<AtomicBool>) -> io::Result<Self> {
        Self::start_logging(command, stop, |line| Some(line.to_owned()))
    }

    /// Does the same, and passes every line of standard error to `log`, which returns what to keep of it.
    ///
    /// # Errors
    /// Same as for [`Process::start`].
    pub fn start_logging(
        command: &mut Command,
        stop: &Arc<AtomicBool>,
        log: impl FnMut(&str) -> Option<String> + Send + 'static,
    ) -> io::Result<Self> {
        // Ctrl-C on a terminal signals the whole group, and an encoder must survive until the last frame.
        let mut child = command.process_group(0).spawn()?;
        let (stderr_sender, stderr) = mpsc::channel();
        // Read continuously: a process that fills the pipe would block, and this program with it.
        let reader = child.stderr.take().map(|stderr| {
            thread::Builder::new()
                .name("messages".into())
                .spawn(move || drop(stderr_sender.send(read_last_lines(stderr, log))))
        });
        let process = Self { child, stderr, stop: Arc::clone(stop) };
        reader.transpose().map(|_| process)
    }

    /// Takes its standard input, if that is piped.
    pub fn stdin(&mut self) -> Option<ChildStdin> {
        self.child.stdin.take()
    }

    /// Takes its standard output, if that is piped.
    pub fn stdout(&mut self) -> Option<ChildStdout> {
        self.child.stdout.take()
    }

    /// Returns the id of its process group.
    pub fn group(&self) -> u32 {
        self.child.id()
    }

    /// Creates a watchdog for it.
    pub fn watchdog(&self) -> Watchdog {
        Watchdog { pid: self.child.id(), stop: Arc::clone(&self.stop), cpu_ticks: None, last_active_at: Instant::now() }
    }

    /// Waits until it ends; kills it if it hangs.
    ///
    /// # Errors
    /// The system cannot tell its state.
    pub fn wait(&mut self) -> io::Result<ProcessEnd> {
        self.wait_at_most(Duration::MAX)
    }

    /// Does the same, and kills it after `limit` even if it works.
    ///
    /// # Errors
    /// Same as for [`Process::wait`].
    pub fn wait_at_most(&mut self, limit: Duration) -> io::Result<ProcessEnd> {
        let (started, mut watchdog) = (Instant::now(), self.watchdog());
        let status = loop {
            if let Some(status) = self.child.try_wait()? {
                break Some(status);
            }
            if watchdog.is_hung(started.elapsed()) || started.elapsed() > limit {
                return Ok(self.kill_hung());
            }
            thread::sleep(TICK);
        };
        Ok(ProcessEnd { status, stderr: self.last_stderr() })
    }

    /// Kills the hung process.
    pub fn kill_hung(&mut self) -> ProcessEnd {
        self.kill();
        ProcessEnd { status: None, stderr: self.last_stderr() }
    }

    fn last_stderr(&self) -> String {
        // A child process of it may keep standard error open for longer.
        Vec::from(self.stderr.recv_timeout(STOP_TIMEOUT / 2).unwrap_or_default()).join(" | ")
    }

    fn kill(&mut self) {
        // Errors are ignored: it may just have ended by itself.
        let _ = Pid::from_raw(self.child.id() as i32).map(|group| kill_process_group(group, Signal::KILL));
        let _ = self.child.kill();
        let started = Instant::now();
        // A process that waits for an unresponsive device cannot even be killed.
        while started.elapsed() < STOP_TIMEOUT / 2 && matches!(self.child.try_wait(), Ok(None)) {
            thread::sleep(TICK);
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            self.kill();
        }
    }
}

/// Detects whether a process hangs, by its processor time and its state.
pub struct Watchdog {
    pid: u32,
    stop: Arc<AtomicBool>,
    /// Processor time used when it was last seen to work.
    cpu_ticks: Option<u64>,
    last_active_at: Instant,
}

impl Watchdog {
    /// Whether it has been idle for too long, where the caller has waited for it for `waited`.
    pub fn is_hung(&mut self, waited: Duration) -> bool {
        let (is_active, cpu_ticks) = read_activity(self.pid);
        if is_active || cpu_ticks != self.cpu_ticks {
            (self.cpu_ticks, self.last_active_at) = (cpu_ticks, Instant::now());
        }
        let timeout = if self.stop.load(Ordering::Relaxed) { STOP_TIMEOUT } else { HANG_TIMEOUT };
        // It may have been idle before because it had no work.
        waited.min(self.last_active_at.elapsed()) >= timeout
    }
}

/// Returns whether a process runs or waits for a device, and the processor time of all of its threads so far.
fn read_activity(pid: u32) -> (bool, Option<u64>) {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // The name, in brackets, may contain any characters.
    let mut fields = stat.rsplit_once(')').map_or("", |(_, fields)| fields).split_whitespace();
    let is_active = matches!(fields.next(), Some("R" | "D"));
    let mut number = |at| fields.nth(at).and_then(|field| field.parse::<u64>().ok());
    // proc(5): utime and stime are the 14th and 15th, the state is the third.
    (is_active, number(10).zip(number(0)).map(|(user, system)| user + system))
}

fn read_last_lines(stderr: impl Read, mut log: impl FnMut(&str) -> Option<String>) -> VecDeque<String> {
    let mut lines = VecDeque::with_capacity(MAX_STDERR_LINES + 1);
    for line in BufReader::new(stderr).split(b'\n').map_while(Result::ok) {
        let line = String::from_utf8_lossy(&line);
        if !line.trim().is_empty() {
            lines.extend(log(line.trim()));
        }
        if lines.len() > MAX_STDERR_LINES {
            lines.pop_front();
        }
    }
    lines
}

/// Returns a program's standard output, if it ends in time.
pub fn read_output_within(command: &mut Command, timeout: Duration) -> Option<String> {
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().ok()?;
    let mut stdout = child.stdout.take()?;
    let (output_sender, output) = mpsc::channel();
    let read = move || {
        let mut text = Vec::new();
        // The receiver may have timed out.
        let _ = stdout.read_to_end(&mut text).map(|_| output_sender.send(text));
    };
    thread::Builder::new().name("messages".into()).spawn(read).ok()?;
    let output = output.recv_timeout(timeout);
    // Either it has closed its output and is done, or it took too long.
    let _ = child.kill();
    let _ = child.wait();
    String::from_utf8(output.ok()?).ok()
}
