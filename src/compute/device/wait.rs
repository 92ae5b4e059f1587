//! Waiting for a device, which may hang.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::{Device, record_fault};
use crate::compute::{GpuError, catch_panic};

/// Interval at which a waiting thread checks for the timeout.
const POLL_INTERVAL: Duration = Duration::from_millis(100);
/// Time after which a device counts as hung once the program is to end.
const SHUTDOWN_HANG_TIMEOUT: Duration = Duration::from_secs(1);

/// Whether the program is to end.
static IS_SHUTTING_DOWN: AtomicBool = AtomicBool::new(false);

/// Limits waiting for any device of this process to a second from now on, because the program is to end.
pub fn begin_shutdown() {
    IS_SHUTTING_DOWN.store(true, Ordering::Relaxed);
}

impl Device {
    /// Runs the callbacks of finished work. With `until`, first waits for that submission.
    ///
    /// # Errors
    /// The device failed, or took too long.
    pub fn poll(&self, until: Option<wgpu::SubmissionIndex>) -> Result<(), GpuError> {
        self.check()?;
        let began = Instant::now();
        loop {
            let poll = match &until {
                Some(index) => {
                    wgpu::PollType::Wait { submission_index: Some(index.clone()), timeout: Some(POLL_INTERVAL) }
                }
                None => wgpu::PollType::Poll,
            };
            // wgpu panics if the device is lost meanwhile.
            match catch_panic(|| self.device.poll(poll)) {
                Some(Err(wgpu::PollError::Timeout)) if !self.is_hung(began) => continue,
                Some(Ok(_)) => {}
                Some(Err(wgpu::PollError::Timeout)) => self.mark_hung(began),
                Some(Err(error)) => record_fault(&self.fault, error.to_string()),
                None => record_fault(&self.fault, "device lost".to_owned()),
            }
            return self.check();
        }
    }

    /// Waits until `done` returns true, which a callback of finished work causes.
    ///
    /// # Errors
    /// Fails like [`Device::poll`].
    pub fn wait_for(&self, done: impl Fn() -> bool) -> Result<(), GpuError> {
        let began = Instant::now();
        // The work is done: another thread that polls the device is about to run the callback.
        while !done() {
            self.check()?;
            if self.is_hung(began) {
                self.mark_hung(began);
            }
            std::thread::yield_now();
        }
        Ok(())
    }

    /// Whether the device counts as hung since `began`.
    fn is_hung(&self, began: Instant) -> bool {
        let hang_timeout = if IS_SHUTTING_DOWN.load(Ordering::Relaxed) {
            self.hang_timeout.min(SHUTDOWN_HANG_TIMEOUT)
        } else {
            self.hang_timeout
        };
        began.elapsed() >= hang_timeout
    }

    /// Marks the device as hung.
    fn mark_hung(&self, began: Instant) {
        // Leaked, because freeing them would wait for the device.
        std::mem::forget((self.instance.clone(), self.device.clone(), self.queue.clone()));
        record_fault(&self.fault, format!("no answer for {:.0} s", began.elapsed().as_secs_f64()));
    }
}
