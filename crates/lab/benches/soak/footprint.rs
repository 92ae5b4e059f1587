//! Resources that a process holds.

use std::fmt;
use std::fs;
use std::io;

/// Allowed relative growth of the memory: allocators keep some.
const GROWTH: f64 = 0.05;

/// Descriptors, threads and memory.
pub struct Footprint {
    descriptors: usize,
    threads: usize,
    resident_kb: u64,
}

impl Footprint {
    /// Returns the current footprint of this process.
    ///
    /// # Errors
    /// Fails without /proc.
    pub fn measure() -> io::Result<Self> {
        let status = fs::read_to_string("/proc/self/status")?;
        let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        Ok(Self {
            descriptors: fs::read_dir("/proc/self/fd")?.count(),
            threads: fs::read_dir("/proc/self/task")?.count(),
            resident_kb: resident.and_then(|kb| kb.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(0),
        })
    }

    /// Returns whether the footprint is no larger than before, but for the allowed growth.
    pub fn has_not_grown_since(&self, before: &Self) -> bool {
        self.descriptors <= before.descriptors
            && self.threads <= before.threads
            && self.resident_kb as f64 <= before.resident_kb as f64 * (1.0 + GROWTH)
    }
}

impl fmt::Display for Footprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { descriptors, threads, resident_kb } = self;
        write!(f, "{descriptors} descriptors, {threads} threads, {:.1} MB", *resident_kb as f64 / 1024.0)
    }
}
