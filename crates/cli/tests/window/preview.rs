//! `bokehcam preview` under test, with private settings.

use std::fs;
use std::path::Path;
use std::process::{ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::Signal;

use super::program::{Beside, Home, PROGRAM, Ran, assert_accounted, found, json};
use super::screen::{Screen, tied};
use super::window::{PATIENCE, Window};

/// A running `bokehcam preview`.
pub struct Program<'a> {
    screen: &'a Screen,
    process: Beside,
    home: Home,
    /// The time of the start.
    pub began: Instant,
}

impl<'a> Program<'a> {
    /// Starts the program with these arguments as a new user.
    pub fn start(screen: &'a Screen, arguments: &[&str]) -> Self {
        Self::start_at(screen, Home::new(), arguments)
    }

    /// Starts the program as a returning user: `home` comes from [`Program::end`].
    pub fn start_at(screen: &'a Screen, home: Home, arguments: &[&str]) -> Self {
        Self::start_on(screen, home, "unix:path=/none", arguments)
    }

    /// Starts the program with the session bus at the address `bus`.
    pub fn start_on(screen: &'a Screen, home: Home, bus: &str, arguments: &[&str]) -> Self {
        let said = fs::File::create(home.path("said")).unwrap();
        let mut command = home.within(tied(PROGRAM));
        command.arg("preview").args(arguments).args(["--report", "report.json"]);
        command.env("DISPLAY", &screen.display).env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
        command.env("DBUS_SESSION_BUS_ADDRESS", bus).env("HOME", home.0.path()).env("RUST_BACKTRACE", "1");
        // GPU drivers are found there.
        command.env_remove("XDG_DATA_DIRS").stdout(Stdio::null()).stderr(said);
        let began = Instant::now();
        Self { screen, process: Beside::start(&mut command), home, began }
    }

    /// Returns the program's working directory, which also holds its settings in `config/` and `state/`.
    pub fn home(&self) -> &Path {
        self.home.0.path()
    }

    /// Returns the standard error so far.
    pub fn said(&self) -> String {
        String::from_utf8_lossy(&fs::read(self.home.path("said")).unwrap()).into_owned()
    }

    /// Runs `bokehcam ctl` on the program.
    pub fn ctl(&self, args: &[&str]) -> Ran {
        self.home.run(&[&["ctl"], args].concat())
    }

    /// Whether the program is still running.
    pub fn runs(&mut self) -> bool {
        self.process.runs()
    }

    /// Returns the processor time used so far, in kernel ticks.
    pub fn cpu_ticks(&self) -> u64 {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.process.0.id())).unwrap();
        // After the name, which is in brackets, user and system time are the 12th and 13th fields.
        let (_, fields) = stat.rsplit_once(')').unwrap();
        fields.split_whitespace().skip(11).take(2).map(|field| field.parse::<u64>().unwrap()).sum()
    }

    /// Sends SIGINT, as Ctrl-C in a terminal does.
    pub fn interrupt(&self) {
        self.process.signal(Signal::INT);
    }

    /// Waits for the program's window.
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

    /// Waits for the program to end.
    #[track_caller]
    pub fn end(mut self) -> Ended {
        let what = format!("the program ends; see {}", self.home.path("said").display());
        let status = found(&what, PATIENCE, || self.process.0.try_wait().unwrap());
        Ended { status, said: self.said(), home: self.home }
    }

    /// Closes the window; asserts that the program succeeds.
    #[track_caller]
    pub fn close(mut self) -> Ended {
        self.window().close();
        let ended = self.end();
        ended.succeeded();
        ended
    }
}

/// A program that has ended.
pub struct Ended {
    /// The exit status.
    pub status: ExitStatus,
    /// The standard error.
    pub said: String,
    /// The program's folder.
    pub home: Home,
}

impl Ended {
    /// Asserts that the program succeeded and its report accounts for every frame.
    #[track_caller]
    pub fn succeeded(&self) {
        assert_eq!(self.status.code(), Some(0), "{}: {}", self.status, self.said);
        assert!(!self.said.contains("panicked"), "{}", self.said);
        assert_accounted(&self.report());
    }

    /// Reads the report.
    #[track_caller]
    pub fn report(&self) -> serde_json::Value {
        let path = self.home.path("report.json");
        assert!(path.exists(), "no report: {}", self.said);
        json(path)
    }
}
