//! Pairs depth maps with colour frames by capture time.

use bokehcam::frame::DepthMap;

/// Number of kept maps: depth may lead or lag by a frame.
const MAX_MAPS: usize = 3;

/// Number of periods without a map after which the camera counts as stopped: waiting would only add delay, and the
/// last map is of another time.
const STOPPED_PERIODS: u64 = 4;
/// Difference in capture time, in nanoseconds, up to which a map fits a frame at any rate: the delay of a camera.
const MAX_DELAY_NS: u64 = 150_000_000;

/// The newest maps with their capture times.
#[derive(Debug, Default)]
pub(super) struct Pairing {
    maps: [DepthMap; MAX_MAPS],
    /// Capture times; `None` for an unused map.
    captured_ns: [Option<u64>; MAX_MAPS],
    /// Index of the oldest map, which the next one overwrites.
    next: usize,
}

impl Pairing {
    /// Returns the map to overwrite, which is unused until [`Pairing::commit`] makes it the newest.
    pub(super) fn oldest_mut(&mut self) -> &mut DepthMap {
        self.captured_ns[self.next] = None;
        &mut self.maps[self.next]
    }

    /// Makes the overwritten map the newest, captured at `captured_ns`.
    pub(super) fn commit(&mut self, captured_ns: u64) {
        self.captured_ns[self.next] = Some(captured_ns);
        self.next = (self.next + 1) % MAX_MAPS;
    }

    pub(super) fn clear(&mut self) {
        self.captured_ns = [None; MAX_MAPS];
    }

    /// Returns the capture time of the newest map.
    pub(super) fn newest_ns(&self) -> Option<u64> {
        self.captured_ns.into_iter().flatten().max()
    }

    /// Whether a better map for a frame captured at `captured_ns` is due: the newest map is more than half a period
    /// older, and the camera still runs.
    pub(super) fn is_worth_waiting(&self, captured_ns: u64, period_ns: u64) -> bool {
        self.newest_ns().is_some_and(|newest_ns| {
            let lag_ns = captured_ns.saturating_sub(newest_ns);
            (period_ns / 2 + 1..STOPPED_PERIODS * period_ns).contains(&lag_ns)
        })
    }

    /// Returns the map captured nearest to this time, of a camera with this period; `None` if it is of another time.
    pub(super) fn nearest(&self, captured_ns: u64, period_ns: u64) -> Option<&DepthMap> {
        let most_ns = MAX_DELAY_NS.max(STOPPED_PERIODS * period_ns);
        let maps = self.maps.iter().zip(self.captured_ns);
        let off = maps.filter_map(|(map, at_ns)| Some((map, at_ns?.abs_diff(captured_ns))));
        off.filter(|&(_, off_ns)| off_ns <= most_ns).min_by_key(|&(_, off_ns)| off_ns).map(|(map, _)| map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn pairing(times_ms: &[u64]) -> Pairing {
        let mut pairing = Pairing::default();
        for &time_ms in times_ms {
            let map = pairing.oldest_mut();
            map.resize(1, 1);
            map.metres[0] = time_ms as f32;
            pairing.commit(time_ms * MS);
        }
        pairing
    }

    #[test]
    fn the_nearest_in_time_is_taken_unless_it_is_of_another_time() {
        let pairing = pairing(&[10, 43, 76, 110]);
        let at = |ms: u64, period_ms: u64| pairing.nearest(ms * MS, period_ms * MS).map(|map| map.metres[0]);
        let near = [at(0, 33), at(43, 33), at(60, 33), at(90, 33), at(250, 11)];
        assert_eq!(near, [Some(43.0), Some(43.0), Some(76.0), Some(76.0), Some(110.0)]);
        assert_eq!(
            [at(270, 33), at(270, 100), at(10_000, 100)],
            [None, Some(110.0), None],
            "a person has moved by then"
        );
        assert_eq!(pairing.newest_ns(), Some(110 * MS));
    }

    #[test]
    fn before_the_first_and_after_a_rest_there_is_none() {
        assert!(Pairing::default().nearest(5, MS).is_none());
        let mut pairing = pairing(&[10, 20]);
        pairing.clear();
        assert!(pairing.nearest(20 * MS, 33 * MS).is_none() && pairing.newest_ns().is_none());
        assert!(!pairing.is_worth_waiting(20 * MS, 33 * MS));
    }

    #[test]
    fn one_that_failed_to_decode_is_not_taken() {
        let mut pairing = pairing(&[10, 20, 30]);
        pairing.oldest_mut().metres[0] = -1.0;
        assert_eq!(pairing.nearest(0, 33 * MS).map(|map| map.metres[0]), Some(20.0));
        pairing.oldest_mut().metres[0] = 40.0;
        pairing.commit(40 * MS);
        assert_eq!(pairing.nearest(50 * MS, 33 * MS).map(|map| map.metres[0]), Some(40.0));
    }

    #[test]
    fn a_picture_waits_only_for_a_map_that_is_due() {
        let pairing = pairing(&[100]);
        let waits = |ms: u64| pairing.is_worth_waiting(ms * MS, 33 * MS);
        assert_eq!([waits(90), waits(110), waits(120), waits(150), waits(240)], [false, false, true, true, false]);
    }
}
