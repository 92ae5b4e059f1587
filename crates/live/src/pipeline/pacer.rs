//! Replays stored frames in real time: each waits for its media time, and those that would miss theirs are skipped,
//! as a camera would have overwritten them.

use crate::capture::Camera;
use bokehcam::clock::Clock;

/// Longest time until a stop is noticed.
const POLL_INTERVAL_NS: u64 = 50_000_000;

pub(super) struct Pacer {
    clock: Clock,
    is_paced: bool,
    period_ns: u64,
    /// The time of media time 0; `None` before the first frame.
    epoch_ns: Option<u64>,
    /// Time to read a frame, a moving average.
    read_ns: u64,
}

impl Pacer {
    pub(super) fn new(clock: Clock, is_paced: bool, period_ns: u64) -> Self {
        Self { clock, is_paced, period_ns, epoch_ns: None, read_ns: 0 }
    }

    /// Skips the frames that would be more than a period late once read; returns how many.
    pub(super) fn skip_late_frames(&self, camera: &mut dyn Camera) -> u64 {
        match self.epoch_ns {
            Some(epoch_ns) if self.is_paced => {
                let read_ns = self.clock.now_ns() + self.read_ns;
                camera.skip_until(read_ns.saturating_sub(epoch_ns + self.period_ns))
            }
            _ => 0,
        }
    }

    /// Shifts the schedule by a pause, so that frames go on from where they were.
    pub(super) fn shift_schedule(&mut self, pause_ns: u64) {
        self.epoch_ns = self.epoch_ns.map(|epoch_ns| epoch_ns + pause_ns);
    }

    /// Restarts the schedule: the next frame is due at once, after a seek.
    pub(super) fn restart_schedule(&mut self) {
        self.epoch_ns = None;
    }

    /// Waits until the frame of media time `time_ns`, which took `read_ns` to read, is due, or until `stop` returns
    /// true. Returns its capture time: when it was due, or now if the source is not paced.
    pub(super) fn wait_until_due(&mut self, time_ns: u64, read_ns: u64, stop: impl Fn() -> bool) -> u64 {
        let now_ns = self.clock.now_ns();
        if !self.is_paced {
            return now_ns;
        }
        self.read_ns = if self.epoch_ns.is_none() { read_ns } else { self.read_ns - self.read_ns / 4 + read_ns / 4 };
        let due_ns = *self.epoch_ns.get_or_insert(now_ns.saturating_sub(time_ns)) + time_ns;
        while !stop() && self.clock.now_ns() < due_ns {
            self.clock.sleep_until_ns(due_ns.min(self.clock.now_ns() + POLL_INTERVAL_NS));
        }
        // After an early stop the frame must not be stamped with a capture time in the future.
        due_ns.min(self.clock.now_ns())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::{CaptureError, Captured, FrameBuffers, SourceInfo};

    const PERIOD_NS: u64 = 100;

    /// A camera with a frame every 100 ns, as a position.
    struct Positions(u64);

    impl Camera for Positions {
        fn info(&self) -> SourceInfo {
            unreachable!("the pacer asks for nothing but skips")
        }
        fn next(&mut self, _: FrameBuffers) -> Result<Captured, CaptureError> {
            Ok(Captured::End)
        }
        fn skip_until(&mut self, until_ns: u64) -> u64 {
            let from = self.0;
            self.0 = self.0.max(until_ns.div_ceil(PERIOD_NS));
            self.0 - from
        }
    }

    /// Plays 40 frames that take `read_ns` each; returns how many were read, and the largest delay.
    fn play(read_ns: u64) -> (u64, u64) {
        let clock = Clock::manual();
        let mut pacer = Pacer::new(clock.clone(), true, PERIOD_NS);
        let mut camera = Positions(0);
        let (mut read, mut latest_ns) = (0, 0);
        loop {
            pacer.skip_late_frames(&mut camera);
            if camera.0 >= 40 {
                return (read, latest_ns);
            }
            let time_ns = camera.0 * PERIOD_NS;
            camera.0 += 1;
            clock.advance_ns(read_ns);
            let captured_ns = pacer.wait_until_due(time_ns, read_ns, || false);
            latest_ns = latest_ns.max(clock.now_ns() - captured_ns);
            read += 1;
        }
    }

    #[test]
    fn a_fast_source_keeps_every_frame_on_time() {
        assert_eq!(play(90), (40, 0));
    }

    #[test]
    fn a_slow_source_keeps_time_and_loses_frames() {
        let (read, latest_ns) = play(350);
        assert!((10..=12).contains(&read), "{read} of 40 at 3.5 periods each");
        assert!(latest_ns <= PERIOD_NS + 50, "never much more than a period late: {latest_ns}");
    }

    #[test]
    fn only_what_would_be_more_than_a_period_late_is_passed_over() {
        let late = |since_ns: u64, read_ns: u64| {
            let clock = Clock::manual();
            let mut pacer = Pacer::new(clock.clone(), true, PERIOD_NS);
            pacer.wait_until_due(0, read_ns, || false);
            clock.advance_ns(since_ns);
            pacer.skip_late_frames(&mut Positions(1))
        };
        // The next frame is due at 100.
        assert_eq!([199, 200, 201, 300, 301].map(|since_ns| late(since_ns, 0)), [0, 0, 1, 1, 2]);
        assert_eq!([170, 171].map(|since_ns| late(since_ns, 30)), [0, 1], "it takes 30 to be read");
    }

    #[test]
    fn a_rest_passes_over_nothing() {
        let clock = Clock::manual();
        let mut pacer = Pacer::new(clock.clone(), true, PERIOD_NS);
        let mut camera = Positions(1);
        pacer.wait_until_due(0, 0, || false);
        clock.advance_ns(60 * PERIOD_NS);
        pacer.shift_schedule(60 * PERIOD_NS);
        assert_eq!(pacer.skip_late_frames(&mut camera), 0);
        assert_eq!(pacer.wait_until_due(PERIOD_NS, 0, || false), 61 * PERIOD_NS);
    }

    #[test]
    fn without_pace_nothing_waits_and_nothing_is_passed_over() {
        let clock = Clock::manual();
        let mut pacer = Pacer::new(clock.clone(), false, PERIOD_NS);
        clock.advance_ns(7);
        assert_eq!(pacer.wait_until_due(1_000_000, 5, || false), 7);
        assert_eq!(pacer.skip_late_frames(&mut Positions(0)), 0);
        assert_eq!(clock.now_ns(), 7);
    }

    #[test]
    fn a_stop_ends_the_wait() {
        let mut pacer = Pacer::new(Clock::system(), true, PERIOD_NS);
        let began_ns = pacer.wait_until_due(0, 0, || false);
        let hour_ns = 3_600_000_000_000;
        assert!(pacer.wait_until_due(hour_ns, 0, || true) < began_ns + hour_ns);
    }
}
