//! A run listens: one thread that takes up connections, and one for each of them.

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

use super::{Answer, ControlError, MOST_REQUEST_BYTES, Name, Request, folder, socket};

/// How long somebody may take to send a request, and then to take the answer.
pub const PATIENCE: Duration = Duration::from_secs(1);
/// Who asks while so many do is told to come back.
pub const MOST_CLIENTS: usize = 8;
/// How long a request is waited for that will be refused.
const HASTE: Duration = Duration::from_millis(10);
/// How often one who waits for a request looks whether the run is over.
const TICK: Duration = Duration::from_millis(50);

/// What answers requests, on several threads at once.
pub type Handler = dyn Fn(Request) -> Answer + Send + Sync;

/// A name, and the socket that nobody answers at yet. Dropping it gives both up.
pub struct Claim {
    name: Name,
    listener: UnixListener,
    path: PathBuf,
    /// Device and inode of the socket: what else may come to have its name is left alone.
    file: (u64, u64),
}

/// Takes a name for this run: the one that was `chosen`, or the first that is free of `base`, `base-2` and so on. Sockets
/// of runs that are dead are removed.
///
/// # Errors
/// The user has no runtime folder; or the chosen name is taken.
pub fn claim(chosen: Option<&Name>, base: &'static str) -> Result<Claim, ControlError> {
    let (folder, _lock): (PathBuf, File) = folder::locked()?;
    folder::sweep(&folder);
    let free = |name: &Name| folder::socket_of(&folder, name).symlink_metadata().is_err();
    let name = match chosen {
        Some(name) if free(name) => name.clone(),
        Some(name) => {
            let path = folder::socket_of(&folder, name);
            let is_run = folder::is_ours(&path);
            return Err(if is_run { ControlError::Taken(name.clone()) } else { ControlError::InTheWay(path) });
        }
        None => Name::numbered(base)
            .find(free)
            .ok_or_else(|| ControlError::NoFolder(format!("{} is full", folder.display())))?,
    };
    let path = folder::socket_of(&folder, &name);
    let refuse = |error: io::Error| ControlError::NoFolder(format!("{}: {error}", path.display()));
    let listener = UnixListener::bind(&path).map_err(refuse)?;
    let made = path.symlink_metadata().map_err(refuse)?;
    Ok(Claim { name, listener, file: (made.dev(), made.ino()), path })
}

impl Claim {
    /// The name.
    pub fn name(&self) -> &Name {
        &self.name
    }

    /// Answers from now on.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn serve(self, handler: Arc<Handler>) -> io::Result<Server> {
        let over = Arc::new(AtomicBool::new(false));
        let (listener, seen) = (self.listener.try_clone()?, Arc::clone(&over));
        let thread =
            thread::Builder::new().name("control".into()).spawn(move || listen(&listener, &*handler, &seen))?;
        Ok(Server { claim: self, over, thread: Some(thread) })
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        let is_ours = |found: fs::Metadata| (found.dev(), found.ino()) == self.file;
        if self.path.symlink_metadata().is_ok_and(is_ours) {
            // It would be swept by the next run.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// A run that answers, until this is dropped.
pub struct Server {
    claim: Claim,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// What the run is called.
    pub fn name(&self) -> &Name {
        &self.claim.name
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        // The thread that waits for connections wakes with an error.
        let _ = shutdown(&self.claim.listener, Shutdown::Both);
        // A panic was printed.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Takes up connections until the run is over, and waits for those under way.
fn listen(listener: &UnixListener, handler: &Handler, over: &AtomicBool) {
    let clients = AtomicUsize::new(0);
    thread::scope(|scope| {
        while !over.load(Ordering::Relaxed) {
            let stream = match listener.accept() {
                Ok((stream, _)) => stream,
                Err(_) if over.load(Ordering::Relaxed) => break,
                Err(error) => {
                    tracing::debug!("control: {error}");
                    // Such as too many open files: others may close some.
                    thread::sleep(TICK);
                    continue;
                }
            };
            let Some(seat) = Seat::take(&clients) else {
                refuse(stream);
                continue;
            };
            let serve = move || {
                let _seat = seat;
                serve(&stream, handler, over);
            };
            // Without a thread the connection is closed.
            let _ = thread::Builder::new().name("control-client".into()).spawn_scoped(scope, serve);
        }
    });
}

/// Tells one for whom there is no place, after what was asked: who is closed on with a request unread may lose the answer.
fn refuse(stream: UnixStream) {
    let read = stream.set_read_timeout(Some(HASTE)).and_then(|()| (&stream).read(&mut [0; MOST_REQUEST_BYTES]));
    if let Err(error) = read {
        tracing::debug!("control: refused before it asked: {error}");
    }
    answer(&stream, &Answer::failed("too many ask at once: ask again"));
}

/// A place among the clients.
struct Seat<'a>(&'a AtomicUsize);

impl<'a> Seat<'a> {
    /// A place, if one is free. One thread alone gives them.
    fn take(clients: &'a AtomicUsize) -> Option<Self> {
        let is_free = clients.load(Ordering::Relaxed) < MOST_CLIENTS;
        is_free.then(|| {
            clients.fetch_add(1, Ordering::Relaxed);
            Self(clients)
        })
    }
}

impl Drop for Seat<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// One request, one answer.
fn serve(stream: &UnixStream, handler: &Handler, over: &AtomicBool) {
    if !socket::is_own_user(stream) {
        tracing::warn!("control: another user asked, and was refused");
        return answer(stream, &Answer::failed("this run is another user's"));
    }
    match read(stream, over) {
        Ok(None) => {}
        Ok(Some(line)) => match serde_json::from_slice(&line) {
            Ok(request) => answer(stream, &handler(request)),
            Err(error) => answer(stream, &Answer::usage(format!("this is no request: {error}"))),
        },
        Err(what) => answer(stream, &Answer::usage(what)),
    }
}

/// A line; `None` where there is nothing to answer: nothing was sent, or the run is over.
fn read(mut stream: &UnixStream, over: &AtomicBool) -> Result<Option<Vec<u8>>, String> {
    let until = Instant::now() + PATIENCE;
    let (mut line, mut some) = (Vec::new(), [0; 1024]);
    stream.set_read_timeout(Some(TICK)).map_err(|error| error.to_string())?;
    while !over.load(Ordering::Relaxed) {
        match stream.read(&mut some) {
            Ok(0) if line.is_empty() => return Ok(None),
            Ok(0) => return Err("the request has no end: it is a line".into()),
            Ok(read) => {
                let end = some[..read].iter().position(|&byte| byte == b'\n');
                line.extend_from_slice(&some[..end.unwrap_or(read)]);
                if line.len() >= MOST_REQUEST_BYTES {
                    return Err(format!("the request is too long: {MOST_REQUEST_BYTES} bytes at most"));
                }
                if end.is_some() {
                    return Ok(Some(line));
                }
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(_) => return Ok(None),
        }
        if Instant::now() >= until {
            return Err(format!("the request did not come within {} s", PATIENCE.as_secs()));
        }
    }
    Ok(None)
}

/// Answers; somebody who has gone gets nothing.
fn answer(mut stream: &UnixStream, answer: &Answer) {
    let Ok(mut line) = serde_json::to_vec(answer) else { return };
    line.push(b'\n');
    let _ = stream.set_write_timeout(Some(PATIENCE)).and_then(|()| stream.write_all(&line));
}
