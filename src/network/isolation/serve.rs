//! The server side, which runs a network.

use std::fs;
use std::io::{self, ErrorKind, Read};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::thread;

use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Resource, Signal, getpid, getrlimit, kill_process, setrlimit};

use super::MAX_MEMORY_BYTES;
use super::message::{Ports, Reply, Request, receive, receive_values, send, send_values, tensor_shapes};
use crate::names;
use crate::network::{self, LoadFailure, Network, load_in_process};

/// Loads and runs a network for the process at the other end of standard input, until that process closes it; exits at
/// once if that process dies.
///
/// # Errors
/// Standard input is not a socket, or a request is malformed.
pub fn serve() -> io::Result<()> {
    let stream = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    stream.peer_addr()?;
    limit_resources();
    let watched = stream.try_clone()?;
    thread::Builder::new().name("watch".to_owned()).spawn(move || exit_on_close(&watched))?;
    match handle_requests(stream) {
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(()),
        ended => ended,
    }
}

/// Limits the memory of this process, and disables core dumps.
fn limit_resources() {
    for (resource, most) in [(Resource::As, MAX_MEMORY_BYTES), (Resource::Core, 0)] {
        let mut limits = getrlimit(resource);
        let least = |limit: Option<u64>| Some(limit.map_or(most, |limit| limit.min(most)));
        (limits.current, limits.maximum) = (least(limits.current), least(limits.maximum));
        // Lowering a limit is always permitted.
        let _ = setrlimit(resource, limits);
    }
    // Prefer this process if the system runs out of memory; ignored where that is not permitted.
    let _ = fs::write("/proc/self/oom_score_adj", "1000");
}

/// Exits this process when the peer closes the socket: the other thread may be busy for hours.
fn exit_on_close(stream: &UnixStream) {
    // With no events requested, poll only returns on hang-up.
    while matches!(poll(&mut [PollFd::new(stream, PollFlags::empty())], None), Err(rustix::io::Errno::INTR)) {}
    let _ = kill_process(getpid(), Signal::KILL);
}

fn handle_requests(mut stream: UnixStream) -> io::Result<()> {
    let mut network: Option<Network> = None;
    let (mut inputs, mut outputs, mut buffer) = (Vec::new(), Vec::new(), Vec::new());
    loop {
        match (receive(&mut stream)?, &mut network) {
            (Request::Load { runtime, bytes }, None) => {
                let mut content = vec![0; bytes.min(network::MAX_BYTES as usize)];
                stream.read_exact(&mut content)?;
                let runtime = names::parse_name(&runtime).map_err(|why| io::Error::new(ErrorKind::InvalidData, why))?;
                let reply = match load_in_process(content, runtime) {
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
                // If the description itself is too long, report that instead.
                if send(&mut stream, &reply).is_err_and(|error| error.kind() == ErrorKind::InvalidData) {
                    send(
                        &mut stream,
                        &Reply::NotLoaded(LoadFailure::Refused(
                            "it has too many inputs or \
                             outputs"
                                .to_owned(),
                        )),
                    )?;
                }
            }
            (Request::Run(sizes), Some(network)) => {
                receive_values(&mut stream, sizes, &mut inputs, &mut buffer)?;
                match network.run(&inputs, &mut outputs) {
                    Ok(()) => {
                        send(&mut stream, &Reply::Ran(tensor_shapes(&outputs)))?;
                        send_values(&mut stream, &outputs, &mut buffer)?;
                    }
                    Err(why) => send(&mut stream, &Reply::Failed(why))?,
                }
            }
            _ => return Err(io::Error::new(ErrorKind::InvalidData, "a request came at an unexpected time")),
        }
    }
}
