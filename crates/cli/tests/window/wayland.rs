//! The window on Wayland: in a compositor that itself draws into an X window, which is captured.

use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use rustix::process::Signal;

use super::picture::is_photograph;
use super::program::{Beside, Home, PORTRAIT, PROGRAM, json};
use super::screen::{Screen, tied, until};
use super::window::{PATIENCE, Window};

const SOCKET: &str = "wayland-of-the-test";
/// Longest time that a working compositor shows nothing.
const MAX_BLACK: Duration = Duration::from_secs(30);

/// Starts a Wayland compositor on the screen, with its socket in `folder`.
fn compositor(screen: &Screen, folder: &Path) -> Beside {
    let mut weston = tied("weston");
    weston.args(["--backend=x11-backend.so", "--use-pixman"]);
    weston.args(["--width=1280", "--height=900", "--idle-time=0", &format!("--socket={SOCKET}")]);
    weston.env("DISPLAY", &screen.display).env("XDG_RUNTIME_DIR", folder).env("HOME", folder);
    let weston = Beside::start(weston.stdout(Stdio::null()).stderr(Stdio::null()));
    until("a compositor", PATIENCE, || folder.join(SOCKET).exists());
    weston
}

/// Shows the recording in a compositor. Returns whether the compositor lived: once in a while Weston's screen goes black and
/// stays so.
fn shows_the_picture(backend: &[&str]) -> bool {
    let (screen, home) = (Screen::new(), Home::new());
    let mut weston = compositor(&screen, &home.path("run"));
    let mut command = home.within(tied(PROGRAM));
    command.args(["preview", PORTRAIT, "--panel=false", "--report", "report.json"]).args(backend);
    command.env("WAYLAND_DISPLAY", SOCKET).env_remove("DISPLAY").env("HOME", home.0.path());
    // GPU drivers are found there.
    command.env_remove("XDG_DATA_DIRS");
    let program = Beside::start(command.stdout(Stdio::null()).stderr(Stdio::null()));
    let (mut lived, mut drawn) = (true, Instant::now());
    Window { screen: &screen, id: screen.root }.until("a photograph", |image| {
        if image.rgb.iter().any(|&byte| byte > 0) {
            drawn = Instant::now();
        }
        lived = weston.runs() && drawn.elapsed() < MAX_BLACK;
        !lived || is_photograph(image)
    });
    if lived {
        program.end_by(Signal::INT, PATIENCE).done();
        let report = json(home.path("report.json"));
        assert!(report["window"]["presented"].as_u64().unwrap() > 0, "{report}");
    }
    lived
}

#[test]
#[ignore = "needs an X server"]
fn a_window_on_wayland_shows_the_picture_by_processor_and_by_gpu() {
    for backend in [&["--backend", "cpu"][..], &["--backend", "gpu", "--adapter", "llvmpipe"]] {
        assert!((0..3).any(|_| shows_the_picture(backend)), "Weston's screen was black three times");
    }
}
