//! `cargo bench --bench handover -- [OPTIONS]`: the latency of the hand-over between threads, against a link with a
//! lock.
//!
//! | file | what |
//! |---|---|
//! | `case` | what is measured |
//! | `locked` | the link to compare with |
//! | `options` | the command line |

mod case;
mod locked;
mod options;

use std::time::Duration;

use clap::{Parser, ValueEnum};

use case::{Case, Link, Load, Times, measure_turn};
use options::Options;

fn main() {
    let options = Options::parse();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let busy = options.load.map_or(cores, usize::from);
    println!("{cores} cores; load: {busy} busy threads; {} s each, in {} turns", options.seconds, options.turns);
    let (between, edge) = if options.markdown { (" | ", "| ") } else { ("  ", "") };
    let print = |cells: [String; 10]| println!("{edge}{}", cells.join(between) + edge.trim_start_matches("| "));
    print(table_header());
    if options.markdown {
        println!("|{}", "---|".repeat(10));
    }
    for &case in &options.cases {
        for threads in [0, busy] {
            let mut times = [Times::default(), Times::default()];
            let load = Load::new(threads);
            let time = Duration::from_secs(options.seconds.into()) / options.turns;
            for _ in 0..options.turns {
                for (link, times) in [Link::LockFree, Link::Locked].into_iter().zip(&mut times) {
                    measure_turn(case, link, options.rate, time, times);
                }
            }
            drop(load);
            for (link, times) in [Link::LockFree, Link::Locked].into_iter().zip(times) {
                print(format_row(case, threads > 0, link, times));
            }
        }
    }
}

fn table_header() -> [String; 10] {
    [
        format!("{:<10}", "case"),
        "load".into(),
        format!("{:<9}", "link"),
        format!("{:>10}", "sent"),
        "hand-over µs p50".into(),
        format!("{:>8}", "p99"),
        format!("{:>8}", "max"),
        "send µs p50".into(),
        format!("{:>8}", "p99"),
        format!("{:>8}", "max"),
    ]
}

fn format_row(case: Case, loaded: bool, link: Link, times: Times) -> [String; 10] {
    let Times { sent, mut hand_over_ns, mut send_ns } = times;
    hand_over_ns.sort_unstable();
    send_ns.sort_unstable();
    let case = case.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default();
    let link = match link {
        Link::LockFree => "lock-free",
        Link::Locked => "mutex",
    };
    [
        format!("{case:<10}"),
        format!("{:<4}", if loaded { "busy" } else { "idle" }),
        format!("{link:<9}"),
        format!("{sent:>10}"),
        format!("{:>16}", quantile_us(&hand_over_ns, 0.5)),
        format!("{:>8}", quantile_us(&hand_over_ns, 0.99)),
        format!("{:>8}", quantile_us(&hand_over_ns, 1.0)),
        format!("{:>11}", quantile_us(&send_ns, 0.5)),
        format!("{:>8}", quantile_us(&send_ns, 0.99)),
        format!("{:>8}", quantile_us(&send_ns, 1.0)),
    ]
}

/// Returns the quantile `q` of the sorted times, in microseconds.
fn quantile_us(sorted_ns: &[u64], q: f64) -> String {
    let time_ns = sorted_ns[((sorted_ns.len() - 1) as f64 * q).round() as usize];
    format!("{:.2}", time_ns as f64 / 1e3)
}
