//! Cleans up after this program if it is killed while a helper works for it.

use std::io::{self, Write};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};

/// Reads the group of the helper, the last line counting, until this program closes the pipe or is gone. `$0` is the
/// folder.
const SCRIPT: &str = "while read -r line; do group=$line; done
[ -z \"$group\" ] || kill -9 \"-$group\"
rm -rf -- \"$0\"";

/// A small process that outlives this program, however that ends: it then kills a helper and removes its folder.
///
/// A handler of signals could not do this after SIGKILL, and a death signal (`PR_SET_PDEATHSIG`) leaves the folder.
/// Dropping it removes the folder, too.
pub struct Guardian {
    process: Child,
    /// Taken to close it.
    pipe: Option<ChildStdin>,
}

impl Guardian {
    /// Starts to guard the folder `folder`.
    ///
    /// # Errors
    /// The system refuses the process.
    pub fn start(folder: &Path) -> io::Result<Self> {
        let mut command = Command::new("/bin/sh");
        command.args(["-c", SCRIPT]).arg(folder).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
        // Ctrl-C on a terminal must not end it.
        let mut process = command.process_group(0).spawn()?;
        let pipe = process.stdin.take();
        Ok(Self { process, pipe })
    }

    /// Sets the process group that is killed, too; `None` once it has ended, as its number may be given to others.
    pub fn set_group(&mut self, group: Option<u32>) {
        let line = group.map_or(String::new(), |group| group.to_string()) + "\n";
        // Without a guardian, only the help after a kill is missing.
        let _ = self.pipe.as_mut().map(|pipe| pipe.write_all(line.as_bytes()));
    }
}

impl Drop for Guardian {
    fn drop(&mut self) {
        self.pipe = None;
        // Its end cannot be reported here.
        let _ = self.process.wait();
    }
}
