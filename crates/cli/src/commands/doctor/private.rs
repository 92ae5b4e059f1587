//! Redacts reports: names of users and of this machine, and serial numbers of devices.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

/// Words of this length or more are also replaced inside longer words; shorter ones only as whole words.
const MIN_LONG_BYTES: usize = 6;
/// Minimum length of a serial number: shorter ones, such as `1`, identify no device.
const MIN_SERIAL_BYTES: usize = 4;
/// Common names, which identify no machine.
const COMMON_NAMES: [&str; 4] = ["root", "localhost", "linux", "bokehcam"];

/// Private words, each with its placeholder; longest first.
pub struct Redactor(Vec<(String, &'static str)>);

impl Redactor {
    /// Collects this machine's private words.
    pub fn detect() -> Self {
        Self::read_from("/".as_ref(), |name| env::var(name).unwrap_or_default())
    }

    /// Collects the private words of a system with its files below `root` and its environment from `variable`.
    fn read_from(root: &Path, variable: impl Fn(&str) -> String) -> Self {
        let read = |path: &str| fs::read_to_string(root.join(path)).unwrap_or_default().trim().to_owned();
        let accounts = read("etc/passwd");
        let accounts: Vec<Vec<&str>> = accounts.lines().map(|line| line.split(':').collect()).collect();
        // User ids below 1000 belong to the system.
        let people = accounts.iter().filter(|account| {
            account.len() >= 6 && account[2].parse::<u32>().is_ok_and(|id| (1000..65534).contains(&id))
        });
        let mut found = Vec::new();
        let mut add = |text: &str, place| found.push((text.trim().to_owned(), place));
        for account in people {
            add(account[5].trim_end_matches('/'), "~");
            add(account[0], "(user)");
            // The GECOS field lists room and telephone numbers after the first comma.
            let name = account[4].split(',').next().unwrap_or_default();
            [name]
                .into_iter()
                .chain(name.split_whitespace().filter(|part| part.len() > 2))
                .for_each(|name| add(name, "(user)"));
        }
        let home = variable("HOME");
        let home = home.trim_end_matches('/');
        add(home, "~");
        add(home.rsplit('/').next().unwrap_or_default(), "(user)");
        ["USER", "LOGNAME", "SUDO_USER"].iter().for_each(|name| add(&variable(name), "(user)"));
        for host in [read("proc/sys/kernel/hostname"), read("etc/hostname"), variable("HOSTNAME")] {
            let (short, domain) = host.split_once('.').unwrap_or((&host, ""));
            [&host, short, domain].iter().for_each(|name| add(name, "(host)"));
        }
        add(&read("etc/machine-id"), "(serial)");
        for number in read_serials(root).iter().filter(|number| number.len() >= MIN_SERIAL_BYTES) {
            add(number, "(serial)");
        }
        let release = read("etc/os-release").to_ascii_lowercase();
        // Many machines are named after their distribution.
        let is_common = |word: &str| {
            let word = word.to_ascii_lowercase();
            COMMON_NAMES.contains(&&*word)
                || release.lines().any(|line| {
                    let value = line.strip_prefix("id=").or_else(|| line.strip_prefix("name="));
                    value.is_some_and(|value| value.split(['"', '\'', ' ']).any(|part| part == word))
                })
        };
        found.retain(|(word, _)| !word.is_empty() && !is_common(word));
        found.sort_by(|(a, _), (b, _)| b.len().cmp(&a.len()).then_with(|| a.cmp(b)));
        found.dedup();
        Self(found)
    }

    /// Replaces the private words in `text` by their placeholders, ignoring ASCII case.
    pub fn redact(&self, text: &str) -> String {
        let text = self.0.iter().fold(text.to_owned(), |text, (word, place)| replace_word(&text, word, place));
        // Home folders of accounts missing from /etc/passwd.
        ["/var/home/", "/home/"].iter().fold(text, |text, folder| replace_next_name(&text, folder, "~"))
    }
}

/// Replaces `word` by `place`: everywhere if it is long or a path, else only as a whole word.
fn replace_word(text: &str, word: &str, place: &str) -> String {
    let anywhere = word.len() >= MIN_LONG_BYTES || word.starts_with('/');
    let (lower, word) = (text.to_ascii_lowercase(), word.to_ascii_lowercase());
    let (mut out, mut from) = (String::with_capacity(text.len()), 0);
    for (at, _) in lower.match_indices(&word) {
        let (before, after) = (lower[..at].chars().next_back(), lower[at + word.len()..].chars().next());
        let alone = ![before, after].into_iter().flatten().any(char::is_alphanumeric);
        if anywhere || alone {
            out.push_str(&text[from..at]);
            out.push_str(place);
            from = at + word.len();
        }
    }
    out + &text[from..]
}

/// Replaces each `folder` and the path component after it by `place`.
fn replace_next_name(text: &str, folder: &str, place: &str) -> String {
    let mut parts = text.split(folder);
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |out, part| {
        let end = part.find(|c: char| c == '/' || c.is_whitespace() || "'\"`,;:)".contains(c)).unwrap_or(part.len());
        out + place + &part[end..]
    })
}

/// Reads the serial numbers of USB devices, of video devices and of the machine, and its network addresses.
fn read_serials(root: &Path) -> Vec<String> {
    let list = |folder: &str| -> Vec<PathBuf> {
        let entries = fs::read_dir(root.join(folder)).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect()
    };
    // Root hubs, such as usb1, have their bus address as serial number.
    let is_hub = |device: &Path| device.file_name().is_some_and(|name| name.to_string_lossy().starts_with("usb"));
    let usb = list("sys/bus/usb/devices").into_iter().filter(|device| !is_hub(device));
    let mut files: Vec<PathBuf> = usb.map(|device| device.join("serial")).collect();
    for node in list("sys/class/video4linux") {
        // For USB, this is the interface; its parent is the device.
        let Ok(device) = fs::canonicalize(node.join("device")) else { continue };
        files.extend(device.ancestors().take(2).map(|folder| folder.join("serial")));
    }
    files.extend(
        ["product_serial", "board_serial", "chassis_serial", "product_uuid"]
            .map(|name| root.join("sys/class/dmi/id").join(name)),
    );
    files.push(root.join("proc/device-tree/serial-number"));
    files.extend(list("sys/class/net").iter().map(|card| card.join("address")));
    let texts = files.iter().filter_map(|file| fs::read_to_string(file).ok());
    texts.map(|text| text.trim_matches(|c: char| c.is_whitespace() || c == '\0').to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    /// Creates a system with a user, a host name and a camera.
    fn system() -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        let put = |path: &str, text: &str| {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        put(
            "etc/passwd",
            "root:x:0:0:root:/root:/bin/sh\nvideo:x:44:44::/:/bin/false\njane:x:1000:1000:Jane Döring,Room 7,,:/srv/people/jane:/bin/sh\n",
        );
        put("etc/os-release", "NAME=\"Debian GNU/Linux\"\nID=debian\n");
        put("proc/sys/kernel/hostname", "owl.forest.example\n");
        put("sys/devices/usb1/1-2/serial", "7A3F09C1\n");
        put("sys/devices/usb1/1-2/1-2:1.0/modalias", "usb:\n");
        put("sys/class/video4linux/video0/name", "HD Webcam\n");
        symlink(
            root.path().join("sys/devices/usb1/1-2/1-2:1.0"),
            root.path().join("sys/class/video4linux/video0/device"),
        )
        .unwrap();
        root
    }

    #[test]
    fn people_machines_and_serial_numbers_are_not_told() {
        let root = system();
        let variable = |name: &str| match name {
            "HOME" => "/data/joe".to_owned(),
            "SUDO_USER" => "mary".to_owned(),
            _ => String::new(),
        };
        let private = Redactor::read_from(root.path(), variable);
        for (text, kept) in [
            ("run by /srv/people/jane/.local/lib/libx.so", "run by ~/.local/lib/libx.so"),
            ("/data/joe/x, /home/ann/x '/var/home/bob'", "~/x, ~/x '~'"),
            ("Jane's camera, of Döring or JANE Döring", "(user)'s camera, of (user) or (user)"),
            ("/media/jane/disk of joe, and mary", "/media/(user)/disk of (user), and (user)"),
            ("Linux 6.1-OWL on owl.forest.example", "Linux 6.1-(host) on (host)"),
            ("usb-046d_HD_Webcam_7a3f09c1-video-index0", "usb-046d_HD_Webcam_(serial)-video-index0"),
            ("x7A3F09C1y", "x(serial)y"),
            // Private words inside other words stay.
            (
                "joey owls; Debian GNU/Linux; root; the group video",
                "joey owls; Debian GNU/Linux; root; the group video",
            ),
        ] {
            assert_eq!(private.redact(text), kept);
        }
    }

    #[test]
    fn a_machine_that_is_called_as_its_distribution_keeps_that() {
        let root = system();
        fs::write(root.path().join("proc/sys/kernel/hostname"), "debian\n").unwrap();
        let private = Redactor::read_from(root.path(), |_| String::new());
        assert_eq!(private.redact("Debian GNU/Linux 12"), "Debian GNU/Linux 12");
    }
}
