//! Accounting and report: the fate of every frame, its times, and its quality level.
//!
//! Memory is bounded for a run of any length, and counting a frame does not allocate.

mod energy;
mod frame_counter;
mod frame_rate;
mod histogram;
mod output_counts;
mod quality_counts;
mod report;
mod summary;

pub use energy::EnergyMeter;
pub use frame_counter::{DropCause, DropCounts, FrameCounter, FrameCounts, FrameTicket};
pub use frame_rate::FrameRateMeter;
pub use histogram::{Histogram, PassHistograms};
pub use output_counts::{NodeCounts, OutputCounts};
pub use quality_counts::QualityCounts;
pub use report::{LiveSource, Percentiles, QualityStats, Report, RunInfo, StageMs, StagesMs, Versions, WindowStats};

/// Measurements of the stages during a run; each stage fills its own part.
#[derive(Clone, Debug, Default)]
pub struct Timings {
    /// Reading and decoding a picture, waits excluded.
    pub decode: Histogram,
    /// Depth stage.
    pub depth: DepthTimings,
    /// Blur stage.
    pub blur: BlurTimings,
    /// Delivery.
    pub sink: SinkTimings,
}

/// Measurements of the depth stage.
#[derive(Clone, Debug, Default)]
pub struct DepthTimings {
    /// Reading depth, focusing and filling holes.
    pub took: Histogram,
    /// Frames that reused the previous depth map, to save time.
    pub reused: u64,
    /// The backend that refined depth: `cpu`, `gpu` or `gpu, then cpu`.
    pub refined_by: Option<&'static str>,
    /// The backend that found mattes, with the same values.
    pub matted_by: Option<&'static str>,
}

/// Measurements of the blur stage.
#[derive(Clone, Debug, Default)]
pub struct BlurTimings {
    /// Time of the blur of a frame: the sum of its passes, or the wall time if the executor does not time passes.
    pub took: Histogram,
    /// Times of the blur's passes.
    pub passes: PassHistograms,
    /// Frames blurred at each quality level.
    pub quality_counts: QualityCounts,
    /// Frames whose blur took longer than the budget.
    pub misses: u64,
    /// The backend, `cpu`, `gpu`, `gpu, then cpu` or `none`, and the executor's description.
    pub by: [String; 2],
}

/// Measurements of the delivery stage.
#[derive(Clone, Debug, Default)]
pub struct SinkTimings {
    /// Time to write or show a picture.
    pub took: Histogram,
    /// Time that finished pictures waited for their playout, in real time.
    pub playout: Histogram,
    /// Time from capture to delivery.
    pub latency: Histogram,
    /// Time from one delivery to the next.
    pub frame: Histogram,
    /// Pictures that were repeated because no new one came.
    pub repeats: u64,
}
