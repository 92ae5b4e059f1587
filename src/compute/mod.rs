//! What the executors run on: a [`team`] of threads, vector instructions ([`simd`]), and a GPU ([`device`]).

pub mod aligned;
#[cfg(feature = "gpu")]
pub mod device;
pub mod simd;
pub mod team;

/// Why there is no GPU to compute on.
#[derive(Clone, Debug, thiserror::Error)]
pub enum GpuError {
    /// No adapter fits what was asked for.
    #[error("no GPU adapter {wanted}; found: {found}. Use --backend cpu, or install a Vulkan driver")]
    NoAdapter {
        /// What was asked for.
        wanted: String,
        /// What there is.
        found: String,
    },
    /// The GPU refused or was lost.
    #[error("GPU: {0}")]
    Failed(String),
}
