//! A frame rate meter that other threads can read.

use std::sync::atomic::{AtomicU64, Ordering};

/// The current frame rate of a run, an exponential moving average. One thread records frames; any may read, without
/// locks.
#[derive(Debug, Default)]
pub struct FrameRateMeter {
    /// The time of the last frame, and the mean interval; both 0 before there is one.
    last_ns: AtomicU64,
    mean_ns: AtomicU64,
}

/// Weight of the newest interval in the mean.
const WEIGHT: f64 = 0.1;
/// A frame that is this much later than usual is a pause, not a slow frame.
const STOPPED_NS: u64 = 500_000_000;

impl FrameRateMeter {
    /// Records a frame at `now_ns`.
    pub fn record_frame(&self, now_ns: u64) {
        let last_ns = self.last_ns.swap(now_ns, Ordering::Relaxed);
        let mean_ns = self.mean_ns.load(Ordering::Relaxed);
        let took_ns = now_ns.saturating_sub(last_ns);
        let mean_ns = match (last_ns, mean_ns) {
            (0, _) => 0,
            // The first interval.
            (_, 0) => took_ns,
            (_, mean_ns) if took_ns > mean_ns + STOPPED_NS => mean_ns,
            (_, mean_ns) => (mean_ns as f64 + (took_ns as f64 - mean_ns as f64) * WEIGHT) as u64,
        };
        self.mean_ns.store(mean_ns, Ordering::Relaxed);
    }

    /// Returns the frames per second at `now_ns`; 0 if frames have stopped.
    pub fn per_second(&self, now_ns: u64) -> f64 {
        let (last_ns, mean_ns) = (self.last_ns.load(Ordering::Relaxed), self.mean_ns.load(Ordering::Relaxed));
        let silent_ns = now_ns.saturating_sub(last_ns);
        if mean_ns == 0 || silent_ns > mean_ns + STOPPED_NS { 0.0 } else { 1e9 / mean_ns as f64 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_that_of_the_last_frames_and_ends_with_them() {
        let pulse = FrameRateMeter::default();
        assert!(pulse.per_second(1) == 0.0);
        let mut now_ns = 1_000;
        for _ in 0..100 {
            pulse.record_frame(now_ns);
            now_ns += 20_000_000;
        }
        assert!((pulse.per_second(now_ns) - 50.0).abs() < 0.1);
        for _ in 0..100 {
            pulse.record_frame(now_ns);
            now_ns += 40_000_000;
        }
        assert!((pulse.per_second(now_ns) - 25.0).abs() < 0.1);
        assert!(pulse.per_second(now_ns + 1_000_000_000) == 0.0);
        // A pause does not count as a slow frame.
        pulse.record_frame(now_ns + 3_000_000_000);
        assert!((pulse.per_second(now_ns + 3_000_000_000) - 25.0).abs() < 0.1);
    }
}
