//! The same window on Wayland: a compositor without a screen, and what it shows.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use bokehcam::recording::still::read_color;

use super::picture::is_photograph;
use super::program::PORTRAIT;
use super::screen::{Beside, until};
use super::window::PATIENCE;

const SOCKET: &str = "wayland-of-the-test";

/// A compositor whose socket is in this folder.
fn compositor(folder: &Path) -> Beside {
    let mut weston = Command::new("setpriv");
    weston.args(["--pdeathsig", "KILL", "weston", "--backend=headless-backend.so", "--use-pixman", "--debug"]);
    weston.args(["--width=1280", "--height=900", "--idle-time=0", &format!("--socket={SOCKET}")]);
    weston.env("XDG_RUNTIME_DIR", folder).stdout(Stdio::null()).stderr(Stdio::null());
    let weston = Beside::start(&mut weston);
    until("a compositor", PATIENCE, || folder.join(SOCKET).exists());
    weston
}

/// What its screen shows.
fn look(folder: &Path) -> Option<PathBuf> {
    let made = Command::new("weston-screenshooter")
        .env("XDG_RUNTIME_DIR", folder)
        .env("WAYLAND_DISPLAY", SOCKET)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let newest = files.filter(|path| path.extension().is_some_and(|extension| extension == "png")).max();
    made.unwrap().success().then_some(newest).flatten()
}

#[test]
#[ignore = "needs an X server"]
fn a_window_on_wayland_shows_the_picture_by_processor_and_by_gpu() {
    for backend in [&["--backend", "cpu"][..], &["--backend", "gpu", "--adapter", "llvmpipe"]] {
        let home = tempfile::tempdir().unwrap();
        let _weston = compositor(home.path());
        let report = home.path().join("report.json");
        let mut command = Command::new("setpriv");
        command.args(["--pdeathsig", "KILL", env!("CARGO_BIN_EXE_bokehcam"), "preview", PORTRAIT, "--panel=false"]);
        command.args(backend).args(["--frames", "100", "--report"]).arg(&report);
        command.env("XDG_RUNTIME_DIR", home.path()).env("WAYLAND_DISPLAY", SOCKET).env_remove("DISPLAY");
        command.env("HOME", home.path()).env("XDG_CONFIG_HOME", home.path()).env("XDG_STATE_HOME", home.path());
        let mut program = Beside::start(command.stdout(Stdio::null()).stderr(Stdio::null()));
        until("a photograph", PATIENCE, || {
            std::thread::sleep(Duration::from_millis(300));
            look(home.path()).and_then(|path| read_color(&path).ok()).is_some_and(|image| is_photograph(&image))
        });
        until("it ends by itself", PATIENCE, || program.0.try_wait().unwrap().is_some());
        assert!(program.0.wait().unwrap().success());
        let report: serde_json::Value = serde_json::from_slice(&fs::read(&report).unwrap()).unwrap();
        assert!(report["window"]["presented"].as_u64().unwrap() > 0, "{report}");
    }
}
