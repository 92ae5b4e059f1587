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
pub use pulse::Pulse;
pub use report::{About, QualityUse, Report, Spread, StageMs, StagesMs, Versions, WindowUse};
pub use rungs::RungCounts;
pub use tally::{Cause, Dropped, Frames, Tally, Ticket};

/// What the stages measure while they run; each stage fills its own fields.
#[derive(Clone, Debug, Default)]
pub struct Timings {
    /// Reading and decoding a picture, waits excluded.
    pub decode: Histogram,
    /// Reading depth, focusing and filling holes.
    pub depth: Histogram,
    /// Frames that took over the depth of the one before, to save time.
    pub held: u64,
    /// The blur of a frame: the sum of its passes, or the wall time where an executor times none.
    pub blur: Histogram,
    /// The blur's passes.
    pub passes: PassHistograms,
    /// Writing or showing a picture.
    pub sink: Histogram,
    /// Waits of finished pictures for their turn, in real time.
    pub playout: Histogram,
    /// From capture to delivery.
    pub latency: Histogram,
    /// From one delivery to the next.
    pub frame: Histogram,
    /// Frames blurred at each rung of the quality ladder.
    pub rungs: RungCounts,
    /// Frames whose blur took longer than the budget.
    pub misses: u64,
    /// Pictures that were shown again because no new one came.
    pub repeats: u64,
}
