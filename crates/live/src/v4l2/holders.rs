//! Finds the processes that have a device open, for messages where the system reports only "busy".

use std::fmt;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// A process that has a device open.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Holder {
    pub pid: u32,
    /// Process name, truncated by the system to 15 bytes.
    pub name: String,
    /// Whether it has buffers of the device in its memory: it takes pictures, or is about to. Programs that watch for
    /// cameras only open them.
    pub has_buffers: bool,
}

impl Holder {
    /// Whether it is this program, which has the device open while it examines it.
    pub fn is_this_program(&self) -> bool {
        self.pid == std::process::id()
    }
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (process {})", self.name, self.pid)
    }
}

/// Lists the processes that have the device node `path` open, this one included. Other users' processes are missing
/// without the rights to see them.
pub fn list_holders(path: &Path) -> Vec<Holder> {
    let real = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let describe = |pid| {
        let maps = fs::read_to_string(format!("/proc/{pid}/maps")).unwrap_or_default();
        Holder { pid, name: process_name(pid), has_buffers: maps_file(&maps, &real) }
    };
    find_holders(path).map(describe).collect()
}

/// Returns whether any process but this one has the device node open.
pub fn has_other_holders(path: &Path) -> bool {
    find_holders(path).any(|pid| pid != std::process::id())
}

/// Finds the numbers of the processes that have the device node open.
fn find_holders(path: &Path) -> impl Iterator<Item = u32> {
    let device = fs::metadata(path).map(|node| node.rdev()).ok();
    let processes = device.and_then(|_| fs::read_dir("/proc").ok()).into_iter().flatten().flatten();
    let pids = processes.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    pids.filter(move |pid| device.is_some_and(|device| has_device_open(*pid, device)))
}

/// Lists the holders except this program.
pub fn list_other_holders(path: &Path) -> Vec<Holder> {
    list_holders(path).into_iter().filter(|holder| !holder.is_this_program()).collect()
}

/// Whether a process has the character device with this number open.
fn has_device_open(pid: u32, device: u64) -> bool {
    let files = fs::read_dir(format!("/proc/{pid}/fd")).into_iter().flatten().flatten();
    files.into_iter().any(|file| {
        // Read the link first: following it may block on a network mount.
        fs::read_link(file.path()).is_ok_and(|target| target.starts_with("/dev"))
            && fs::metadata(file.path()).is_ok_and(|open| open.rdev() == device)
    })
}

/// Whether the memory of a process, as `/proc/PID/maps` lists it, contains parts of a file.
fn maps_file(maps: &str, file: &Path) -> bool {
    // Address, rights, offset, device, inode, path.
    maps.lines().filter_map(|line| line.split_whitespace().nth(5)).any(|mapped| Path::new(mapped) == file)
}

fn process_name(pid: u32) -> String {
    fs::read_to_string(format!("/proc/{pid}/comm")).map_or_else(|_| "?".into(), |name| name.trim_end().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_open_device_is_held_by_this_process() {
        let open = fs::File::open("/dev/zero").unwrap();
        let own = list_holders(Path::new("/dev/zero")).into_iter().find(Holder::is_this_program);
        assert!(own.is_some_and(|own| !own.name.is_empty()));
        assert!(!has_other_holders(Path::new("/dev/no-such-node")));
        drop(open);
        assert_eq!(list_holders(Path::new("/dev/no-such-node")), []);
    }

    #[test]
    fn buffers_are_mapped_parts_of_the_device() {
        let maps = "7f0a-7f0b rw-p 00000000 00:00 0 \n7f1a-7f1b rw-s 00097000 00:05 342        /dev/video0\n";
        let of = |path: &str| maps_file(maps, path.as_ref());
        assert_eq!([of("/dev/video0"), of("/dev/video"), of("0")], [true, false, false]);
    }
}
