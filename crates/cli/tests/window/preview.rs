//! The program that is tested, with settings of its own.

use std::fs;
use std::path::Path;
use std::process::{ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::Signal;

use super::program::{Beside, Home, PROGRAM, Ran, assert_accounted, found, json};
use super::screen::{Screen, tied};
use super::window::{PATIENCE, Window};

/// `bokehcam preview`, running.
pub struct Program<'a> {
    screen: &'a Screen,
    process: Beside,
    home: Home,
    /// When it was started.
    pub began: Instant,
}

impl<'a> Program<'a> {
    /// Starts it with these arguments, as somebody who has never used it.
    pub fn start(screen: &'a Screen, arguments: &[&str]) -> Self {
        Self::start_at(screen, Home::new(), arguments)
    }

    /// Starts it as somebody who has used it before: `home` is what [`Program::end`] gave.
    pub fn start_at(screen: &'a Screen, home: Home, arguments: &[&str]) -> Self {
        Self::start_on(screen, home, "unix:path=/none", arguments)
    }

    /// Starts it in a session that has this bus.
    pub fn start_on(screen: &'a Screen, home: Home, bus: &str, arguments: &[&str]) -> Self {
        let said = fs::File::create(home.path("said")).unwrap();
        let mut command = home.within(tied(PROGRAM));
        command.arg("preview").args(arguments).args(["--report", "report.json"]);
        command.env("DISPLAY", &screen.display).env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
        command.env("DBUS_SESSION_BUS_ADDRESS", bus).env("HOME", home.0.path()).env("RUST_BACKTRACE", "1");
        // Drivers of GPUs are found there.
        command.env_remove("XDG_DATA_DIRS").stdout(Stdio::null()).stderr(said);
        let began = Instant::now();
        Self { screen, process: Beside::start(&mut command), home, began }
    }

    /// Its folder: `config/` and `state/` are its settings, and files that it writes come here.
    pub fn home(&self) -> &Path {
        self.home.0.path()
    }

    /// What it has written to standard error.
    pub fn said(&self) -> String {
        String::from_utf8_lossy(&fs::read(self.home.path("said")).unwrap()).into_owned()
    }

    /// What `bokehcam ctl` says to it.
    pub fn ctl(&self, args: &[&str]) -> Ran {
        self.home.run(&[&["ctl"], args].concat())
    }

    /// Whether it runs.
    pub fn runs(&mut self) -> bool {
        self.process.runs()
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
        self.process.signal(Signal::INT);
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
        let what = format!("the program ends; see {}", self.home.path("said").display());
        let status = found(&what, PATIENCE, || self.process.0.try_wait().unwrap());
        Ended { status, said: self.said(), home: self.home }
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
    pub home: Home,
}

impl Ended {
    /// Fails the test unless it did well, and every frame is accounted for.
    #[track_caller]
    pub fn succeeded(&self) {
        assert_eq!(self.status.code(), Some(0), "{}: {}", self.status, self.said);
        assert!(!self.said.contains("panicked"), "{}", self.said);
        assert_accounted(&self.report());
    }

    /// The report.
    #[track_caller]
    pub fn report(&self) -> serde_json::Value {
        let path = self.home.path("report.json");
        assert!(path.exists(), "no report: {}", self.said);
        json(path)
    }
}
