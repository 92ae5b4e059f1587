//! The server side: one thread accepts connections, and each connection has a thread of its own.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rustix::net::{Shutdown, shutdown};

use super::{Answer, ControlError, MAX_REQUEST_BYTES, Name, Request, folder, socket};

/// Time limit for a client to send its request, and again to take the answer.
pub const CLIENT_TIMEOUT: Duration = Duration::from_secs(1);
/// Refuses connections above this number.
pub const MAX_CLIENTS: usize = 8;
/// Time to wait for a request that will be refused.
const REFUSAL_TIMEOUT: Duration = Duration::from_millis(10);
/// Interval at which a waiting thread checks whether the run is over.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Answers requests, from several threads at once.
pub type Handler = dyn Fn(Request) -> Answer + Send + Sync;

/// A claimed name with its bound socket, not served yet. Dropping it releases both.
pub struct Claim {
    name: Name,
    listener: UnixListener,
    path: PathBuf,
    /// Device and inode of the socket: another file that took its name meanwhile is not removed.
    file: (u64, u64),
}

/// Claims a name for this run: `chosen`, or the first free one of `base`, `base-2` and so on. Removes the sockets of
/// dead runs.
///
/// # Errors
/// The user has no runtime folder, or the chosen name is taken.
pub fn claim_name(chosen: Option<&Name>, base: &'static str) -> Result<Claim, ControlError> {
    let (folder, _lock): (PathBuf, File) = folder::create_locked()?;
    folder::remove_dead_sockets(&folder);
    let free = |name: &Name| folder::socket_path(&folder, name).symlink_metadata().is_err();
    let name = match chosen {
        Some(name) if free(name) => name.clone(),
        Some(name) => {
            let path = folder::socket_path(&folder, name);
            let is_run = folder::is_own_socket(&path);
            return Err(if is_run { ControlError::NameTaken(name.clone()) } else { ControlError::NotASocket(path) });
        }
        None => Name::default_names(base)
            .find(free)
            .ok_or_else(|| ControlError::NoFolder(format!("{} is full", folder.display())))?,
    };
    let path = folder::socket_path(&folder, &name);
    let refuse = |error: io::Error| ControlError::NoFolder(format!("{}: {error}", path.display()));
    let listener = UnixListener::bind(&path).map_err(refuse)?;
    let made = path.symlink_metadata().map_err(refuse)?;
    Ok(Claim { name, listener, file: (made.dev(), made.ino()), path })
}

impl Claim {
    /// Returns the name.
    pub fn name(&self) -> &Name {
        &self.name
    }

