//! The scripts, called as users call them.

use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};

fn script(name: &str) -> Command {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut command = Command::new(here.join("scripts").join(name));
    command.current_dir(here);
    command
}

/// A command that ends its arguments, a script and what it has started, after a time.
fn within_20_s() -> Command {
    let mut command = Command::new("timeout");
    command.arg("20s").current_dir(env!("CARGO_MANIFEST_DIR"));
    command
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Clang's runtime has libclang in its name, but the build cannot use it.
#[test]
fn setup_looks_for_the_library_that_the_build_needs() {
    let folder = tempfile::tempdir().unwrap();
    let offline = Offline::new();
    let setup = || offline.script("setup").arg("build").env("LIBCLANG_PATH", folder.path()).output().unwrap();
    std::fs::write(folder.path().join("libclang-cpp.so.14"), "").unwrap();
    let refused = setup();
    assert_eq!(refused.status.code(), Some(1));
    assert!(said(&refused).contains("holds no libclang.so"), "{}", said(&refused));
    std::fs::write(folder.path().join("libclang-14.so.1"), "").unwrap();
    let found = setup();
    assert!(found.status.success(), "{}", said(&found));
}

/// A build has the network for persons, as the packages do; without a connection it goes on without.
#[test]
fn setup_for_a_build_fetches_the_network_and_goes_on_without_it() {
    let offline = Offline::new();
    let output = offline.script("setup").arg("build").output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    let lines: Vec<String> = said(&output).lines().map(str::to_owned).collect();
    assert!(lines.len() == 1 && lines[0].contains("could not be downloaded; one webcam gives no"), "{lines:?}");
    let left: Vec<_> = std::fs::read_dir(offline.0.path().join("models")).unwrap().collect();
    assert!(left.is_empty(), "{left:?}");
    // Nor does a folder that cannot be made stop it.
    std::fs::remove_dir(offline.0.path().join("models")).unwrap();
    std::fs::write(offline.0.path().join("models"), "").unwrap();
    let output = offline.script("setup").arg("build").output().unwrap();
    assert!(output.status.success() && said(&output).lines().count() == 1, "{}", said(&output));
}

/// An empty build folder, and programs `npm` and `curl` that reach nothing.
struct Offline(tempfile::TempDir);

impl Offline {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let programs = folder.path().join("programs");
        std::fs::create_dir(&programs).unwrap();
        for name in ["npm", "curl"] {
            std::fs::write(programs.join(name), "#!/bin/sh\nexit 7\n").unwrap();
            std::fs::set_permissions(programs.join(name), PermissionsExt::from_mode(0o755)).unwrap();
        }
        Self(folder)
    }

    fn script(&self, name: &str) -> Command {
        let mut command = script(name);
        let path = format!("{}:{}", self.0.path().join("programs").display(), std::env::var("PATH").unwrap());
        command.env("PATH", path).env("CARGO_TARGET_DIR", self.0.path());
        command
    }
}

/// Calibration of a pair, and of one whose cameras are swapped, which no command reads.
#[test]
#[ignore = "needs OpenCV for Python"]
fn swapped_cameras_are_not_calibrated() {
    let folder = tempfile::tempdir().unwrap();
    let python = |script: &str, arguments: &[String]| {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join(script);
        Command::new("python3").arg(script).args(arguments).current_dir(&folder).output().unwrap()
    };
    let made = python("tests/files/boards.py", &[".".to_owned()]);
    assert!(made.status.success(), "{}", said(&made));
    let calibrate = |[left, right]: [&str; 2]| {
        let mut arguments: Vec<String> =
            ["--corners", "9x6", "--square-mm", "25", "--out", "stereo.yml"].map(str::to_owned).to_vec();
        for (option, camera) in [("--left", left), ("--right", right)] {
            arguments.push(option.to_owned());
            arguments.extend((0..10).map(|shot| format!("{camera}{shot}.png")));
        }
        python("scripts/calibrate.py", &arguments)
    };
    let refused = calibrate(["right", "left"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(said(&refused).contains("swap --left and --right; stereo.yml is not written"), "{}", said(&refused));
    let written = || -> Vec<_> {
        let files = std::fs::read_dir(&folder).unwrap().map(|file| file.unwrap().file_name().into_string().unwrap());
        files.filter(|name| !name.ends_with(".png")).collect()
    };
    assert_eq!(written(), Vec::<String>::new());
    let done = calibrate(["left", "right"]);
    assert!(done.status.success(), "{}", said(&done));
    assert_eq!(written(), ["stereo.yml"]);
}

/// With `--help`, scripts that build or test for long print what they would do, and do not start.
#[test]
fn scripts_tell_what_they_do() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let of_scripts = std::fs::read_dir(here.join("scripts")).unwrap().map(|entry| entry.unwrap().path());
    let elsewhere = [
        "python/test",
        "python/wheel",
        "crates/lab/benches/gpu.sh",
        "tests/vm/run",
        "crates/cli/tests/pipewire/session",
    ];
    let mut tried = 0;
    for path in of_scripts.chain(elsewhere.map(|name| here.join(name))) {
        let text = std::fs::read_to_string(&path).unwrap();
        // A script that only other scripts run has a usage line instead.
        let Some(first) = text.strip_prefix("#!/usr/bin/env bash\n# ") else {
            continue;
        };
        let output = within_20_s().arg(&path).arg("--help").output().unwrap();
        let help = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{}: {}", path.display(), said(&output));
        assert_eq!(help.lines().next(), first.lines().next(), "{}", path.display());
        assert!(!help.contains("set -"), "{}: {help}", path.display());
        tried += 1;
    }
    assert!(tried > 12, "{tried} scripts");
    let refused = within_20_s().args(["scripts/test", "--nosuch"]).output().unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
}

/// All parts of a release have one version, and a build from another version is refused.
#[test]
fn a_release_has_the_version_of_the_source() {
    let release = |args: &[&str]| within_20_s().arg("scripts/release").args(args).output().unwrap();
    for (args, code, named) in [
        (&["99.0.0"][..], 1, "Cargo.toml has version"),
        (&[], 2, "usage: scripts/release"),
        (&["--nosuch"], 2, "there is no '--nosuch'"),
    ] {
        let refused = release(args);
        assert_eq!(refused.status.code(), Some(code), "{args:?}: {}", said(&refused));
        assert!(said(&refused).contains(named) && said(&refused).lines().count() == 1, "{args:?}: {}", said(&refused));
    }
}
