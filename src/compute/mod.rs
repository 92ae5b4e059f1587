//! Execution resources: a thread pool ([`thread_pool`]), vector instructions ([`simd`]), and a GPU ([`device`]).

pub mod aligned;
pub mod bands;
#[cfg_attr(not(feature = "gpu"), path = "no_device.rs")]
pub mod device;
pub mod memory;
pub mod memory_limit;
pub mod pass_times;
pub mod simd;
pub mod thread_pool;
pub mod with_fallback;

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::names::named;

pub use device::{Device, DeviceFrame, DevicePicture};
pub use pass_times::PassTimes;

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

/// Where a picture is needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum PictureLocation {
    #[default]
    Memory,
    /// In the memory of the GPU that made it; a CPU executor leaves it in memory.
    Device,
    Both,
}

/// Why there is no usable GPU.
#[derive(Clone, Debug, thiserror::Error)]
pub enum GpuError {
    /// No adapter fits the request.
    #[error("no GPU adapter {wanted}; found: {found}. Use --backend cpu, or install a Vulkan driver")]
    NoAdapter { wanted: String, found: String },
    /// The GPU refused or was lost.
    #[error("GPU: {0}")]
    Failed(String),
}

thread_local! {
    /// Whether the thread is in [`catch_panic`].
    static IS_CATCHING: Cell<bool> = const { Cell::new(false) };
}

/// Calls code that reports an error by panicking; returns `None` if it panics. State that it was changing must not be
/// used afterwards.
pub fn catch_panic<T>(work: impl FnOnce() -> T) -> Option<T> {
    let before = IS_CATCHING.replace(true);
    let done = catch_unwind(AssertUnwindSafe(work));
    IS_CATCHING.set(before);
    // The payload is leaked, as dropping it may panic again.
    done.map_err(std::mem::forget).ok()
}

/// Declares that the caller of the work on this thread reports its panics, as [`catch_panic`] does.
pub fn expect_panics() {
    IS_CATCHING.set(true);
}

/// Returns the message of a panic from its payload.
pub fn panic_message(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&str>().copied();
    text.or(payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}

/// Whether a panic of this thread is one that a caller reports: no crash to log.
pub fn is_catching_panics() -> bool {
    IS_CATCHING.get()
}
