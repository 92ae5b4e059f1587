//! What is said where there is no PipeWire, or where it is asked for wrongly.

use std::process::Command;

fn said(arguments: &[&str]) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_bokehcam"))
        .args(["stream", "synthetic", "--frames", "2"])
        .args(arguments)
        .env("XDG_RUNTIME_DIR", folder.path())
        .env_remove("PIPEWIRE_REMOTE")
        .env_remove("PIPEWIRE_RUNTIME_DIR")
        .current_dir(&folder)
        .output()
        .unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn without_a_daemon_one_line_says_so() {
    let (code, said) = said(&["--to", "pipewire"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(
        said.contains("PipeWire cannot be reached at") && said.contains("systemctl --user start pipewire"),
        "{said}"
    );
    assert_eq!(said.trim().lines().count(), 1, "{said}");
}

#[test]
fn two_cameras_need_two_names_and_a_name_can_be_read() {
    for (arguments, told) in [
        (&["--to", "pipewire:Desk", "--to", "pipewire:Desk"][..], "given twice"),
        (&["--to", "pipewire:"], "needs a name"),
        (&["--to", "pipewire", "--out-size", "321x180"], "even width"),
    ] {
        let (code, said) = said(arguments);
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains(told), "{said}");
    }
}
