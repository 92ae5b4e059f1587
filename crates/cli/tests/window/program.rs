//! The program that is tested, with settings of its own.

use std::fs;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use super::screen::{Beside, Screen, until};
use super::window::{PATIENCE, Window};

/// `bokehcam preview`, running.
pub struct Program<'a> {
    screen: &'a Screen,
    process: Beside,
    home: TempDir,
    /// When it was started.
    pub began: Instant,
}

/// The recording that comes with the project.
pub const PORTRAIT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../recordings/portrait");

impl<'a> Program<'a> {
    /// Starts it with these arguments, as somebody who has never used it.
    pub fn start(screen: &'a Screen, arguments: &[&str]) -> Self {
        Self::start_at(screen, tempfile::tempdir().unwrap(), arguments)
    }

    /// Starts it as somebody who has used it before: `home` is what [`Program::end`] gave.
    pub fn start_at(screen: &'a Screen, home: TempDir, arguments: &[&str]) -> Self {
        Self::start_on(screen, home, "unix:path=/none", arguments)
    }

    /// Starts it in a session that has this bus.
    pub fn start_on(screen: &'a Screen, home: TempDir, bus: &str, arguments: &[&str]) -> Self {
        let said = fs::File::create(home.path().join("said")).unwrap();
        let runtime = home.path().join("run");
        fs::create_dir_all(&runtime).unwrap();
        let mut command = Command::new("setpriv");
        command
            .args(["--pdeathsig", "KILL", env!("CARGO_BIN_EXE_bokehcam"), "preview"])
            .args(arguments)
            .arg("--report")
            .arg(home.path().join("report.json"))
            .env("DISPLAY", &screen.display)
            .env("DBUS_SESSION_BUS_ADDRESS", bus)
            .env("XDG_RUNTIME_DIR", runtime)
            .env("HOME", home.path())
            .env("XDG_CONFIG_HOME", home.path().join("config"))
            .env("XDG_STATE_HOME", home.path().join("state"))
            .env("RUST_BACKTRACE", "1")
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .current_dir(home.path())
            .stdout(Stdio::null())
            .stderr(said);
        let began = Instant::now();
        Self { screen, process: Beside::start(&mut command), home, began }
    }

    /// Its folder: `config/` and `state/` are its settings, and files that it writes come here.
    pub fn home(&self) -> &Path {
        self.home.path()
    }

    /// What it has written to standard error.
    pub fn said(&self) -> String {
        String::from_utf8_lossy(&fs::read(self.home().join("said")).unwrap()).into_owned()
    }

    /// Whether it runs.
    pub fn runs(&mut self) -> bool {
        self.process.0.try_wait().unwrap().is_none()
    }

    /// Processor time that it has used, in the kernel's ticks.
    pub fn cpu_ticks(&self) -> u64 {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.process.0.id())).unwrap();
        // What follows the name, which is in brackets: user and system time are the 12th and 13th.
        let (_, fields) = stat.rsplit_once(')').unwrap();
        fields.split_whitespace().skip(11).take(2).map(|field| field.parse::<u64>().unwrap()).sum()
    }

    /// Asks it to end, as Ctrl-C in a terminal does.
    pub fn interrupt(&self) {
        self.process.interrupt();
    }

    /// Its window, as soon as it is on the screen.
    #[track_caller]
    pub fn window(&mut self) -> Window<'a> {
        let (screen, pid) = (self.screen, self.process.0.id());
        let deadline = Instant::now() + PATIENCE;
        loop {
            if let Some(window) = Window::of(screen, pid) {
                return window;
            }
            assert!(self.runs(), "it ended: {}", self.said());
            assert!(Instant::now() < deadline, "no window: {}", self.said());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Waits for its end.
    #[track_caller]
    pub fn end(mut self) -> Ended {
        let said = self.home().join("said");
        let mut status = None;
        until(&format!("the program ends; see {}", said.display()), PATIENCE, || {
            status = self.process.0.try_wait().unwrap();
            status.is_some()
        });
        Ended { status: status.unwrap(), said: self.said(), home: self.home }
    }

    /// Closes its window, after which it must end well.
    #[track_caller]
    pub fn close(mut self) -> Ended {
        self.window().close();
        let ended = self.end();
        ended.succeeded();
        ended
    }
}

/// What is left of it.
pub struct Ended {
    /// How it ended.
    pub status: ExitStatus,
    /// What it wrote to standard error.
    pub said: String,
    /// Its folder.
    pub home: TempDir,
}

impl Ended {
    /// Fails the test unless it did well, and every frame is accounted for.
    #[track_caller]
    pub fn succeeded(&self) {
        assert_eq!(self.status.code(), Some(0), "{}: {}", self.status, self.said);
        assert!(!self.said.contains("panicked"), "{}", self.said);
        let report = self.report();
        let frames = &report["frames"];
        let count = |value: &serde_json::Value| value.as_u64().unwrap_or_else(|| panic!("{report}"));
        let dropped: u64 = frames["dropped"].as_object().unwrap().values().map(count).sum();
        let accounted = count(&frames["delivered"]) + dropped + count(&frames["in_flight"]);
        assert_eq!(count(&frames["captured"]), accounted, "{report}");
    }

    /// The report.
    #[track_caller]
    pub fn report(&self) -> serde_json::Value {
        let path = self.home.path().join("report.json");
        let text = fs::read(&path).unwrap_or_else(|error| panic!("no report ({error}): {}", self.said));
        serde_json::from_slice(&text).unwrap()
    }
}
