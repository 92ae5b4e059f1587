//! Who has a device open: what to tell where the system says no more than "busy".

use std::fmt;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// A process that has a device open.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Holder {
    pub pid: u32,
    /// Its name as the system cuts it, to 15 bytes.
    pub name: String,
}

impl Holder {
    /// Whether it is this program: who looks into a device has it open, too.
    pub fn is_this_program(&self) -> bool {
        self.pid == std::process::id()
    }
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (process {})", self.name, self.pid)
    }
}

/// The processes that have the device node `path` open, this one included. Those of other users stay unseen without
/// the rights to look.
pub fn holders(path: &Path) -> Vec<Holder> {
    let Ok(device) = fs::metadata(path).map(|node| node.rdev()) else { return Vec::new() };
    let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
    let pids = processes.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    pids.filter(|pid| holds(*pid, device)).map(|pid| Holder { pid, name: name(pid) }).collect()
}

/// The same without this program.
pub fn other_holders(path: &Path) -> Vec<Holder> {
    holders(path).into_iter().filter(|holder| !holder.is_this_program()).collect()
}

/// Whether a process has the character device of this number open.
fn holds(pid: u32, device: u64) -> bool {
    let files = fs::read_dir(format!("/proc/{pid}/fd")).into_iter().flatten().flatten();
    files.into_iter().any(|file| {
        // The link first: looking at what it leads to may wake a network mount.
        fs::read_link(file.path()).is_ok_and(|target| target.starts_with("/dev"))
            && fs::metadata(file.path()).is_ok_and(|open| open.rdev() == device)
    })
}

fn name(pid: u32) -> String {
    fs::read_to_string(format!("/proc/{pid}/comm")).map_or_else(|_| "?".into(), |name| name.trim_end().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_open_device_is_held_by_this_process() {
        let open = fs::File::open("/dev/zero").unwrap();
        let own = holders(Path::new("/dev/zero")).into_iter().find(Holder::is_this_program);
        assert!(own.is_some_and(|own| !own.name.is_empty()));
        drop(open);
        assert_eq!(holders(Path::new("/dev/no-such-node")), []);
    }
}
