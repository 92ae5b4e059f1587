//! The client side, which waits for a network's answers.

use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::message::{Ports, Reply, Request, receive, receive_values, send, send_values, tensor_shapes};
use super::{ARGUMENT, IS_EXITING, LOAD_TIMEOUT, MAX_MEMORY_BYTES, RUN_TIMEOUT};
use crate::network::{Engine, LoadFailure, Network, Runtime, Tensor, to_one_line};

/// Interval at which a wait is checked for its end.
const POLL_INTERVAL: Duration = Duration::from_millis(50);
/// Time limit for an answer once the program is about to exit.
const EXIT_TIMEOUT: Duration = Duration::from_millis(500);

/// A process that runs a network; it is killed on drop.
pub struct Process {
    child: Child,
    stream: UnixStream,
    outputs: usize,
    /// The error that ended communication.
    failed: Option<String>,
    buffer: Vec<u8>,
}

impl Process {
    /// Starts this program again.
    pub fn start() -> io::Result<Self> {
        // Runs the same program even if its file was replaced meanwhile.
        Self::spawn(Command::new("/proc/self/exe").arg0("bokehcam").arg(ARGUMENT))
    }

    fn spawn(command: &mut Command) -> io::Result<Self> {
        let (stream, other) = UnixStream::pair()?;
        stream.set_read_timeout(Some(POLL_INTERVAL))?;
        stream.set_write_timeout(Some(POLL_INTERVAL))?;
        // Its own process group, because Ctrl-C must only reach this program, which ends the other one itself. stderr
        // is discarded, as a runtime would write to the terminal directly.
        let command = command.process_group(0).stdin(OwnedFd::from(other)).stdout(Stdio::null()).stderr(Stdio::null());
        let child = command.spawn()?;
        // Close our copy of its end of the socket, or its death would go unnoticed.
        command.stdin(Stdio::null());
        Ok(Self { child, stream, outputs: 0, failed: None, buffer: Vec::new() })
    }

    pub fn load(mut self, content: &[u8], runtime: Runtime) -> Result<Network, LoadFailure> {
        let request = Request::Load { runtime: runtime.name().to_owned(), bytes: content.len() };
        let reply = self.exchange(LOAD_TIMEOUT, |stream, _| {
            send(stream, &request)?;
            stream.write_all(content)?;
            receive(stream)
        });
        match reply.map_err(LoadFailure::Refused)? {
            Reply::Loaded(Ports { inputs, outputs, runtime }) => {
                self.outputs = outputs.len();
                Ok(Network { engine: Box::new(self), inputs, outputs, runtime })
            }
            Reply::NotLoaded(failure) => Err(failure),
            Reply::Ran(_) | Reply::Failed(_) => Err(LoadFailure::Refused(UNEXPECTED_ANSWER.to_owned())),
        }
    }

    /// Exchanges messages within `timeout`. Any failure, not only a timeout, kills the process, and later calls return
    /// the same error.
    fn exchange<T>(
        &mut self,
        timeout: Duration,
        communicate: impl FnOnce(&mut TimedStream, &mut Vec<u8>) -> io::Result<T>,
    ) -> Result<T, String> {
        if let Some(why) = &self.failed {
            return Err(why.clone());
        }
        let mut stream = TimedStream { stream: &self.stream, deadline: Instant::now() + timeout, is_exiting: false };
        communicate(&mut stream, &mut self.buffer).map_err(|error| {
            let why = match error.kind() {
                ErrorKind::TimedOut if stream.is_exiting => "it gave no answer before the program ended".to_owned(),
                ErrorKind::TimedOut => format!("it gave no answer in {} s", timeout.as_secs_f32()),
                ErrorKind::UnexpectedEof | ErrorKind::BrokenPipe | ErrorKind::ConnectionReset => self.describe_end(),
                _ => to_one_line(error),
            };
            self.kill();
            self.failed.insert(why).clone()
        })
    }

