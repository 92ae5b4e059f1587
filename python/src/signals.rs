//! Ctrl-C while the work goes on without Python's lock.

use std::ops::ControlFlow;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// So long nobody minds to wait: short work never takes the lock in between.
const PERIOD: Duration = Duration::from_millis(100);

/// Asks Python now and then whether a signal has come.
pub struct Signals {
    asked: Instant,
    error: Option<PyErr>,
}

impl Signals {
    /// Nothing has come yet.
    pub fn new() -> Self {
        Self { asked: Instant::now(), error: None }
    }

    /// Whether the work goes on.
    pub fn go_on(&mut self) -> ControlFlow<()> {
        if self.error.is_none() && self.asked.elapsed() > PERIOD {
            self.error = Python::attach(|py| py.check_signals()).err();
            self.asked = Instant::now();
        }
        if self.error.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// What a signal's handler has raised.
    ///
    /// # Errors
    /// That.
    pub fn raise(self) -> PyResult<()> {
        self.error.map_or(Ok(()), Err)
    }
}

/// Does work that cannot be stopped, and owns all it uses, on a thread of its own. A signal ends the waiting, not the work,
/// whose result is then dropped.
///
/// # Errors
/// What a signal's handler has raised; the work panicked, or there is no thread to be had.
pub fn wait_for<T: Send + 'static>(py: Python<'_>, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    py.detach(|| {
        let (done, result) = mpsc::sync_channel(1);
        // Nobody listens any more after a signal.
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
