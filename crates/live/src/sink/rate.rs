//! Frame rates as the fractions that formats and drivers accept.

/// Returns frames per second as numerator and denominator: an integer or NTSC rate (n * 1000 / 1001) if the period is
/// within rounding of it, else in thousandths; below one per second from the period in whole milliseconds.
pub(super) fn frame_rate(period_ns: u64) -> (u64, u64) {
    let period_ns = period_ns.max(1);
    let per_second = 1e9 / period_ns as f64;
    let whole = per_second.round();
    // Integer and NTSC rates are 1e-3 apart; this tolerance allows for rounded periods.
    let is_near = |rate: f64| rate >= 1.0 && (per_second / rate - 1.0).abs() < 2e-4;
    let ntsc = (per_second * 1.001).round();
    if is_near(whole) {
        (whole as u64, 1)
    } else if is_near(ntsc / 1.001) {
        (ntsc as u64 * 1000, 1001)
    } else if per_second >= 1.0 {
        reduce_fraction((per_second * 1000.0).round() as u64, 1000)
    } else {
        reduce_fraction(1000, period_ns / 1_000_000)
    }
}

fn reduce_fraction(rate: u64, scale: u64) -> (u64, u64) {
    let (mut a, mut b) = (rate, scale);
    while b != 0 {
        (a, b) = (b, a % b);
    }
    (rate / a, scale / a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_rates_are_what_encoders_know() {
        for (period_ns, rate) in [
            (33_333_333, (30, 1)),
            (33_334_000, (30, 1)),
            (33_366_667, (30_000, 1001)),
            (41_708_333, (24_000, 1001)),
            (41_666_667, (24, 1)),
            (80_000_000, (25, 2)),
            (33_356_000, (1499, 50)),
            (2_000_000_000, (1, 2)),
            (3_600_000_000_000, (1, 3600)),
        ] {
            assert_eq!(frame_rate(period_ns), rate, "{period_ns} ns");
        }
    }
}