    /// Kills a process that has closed its end, and describes how it ended.
    fn describe_end(&mut self) -> String {
        // Do not wait for a process that lives on with its end closed.
        let _ = self.child.kill();
        let signal = self.child.wait().ok().and_then(|status| status.signal());
        let most = MAX_MEMORY_BYTES >> 30;
        match signal {
            Some(_) => {
                format!("its process aborted: it asks for more than {most} GiB of memory, or its runtime crashed")
            }
            None => "its process ended".to_owned(),
        }
    }

    fn kill(&mut self) {
        // It may have ended by itself; `wait` reaps it.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

const UNEXPECTED_ANSWER: &str = "its process sent an unexpected answer";

impl Engine for Process {
    fn run(&mut self, inputs: &[Tensor], outputs: &mut Vec<Tensor>) -> Result<(), String> {
        let count = self.outputs;
        self.exchange(RUN_TIMEOUT, |stream, buffer| {
            send(stream, &Request::Run(tensor_shapes(inputs)))?;
            send_values(stream, inputs, buffer)?;
            match receive(stream)? {
                Reply::Ran(sizes) if sizes.len() == count => {
                    receive_values(stream, sizes, outputs, buffer).map(|()| Ok(()))
                }
                Reply::Failed(why) => Ok(Err(why)),
                _ => Err(io::Error::new(ErrorKind::InvalidData, UNEXPECTED_ANSWER)),
            }
        })?
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// A stream with a time limit, which is shortened when the program is about to exit.
struct TimedStream<'a> {
    stream: &'a UnixStream,
    deadline: Instant,
    is_exiting: bool,
}

impl TimedStream<'_> {
    /// Retries until success, error or time limit; at least once, as this program may have been suspended meanwhile.
    fn retry<T>(&mut self, mut work: impl FnMut(&mut &UnixStream) -> io::Result<T>) -> io::Result<T> {
        loop {
            match work(&mut &*self.stream) {
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
                done => return done,
            }
            if !self.is_exiting && IS_EXITING.load(Ordering::Relaxed) {
                self.is_exiting = true;
                self.deadline = self.deadline.min(Instant::now() + EXIT_TIMEOUT);
            }
            if Instant::now() >= self.deadline {
                return Err(ErrorKind::TimedOut.into());
            }
        }
    }
}

impl Read for TimedStream<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.retry(|stream| stream.read(bytes))
    }
}

impl Write for TimedStream<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.retry(|stream| stream.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(command: &mut Command, timeout: Duration) -> (Process, String) {
        let mut process = Process::spawn(command).unwrap();
        let why = process.exchange(timeout, |stream, _| receive::<Reply>(stream)).unwrap_err();
        (process, why)
    }

    #[test]
    fn a_process_that_does_not_answer_is_killed_and_told_of() {
        let (mut process, why) = asked(Command::new("sleep").arg("1000"), Duration::from_millis(100));
        assert_eq!(why, "it gave no answer in 0.1 s");
        assert_eq!(process.child.wait().unwrap().signal(), Some(9));
        let again = process.exchange(LOAD_TIMEOUT, |stream, _| receive::<Reply>(stream)).unwrap_err();
        assert_eq!(again, why);
    }

    #[test]
    fn a_process_that_ends_or_talks_nonsense_is_told_of_at_once() {
        let shell = |script: &str| asked(Command::new("sh").args(["-c", script]), LOAD_TIMEOUT).1;
        assert_eq!(shell("exit 3"), "its process ended");
        assert!(shell("kill -ABRT $$").contains("more than 4 GiB of memory"));
        assert!(shell("printf '\\377\\377\\377\\377x' >&0; sleep 1000").contains("too long"));
        assert!(shell("printf '\\2\\0\\0\\0{}' >&0; sleep 1000").contains("expected"));
    }

    #[test]
    fn more_values_than_any_output_has_are_not_waited_for() {
        let script = "printf '\\33\\0\\0\\0{\"Ran\":[[1,1,99999,99999]]}' >&0; sleep 1000";
        let mut process = Process::spawn(Command::new("sh").args(["-c", script])).unwrap();
        process.outputs = 1;
        assert!(process.run(&[], &mut Vec::new()).unwrap_err().contains("too many values"));
    }
}
