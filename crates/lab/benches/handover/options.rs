//! The command line of the bench.

use clap::{Parser, value_parser};

use super::case::Case;

/// Time of the hand-over between threads, beside a link of a mutex and a condition variable
///
/// Both links hold the newest item only and are measured in turns in one process. Hand-over is the time from just
/// before an item is sent until its reader has it; send is what the sender spends. Each includes one reading of the
/// clock, some 20 to 50 ns.
#[derive(Parser, Debug)]
#[command(
    name = "handover",
    bin_name = "cargo bench --bench handover --",
    after_help = "\
Examples:
  cargo bench --bench handover
  cargo bench --bench handover -- --cases paced,polled --seconds 60
  cargo bench --bench handover -- --markdown > tables.md"
)]
pub struct Options {
    /// Cases to measure
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_enum, default_value = "paced,full-speed,polled")]
    pub cases: Vec<Case>,
    /// Time of each case and link, idle and under load, in seconds
    #[arg(long, value_name = "S", default_value_t = 20, value_parser = value_parser!(u32).range(1..=3600))]
    pub seconds: u32,
    /// Turns in which that time is spent
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = value_parser!(u32).range(1..=100))]
    pub turns: u32,
    /// Items a second where they are paced
    #[arg(long, value_name = "HZ", default_value_t = 60, value_parser = value_parser!(u32).range(1..=1000))]
    pub rate: u32,
    /// Busy threads that make the load [default: one per core]
    #[arg(long, value_name = "N", value_parser = value_parser!(u16).range(1..=1024))]
    pub load: Option<u16>,
    /// A table for the documentation
    #[arg(long)]
    pub markdown: bool,
    /// Given by `cargo bench`
    #[arg(long, hide = true)]
    bench: bool,
}
