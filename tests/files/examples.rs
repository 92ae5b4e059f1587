//! The programs in `examples/` are short enough to be read at once, and they run.
#![allow(missing_docs)]

use std::fs;
use std::path::Path;
use std::process::Command;

/// Returns the path at which cargo builds an example for the tests.
fn built(name: &str) -> std::path::PathBuf {
    let deps = std::env::current_exe().unwrap();
    deps.parent().and_then(Path::parent).unwrap().join("examples").join(name)
}

#[test]
fn every_example_is_short_and_runs() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let repository = root.ancestors().find(|folder| folder.join("recordings").exists()).unwrap();
    let mut run = 0;
    for entry in fs::read_dir(root.join("examples")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap();
        let lines = fs::read_to_string(&path).unwrap().lines().count();
        assert!(lines <= 30, "{name}: {lines} lines");
        let output = Command::new(built(name)).current_dir(repository).output().unwrap();
        let told = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(!told.trim().is_empty(), "{name} says nothing");
        run += 1;
    }
    assert!(run > 1);
}
