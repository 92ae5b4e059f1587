//! The criteria, and the results against them.

use bokehcam_live::stats::Report;

use crate::loader;
use crate::stages::PERIOD_NS;

/// Limit for the interval between pictures (99th percentile), in periods.
const INTERVAL_PERIODS: f64 = 1.25;
/// Limit for the age from capture to output (99th percentile), in periods.
const AGE_PERIODS: f64 = 2.0;
/// Limit for the growth of the median age from the first minute to the last, in periods.
const GROWTH_PERIODS: f64 = 0.1;
const MINUTE_NS: u64 = 60_000_000_000;

/// Prints the results; returns whether all criteria are met. `shown` has times since the beginning, and ages.
pub fn print_verdict(shown: &[(u64, u64)], report: &Report) -> bool {
    let period_ms = PERIOD_NS as f64 / 1e6;
    let mut intervals: Vec<f64> = shown.windows(2).map(|pair| ns_to_ms(pair[1].0 - pair[0].0)).collect();
    let mut ages: Vec<f64> = shown.iter().map(|shown| ns_to_ms(shown.1)).collect();
    let end_ns = shown.last().map_or(0, |last| last.0);
    // A minute, or up to half of a shorter run, in whole cycles of the load process.
    let half_ns = MINUTE_NS.min(end_ns / 2);
    let cycle_ns = loader::CYCLE.as_nanos() as u64;
    let part_ns = if half_ns < cycle_ns { half_ns } else { half_ns - half_ns % cycle_ns };
    let median = |from_ns: u64, to_ns: u64| {
        let part = shown.iter().filter(|shown| (from_ns..=to_ns).contains(&shown.0));
        quantile(&mut part.map(|shown| ns_to_ms(shown.1)).collect::<Vec<_>>(), 0.5)
    };
    let (first, last) = (median(0, part_ns), median(end_ns - part_ns, end_ns));
    println!("{:<22}{:>9}{:>9}{:>9}   target", "ms", "p50", "p99", "max");
    let mut met = true;
    let mut row = |name: &str, values: &mut [f64], periods: f64| {
        let [p50, p99, max] = [0.5, 0.99, 1.0].map(|p| quantile(values, p));
        let fine = p99 <= periods * period_ms;
        met &= fine;
        let limit = periods * period_ms;
        println!("{name:<22}{p50:>9.1}{p99:>9.1}{max:>9.1}   p99 <= {limit:.1}: {}", criterion_word(fine));
    };
    row("output interval", &mut intervals, INTERVAL_PERIODS);
    row("age at output", &mut ages, AGE_PERIODS);
    let fine = last - first <= GROWTH_PERIODS * period_ms;
    met &= fine;
    let part_s = part_ns as f64 / 1e9;
    println!("median age of the first {part_s:.0} s {first:.1} ms, of the last {last:.1} ms: {}", criterion_word(fine));

    let frames = report.frames.captured.max(1) as f64;
    let dropped = report.frames.dropped.by_cause();
    let dropped = dropped.map(|(cause, count)| format!("{cause} {count} ({:.2} %)", 100.0 * count as f64 / frames));
    println!("dropped: {}", dropped.join(", "));
    let fractions =
        report.quality.fractions.iter().map(|(level, fraction)| format!("{level} {:.1} %", 100.0 * fraction));
    let minutes = report.elapsed_s / 60.0;
    println!(
        "quality: {}; {:.1} switches a minute; {} misses ({:.2} %); depth held for {:.1} %",
        fractions.collect::<Vec<_>>().join(", "),
        report.quality.switches as f64 / minutes,
        report.misses,
        100.0 * report.misses as f64 / frames,
        100.0 * report.depth_held as f64 / frames,
    );
    met
}

/// Returns the word for a criterion's result.
pub fn criterion_word(fine: bool) -> &'static str {
    if fine { "met" } else { "MISSED" }
}

fn ns_to_ms(ns: u64) -> f64 {
    ns as f64 / 1e6
}

/// Returns the `p` quantile of the values; NaN without values.
fn quantile(values: &mut [f64], p: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let rank = ((p * values.len() as f64).ceil() as usize).clamp(1, values.len().max(1));
    values.get(rank - 1).copied().unwrap_or(f64::NAN)
}
