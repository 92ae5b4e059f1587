//! Free memory of the process.

use std::fs;

use rustix::process::{Resource, getrlimit};

/// Returns how much this process can still allocate: free memory and swap space, within its own limit (`ulimit -v`) and
/// that of its control group. `None` if the system does not report it.
pub fn free_bytes() -> Option<u64> {
    let info = fs::read_to_string("/proc/meminfo").ok()?;
    let free = parse_kb_field(&info, "MemAvailable:")? + parse_kb_field(&info, "SwapFree:").unwrap_or(0);
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let own_limit = getrlimit(Resource::As)
        .current
        .map(|limit| limit.saturating_sub(parse_kb_field(&status, "VmSize:").unwrap_or(0)));
    Some([own_limit, cgroup_free_bytes()].into_iter().flatten().fold(free, u64::min))
}

/// Pictures of at most this many pixels are not checked: estimates leave out memory that does not grow with the picture.
const UNCHECKED_PIXELS: u64 = 16 << 20;

/// Returns the needed and the free memory in megabytes if a picture of `size` (width, height) needs more than is free.
pub fn find_shortage_mb(size: (u32, u32), bytes_per_pixel: u64) -> Option<(u64, u64)> {
    let pixels = u64::from(size.0) * u64::from(size.1);
    let needed = pixels * bytes_per_pixel;
    let free = free_bytes().filter(|&free| pixels > UNCHECKED_PIXELS && needed > free)?;
    Some((needed >> 20, free >> 20))
}

/// Returns the remainder of the limit of this process's control group (version 2). Parent groups are not read: they are
/// rarely tighter.
fn cgroup_free_bytes() -> Option<u64> {
    let groups = fs::read_to_string("/proc/self/cgroup").ok()?;
    let group = groups.lines().find_map(|line| line.strip_prefix("0::/"))?;
    let number =
        |name: &str| fs::read_to_string(format!("/sys/fs/cgroup/{group}/{name}")).ok()?.trim().parse::<u64>().ok();
    Some(number("memory.max")?.saturating_sub(number("memory.current")?))
}

/// Returns the number, in bytes, in a line of /proc that begins with `name`, as in `NAME:   123 kB`.
fn parse_kb_field(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(line.trim().trim_end_matches(" kB").parse::<u64>().ok()? << 10)
}
