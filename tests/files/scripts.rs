//! The scripts, called as users call them.

use std::path::Path;
use std::process::{Command, Output};

fn script(name: &str) -> Command {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut command = Command::new(here.join("scripts").join(name));
    command.current_dir(here);
    command
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A hanging command is killed with all its child processes: else its output pipe would stay open, and this test would
/// wait.
#[test]
fn a_command_that_hangs_is_ended_and_named() {
    let output = script("within").args(["1s", "sh", "-c", "sleep 1000000 & wait"]).output().unwrap();
    assert_eq!(output.status.code(), Some(124));
    assert!(said(&output).contains("not done within 1s, so it was ended: sh -c sleep"), "{}", said(&output));
}

#[test]
fn a_command_that_ends_keeps_its_exit_code_and_output() {
    for code in [0, 3] {
        let output = script("within").args(["10m", "sh", "-c", &format!("echo here; exit {code}")]).output().unwrap();
        assert_eq!((output.status.code(), output.stdout.as_slice()), (Some(code), b"here\n".as_slice()));
    }
}

/// Clang's runtime has libclang in its name, but the build cannot use it.
#[test]
fn setup_looks_for_the_library_that_the_build_needs() {
    let folder = tempfile::tempdir().unwrap();
    let setup = || script("setup").arg("build").env("LIBCLANG_PATH", folder.path()).output().unwrap();
    std::fs::write(folder.path().join("libclang-cpp.so.14"), "").unwrap();
    let refused = setup();
    assert_eq!(refused.status.code(), Some(1));
    assert!(said(&refused).contains("holds no libclang.so"), "{}", said(&refused));
    std::fs::write(folder.path().join("libclang-14.so.1"), "").unwrap();
    let found = setup();
    assert!(found.status.success(), "{}", said(&found));
}

/// With `--help`, scripts that build or test for long print what they would do, and do not start.
#[test]
fn scripts_tell_what_they_do() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let of_scripts = std::fs::read_dir(here.join("scripts")).unwrap().map(|entry| entry.unwrap().path());
    let elsewhere = [
        "gst/test",
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
        let Some(first) = text.strip_prefix("#!/usr/bin/env bash\n# ").filter(|_| !path.ends_with("scripts/within"))
        else {
            continue;
        };
        let output = script("within").arg("20s").arg(&path).arg("--help").output().unwrap();
        let help = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{}: {}", path.display(), said(&output));
        assert_eq!(help.lines().next(), first.lines().next(), "{}", path.display());
        assert!(!help.contains("set -"), "{}: {help}", path.display());
        tried += 1;
    }
    assert!(tried > 12, "{tried} scripts");
    let refused = script("within").args(["20s", "scripts/test", "--nosuch"]).output().unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
}

/// All parts of a release have one version, and a build from another version is refused.
#[test]
fn a_release_has_the_version_of_the_source() {
    let release = |args: &[&str]| script("within").args(["20s", "scripts/release"]).args(args).output().unwrap();
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
