//! Whether a picture fits into the memory that is free.

use std::fs;

use rustix::process::{Resource, getrlimit};

use super::error::CliError;

/// What reading, preparing and blurring a picture takes at most, at the finest quality with refined depth
/// (`docs/reliability.md` has the measurements).
const BYTES_PER_PIXEL: u64 = 90;
/// Below this nothing is asked: the estimate leaves out what does not grow with the picture.
const SMALL_PX: u64 = 16 << 20;

/// Refuses a picture of `size` pixels whose blur would take more memory than there is, before that is taken.
///
/// # Errors
/// [`CliError::Memory`].
pub fn check(size: (u32, u32)) -> Result<(), CliError> {
    let pixels = u64::from(size.0) * u64::from(size.1);
    let needed = pixels * BYTES_PER_PIXEL;
    match free_bytes() {
        Some(free) if pixels > SMALL_PX && needed > free => {
            Err(CliError::Memory { size, needed_mb: needed >> 20, free_mb: free >> 20 })
        }
        _ => Ok(()),
    }
}

/// What this process can still take: free memory and swap space, within its own limit (`ulimit -v`) and those of its
/// control groups. `None` where the system does not say.
fn free_bytes() -> Option<u64> {
    let info = fs::read_to_string("/proc/meminfo").ok()?;
    let free = kilobytes(&info, "MemAvailable:")? + kilobytes(&info, "SwapFree:").unwrap_or(0);
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let own =
        getrlimit(Resource::As).current.map(|most| most.saturating_sub(kilobytes(&status, "VmSize:").unwrap_or(0)));
    Some([own, group_bytes()].into_iter().flatten().fold(free, u64::min))
}

/// What the control group of this process (version 2) leaves; those above it are at least as wide, as a rule.
fn group_bytes() -> Option<u64> {
    let groups = fs::read_to_string("/proc/self/cgroup").ok()?;
    let group = groups.lines().find_map(|line| line.strip_prefix("0::/"))?;
    let number =
        |name: &str| fs::read_to_string(format!("/sys/fs/cgroup/{group}/{name}")).ok()?.trim().parse::<u64>().ok();
    Some(number("memory.max")?.saturating_sub(number("memory.current")?))
}

/// The number of a line of /proc, `NAME:   123 kB`, in bytes.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(line.trim().trim_end_matches(" kB").parse::<u64>().ok()? << 10)
}
