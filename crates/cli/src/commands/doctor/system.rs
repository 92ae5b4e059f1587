//! The operating system and the session: the first facts needed to help a user.

use std::fmt;
use std::fs;
use std::path::Path;

use serde::Serialize;

/// Environment of this program.
#[derive(Debug, Serialize)]
pub struct System {
    /// Version of this program.
    pub bokehcam: &'static str,
    /// Release of the kernel.
    pub kernel: String,
    /// Name of the Linux distribution.
    pub distribution: String,
    /// Type of the desktop session: wayland, x11, tty, or none.
    pub session: String,
    /// The sandbox or container around this program, if any.
    pub sandbox: Option<String>,
    /// Whether Secure Boot is on: then the kernel loads signed modules only. `None` if the firmware does not report it.
    pub secure_boot: Option<bool>,
    /// Whether PipeWire, the source of cameras for many programs, has a socket in this session.
    pub pipewire: bool,
    /// Whether a desktop portal, through which sandboxed programs access cameras, is running.
    pub portal: bool,
}

impl System {
    /// Reads files and environment variables; starts no process.
    pub fn detect() -> Self {
        Self {
            bokehcam: env!("CARGO_PKG_VERSION"),
            kernel: read_trimmed("/proc/sys/kernel/osrelease"),
            distribution: parse_distribution(&fs::read_to_string("/etc/os-release").unwrap_or_default()),
            session: std::env::var("XDG_SESSION_TYPE").unwrap_or_else(|_| "none".into()),
            sandbox: detect_sandbox(),
            secure_boot: detect_secure_boot(),
            pipewire: has_pipewire_socket(),
            // xdg-desktop-portal, cut to 15 bytes by the kernel.
            portal: is_running("xdg-desktop-por"),
        }
    }
}

impl fmt::Display for System {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let secure_boot = match self.secure_boot {
            Some(true) => "on",
            Some(false) => "off",
            None => "unknown",
        };
        let running = |is| if is { "running" } else { "not found" };
        writeln!(f, "bokehcam {} on {}, Linux {}", self.bokehcam, self.distribution, self.kernel)?;
        writeln!(f, "session {}, sandbox {}", self.session, self.sandbox.as_deref().unwrap_or("none"))?;
        write!(f, "Secure Boot {secure_boot}, PipeWire {}, ", running(self.pipewire))?;
        writeln!(f, "desktop portal {}", running(self.portal))
    }
}

fn read_trimmed(path: &str) -> String {
    fs::read_to_string(path).map_or_else(|_| "unknown".into(), |text| text.trim().to_owned())
}

fn parse_distribution(os_release: &str) -> String {
    let value = |key: &str| {
        let line = os_release.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='))?;
        Some(line.trim_matches(['"', '\'']).to_owned())
    };
    value("PRETTY_NAME").or_else(|| value("NAME")).unwrap_or_else(|| "an unknown distribution".into())
}

fn detect_sandbox() -> Option<String> {
    let exists = |path: &str| Path::new(path).exists();
    let variable = |name| std::env::var(name).ok().filter(|value| !value.is_empty());
    if exists("/.flatpak-info") {
        Some("Flatpak".into())
    } else if variable("SNAP_NAME").is_some() {
        Some("Snap".into())
    } else if exists("/run/.containerenv") || exists("/.dockerenv") {
        Some("container".into())
    } else {
        // Set by systemd-nspawn, LXC and others in their containers.
        variable("container")
    }
}

fn detect_secure_boot() -> Option<bool> {
    if !Path::new("/sys/firmware/efi").exists() {
        // Booted without UEFI.
        return Some(false);
    }
    let variable = "/sys/firmware/efi/efivars/SecureBoot-8be4df61-93ca-11d2-aa0d-00e098032b8c";
    // The value follows four bytes of attributes.
    fs::read(variable).ok()?.get(4).map(|on| *on == 1)
}

fn has_pipewire_socket() -> bool {
    let folder = std::env::var_os("PIPEWIRE_RUNTIME_DIR").or_else(|| std::env::var_os("XDG_RUNTIME_DIR"));
    folder.is_some_and(|folder| Path::new(&folder).join("pipewire-0").exists())
}

/// Whether a process of this name runs; the kernel cuts names to 15 bytes.
fn is_running(name: &str) -> bool {
    let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
    processes.into_iter().any(|process| {
        let is_process = process.file_name().to_str().is_some_and(|name| name.bytes().all(|b| b.is_ascii_digit()));
        is_process && fs::read_to_string(process.path().join("comm")).is_ok_and(|comm| comm.trim_end() == name)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distribution_has_a_name_in_any_file() {
        assert_eq!(
            parse_distribution("ID=x\nPRETTY_NAME=\"Debian GNU/Linux 12 (bookworm)\"\n"),
            "Debian GNU/Linux 12 (bookworm)"
        );
        assert_eq!(parse_distribution("NAME='Void'\n"), "Void");
        assert_eq!(parse_distribution(""), "an unknown distribution");
    }
}
