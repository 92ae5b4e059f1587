//! A stream's depth is refined and matted where its pictures are blurred.

use std::process::Command;

use serde_json::Value;

/// Streams the recording to nowhere, with these arguments; what the program said, and its report.
fn streamed(arguments: &[&str]) -> (String, Value) {
    let folder = tempfile::tempdir().expect("a folder");
    let report = folder.path().join("report.json");
    let mut command = Command::new(env!("CARGO_BIN_EXE_bokehcam"));
    command
        .env("XDG_CONFIG_HOME", folder.path())
        .arg("stream")
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/../../recordings/portrait"))
        .args(arguments);
    let output = command.args(["--pace", "asap", "--to", "null", "--report"]).arg(&report).output();
    let output = output.expect("the program");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{told}");
    let report = std::fs::read_to_string(report).expect("a report");
    (told, serde_json::from_str(&report).expect("JSON"))
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_stream_is_refined_where_it_is_blurred() {
    for (backend, refine, expected) in [("gpu", "on", "gpu"), ("cpu", "on", "cpu"), ("cpu", "off", "none")] {
        let (told, report) = streamed(&["--backend", backend, "--refine", refine]);
        assert!(!told.contains("the CPU refines"), "{told}");
        assert_eq!((&report["refined_by"], &report["backend"]), (&expected.into(), &backend.into()), "{report}");
    }
}

#[test]
#[ignore = "needs a Vulkan adapter (software will do)"]
fn a_stream_is_matted_where_it_is_blurred() {
    for (backend, effect, expected) in [("gpu", "dof", "gpu"), ("cpu", "dof", "cpu"), ("cpu", "blur", "none")] {
        let (told, report) = streamed(&["--backend", backend, "--effect", effect]);
        assert!(!told.contains("the CPU finds mattes"), "{told}");
        assert_eq!((&report["matted_by"], &report["backend"]), (&expected.into(), &backend.into()), "{report}");
    }
}
