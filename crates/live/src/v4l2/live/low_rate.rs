//! Detects a camera that delivers fewer frames than it reports without losing any: most do so in the dark.

/// Measures a camera's frame rate, and reports once if it is low.
#[derive(Debug)]
pub struct LowRateCheck {
    nominal_fps: f64,
    /// Frames counted in the current window, and its start, which may be in the future.
    window: Option<(u64, u64)>,
    /// Whether a low rate was reported.
    reported: bool,
}

/// Time after a start that is not measured.
const SETTLE_NS: u64 = 1_000_000_000;
/// Time over which the rate is measured.
const WINDOW_NS: u64 = 3_000_000_000;
/// A rate below this fraction of the stated one is low.
const MIN_RATE_FRACTION: f64 = 0.75;

impl LowRateCheck {
    /// Creates a check for a camera that reports `nominal_fps` and starts at `now_ns`.
    pub fn new(nominal_fps: f64, now_ns: u64) -> Self {
        Self { nominal_fps, window: Some((0, now_ns + SETTLE_NS)), reported: false }
    }

    /// Restarts the measurement with the stream.
    pub fn restart(&mut self, now_ns: u64) {
        self.window = Some((0, now_ns + SETTLE_NS));
    }

    /// Counts `frames` received since the last call and `missed` ones, at `now_ns`. Returns the measured rate, once, if
    /// it was below `MIN_RATE_FRACTION` of the stated one for three seconds and nothing was lost.
    pub fn count_frames(&mut self, frames: u64, missed: u64, now_ns: u64) -> Option<f64> {
        let (count, began_ns) = self.window?;
        if self.reported || now_ns < began_ns {
            return None;
        }
        if missed > 0 || count == 0 {
            // Restart the window: losses have another cause than the dark.
            self.window = Some((frames.min(1), now_ns));
            return None;
        }
        let passed_ns = now_ns - began_ns;
        if passed_ns < WINDOW_NS {
            self.window = Some((count + frames, began_ns));
            return None;
        }
        self.window = Some((1, now_ns));
        // The first frame started the window: there is one interval fewer.
        let fps = (count + frames - 1) as f64 / (passed_ns as f64 / 1e9);
        self.reported = fps < MIN_RATE_FRACTION * self.nominal_fps;
        self.reported.then_some(fps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the reports for a 30 fps camera that delivers `fps` for `seconds`, missing one in `missing`.
    fn reports(fps: f64, seconds: f64, missing: Option<u64>) -> Vec<f64> {
        let mut check = LowRateCheck::new(30.0, 0);
        let frames = (0..(fps * seconds) as u64).filter_map(|frame| {
            let missed = missing.is_some_and(|missing| frame % missing == 0);
            check.count_frames(1, u64::from(missed), (frame as f64 / fps * 1e9) as u64)
        });
        frames.collect()
    }

    #[test]
    fn half_the_rate_is_told_once() {
        let reports = reports(15.0, 60.0, None);
        assert_eq!(reports.len(), 1);
        assert!((reports[0] - 15.0).abs() < 0.3, "{reports:?}");
    }

    #[test]
    fn a_little_less_is_nothing_and_so_are_losses() {
        assert!(reports(30.0, 60.0, None).is_empty());
        assert!(reports(25.0, 60.0, None).is_empty());
        assert!(reports(15.0, 3.5, None).is_empty(), "not yet");
        assert!(reports(15.0, 60.0, Some(10)).is_empty(), "frames are lost, which has another cause");
    }
}
