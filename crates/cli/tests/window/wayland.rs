//! The same window on Wayland: a compositor in a window of an X server, and what that shows.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use super::picture::is_photograph;
use super::program::PORTRAIT;
use super::screen::{Beside, Screen, until};
use super::window::{PATIENCE, Window};

const SOCKET: &str = "wayland-of-the-test";

/// A compositor on this screen, whose socket is in this folder.
fn compositor(screen: &Screen, folder: &Path) -> Beside {
    let mut weston = Command::new("setpriv");
    weston.args(["--pdeathsig", "KILL", "weston", "--backend=x11-backend.so", "--use-pixman"]);
    weston.args(["--width=1280", "--height=900", "--idle-time=0", &format!("--socket={SOCKET}")]);
    weston.env("DISPLAY", &screen.display).env("XDG_RUNTIME_DIR", folder).env("HOME", folder);
    let weston = Beside::start(weston.stdout(Stdio::null()).stderr(Stdio::null()));
    until("a compositor", PATIENCE, || folder.join(SOCKET).exists());
    weston
}

#[test]
#[ignore = "needs an X server"]
fn a_window_on_wayland_shows_the_picture_by_processor_and_by_gpu() {
    for backend in [&["--backend", "cpu"][..], &["--backend", "gpu", "--adapter", "llvmpipe"]] {
        let (screen, home) = (Screen::new(), tempfile::tempdir().unwrap());
        let _weston = compositor(&screen, home.path());
        let report = home.path().join("report.json");
        let mut command = Command::new("setpriv");
        command.args(["--pdeathsig", "KILL", env!("CARGO_BIN_EXE_bokehcam"), "preview", PORTRAIT, "--panel=false"]);
        command.args(backend).arg("--report").arg(&report);
        command.env("XDG_RUNTIME_DIR", home.path()).env("WAYLAND_DISPLAY", SOCKET).env_remove("DISPLAY");
        command.env("HOME", home.path()).env("XDG_CONFIG_HOME", home.path()).env("XDG_STATE_HOME", home.path());
        let mut program = Beside::start(command.stdout(Stdio::null()).stderr(Stdio::null()));
        Window { screen: &screen, id: screen.root }.until("a photograph", is_photograph);
        program.interrupt();
        until("it ends when asked", PATIENCE, || program.0.try_wait().unwrap().is_some());
        assert!(program.0.wait().unwrap().success());
        let report: serde_json::Value = serde_json::from_slice(&fs::read(&report).unwrap()).unwrap();
        assert!(report["window"]["presented"].as_u64().unwrap() > 0, "{report}");
    }
}
