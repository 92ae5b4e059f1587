//! The client side: sends a request to a run.

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use super::{Answer, ControlError, Name, Request, folder, socket};

/// Time limit for an answer: longer than any limit within the run.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);
/// Interval between attempts to connect.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Maximum length of an answer.
const MAX_ANSWER_BYTES: u64 = 1 << 20;

/// Returns the names of all runs that listen, sorted.
///
/// # Errors
/// The user has no folder for sockets.
pub fn list_run_names() -> Result<Vec<Name>, ControlError> {
    let folder = folder::socket_folder()?;
    Ok(folder::list_names(&folder).into_iter().filter(|name| is_alive(&folder, name)).collect())
}

/// Sends a request to the run of this name, or to the only one, and waits for its answer.
///
/// # Errors
/// There is no such run, there are several, or the run does not answer.
pub fn send_request(name: Option<&Name>, request: &Request) -> Result<Answer, ControlError> {
    let folder = folder::socket_folder()?;
    let there = list_run_names()?;
    let texts = |names: &[Name]| names.iter().map(Name::to_string).collect();
    let name = match (name, there.as_slice()) {
        (Some(name), there) if there.contains(name) => name,
        (Some(name), there) => return Err(ControlError::NoSuchRun { name: name.clone(), there: texts(there) }),
        (None, [only]) => only,
        (None, []) => return Err(ControlError::NoRuns),
        (None, several) => return Err(ControlError::SeveralRuns(texts(several))),
    };
    let silent = |why: String| ControlError::NoAnswer { name: name.to_string(), why };
    let answer = send_and_receive(&folder::socket_path(&folder, name), request).map_err(|error| {
        silent(match error.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => "it hangs, or is still starting".into(),
            _ => error.to_string(),
        })
    })?;
    if answer.is_empty() {
        return Err(silent("it has just ended".into()));
    }
    serde_json::from_slice(&answer).map_err(|error| silent(format!("it may be of another version: {error}")))
}

/// Returns whether a run listens; a run whose queue of connections is full is alive as well.
fn is_alive(folder: &Path, name: &Name) -> bool {
    match socket::connect(&folder::socket_path(folder, name)) {
        Ok(_) => true,
        Err(error) => !matches!(error.kind(), ErrorKind::ConnectionRefused | ErrorKind::NotFound),
    }
}

/// Sends a request and reads the answer until end of file.
fn send_and_receive(path: &Path, request: &Request) -> io::Result<Vec<u8>> {
    let until = Instant::now() + ANSWER_TIMEOUT;
    let mut stream = loop {
        match socket::connect(path) {
            // The queue of connections is full: try again.
            Err(error) if error.kind() == ErrorKind::WouldBlock && Instant::now() < until => {
                thread::sleep(POLL_INTERVAL)
            }
            connected => break connected?,
        }
    };
    stream.set_write_timeout(Some(ANSWER_TIMEOUT))?;
    let mut line = serde_json::to_vec(request)?;
    line.push(b'\n');
    match stream.write_all(&line) {
        // The request was refused before it was read: the answer says why.
        Err(error) if error.kind() == ErrorKind::BrokenPipe => {}
        sent => sent?,
    }
    let (mut answer, mut buffer) = (Vec::new(), [0; 4096]);
    loop {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(ErrorKind::TimedOut.into());
        }
        stream.set_read_timeout(Some(left))?;
        match stream.read(&mut buffer) {
            Ok(0) => return Ok(answer),
            Ok(read) => answer.extend_from_slice(&buffer[..read]),
            // The run answered and closed before it had read the whole request: the answer is complete.
            Err(error) if error.kind() == ErrorKind::ConnectionReset && !answer.is_empty() => return Ok(answer),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
        if answer.len() as u64 > MAX_ANSWER_BYTES {
            return Err(io::Error::other("its answer is too long"));
        }
    }
}
