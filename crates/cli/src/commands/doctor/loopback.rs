//! Checks of the virtual camera: the module v4l2loopback, its options, its nodes.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::cameras::report_denied;
use super::finding::Finding;
use super::system::System;
use bokehcam_live::v4l2::holders::list_holders;
use bokehcam_live::v4l2::loopback::{self, modprobe_command};
use bokehcam_live::v4l2::node::{Kind, Node};

pub const TOPIC: &str = "virtual camera";

const LOADED: &str = "/sys/module/v4l2loopback";

/// Returns the command that loads the module so that browsers list its camera.
fn load_command() -> String {
    modprobe_command("/dev/video10".as_ref())
}

/// Folders of module options: a file hides those of the same name in later folders.
const OPTION_FOLDERS: [&str; 4] =
    ["/etc/modprobe.d", "/run/modprobe.d", "/usr/local/lib/modprobe.d", "/usr/lib/modprobe.d"];

/// Number of buffers that PipeWire requests; it refuses a node with fewer.
const PIPEWIRE_BUFFERS: u32 = 16;

/// Checks the module v4l2loopback and each of its nodes.
pub fn check_loopback(nodes: &[Node], system: &System) -> Vec<Finding> {
    let nodes: Vec<&Node> = nodes.iter().filter(|node| node.kind == Kind::Virtual).collect();
    let loaded = Path::new(LOADED).exists();
    if !loaded && nodes.is_empty() {
        return vec![report_not_loaded(system)];
    }
    let mut findings = vec![Finding::good(TOPIC, format!("module v4l2loopback {} is loaded", module_version()))];
    if nodes.is_empty() {
        findings.push(Finding::missing(TOPIC, "the module has no device here", load_command()));
    }
    findings.extend(nodes.iter().map(|node| check_node(node)));
    findings.extend(check_buffers(system));
    findings.extend(check_options(&OPTION_FOLDERS.map(Path::new)));
    findings
}

/// Reports how to install or load the module.
fn report_not_loaded(system: &System) -> Finding {
    if !is_installed(&system.kernel) {
        let fix = format!(
            "install it (`sudo apt install v4l2loopback-dkms`, `dnf install akmod-v4l2loopback` of RPM Fusion, \
             `pacman -S v4l2loopback-dkms`, with the kernel's headers), then `{}`",
            load_command()
        );
        return Finding::missing(
            TOPIC,
            format!("module v4l2loopback is not installed for Linux {}", system.kernel),
            fix,
        );
    }
    let fix = if system.secure_boot == Some(true) {
        format!(
            "`{}`; if that says \"Key was rejected\": Secure Boot is on, enrol the key that the module is \
                 signed with (`sudo mokutil --import`), or switch Secure Boot off",
            load_command()
        )
    } else {
        format!("`{}`", load_command())
    };
    Finding::missing(TOPIC, "module v4l2loopback is installed and not loaded", fix)
}

/// Whether the kernel's module list contains v4l2loopback, in any of the distributions' folders.
fn is_installed(kernel: &str) -> bool {
    ["/lib/modules", "/usr/lib/modules", "/run/booted-system/kernel-modules/lib/modules"].iter().any(|folder| {
        let list = fs::read_to_string(Path::new(folder).join(kernel).join("modules.dep"));
        list.is_ok_and(|list| list.lines().any(|line| line.split(".ko").next().is_some_and(is_loopback)))
    })
}

fn is_loopback(path: &str) -> bool {
    path.rsplit('/').next() == Some("v4l2loopback")
}

/// Returns the version of the loaded module; those before 0.13 do not publish it.
fn module_version() -> String {
    let text = fs::read_to_string(Path::new(LOADED).join("version"));
    text.map_or_else(|_| "(before 0.13, or of unknown version)".into(), |version| version.trim().to_owned())
}

