//! What the executors run on: a thread pool ([`thread_pool`]), vector instructions ([`simd`]), and a GPU ([`device`]).

pub mod aligned;
pub mod backed;
pub mod bands;
#[cfg(feature = "gpu")]
pub mod device;
pub mod memory;
pub mod pass_times;
pub mod simd;
pub mod thread_pool;

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::names::named;

#[cfg(feature = "gpu")]
pub use device::{Device, DeviceFrame, DevicePicture};
pub use pass_times::PassTimes;

/// A GPU, of which this build has none.
#[cfg(not(feature = "gpu"))]
#[derive(Debug)]
pub enum Device {}

/// A picture in a GPU's memory, of which this build has none.
#[cfg(not(feature = "gpu"))]
#[derive(Debug)]
pub enum DevicePicture {}

/// A depth map and its picture in a GPU's memory, of which this build has none.
#[cfg(not(feature = "gpu"))]
#[derive(Debug)]
pub enum DeviceFrame {}

named! {
    /// Where the executors run. A software Vulkan driver is far slower than plain code, so it has to be asked for.
    pub enum Backend default Auto {
        /// A hardware GPU if there is one, else the CPU
        Auto = "auto",
        /// A GPU, or an error
        Gpu = "gpu",
        /// The CPU
        Cpu = "cpu",
    }
}

/// Where a picture is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Place {
    #[default]
    Memory,
    /// In the memory of the GPU that made it; who computes elsewhere leaves it in memory.
    Device,
    Both,
}

/// Why there is no GPU to compute on.
#[derive(Clone, Debug, thiserror::Error)]
pub enum GpuError {
    /// No adapter fits what was asked for.
    #[error("no GPU adapter {wanted}; found: {found}. Use --backend cpu, or install a Vulkan driver")]
    NoAdapter {
        /// What was asked for.
        wanted: String,
        found: String,
    },
    /// The GPU refused or was lost.
    #[error("GPU: {0}")]
    Failed(String),
}

#[cfg(not(feature = "gpu"))]
impl GpuError {
    /// A GPU was asked for, and this build cannot use any.
    pub fn left_out() -> Self {
        let wanted = "at all: this build leaves the GPU out (feature `gpu`)".to_owned();
        Self::NoAdapter { wanted, found: "none".to_owned() }
    }
}

#[cfg(not(feature = "gpu"))]
impl Device {
    /// Finds none.
    ///
    /// # Errors
    /// Always.
    pub fn open(_: bool, _: Option<&str>) -> Result<Self, GpuError> {
        Err(GpuError::left_out())
    }

    /// There is nothing that could fail.
    ///
    /// # Errors
    /// Never.
    pub fn check(&self) -> Result<(), GpuError> {
        match *self {}
    }
}

thread_local! {
    /// Whether the thread is in [`catch_panic`].
    static CATCHES: Cell<bool> = const { Cell::new(false) };
}

/// Calls what reports an error by panicking: `None` if it does. What it was changing must not be used afterwards.
pub fn catch_panic<T>(work: impl FnOnce() -> T) -> Option<T> {
    let before = CATCHES.replace(true);
    let done = catch_unwind(AssertUnwindSafe(work));
    CATCHES.set(before);
    // The payload is leaked, as dropping it may panic again.
    done.map_err(std::mem::forget).ok()
}

/// Whether a panic of this thread is only an error, which the caller of [`catch_panic`] reports: no crash to log.
pub fn is_catching_panics() -> bool {
    CATCHES.get()
}
