//! Waiting for a device, which may never answer.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::{Device, note};
use crate::compute::{GpuError, catch_panic};

/// How often one who waits looks whether it has been long enough.
const LOOK: Duration = Duration::from_millis(100);
/// How long a device may take once the program is to end.
const LAST_PATIENCE: Duration = Duration::from_secs(1);

/// Whether the program is to end.
static ENDS: AtomicBool = AtomicBool::new(false);

/// From now on no device of this process is waited for longer than a second: somebody asked the program to end.
pub fn end_soon() {
    ENDS.store(true, Ordering::Relaxed);
}

impl Device {
    /// Runs the callbacks of what the device has done. With `until`, first waits for that submission.
    ///
    /// # Errors
    /// The device failed, or took too long.
    pub fn poll(&self, until: Option<wgpu::SubmissionIndex>) -> Result<(), GpuError> {
        self.check()?;
        let began = Instant::now();
        loop {
            let poll = match &until {
                Some(index) => wgpu::PollType::Wait { submission_index: Some(index.clone()), timeout: Some(LOOK) },
                None => wgpu::PollType::Poll,
            };
            // A device that is lost meanwhile makes it panic.
            match catch_panic(|| self.device.poll(poll)) {
                Some(Err(wgpu::PollError::Timeout)) if !self.hangs(began) => continue,
                Some(Ok(_)) => {}
                Some(Err(wgpu::PollError::Timeout)) => self.give_up(began),
                Some(Err(error)) => note(&self.fault, error.to_string()),
                None => note(&self.fault, "device lost".to_owned()),
            }
            return self.check();
        }
    }

    /// Waits until `done`, which a callback of finished work makes true.
    ///
    /// # Errors
    /// As for [`Device::poll`].
    pub fn wait_for(&self, done: impl Fn() -> bool) -> Result<(), GpuError> {
        let began = Instant::now();
        // The work is done: another thread that polls the device is about to run the callback.
        while !done() {
            self.check()?;
            if self.hangs(began) {
                self.give_up(began);
            }
            std::thread::yield_now();
        }
        Ok(())
    }

    /// Whether the device has taken too long for what it was given.
    fn hangs(&self, began: Instant) -> bool {
        let patience = if ENDS.load(Ordering::Relaxed) { self.patience.min(LAST_PATIENCE) } else { self.patience };
        began.elapsed() >= patience
    }

    /// Counts the device as hung.
    fn give_up(&self, began: Instant) {
        // Leaked: freeing them would wait for the device.
        std::mem::forget((self.instance.clone(), self.device.clone(), self.queue.clone()));
        note(&self.fault, format!("no answer for {:.0} s", began.elapsed().as_secs_f64()));
    }
}
