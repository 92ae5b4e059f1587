//! `cargo bench --bench governor -- [OPTIONS]`: the governor on a simulated machine, against other rules.
//!
//! | file | what |
//! |---|---|
//! | `load` | the machine: steps of its load, noise, spikes, times that are known late |
//! | `rivals` | what picks the rung |
//! | `play` | one run of one of them, and what is counted |
//! | `claims` | the machines, and what is claimed of the governor on each |
//!
//! Exit code 1 if a claim is broken; `crates/lab/tests/lab/governor.rs` checks all claims that need no rival.

mod claims;
#[path = "../common/mod.rs"]
mod common;
mod load;
mod play;
mod rivals;

use std::process::ExitCode;

use clap::Parser;

use claims::{BUDGET, Case};
use play::Score;
use rivals::{LevelRule, OracleRule, ThresholdRule};

/// The governor of the quality ladder on a simulated machine, beside other rules
///
/// Misses: share of the frames over the budget. Quality: mean over the frames, from 0.8 at the cheapest rung to 1 at
/// the finest. Settled: frames from a step of the load until the rung stays the same or within one of its last.
#[derive(Parser, Debug)]
#[command(
    name = "governor",
    bin_name = "cargo bench --bench governor --",
    after_help = "\
Examples:
  cargo bench --bench governor
  cargo bench --bench governor -- --seeds 100-149 --minutes 60 --markdown"
)]
struct Options {
    /// Seeds of the machine, FIRST-LAST: rules were tuned on 1-20
    #[arg(long, value_name = "RANGE", default_value = "101-140", value_parser = parse_seeds)]
    seeds: std::ops::RangeInclusive<u64>,
    /// Simulated minutes of each seed, at 30 frames a second
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=600))]
    minutes: u32,
    /// Tables for the documentation
    #[arg(long)]
    markdown: bool,
    /// Given by `cargo bench`
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    let options: Options = match common::options() {
        Ok(options) => options,
        Err(code) => return code,
    };
    if !options.bench {
        println!("nothing measured: run it by `cargo bench --bench governor`");
        return ExitCode::SUCCESS;
    }
    // Every claim counts, in every case.
    let met = claims::cases().iter().filter(|case| !compare_rules(case, &options)).count() == 0;
    if met { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Plays a case by every rule and prints its table; returns whether the governor meets its claims.
fn compare_rules(case: &Case, options: &Options) -> bool {
    let costs = case.costs();
    let run = |make: &dyn Fn(&[f64]) -> Box<dyn LevelRule>| case.simulate(options.seeds.clone(), options.minutes, make);
    let threshold = run(&|known| Box::new(ThresholdRule::new(known.len(), BUDGET)));
    let oracle = run(&|_| Box::new(OracleRule { costs: costs.clone(), budget: BUDGET }));
    let outcome = case.compare_with_pid(options.seeds.clone(), options.minutes);

    let title = format!("{}: seeds {:?}, {} minutes each", case.name, options.seeds, options.minutes);
    let head = ["rule", "misses %", "mean quality", "switches/min", "settled after a rise: p50, p95", "after a fall"];
    if options.markdown {
        println!("{title}\n\n| {} |\n|{}", head.join(" | "), "---|".repeat(head.len()));
    } else {
        println!("{title}\n{}", format_row(&head.map(String::from), false));
    }
    let line = |name: &str, score: &Score| {
        let settled =
            |fell: bool| format!("{}, {}", score.settling_frames(fell, 0.5), score.settling_frames(fell, 0.95));
        let cells = [
            name.to_string(),
            format!("{:.2}", 100.0 * score.miss_fraction()),
            format!("{:.4}", score.mean_quality()),
            format!("{:.1}", score.switches_per_minute()),
            settled(false),
            settled(true),
        ];
        println!("{}", format_row(&cells, options.markdown));
    };
    line("threshold 75/100 %", &threshold);
    for (headroom, score) in outcome.pids.iter().filter(|(headroom, _)| (headroom * 20.0).round() % 2.0 == 0.0) {
        line(&format!("PID, headroom {:.0} %", headroom * 100.0), score);
    }
    line("governor", &outcome.ours);
    line("oracle", &oracle);
    let equal = outcome.equal.map_or("above all its headrooms".to_string(), |quality| format!("{quality:.4}"));
    let broken = case.find_violations(&outcome);
    let verdict = if broken.is_empty() { "kept".to_string() } else { format!("broken: {}", broken.join("; ")) };
    println!("\nThe PID's quality at the governor's misses: {equal}. What is claimed is {verdict}.\n");
    broken.is_empty()
}

fn format_row(cells: &[String], markdown: bool) -> String {
    if markdown {
        return format!("| {} |", cells.join(" | "));
    }
    let widths = [22, 9, 13, 13, 31, 13];
    cells.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}")).collect::<String>().trim_end().to_string()
}

fn parse_seeds(text: &str) -> Result<std::ops::RangeInclusive<u64>, String> {
    let bad = || "use FIRST-LAST, such as 101-140".to_string();
    let (first, last) = text.split_once('-').ok_or_else(bad)?;
    let range = first.parse().map_err(|_| bad())?..=last.parse().map_err(|_| bad())?;
    if range.is_empty() { Err(bad()) } else { Ok(range) }
}
