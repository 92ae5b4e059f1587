//! Python signals (Ctrl-C) during native work without the GIL.

use std::ops::ControlFlow;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Time between two checks, in which short work never takes the GIL.
const PERIOD: Duration = Duration::from_millis(100);

/// Polls Python for signals at intervals.
pub struct Signals {
    checked: Instant,
    error: Option<PyErr>,
}

impl Signals {
    /// Creates a poller without a signal.
    pub fn new() -> Self {
        Self { checked: Instant::now(), error: None }
    }

    /// Returns `Break` once a signal handler has raised an exception.
    pub fn poll(&mut self) -> ControlFlow<()> {
        if self.error.is_none() && self.checked.elapsed() > PERIOD {
            self.error = Python::attach(|py| py.check_signals()).err();
            self.checked = Instant::now();
        }
        if self.error.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Returns the exception of a signal handler, if any.
    ///
    /// # Errors
    /// Returns the exception itself.
    pub fn raise(self) -> PyResult<()> {
        self.error.map_or(Ok(()), Err)
    }
}

/// Runs work that cannot be interrupted, and owns its data, on a separate thread. A signal ends the wait, not the work,
/// whose result is then dropped.
///
/// # Errors
/// Returns the exception of a signal handler, or fails if the work panics or no thread can be created.
pub fn wait_for<T: Send + 'static>(py: Python<'_>, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    py.detach(|| {
        let (done, result) = mpsc::sync_channel(1);
        // After a signal, the receiver is gone.
        let run = move || drop(done.send(work()));
        std::thread::Builder::new().name("bokehcam".into()).spawn(run)?;
        loop {
            match result.recv_timeout(PERIOD) {
                Ok(result) => return Ok(result),
                Err(RecvTimeoutError::Timeout) => Python::attach(|py| py.check_signals())?,
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(PyRuntimeError::new_err("the work ended without a result: please report this"));
                }
            }
        }
    })
}
