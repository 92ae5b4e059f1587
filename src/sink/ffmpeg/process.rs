//! A child process that is killed when it hangs.

use std::collections::VecDeque;
use std::fs;
use std::io::{self, BufRead, BufReader, Read};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process_group};

use crate::sink::pipe::LAST_PATIENCE;

/// Lines of a complaint that are kept: the cause comes last, but not always alone.
const LAST_LINES: usize = 4;
/// A process that has something to do and does nothing for this long hangs; [`LAST_PATIENCE`] once the run is to stop.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often a process is checked while it is waited for.
const TICK: Duration = Duration::from_millis(10);

/// A process in a group of its own. Dropping it kills the group.
pub(super) struct Process {
    child: Child,
    /// Its last lines on standard error, once it has closed that.
    said: Receiver<VecDeque<String>>,
    stop: Arc<AtomicBool>,
}

/// How a process ended.
pub(super) struct Ended {
    /// `None` for one that hung, and was killed.
    pub status: Option<ExitStatus>,
    /// The last lines that it said, joined by ` | `.
    pub said: String,
}

impl Process {
    /// Starts a command whose standard error is piped. `stop` is set once the run is to stop.
    pub(super) fn start(command: &mut Command, stop: &Arc<AtomicBool>) -> io::Result<Self> {
        let mut child = command.spawn()?;
        let (to, said) = mpsc::channel();
        // Read all the while: a process that fills the pipe would block, and this program with it.
        let reader = child.stderr.take().map(|stderr| {
            thread::Builder::new().name("ffmpeg".into()).spawn(move || drop(to.send(last_lines(stderr))))
        });
        let process = Self { child, said, stop: Arc::clone(stop) };
        reader.transpose().map(|_| process)
    }

    pub(super) fn stdin(&mut self) -> Option<ChildStdin> {
        self.child.stdin.take()
    }

    pub(super) fn watchdog(&self) -> Watchdog {
        Watchdog { pid: self.child.id(), stop: Arc::clone(&self.stop), used: None, worked_at: Instant::now() }
    }

    /// Waits until it ends; kills it if it hangs.
    pub(super) fn wait(&mut self) -> io::Result<Ended> {
        let (began, mut watchdog) = (Instant::now(), self.watchdog());
        let status = loop {
            if let Some(status) = self.child.try_wait()? {
                break Some(status);
            }
            if watchdog.hangs(began.elapsed()) {
                return Ok(self.end_hung());
            }
            thread::sleep(TICK);
        };
        Ok(Ended { status, said: self.said() })
    }

    /// Kills it because it hangs.
    pub(super) fn end_hung(&mut self) -> Ended {
        self.kill();
        Ended { status: None, said: self.said() }
    }

    fn said(&self) -> String {
        // A child of its own may keep standard error open for longer.
        Vec::from(self.said.recv_timeout(LAST_PATIENCE / 2).unwrap_or_default()).join(" | ")
    }

    fn kill(&mut self) {
        // Errors are ignored: it may just have ended by itself.
        let _ = Pid::from_raw(self.child.id() as i32).map(|group| kill_process_group(group, Signal::KILL));
        let _ = self.child.kill();
        let began = Instant::now();
        // A process that waits for a device that does not answer cannot even be killed.
        while began.elapsed() < LAST_PATIENCE / 2 && matches!(self.child.try_wait(), Ok(None)) {
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

/// Tells whether a process hangs, by its use of the processor and its state.
pub(super) struct Watchdog {
    pid: u32,
    stop: Arc<AtomicBool>,
    /// Processor time that it had used, in ticks, when it was last seen to work.
    used: Option<u64>,
    worked_at: Instant,
}

impl Watchdog {
    /// Whether it has done nothing for too long, where the caller has waited for it for `waited`.
    pub(super) fn hangs(&mut self, waited: Duration) -> bool {
        let (works, used) = activity(self.pid);
        if works || used != self.used {
            (self.used, self.worked_at) = (used, Instant::now());
        }
        let patience = if self.stop.load(Ordering::Relaxed) { LAST_PATIENCE } else { PATIENCE };
        // It may have been idle before, for want of something to do.
        waited.min(self.worked_at.elapsed()) >= patience
    }
}

/// Whether a process runs or waits for a device, and the processor time of all of its threads so far.
fn activity(pid: u32) -> (bool, Option<u64>) {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // The name, in brackets, may have anything in it.
    let mut fields = stat.rsplit_once(')').map_or("", |(_, fields)| fields).split_whitespace();
    let works = matches!(fields.next(), Some("R" | "D"));
    let mut number = |at| fields.nth(at).and_then(|field| field.parse::<u64>().ok());
    // proc(5): utime and stime are the 14th and 15th, the state is the third.
    (works, number(10).zip(number(0)).map(|(user, system)| user + system))
}

fn last_lines(stderr: impl Read) -> VecDeque<String> {
    let mut lines = VecDeque::with_capacity(LAST_LINES + 1);
    for line in BufReader::new(stderr).split(b'\n').map_while(Result::ok) {
        let line = String::from_utf8_lossy(&line).trim().to_owned();
        if !line.is_empty() {
            lines.push_back(line);
        }
        if lines.len() > LAST_LINES {
            lines.pop_front();
        }
    }
    lines
}

/// What a program says on its standard output, if it ends well and in time.
pub(super) fn output_within(command: &mut Command, patience: Duration) -> Option<String> {
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().ok()?;
    let mut stdout = child.stdout.take()?;
    let (to, said) = mpsc::channel();
    let read = move || {
        let mut text = Vec::new();
        // The receiver may have given up.
        let _ = stdout.read_to_end(&mut text).map(|_| to.send(text));
    };
    thread::Builder::new().name("ffmpeg".into()).spawn(read).ok()?;
    let said = said.recv_timeout(patience);
    // Either it has closed its output and is done, or it took too long.
    let _ = child.kill();
    let _ = child.wait();
    String::from_utf8(said.ok()?).ok()
}
