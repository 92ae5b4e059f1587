//! How fast frames come now, for who asks from another thread.

use std::sync::atomic::{AtomicU64, Ordering};

/// The rate of a run's frames over the last ones. One thread counts; any may look, and nobody waits.
#[derive(Debug, Default)]
pub struct Pulse {
    /// When the last frame came, and the mean time from one to the next; 0 before there is any.
    last_ns: AtomicU64,
    mean_ns: AtomicU64,
}

/// The newest frame's share of the mean.
const SHARE: f64 = 0.1;
/// Frames that are this much later than usual have stopped.
const STOPPED_NS: u64 = 500_000_000;

impl Pulse {
    /// A frame came at `now_ns`.
    pub fn beat(&self, now_ns: u64) {
        let last_ns = self.last_ns.swap(now_ns, Ordering::Relaxed);
        let mean_ns = self.mean_ns.load(Ordering::Relaxed);
        let took_ns = now_ns.saturating_sub(last_ns);
        let mean_ns = match (last_ns, mean_ns) {
            (0, _) => 0,
            // The first, and the first after a rest.
            (_, 0) => took_ns,
            (_, mean_ns) if took_ns > mean_ns + STOPPED_NS => mean_ns,
            (_, mean_ns) => (mean_ns as f64 + (took_ns as f64 - mean_ns as f64) * SHARE) as u64,
        };
        self.mean_ns.store(mean_ns, Ordering::Relaxed);
    }

    /// Frames per second at `now_ns`; 0 where none come any more.
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
        let pulse = Pulse::default();
        assert!(pulse.per_second(1) == 0.0);
        let mut now_ns = 1_000;
        for _ in 0..100 {
            pulse.beat(now_ns);
            now_ns += 20_000_000;
        }
        assert!((pulse.per_second(now_ns) - 50.0).abs() < 0.1);
        for _ in 0..100 {
            pulse.beat(now_ns);
            now_ns += 40_000_000;
        }
        assert!((pulse.per_second(now_ns) - 25.0).abs() < 0.1);
        assert!(pulse.per_second(now_ns + 1_000_000_000) == 0.0);
        // A rest is no slow frame.
        pulse.beat(now_ns + 3_000_000_000);
        assert!((pulse.per_second(now_ns + 3_000_000_000) - 25.0).abs() < 0.1);
    }
}
