//! What a report keeps to itself: who uses this machine, what it is called, and the numbers of its devices.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

/// Words of at least so many bytes are taken out of longer ones, too; shorter ones might be part of any.
const LONG_BYTES: usize = 6;
/// Shorter serial numbers, such as `1`, tell nobody from another.
const LEAST_SERIAL_BYTES: usize = 4;
/// Names that many machines have.
const COMMON: [&str; 4] = ["root", "localhost", "linux", "bokehcam"];

/// Texts that nobody else shall read, each with what stands in its place; longer ones first.
pub struct Private(Vec<(String, &'static str)>);

impl Private {
    /// What this machine has of them.
    pub fn here() -> Self {
        Self::below("/".as_ref(), |name| env::var(name).unwrap_or_default())
    }

    /// The same of a system whose files are below `root`, and whose environment is `variable`.
    fn below(root: &Path, variable: impl Fn(&str) -> String) -> Self {
        let read = |path: &str| fs::read_to_string(root.join(path)).unwrap_or_default().trim().to_owned();
        let accounts = read("etc/passwd");
        let accounts: Vec<Vec<&str>> = accounts.lines().map(|line| line.split(':').collect()).collect();
        // Accounts below 1000 are the system's.
        let people = accounts.iter().filter(|account| {
            account.len() >= 6 && account[2].parse::<u32>().is_ok_and(|id| (1000..65534).contains(&id))
        });
        let mut found = Vec::new();
        let mut keep = |text: &str, place| found.push((text.trim().to_owned(), place));
        for account in people {
            keep(account[5].trim_end_matches('/'), "~");
            keep(account[0], "(user)");
            // After a comma there are rooms and telephone numbers.
            let name = account[4].split(',').next().unwrap_or_default();
            [name]
                .into_iter()
                .chain(name.split_whitespace().filter(|part| part.len() > 2))
                .for_each(|name| keep(name, "(user)"));
        }
        let home = variable("HOME");
        let home = home.trim_end_matches('/');
        keep(home, "~");
        keep(home.rsplit('/').next().unwrap_or_default(), "(user)");
        ["USER", "LOGNAME", "SUDO_USER"].iter().for_each(|name| keep(&variable(name), "(user)"));
        for host in [read("proc/sys/kernel/hostname"), read("etc/hostname"), variable("HOSTNAME")] {
            let (short, domain) = host.split_once('.').unwrap_or((&host, ""));
            [&host, short, domain].iter().for_each(|name| keep(name, "(host)"));
        }
        keep(&read("etc/machine-id"), "(serial)");
        for number in serials(root).iter().filter(|number| number.len() >= LEAST_SERIAL_BYTES) {
            keep(number, "(serial)");
        }
        let release = read("etc/os-release").to_ascii_lowercase();
        // Many a machine is called as its distribution is.
        let is_common = |word: &str| {
            let word = word.to_ascii_lowercase();
            COMMON.contains(&&*word)
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

    /// The text with their places taken; letters of ASCII in any case.
    pub fn taken_out(&self, text: &str) -> String {
        let text = self.0.iter().fold(text.to_owned(), |text, (word, place)| replaced(&text, word, place));
        // Homes of accounts that are in no file here.
        ["/var/home/", "/home/"].iter().fold(text, |text, folder| without_next(&text, folder, "~"))
    }
}

/// The text with `place` for `word`: where that is long or a path, anywhere, else where it stands alone.
fn replaced(text: &str, word: &str, place: &str) -> String {
    let anywhere = word.len() >= LONG_BYTES || word.starts_with('/');
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

/// The text with `place` for each `folder` and the name that follows it.
fn without_next(text: &str, folder: &str, place: &str) -> String {
    let mut parts = text.split(folder);
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |out, part| {
        let end = part.find(|c: char| c == '/' || c.is_whitespace() || "'\"`,;:)".contains(c)).unwrap_or(part.len());
        out + place + &part[end..]
    })
}

/// Serial numbers of USB devices, of video nodes' devices and of the machine, and addresses of its networks.
fn serials(root: &Path) -> Vec<String> {
    let below = |folder: &str| -> Vec<PathBuf> {
        let entries = fs::read_dir(root.join(folder)).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect()
    };
    // The hubs within the machine, such as usb1, have their place as serial number.
    let is_hub = |device: &Path| device.file_name().is_some_and(|name| name.to_string_lossy().starts_with("usb"));
    let usb = below("sys/bus/usb/devices").into_iter().filter(|device| !is_hub(device));
    let mut files: Vec<PathBuf> = usb.map(|device| device.join("serial")).collect();
    for node in below("sys/class/video4linux") {
        // Of USB that is an interface; its parent is the device.
        let Ok(device) = fs::canonicalize(node.join("device")) else { continue };
        files.extend(device.ancestors().take(2).map(|folder| folder.join("serial")));
    }
    files.extend(
        ["product_serial", "board_serial", "chassis_serial", "product_uuid"]
            .map(|name| root.join("sys/class/dmi/id").join(name)),
    );
    files.push(root.join("proc/device-tree/serial-number"));
    files.extend(below("sys/class/net").iter().map(|card| card.join("address")));
    let texts = files.iter().filter_map(|file| fs::read_to_string(file).ok());
    texts.map(|text| text.trim_matches(|c: char| c.is_whitespace() || c == '\0').to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    /// A system with a person, a name and a camera.
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
        let private = Private::below(root.path(), variable);
        for (text, kept) in [
            ("run by /srv/people/jane/.local/lib/libx.so", "run by ~/.local/lib/libx.so"),
            ("/data/joe/x, /home/ann/x '/var/home/bob'", "~/x, ~/x '~'"),
            ("Jane's camera, of Döring or JANE Döring", "(user)'s camera, of (user) or (user)"),
            ("/media/jane/disk of joe, and mary", "/media/(user)/disk of (user), and (user)"),
            ("Linux 6.1-OWL on owl.forest.example", "Linux 6.1-(host) on (host)"),
            ("usb-046d_HD_Webcam_7a3f09c1-video-index0", "usb-046d_HD_Webcam_(serial)-video-index0"),
            ("x7A3F09C1y", "x(serial)y"),
            // No word of another.
            (
                "joey owls; Debian GNU/Linux; root; the group video",
                "joey owls; Debian GNU/Linux; root; the group video",
            ),
        ] {
            assert_eq!(private.taken_out(text), kept);
        }
    }

    #[test]
    fn a_machine_that_is_called_as_its_distribution_keeps_that() {
        let root = system();
        fs::write(root.path().join("proc/sys/kernel/hostname"), "debian\n").unwrap();
        let private = Private::below(root.path(), |_| String::new());
        assert_eq!(private.taken_out("Debian GNU/Linux 12"), "Debian GNU/Linux 12");
    }
}
