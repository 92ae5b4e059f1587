//! Notices a camera that gives fewer frames than it says although none are lost: most do so in the dark.

/// Measures a camera's rate, and reports once that it is low.
#[derive(Debug)]
pub struct LowRateCheck {
    nominal_fps: f64,
    /// Frames counted in the present window, and when it begins or began.
    window: Option<(u64, u64)>,
    /// A low rate was reported.
    done: bool,
}

/// Time after a start that is not measured.
const SETTLE_NS: u64 = 1_000_000_000;
/// Time over which the rate is measured.
const WINDOW_NS: u64 = 3_000_000_000;
/// Less than this part of the stated rate is well below it.
const WELL_BELOW: f64 = 0.75;

impl LowRateCheck {
    /// Of a camera that says it gives so many frames per second, and starts at `now_ns`.
    pub fn new(nominal_fps: f64, now_ns: u64) -> Self {
        Self { nominal_fps, window: Some((0, now_ns + SETTLE_NS)), done: false }
    }

    /// The stream starts again.
    pub fn restarted(&mut self, now_ns: u64) {
        self.window = Some((0, now_ns + SETTLE_NS));
    }

    /// Counts `frames` that came since the last call and `missed` ones that did not, at `now_ns`. Returns the measured
    /// rate, once, when it was well below the stated one for three seconds and nothing was lost.
    pub fn frames(&mut self, frames: u64, missed: u64, now_ns: u64) -> Option<f64> {
        let (count, began_ns) = self.window?;
        if self.done || now_ns < began_ns {
            return None;
        }
        if missed > 0 || count == 0 {
            // The window begins anew: what loses frames is not the dark.
            self.window = Some((frames.min(1), now_ns));
            return None;
        }
        let passed_ns = now_ns - began_ns;
        if passed_ns < WINDOW_NS {
            self.window = Some((count + frames, began_ns));
            return None;
        }
        self.window = Some((1, now_ns));
        // The first frame began the window: intervals are one fewer.
        let fps = (count + frames - 1) as f64 / (passed_ns as f64 / 1e9);
        self.done = fps < WELL_BELOW * self.nominal_fps;
        self.done.then_some(fps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is told of a camera of 30 fps that gives `fps` for so many seconds, missing one of `missing`.
    fn told(fps: f64, seconds: f64, missing: Option<u64>) -> Vec<f64> {
        let mut check = LowRateCheck::new(30.0, 0);
        let frames = (0..(fps * seconds) as u64).filter_map(|frame| {
            let missed = missing.is_some_and(|missing| frame % missing == 0);
            check.frames(1, u64::from(missed), (frame as f64 / fps * 1e9) as u64)
        });
        frames.collect()
    }

    #[test]
    fn half_the_rate_is_told_once() {
        let told = told(15.0, 60.0, None);
        assert_eq!(told.len(), 1);
        assert!((told[0] - 15.0).abs() < 0.3, "{told:?}");
    }

    #[test]
    fn a_little_less_is_nothing_and_so_are_losses() {
        assert!(told(30.0, 60.0, None).is_empty());
        assert!(told(25.0, 60.0, None).is_empty());
        assert!(told(15.0, 3.5, None).is_empty(), "not yet");
        assert!(told(15.0, 60.0, Some(10)).is_empty(), "frames are lost, which has another cause");
    }
}