    /// Starts to answer requests with `handler`.
    ///
    /// # Errors
    /// The system cannot create a thread.
    pub fn serve(self, handler: Arc<Handler>) -> io::Result<Server> {
        let is_over = Arc::new(AtomicBool::new(false));
        let (listener, seen) = (self.listener.try_clone()?, Arc::clone(&is_over));
        let thread =
            thread::Builder::new().name("control".into()).spawn(move || accept_clients(&listener, &*handler, &seen))?;
        Ok(Server { claim: self, is_over, thread: Some(thread) })
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        let is_ours = |found: fs::Metadata| (found.dev(), found.ino()) == self.file;
        if self.path.symlink_metadata().is_ok_and(is_ours) {
            // A socket left over is removed by the next run.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// A run's server, which answers until it is dropped.
pub struct Server {
    claim: Claim,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Returns the name of the run.
    pub fn name(&self) -> &Name {
        &self.claim.name
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        // Wakes the accepting thread with an error.
        let _ = shutdown(&self.claim.listener, Shutdown::Both);
        // A panic of the thread was printed already.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Accepts connections until the run is over, then waits for those in progress.
fn accept_clients(listener: &UnixListener, handler: &Handler, is_over: &AtomicBool) {
    let clients = AtomicUsize::new(0);
    thread::scope(|scope| {
        while !is_over.load(Ordering::Relaxed) {
            let stream = match listener.accept() {
                Ok((stream, _)) => stream,
                Err(_) if is_over.load(Ordering::Relaxed) => break,
                Err(error) => {
                    tracing::debug!("control: {error}");
                    // For example too many open files: others may be closed meanwhile.
                    thread::sleep(POLL_INTERVAL);
                    continue;
                }
            };
            let Some(slot) = ClientSlot::acquire(&clients) else {
                refuse_client(stream);
                continue;
            };
            let serve = move || {
                let _slot = slot;
                serve_client(&stream, handler, is_over);
            };
            // If there is no thread, dropping the closure closes the connection.
            let _ = thread::Builder::new().name("control-client".into()).spawn_scoped(scope, serve);
        }
    });
}

/// Refuses a client above the limit, after reading its request: closing with unread data may discard the answer.
fn refuse_client(stream: UnixStream) {
    let read =
        stream.set_read_timeout(Some(REFUSAL_TIMEOUT)).and_then(|()| (&stream).read(&mut [0; MAX_REQUEST_BYTES]));
    if let Err(error) = read {
        tracing::debug!("control: refused a client before its request: {error}");
    }
    send_answer(&stream, &Answer::failed("too many requests at once: try again"));
}

/// A slot among the clients.
struct ClientSlot<'a>(&'a AtomicUsize);

impl<'a> ClientSlot<'a> {
    /// Returns a slot if one is free; only called by the accepting thread, so check and increment cannot race.
    fn acquire(clients: &'a AtomicUsize) -> Option<Self> {
        let is_free = clients.load(Ordering::Relaxed) < MAX_CLIENTS;
        is_free.then(|| {
            clients.fetch_add(1, Ordering::Relaxed);
            Self(clients)
        })
    }
}

impl Drop for ClientSlot<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Reads one request and sends one answer.
fn serve_client(stream: &UnixStream, handler: &Handler, is_over: &AtomicBool) {
    if !socket::is_own_user(stream) {
        tracing::warn!("control: refused a request of another user");
        return send_answer(stream, &Answer::failed("this run belongs to another user"));
    }
    match read_request(stream, is_over) {
        Ok(None) => {}
        Ok(Some(line)) => match serde_json::from_slice(&line) {
            Ok(request) => send_answer(stream, &handler(request)),
            Err(error) => {
                send_answer(stream, &Answer::invalid_request(format!("this is not a valid request: {error}")))
            }
        },
        Err(what) => send_answer(stream, &Answer::invalid_request(what)),
    }
}

/// Reads a line; `None` if no answer is needed: nothing was sent, or the run is over.
fn read_request(mut stream: &UnixStream, is_over: &AtomicBool) -> Result<Option<Vec<u8>>, String> {
    let until = Instant::now() + CLIENT_TIMEOUT;
    let (mut line, mut buffer) = (Vec::new(), [0; 1024]);
    stream.set_read_timeout(Some(POLL_INTERVAL)).map_err(|error| error.to_string())?;
    while !is_over.load(Ordering::Relaxed) {
        match stream.read(&mut buffer) {
            Ok(0) if line.is_empty() => return Ok(None),
            Ok(0) => return Err("the request is incomplete: it must be one line".into()),
            Ok(read) => {
                let end = buffer[..read].iter().position(|&byte| byte == b'\n');
                line.extend_from_slice(&buffer[..end.unwrap_or(read)]);
                if line.len() >= MAX_REQUEST_BYTES {
                    return Err(format!("the request is too long: {MAX_REQUEST_BYTES} bytes at most"));
                }
                if end.is_some() {
                    return Ok(Some(line));
                }
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(_) => return Ok(None),
        }
        if Instant::now() >= until {
            return Err(format!("the request did not arrive within {} s", CLIENT_TIMEOUT.as_secs()));
        }
    }
    Ok(None)
}

/// Sends an answer; errors are ignored, as the client may have gone.
fn send_answer(mut stream: &UnixStream, answer: &Answer) {
    let Ok(mut line) = serde_json::to_vec(answer) else { return };
    line.push(b'\n');
    let _ = stream.set_write_timeout(Some(CLIENT_TIMEOUT)).and_then(|()| stream.write_all(&line));
}
