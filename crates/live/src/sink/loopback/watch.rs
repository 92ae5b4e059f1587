//! Watches whether the virtual camera has readers, and updates the demand.

use std::thread::{self, JoinHandle};
use std::time::Duration;
use std::{io, mem};

use crate::v4l2::reader_monitor::{ReaderEvent, ReaderMonitor, StopHandle};
use bokehcam::clock::Clock;
use bokehcam::link::demand::Demand;

/// Time for which a camera still counts as watched after its last reader left: call programs close and reopen it
/// repeatedly.
const WATCH_HOLD: Duration = Duration::from_millis(2500);

/// A thread that watches for readers until it is dropped.
pub(super) struct ReaderWatcher {
    stop: Option<StopHandle>,
    thread: Option<JoinHandle<()>>,
}

impl ReaderWatcher {
    pub(super) fn start((mut monitor, stop): (ReaderMonitor, StopHandle), demand: Demand) -> io::Result<Self> {
        let follow = move || follow_readers(&demand, &Clock::system(), |timeout| monitor.wait(timeout));
        let thread = thread::Builder::new().name("audience".into()).spawn(follow)?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for ReaderWatcher {
    fn drop(&mut self) {
        drop(self.stop.take());
        // A panic of the thread was printed already.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Holds a watch on `demand` while there are readers, and [`WATCH_HOLD`] longer, until it is stopped. `wait` blocks for
/// the next event, at most for the given time (`None`: without limit).
fn follow_readers(demand: &Demand, clock: &Clock, mut wait: impl FnMut(Option<Duration>) -> ReaderEvent) {
    let mut watch = None;
    let mut release_at_ns: Option<u64> = None;
    loop {
        let timeout = release_at_ns.map(|at_ns| Duration::from_nanos(at_ns.saturating_sub(clock.now_ns())));
        match wait(timeout) {
            ReaderEvent::Readers(true) => {
                release_at_ns = None;
                if watch.is_none() {
                    tracing::info!("a program reads the camera");
                    watch = Some(demand.watch());
                }
            }
            ReaderEvent::Readers(false) if watch.is_some() => {
                // A repeated report must not extend the hold.
                release_at_ns.get_or_insert(clock.now_ns() + WATCH_HOLD.as_nanos() as u64);
            }
            ReaderEvent::Readers(false) | ReaderEvent::Nothing => {}
            ReaderEvent::Stopped => return,
        }
        if release_at_ns.is_some_and(|at_ns| clock.now_ns() >= at_ns) {
            tracing::info!("no program reads the camera");
            release_at_ns = None;
            drop(mem::take(&mut watch));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    /// Plays events, each after a delay, but returns earlier if the listener's timeout is shorter. Returns for each
    /// wait whether the demand was watched, and the timeout.
    fn play(events: &[(Duration, ReaderEvent)]) -> Vec<(bool, Option<Duration>)> {
        let (demand, clock) = (Demand::new(), Clock::manual());
        let mut left = events.iter();
        let mut seen = Vec::new();
        let mut next = left.next().copied();
        follow_readers(&demand, &clock, |timeout| {
            seen.push((demand.is_watched(), timeout));
            let Some((after, what)) = next else { return ReaderEvent::Stopped };
            match timeout {
                Some(timeout) if timeout < after => {
                    next = Some((after - timeout, what));
                    clock.advance_ns(timeout.as_nanos() as u64);
                    ReaderEvent::Nothing
                }
                _ => {
                    next = left.next().copied();
                    clock.advance_ns(after.as_nanos() as u64);
                    what
                }
            }
        });
        assert!(!demand.is_watched(), "the watch outlives its listener");
        seen
    }

    #[test]
    fn a_reader_is_watched_for_at_once_and_for_a_while_after() {
        let seen = play(&[
            (Duration::ZERO, ReaderEvent::Readers(false)),
            (60 * SECOND, ReaderEvent::Readers(true)),
            (60 * SECOND, ReaderEvent::Readers(false)),
            (60 * SECOND, ReaderEvent::Readers(true)),
        ]);
        assert_eq!(
            seen,
            [(false, None), (false, None), (true, None), (true, Some(WATCH_HOLD)), (false, None), (true, None)]
        );
    }

    #[test]
    fn who_comes_back_in_time_is_not_missed_and_nobody_makes_it_longer() {
        let seen = play(&[
            (Duration::ZERO, ReaderEvent::Readers(true)),
            (SECOND, ReaderEvent::Readers(false)),
            (SECOND, ReaderEvent::Readers(true)),
            (SECOND, ReaderEvent::Readers(false)),
            (SECOND, ReaderEvent::Readers(false)),
            (SECOND, ReaderEvent::Nothing),
            (60 * SECOND, ReaderEvent::Readers(false)),
        ]);
        let left = |ms| Some(Duration::from_millis(ms));
        let wanted = [
            (false, None),
            (true, None),
            (true, left(2500)),
            (true, None),
            (true, left(2500)),
            (true, left(1500)),
            (true, left(500)),
            (false, None),
            (false, None),
        ];
        assert_eq!(seen, wanted);
    }
}
