//! The accounting and the report: what became of every frame, how long it took, at which quality.
//!
//! Memory is fixed, however long the run, and counting a frame allocates nothing.

mod histogram;
mod node_use;
mod pulse;
mod report;
mod rungs;
mod tally;

pub use histogram::{Histogram, PassHistograms};
pub use node_use::{NodeUse, OutputUse};
pub use pulse::FrameRateMeter;
pub use report::{About, QualityUse, Report, Spread, StageMs, StagesMs, Versions, WindowUse};
pub use rungs::QualityCounts;
pub use tally::{Cause, Dropped, Frames, Tally, Ticket};

/// What the stages measure while they run; each stage fills a part of its own.
#[derive(Clone, Debug, Default)]
pub struct Timings {
    /// Reading and decoding a picture, waits excluded.
    pub decode: Histogram,
    /// Of depth.
    pub depth: DepthTimings,
    /// Of the blur.
    pub blur: BlurTimings,
    /// Of delivery.
    pub sink: SinkTimings,
}

/// What is measured of depth.
#[derive(Clone, Debug, Default)]
pub struct DepthTimings {
    /// Reading depth, focusing and filling holes.
    pub took: Histogram,
    /// Frames that took over the depth of the one before, to save time.
    pub held: u64,
    /// What refined it: `cpu`, `gpu` or `gpu, then cpu`.
    pub refined_by: Option<&'static str>,
    /// What found mattes, as that.
    pub matted_by: Option<&'static str>,
}

/// What is measured of the blur.
#[derive(Clone, Debug, Default)]
pub struct BlurTimings {
    /// The blur of a frame: the sum of its passes, or the wall time where an executor times none.
    pub took: Histogram,
    /// The blur's passes.
    pub passes: PassHistograms,
    /// Frames blurred at each rung of the quality ladder.
    pub rungs: QualityCounts,
    /// Frames whose blur took longer than the budget.
    pub misses: u64,
    /// On what it ran, `cpu`, `gpu`, `gpu, then cpu` or `none`, and how that describes itself.
    pub by: [String; 2],
}

/// What is measured of delivery.
#[derive(Clone, Debug, Default)]
pub struct SinkTimings {
    /// Writing or showing a picture.
    pub took: Histogram,
    /// Waits of finished pictures for their turn, in real time.
    pub playout: Histogram,
    /// From capture to delivery.
    pub latency: Histogram,
    /// From one delivery to the next.
    pub frame: Histogram,
    /// Pictures that were shown again because no new one came.
    pub repeats: u64,
}
