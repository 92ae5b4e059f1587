//! Notices whether anybody reads from the virtual camera, and tells the demand.

use std::thread::{self, JoinHandle};
use std::time::Duration;
use std::{io, mem};

use crate::clock::Clock;
use crate::link::demand::Demand;
use crate::v4l2::audience::{Audience, ReaderEvent, Stop};

/// How long a camera still counts as watched after its last reader left: call programs close and open it repeatedly.
const LINGER: Duration = Duration::from_millis(2500);

/// A thread that watches until it is dropped.
pub(super) struct Watcher {
    stop: Option<Stop>,
    thread: Option<JoinHandle<()>>,
}

impl Watcher {
    pub(super) fn start((mut audience, stop): (Audience, Stop), demand: Demand) -> io::Result<Self> {
        let listen = move || follow_readers(&demand, &Clock::system(), |patience| audience.wait(patience));
        let thread = thread::Builder::new().name("audience".into()).spawn(listen)?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for Watcher {
    fn drop(&mut self) {
        drop(self.stop.take());
        // A panic of the thread was printed; there is nothing left to do about it.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Holds a watch on `demand` while there are readers, and [`LINGER`] longer, until it is told to stop. `wait` blocks
/// for the next event, at most for the given time (`None`: without limit).
fn follow_readers(demand: &Demand, clock: &Clock, mut wait: impl FnMut(Option<Duration>) -> ReaderEvent) {
    let mut watch = None;
    let mut release_at_ns: Option<u64> = None;
    loop {
        let timeout = release_at_ns.map(|at_ns| Duration::from_nanos(at_ns.saturating_sub(clock.now_ns())));
        match wait(timeout) {
            ReaderEvent::Readers(true) => {
                release_at_ns = None;
                if watch.is_none() {
                    tracing::info!("somebody watches");
                    watch = Some(demand.watch());
                }
            }
            ReaderEvent::Readers(false) if watch.is_some() => {
                release_at_ns.get_or_insert(clock.now_ns() + LINGER.as_nanos() as u64);
            }
            ReaderEvent::Readers(false) | ReaderEvent::Nothing => {}
            ReaderEvent::Stopped => return,
        }
        if release_at_ns.is_some_and(|at_ns| clock.now_ns() >= at_ns) {
            tracing::info!("nobody watches");
            release_at_ns = None;
            drop(mem::take(&mut watch));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    /// Plays what is heard, and when: each after so long, but not beyond what the listener is ready to wait. Returns
    /// for each whether the demand was watched when it was waited for, and for how long.
    fn play(heard: &[(Duration, ReaderEvent)]) -> Vec<(bool, Option<Duration>)> {
        let (demand, clock) = (Demand::new(), Clock::manual());
        let mut left = heard.iter();
        let mut seen = Vec::new();
        let mut next = left.next().copied();
        follow_readers(&demand, &clock, |patience| {
            seen.push((demand.is_watched(), patience));
            let Some((after, what)) = next else { return ReaderEvent::Stopped };
            match patience {
                Some(patience) if patience < after => {
                    next = Some((after - patience, what));
                    clock.advance_ns(patience.as_nanos() as u64);
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
            [(false, None), (false, None), (true, None), (true, Some(LINGER)), (false, None), (true, None)]
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
