//! The command `preview` where there can be no window, and with arguments that do not fit.
#![cfg(feature = "window")]
#![allow(missing_docs)]

use std::process::{Command, Output};

fn preview(arguments: &[&str]) -> Output {
    let home = tempfile::tempdir().unwrap();
    Command::new(env!("CARGO_BIN_EXE_bokehcam"))
        .args(arguments)
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .env("HOME", home.path())
        .env_remove("XDG_CONFIG_HOME")
        .env_remove("XDG_STATE_HOME")
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .output()
        .unwrap()
}

#[track_caller]
fn refused(arguments: &[&str], code: i32, what: &str) {
    let output = preview(arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
    assert_eq!(said.lines().count(), 1, "{arguments:?}: {said}");
    assert!(said.starts_with("error: ") && said.contains(what), "{arguments:?}: {said}");
}

#[test]
fn what_does_not_fit_a_window_costs_one_line_and_exit_code_2() {
    let portrait = "recordings/portrait";
    refused(&["preview", "no/such/place"], 1, "no/such/place");
    refused(&["preview", portrait, "--pace", "asap"], 2, "--pace asap");
    refused(&["preview", portrait, "--on-demand"], 2, "--on-demand");
    refused(&["preview", portrait, "--to", "null"], 2, "beside a window");
    refused(&["preview", portrait, "--to", "window"], 2, "beside a window");
    refused(&["preview", portrait, "--split", "1.5"], 2, "from 0 to 1");
    refused(&["preview", portrait, "--preset", "nobody"], 2, "nobody");
    refused(&["stream", portrait, "--to", "window", "--to", "window"], 2, "given twice");
}

#[test]
fn without_a_display_one_line_says_what_does_the_same() {
    refused(&["preview", "recordings/portrait"], 1, "bokehcam stream SOURCE --to SINK");
    refused(&["stream", "recordings/portrait", "--to", "window"], 1, "there can be no window");
}
