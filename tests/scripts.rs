//! The scripts as they are called.

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

/// What hangs is ended with all that it started: else the pipe of its output would stay open, and this test wait.
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

/// Clang's runtime has libclang in its name, and the build cannot use it.
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
