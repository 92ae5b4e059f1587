//! The side of the process that runs a network.

use std::fs;
use std::io::{self, ErrorKind, Read};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::thread;

use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Resource, Signal, getpid, getrlimit, kill_process, setrlimit};

use super::MOST_BYTES;
use super::message::{Ports, Reply, Request, receive, receive_values, send, send_values, shapes};
use crate::names;
use crate::network::{self, Failure, Network, load_here};

/// Loads and runs a network for the process at the other end of standard input, until that closes it; or as soon as it is
/// gone, whatever this one is at.
///
/// # Errors
/// Standard input is no such thing, or says what is not understood.
pub fn serve() -> io::Result<()> {
    let stream = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    stream.peer_addr()?;
    limit();
    let watched = stream.try_clone()?;
    thread::Builder::new().name("watch".to_owned()).spawn(move || end_with(&watched))?;
    match answer(stream) {
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(()),
        ended => ended,
    }
}

/// Bounds what this process can take, and leaves no trace of its death.
fn limit() {
    for (resource, most) in [(Resource::As, MOST_BYTES), (Resource::Core, 0)] {
        let mut limits = getrlimit(resource);
        let least = |limit: Option<u64>| Some(limit.map_or(most, |limit| limit.min(most)));
        (limits.current, limits.maximum) = (least(limits.current), least(limits.maximum));
        // Lower limits are always granted.
        let _ = setrlimit(resource, limits);
    }
    // Where memory is short, this process is the one to go. It is not told where it cannot be.
    let _ = fs::write("/proc/self/oom_score_adj", "1000");
}

/// Ends this process when nobody listens any more: its other thread may be at work for hours.
fn end_with(stream: &UnixStream) {
    // With no events asked for, it is the end alone that is waited for.
    while matches!(poll(&mut [PollFd::new(stream, PollFlags::empty())], None), Err(rustix::io::Errno::INTR)) {}
    let _ = kill_process(getpid(), Signal::KILL);
}

fn answer(mut stream: UnixStream) -> io::Result<()> {
    let mut network: Option<Network> = None;
    let (mut inputs, mut outputs, mut buffer) = (Vec::new(), Vec::new(), Vec::new());
    loop {
        match (receive(&mut stream)?, &mut network) {
            (Request::Load { runtime, bytes }, None) => {
                let mut content = vec![0; bytes.min(network::MOST_BYTES as usize)];
                stream.read_exact(&mut content)?;
                let runtime = names::parse(&runtime).map_err(|why| io::Error::new(ErrorKind::InvalidData, why))?;
                let reply = match load_here(content, runtime) {
                    Ok(mut loaded) => {
                        let ports = Ports {
                            inputs: std::mem::take(&mut loaded.inputs),
                            outputs: std::mem::take(&mut loaded.outputs),
                            runtime: std::mem::take(&mut loaded.runtime),
                        };
                        network = Some(loaded);
                        Reply::Loaded(ports)
                    }
                    Err(failure) => Reply::NotLoaded(failure),
                };
                // What it has too much of cannot be told.
                if send(&mut stream, &reply).is_err_and(|error| error.kind() == ErrorKind::InvalidData) {
                    send(&mut stream, &Reply::NotLoaded(Failure::Refused("it has too many ports".to_owned())))?;
                }
            }
            (Request::Run(sizes), Some(network)) => {
                receive_values(&mut stream, sizes, &mut inputs, &mut buffer)?;
                match network.run(&inputs, &mut outputs) {
                    Ok(()) => {
                        send(&mut stream, &Reply::Ran(shapes(&outputs)))?;
                        send_values(&mut stream, &outputs, &mut buffer)?;
                    }
                    Err(why) => send(&mut stream, &Reply::Failed(why))?,
                }
            }
            _ => return Err(io::Error::new(ErrorKind::InvalidData, "what is asked for comes out of turn")),
        }
    }
}
