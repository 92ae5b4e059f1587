//! Measures the window: for the report, and for the frame rate of its status.

use bokehcam_live::stats::{FrameRateMeter, Histogram, WindowStats};

/// Measurements since the start of the preview.
pub(super) struct Meters {
    started_ns: u64,
    presented: u64,
    first_frame_ns: Option<u64>,
    latency: Histogram,
    /// Latency from an input to the first picture that shows its effect.
    pub reaction: Histogram,
    present: Histogram,
    pub frame_rate: FrameRateMeter,
}

impl Meters {
    /// Creates the meters of a preview that starts at `started_ns` (run clock, like all times here).
    pub fn new(started_ns: u64) -> Self {
        let [latency, reaction, present] = std::array::from_fn(|_| Histogram::default());
        let frame_rate = FrameRateMeter::default();
        Self { started_ns, presented: 0, first_frame_ns: None, latency, reaction, present, frame_rate }
    }

    /// Records a frame that was captured at `captured_ns` and presented at `now_ns`, where presenting took
    /// `present_ns`.
    pub fn add_frame(&mut self, captured_ns: u64, now_ns: u64, present_ns: u64) {
        self.presented += 1;
        self.first_frame_ns.get_or_insert(now_ns.saturating_sub(self.started_ns));
        self.latency.add(now_ns.saturating_sub(captured_ns));
        self.present.add(present_ns);
        self.frame_rate.record_frame(now_ns);
    }

    /// Returns the measurements for the report.
    pub fn stats(&self) -> WindowStats {
        WindowStats::new(self.presented, self.first_frame_ns, [&self.latency, &self.reaction, &self.present])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_frame_counts_and_the_first_is_the_first_of_all() {
        let mut meters = Meters::new(1_000_000);
        for frame in 1..=100 {
            let now_ns = 1_000_000 + frame * 40_000_000;
            meters.add_frame(now_ns - 5_000_000, now_ns, 2_000_000);
        }
        let stats = meters.stats();
        assert_eq!((stats.presented, stats.first_frame_ms, stats.reaction_ms), (100, Some(40.0), None));
        assert_eq!(stats.latency_ms.map(|ms| ms.p50.round()), Some(5.0));
        assert!((meters.frame_rate.per_second(4_001_000_000) - 25.0).abs() < 0.1);
    }
}