/// Checks by its capabilities whether a node can be written to now: with `exclusive_caps=1` it is an output until it
/// has a writer, and a capture device from then on.
fn check_node(node: &Node) -> Finding {
    if node.denied {
        return report_denied(TOPIC, node);
    }
    let holders: Vec<_> = list_holders(&node.path).iter().map(ToString::to_string).collect();
    let by = if holders.is_empty() { "a process that this user cannot see".to_owned() } else { holders.join(", ") };
    match (node.captures, node.outputs) {
        (false, true) => Finding::good(TOPIC, format!("{node}: free; opened by {by}")),
        (true, true) => {
            let found = format!("{node}: free, but made without exclusive_caps=1: browsers will not list it");
            Finding::note(TOPIC, found, load_command())
        }
        (true, false) => {
            let found = format!("{node}: in use, opened by {by}");
            Finding::note(TOPIC, found, "stop that program, or use another node")
        }
        (false, false) => {
            let found = format!("{node}: accepts neither writers nor readers since its last program ended");
            Finding::missing(TOPIC, found, load_command())
        }
    }
}

/// Notes that the module has too few buffers for a running PipeWire.
fn check_buffers(system: &System) -> Option<Finding> {
    let buffers = loopback::read_buffer_count()?;
    let fix = "load the module with max_buffers=16 if programs that get their cameras from PipeWire do not list it";
    (system.pipewire && buffers < PIPEWIRE_BUFFERS).then(|| {
        let found = format!("max_buffers={buffers}: fine for programs that open the node, too few for PipeWire");
        Finding::note(TOPIC, found, fix)
    })
}

/// Notes that several files set the module's options, such as one of a computer's maker beside the user's own.
fn check_options(folders: &[&Path]) -> Option<Finding> {
    let mut files: BTreeMap<_, PathBuf> = BTreeMap::new();
    for entry in folders.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten() {
        if entry.path().extension().is_some_and(|extension| extension == "conf") {
            files.entry(entry.file_name()).or_insert(entry.path());
        }
    }
    let sets_options = |path: &PathBuf| {
        fs::read_to_string(path)
            .is_ok_and(|text| text.lines().any(|line| line.split_whitespace().take(2).eq(["options", "v4l2loopback"])))
    };
    let setting: Vec<PathBuf> = files.into_values().filter(sets_options).collect();
    let (last, others) = setting.split_last().filter(|(_, others)| !others.is_empty())?;
    let others: Vec<String> = others.iter().map(|path| path.display().to_string()).collect();
    let found = format!(
        "{} and {} set options of v4l2loopback: where they differ, the latter wins",
        others.join(", "),
        last.display()
    );
    let fix = format!("keep one of them, then `sudo modprobe -r v4l2loopback` and `{}`", load_command());
    Some(Finding::note(TOPIC, found, fix))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_file_with_options_of_the_module_is_named() {
        let root = tempfile::tempdir().unwrap();
        let [own, vendor] = ["etc", "lib"].map(|folder| root.path().join(folder));
        let missing = root.path().join("none");
        let check = || check_options(&[&own, &missing, &vendor]);
        for folder in [&own, &vendor] {
            fs::create_dir(folder).unwrap();
        }
        let write = |path: PathBuf, text: &str| fs::write(path, text).unwrap();
        write(own.join("bokehcam.conf"), "# options\noptions v4l2loopback devices=1\n");
        write(own.join("other.conf"), "options v4l2loopback-other a=1\noptions snd x=1\n#options v4l2loopback a=1\n");
        write(vendor.join("notes.txt"), "options v4l2loopback devices=9\n");
        assert!(check().is_none());
        write(vendor.join("v4l2-relayd.conf"), "alias x y\noptions  v4l2loopback exclusive_caps=0\n");
        let found = check().unwrap();
        let [first, last] =
            [own.join("bokehcam.conf"), vendor.join("v4l2-relayd.conf")].map(|path| path.display().to_string());
        assert!(found.found.starts_with(&format!("{first} and {last} set")), "{}", found.found);
        // A file of the same name in an earlier folder takes its place.
        write(own.join("v4l2-relayd.conf"), "# nothing\n");
        assert!(check().is_none());
    }

    #[test]
    fn a_list_of_modules_names_the_module_in_any_folder_and_compression() {
        for line in ["updates/dkms/v4l2loopback.ko: kernel/x.ko", "extra/v4l2loopback/v4l2loopback.ko.xz:"] {
            assert!(line.split(".ko").next().is_some_and(is_loopback), "{line}");
        }
        assert!(!is_loopback("kernel/drivers/v4l2loopback-other"));
    }
}
