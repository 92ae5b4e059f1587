//! Times and frame period of a recording.

use std::ops::RangeInclusive;

use super::{MAX_ENTRIES, Options};

/// Period of a recording with fewer than two known times: 30 frames per second.
const DEFAULT_PERIOD_NS: u64 = 33_333_333;

/// Frame periods of cameras, from 500 per second to one in ten seconds: with others, times may have another unit.
pub(super) const PLAUSIBLE_PERIODS_NS: RangeInclusive<u64> = 2_000_000..=10_000_000_000;

/// Maximum length of a recording, ten years: keeps arithmetic with times and periods far from overflow.
pub(super) const MAX_LENGTH_NS: u64 = 10 * 366 * 24 * 3600 * 1_000_000_000;

/// Returns the time of picture `index` of a recording without times.
pub(super) fn numbered_time_ns(index: u64, options: &Options) -> u64 {
    index * given_period_ns(options).unwrap_or(DEFAULT_PERIOD_NS)
}

/// Returns the period that the options give, within bounds: times increase, and even long recordings do not overflow.
pub(super) fn given_period_ns(options: &Options) -> Option<u64> {
    options.period_ns.map(|period_ns| period_ns.clamp(1, MAX_LENGTH_NS / MAX_ENTRIES as u64))
}

/// Describes the frame rate of a recording without times.
pub(super) fn describe_rate(options: &Options) -> String {
    match given_period_ns(options) {
        Some(period_ns) => format!("{} per second", (1e12 / period_ns as f64).round() / 1e3),
        None => "30 per second (--fps)".to_owned(),
    }
}

/// Returns the median interval of strictly increasing times; [`DEFAULT_PERIOD_NS`] if there are fewer than two.
pub(super) fn median_period_ns(times_ns: impl Iterator<Item = u64> + Clone) -> u64 {
    let mut periods_ns: Vec<u64> = times_ns.clone().skip(1).zip(times_ns).map(|(next, time)| next - time).collect();
    let middle = periods_ns.len() / 2;
    if periods_ns.is_empty() { DEFAULT_PERIOD_NS } else { *periods_ns.select_nth_unstable(middle).1 }
}

/// Returns a time for every frame in nanoseconds after the first, strictly increasing, hardly beyond [`MAX_LENGTH_NS`].
/// Unknown times are interpolated between their neighbours, or extrapolated by the period at the ends. The known times
/// must increase strictly.
pub(super) fn interpolate_times(times_ns: &[Option<u64>]) -> Vec<u64> {
    let known: Vec<(usize, u64)> =
        times_ns.iter().enumerate().filter_map(|(index, &time)| Some((index, time?))).collect();
    let period_ns = i128::from(median_period_ns(known.iter().map(|&(_, time)| time)));
    let estimate_ns = |index: usize| {
        // The time of a known frame, and how many frames after it this one is.
        let anchor = |(known, time): (usize, u64)| (i128::from(time), index as i128 - known as i128);
        let next = known.partition_point(|&(known, _)| known < index);
        let before = next.checked_sub(1).map(|last| anchor(known[last]));
        match (before, known.get(next).copied().map(anchor)) {
            (Some((time, offset)), Some((next_time, next_offset))) => {
                time + (next_time - time) * offset / (offset - next_offset)
            }
            (Some((time, offset)), None) | (None, Some((time, offset))) => time + period_ns * offset,
            (None, None) => period_ns * index as i128,
        }
    };
    let start_ns = estimate_ns(0);
    let mut earliest_ns = 0;
    (0..times_ns.len())
        .map(|index| {
            let time_ns = u64::try_from(estimate_ns(index) - start_ns).unwrap_or(u64::MAX);
            // If there are more frames than nanoseconds between two times, the later ones are delayed.
            let time_ns = time_ns.min(MAX_LENGTH_NS).max(earliest_ns);
            earliest_ns = time_ns + 1;
            time_ns
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_times_stay_and_the_others_lie_between_them() {
        assert_eq!(interpolate_times(&[Some(50), Some(60), Some(75)]), [0, 10, 25]);
        assert_eq!(interpolate_times(&[Some(100), None, None, Some(130)]), [0, 10, 20, 30]);
    }

    #[test]
    fn the_ends_go_on_at_the_median_period() {
        assert_eq!(interpolate_times(&[None, Some(5), Some(15), Some(25), None, None]), [0, 10, 20, 30, 40, 50]);
        assert_eq!(interpolate_times(&[None, None]), [0, DEFAULT_PERIOD_NS]);
        assert!(interpolate_times(&[]).is_empty());
    }

    #[test]
    fn times_increase_even_where_there_is_no_room() {
        assert_eq!(interpolate_times(&[Some(7), None, None, Some(8), Some(9)]), [0, 1, 2, 3, 4]);
        assert_eq!(interpolate_times(&[Some(0), Some(u64::MAX), None]), [0, MAX_LENGTH_NS, MAX_LENGTH_NS + 1]);
        assert_eq!(interpolate_times(&[Some(0), Some(MAX_LENGTH_NS), None]), [0, MAX_LENGTH_NS, MAX_LENGTH_NS + 1]);
    }

    #[test]
    fn the_period_is_the_median() {
        assert_eq!(median_period_ns([0, 10, 20, 500].into_iter()), 10);
        assert_eq!(median_period_ns([7].into_iter()), DEFAULT_PERIOD_NS);
    }
}
