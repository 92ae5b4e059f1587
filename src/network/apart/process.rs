//! The side of the process that a network's answers are for.

use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::message::{Ports, Reply, Request, receive, receive_values, send, send_values, shapes};
use super::{ANSWERING, ARGUMENT, ENDS, LOADING, MOST_BYTES};
use crate::network::{Engine, Failure, Network, Runtime, Tensor, one_line};

/// So often is looked whether there is reason to wait no longer.
const SLICE: Duration = Duration::from_millis(50);
/// An answer that is nearly there is waited for when the program ends, too.
const LAST: Duration = Duration::from_millis(500);

/// A process that runs a network; it is killed when it is dropped.
pub struct Process {
    child: Child,
    stream: UnixStream,
    outputs: usize,
    /// Why it is not asked any more.
    failed: Option<String>,
    buffer: Vec<u8>,
}

impl Process {
    /// Starts this program once more.
    pub fn start() -> io::Result<Self> {
        // It is this very program also where its file was replaced since.
        Self::of(Command::new("/proc/self/exe").arg0("bokehcam").arg(ARGUMENT))
    }

    fn of(command: &mut Command) -> io::Result<Self> {
        let (stream, other) = UnixStream::pair()?;
        stream.set_read_timeout(Some(SLICE))?;
        stream.set_write_timeout(Some(SLICE))?;
        // Ctrl-C is for this program, which then ends the other one in its own time. What a runtime says on stderr would go to
        // the terminal as it is.
        let command = command.process_group(0).stdin(OwnedFd::from(other)).stdout(Stdio::null()).stderr(Stdio::null());
        let child = command.spawn()?;
        // With its end of the socket kept here, too, its death would not be heard of.
        command.stdin(Stdio::null());
        Ok(Self { child, stream, outputs: 0, failed: None, buffer: Vec::new() })
    }

    pub fn load(mut self, content: &[u8], runtime: Runtime) -> Result<Network, Failure> {
        let request = Request::Load { runtime: runtime.name().to_owned(), bytes: content.len() };
        let reply = self.ask(LOADING, |stream, _| {
            send(stream, &request)?;
            stream.write_all(content)?;
            receive(stream)
        });
        match reply.map_err(Failure::Refused)? {
            Reply::Loaded(Ports { inputs, outputs, runtime }) => {
                self.outputs = outputs.len();
                Ok(Network { engine: Box::new(self), inputs, outputs, runtime })
            }
            Reply::NotLoaded(failure) => Err(failure),
            Reply::Ran(_) | Reply::Failed(_) => Err(Failure::Refused(OUT_OF_TURN.to_owned())),
        }
    }

    /// Says and hears something within a time. A process that does not answer is killed, and asked no more.
    fn ask<T>(
        &mut self,
        patience: Duration,
        talk: impl FnOnce(&mut Patient, &mut Vec<u8>) -> io::Result<T>,
    ) -> Result<T, String> {
        if let Some(why) = &self.failed {
            return Err(why.clone());
        }
        let mut stream = Patient { stream: &self.stream, until: Instant::now() + patience, hurries: false };
        talk(&mut stream, &mut self.buffer).map_err(|error| {
            let why = match error.kind() {
                ErrorKind::TimedOut if stream.hurries => "it gave no answer before the program ended".to_owned(),
                ErrorKind::TimedOut => format!("it gave no answer in {} s", patience.as_secs_f32()),
                ErrorKind::UnexpectedEof | ErrorKind::BrokenPipe | ErrorKind::ConnectionReset => self.how_it_ended(),
                _ => one_line(error),
            };
            self.kill();
            self.failed.insert(why).clone()
        })
    }

    /// Of a process that has closed its end, and is about to end, if it has not.
    fn how_it_ended(&mut self) -> String {
        // One that lives on with its end closed is not waited for.
        let _ = self.child.kill();
        let signal = self.child.wait().ok().and_then(|status| status.signal());
        let most = MOST_BYTES >> 30;
        match signal {
            Some(_) => {
                format!("its process aborted: it asks for more than {most} GiB of memory, or its runtime crashed")
            }
            None => "its process ended".to_owned(),
        }
    }

    fn kill(&mut self) {
        // It may have ended by itself. A killed process is gone soon, and what is left of it is collected here.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

const OUT_OF_TURN: &str = "its process answers what it was not asked";

impl Engine for Process {
    fn run(&mut self, inputs: &[Tensor], outputs: &mut Vec<Tensor>) -> Result<(), String> {
        let count = self.outputs;
        self.ask(ANSWERING, |stream, buffer| {
            send(stream, &Request::Run(shapes(inputs)))?;
            send_values(stream, inputs, buffer)?;
            match receive(stream)? {
                Reply::Ran(sizes) if sizes.len() == count => {
                    receive_values(stream, sizes, outputs, buffer).map(|()| Ok(()))
                }
                Reply::Failed(why) => Ok(Err(why)),
                _ => Err(io::Error::new(ErrorKind::InvalidData, OUT_OF_TURN)),
            }
        })?
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// A stream that is waited for until a time, or shortly where the program ends.
struct Patient<'a> {
    stream: &'a UnixStream,
    until: Instant,
    hurries: bool,
}

impl Patient<'_> {
    /// Tries until it is done: at least once, as this program may have been stopped meanwhile.
    fn until_done<T>(&mut self, mut work: impl FnMut(&mut &UnixStream) -> io::Result<T>) -> io::Result<T> {
        loop {
            match work(&mut &*self.stream) {
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
                done => return done,
            }
            if !self.hurries && ENDS.load(Ordering::Relaxed) {
                self.hurries = true;
                self.until = self.until.min(Instant::now() + LAST);
            }
            if Instant::now() >= self.until {
                return Err(ErrorKind::TimedOut.into());
            }
        }
    }
}

impl Read for Patient<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.until_done(|stream| stream.read(bytes))
    }
}

impl Write for Patient<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.until_done(|stream| stream.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(command: &mut Command, patience: Duration) -> (Process, String) {
        let mut process = Process::of(command).unwrap();
        let why = process.ask(patience, |stream, _| receive::<Reply>(stream)).unwrap_err();
        (process, why)
    }

    #[test]
    fn a_process_that_does_not_answer_is_killed_and_told_of() {
        let (mut process, why) = asked(Command::new("sleep").arg("1000"), Duration::from_millis(100));
        assert_eq!(why, "it gave no answer in 0.1 s");
        assert_eq!(process.child.wait().unwrap().signal(), Some(9));
        let again = process.ask(LOADING, |stream, _| receive::<Reply>(stream)).unwrap_err();
        assert_eq!(again, why);
    }

    #[test]
    fn a_process_that_ends_or_talks_nonsense_is_told_of_at_once() {
        let shell = |script: &str| asked(Command::new("sh").args(["-c", script]), LOADING).1;
        assert_eq!(shell("exit 3"), "its process ended");
        assert!(shell("kill -ABRT $$").contains("more than 4 GiB of memory"));
        assert!(shell("printf '\\377\\377\\377\\377x' >&0; sleep 1000").contains("too much"));
        assert!(shell("printf '\\2\\0\\0\\0{}' >&0; sleep 1000").contains("expected"));
    }

    #[test]
    fn more_values_than_any_output_has_are_not_waited_for() {
        let script = "printf '\\33\\0\\0\\0{\"Ran\":[[1,1,99999,99999]]}' >&0; sleep 1000";
        let mut process = Process::of(Command::new("sh").args(["-c", script])).unwrap();
        process.outputs = 1;
        assert!(process.run(&[], &mut Vec::new()).unwrap_err().contains("too many values"));
    }
}
