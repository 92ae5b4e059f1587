//! The program: how tests start it, and what comes out of it.
#![allow(dead_code, missing_docs)]

use std::fs::{self, DirBuilder};
use std::io::Read;
use std::os::unix::fs::{DirBuilderExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

#[path = "../../../../tests/common/until.rs"]
mod waiting;
#[allow(unused_imports)] // Not every test waits.
pub use waiting::{found, until};

pub const PROGRAM: &str = env!("CARGO_BIN_EXE_bokehcam");
/// The repository.
pub const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
/// The recordings that come with it.
pub const PORTRAIT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../recordings/portrait");
pub const STEREO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../recordings/stereo");

/// Takes the variables whose names begin so from a command.
pub fn without(mut command: Command, begins: &[&str]) -> Command {
    for (name, _) in std::env::vars_os() {
        if begins.iter().any(|begin| name.as_encoded_bytes().starts_with(begin.as_bytes())) {
            command.env_remove(name);
        }
    }
    command
}

/// What starts the program in the session of whoever runs the tests, without what they have set for it.
pub fn in_session(command: Command) -> Command {
    let mut command = without(command, &["BOKEHCAM_", "RUST_LOG", "NO_COLOR"]);
    command.stdin(Stdio::null());
    command
}

/// The program itself in that session.
pub fn bokehcam(args: &[&str]) -> Command {
    let mut command = in_session(Command::new(PROGRAM));
    command.args(args);
    command
}

/// Runs it as somebody new.
pub fn run(args: &[&str]) -> Ran {
    Home::new().run(args)
}

/// Somebody with folders of their own, in which there is nothing yet, and the folder where they are.
pub struct Home(pub tempfile::TempDir);

impl Home {
    pub fn new() -> Self {
        Self::at(tempfile::tempdir().unwrap())
    }

    pub fn at(folder: tempfile::TempDir) -> Self {
        // Nobody else may reach a runtime folder.
        DirBuilder::new().recursive(true).mode(0o700).create(folder.path().join("run")).unwrap();
        Self(folder)
    }

    pub fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.0.path().join(name)
    }

    /// A path as an argument.
    pub fn arg(&self, name: &str) -> String {
        self.path(name).into_os_string().into_string().unwrap()
    }

    /// The settings file, where nothing else is chosen.
    pub fn settings(&self) -> PathBuf {
        self.path("config/bokehcam/config.toml")
    }

    pub fn with_settings(self, text: &str) -> Self {
        fs::create_dir_all(self.settings().parent().unwrap()).unwrap();
        fs::write(self.settings(), text).unwrap();
        self
    }

    /// A program of our own, as others find it in the folder `bin`; gives a `PATH` where it comes first.
    pub fn add_program(&self, name: &str, script: &str) -> String {
        fs::create_dir_all(self.path("bin")).unwrap();
        let program = self.path("bin").join(name);
        fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        format!("{}:{}", self.arg("bin"), std::env::var("PATH").unwrap())
    }

    /// What starts the program, with nothing but what is here.
    pub fn within(&self, command: Command) -> Command {
        let mut command = without(in_session(command), &["PIPEWIRE_", "XDG_"]);
        for (variable, folder) in [
            ("XDG_CONFIG_HOME", "config"),
            ("XDG_DATA_DIRS", "data"),
            ("XDG_DATA_HOME", "data"),
            ("XDG_RUNTIME_DIR", "run"),
            ("XDG_STATE_HOME", "state"),
        ] {
            command.env(variable, self.path(folder));
        }
        command.current_dir(&self.0);
        command
    }

    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = self.within(Command::new(PROGRAM));
        command.args(args);
        command
    }

    /// By way of a shell, which has done `before`, such as `ulimit -v 1000;`.
    pub fn shell(&self, before: &str, args: &str) -> Command {
        let mut command = self.within(Command::new("sh"));
        command.args(["-c", &format!("{before} exec '{PROGRAM}' {args}")]);
        command
    }

    /// The same where drivers of GPUs are found, which lie where networks of the system's would.
    pub fn with_drivers(&self, args: &[&str]) -> Command {
        let mut command = self.command(args);
        command.env_remove("XDG_DATA_DIRS");
        command
    }

    pub fn run(&self, args: &[&str]) -> Ran {
        Ran::of(&mut self.command(args))
    }
}

/// What came out of a program that has ended by itself.
#[derive(Debug)]
pub struct Ran {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl From<Output> for Ran {
    fn from(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Self {
            code: output.status.code().expect("ended by itself"),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }
}

impl Ran {
    #[track_caller]
    pub fn of(command: &mut Command) -> Self {
        command.output().unwrap_or_else(|error| panic!("{command:?}: {error}")).into()
    }

    /// It was refused with this exit code, in one line that has all of `said`; gives the line.
    #[track_caller]
    pub fn refused(&self, code: i32, said: &[&str]) -> &str {
        assert_eq!((self.code, self.stdout.as_str(), self.stderr.lines().count()), (code, "", 1), "{}", self.stderr);
        self.failed(code, said)
    }

    /// It failed with this exit code and one line of an error, perhaps after others, in which there is all of `said`.
    #[track_caller]
    pub fn failed(&self, code: i32, said: &[&str]) -> &str {
        let errors = self.stderr.lines().filter(|line| line.starts_with("error: ")).count();
        assert_eq!((self.code, errors), (code, 1), "{}", self.stderr);
        said.iter().for_each(|said| assert!(self.stderr.contains(said), "{said:?} is not in {}", self.stderr));
        &self.stderr
    }

    /// It did what it was asked for; gives what was said.
    #[track_caller]
    pub fn done(&self) -> &str {
        assert_eq!(self.code, 0, "{}", self.stderr);
        &self.stderr
    }

    /// It did what it was asked for; gives what it printed.
    #[track_caller]
    pub fn printed(self) -> String {
        self.done();
        self.stdout
    }

    /// The one warning, if there is any.
    #[track_caller]
    pub fn warning(&self) -> &str {
        let mut warnings = self.done().lines().filter(|line| line.starts_with("warning: "));
        let first = warnings.next().unwrap_or_default();
        assert_eq!(warnings.next(), None, "{}", self.stderr);
        first
    }

    /// What it printed, as JSON.
    #[track_caller]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {}{}", self.stdout, self.stderr))
    }
}

/// A program that runs beside the test, and is killed with it.
pub struct Beside(pub Child);

impl Beside {
    #[track_caller]
    pub fn start(command: &mut Command) -> Self {
        let started = command.stdin(Stdio::null()).spawn();
        Self(started.unwrap_or_else(|error| panic!("{command:?}: {error}")))
    }

    pub fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.0), signal).unwrap();
    }

    pub fn runs(&mut self) -> bool {
        self.0.try_wait().unwrap().is_none()
    }

    /// The programs that it has started.
    pub fn children(&self) -> Vec<Pid> {
        let tasks = fs::read_dir(format!("/proc/{}/task", self.0.id())).into_iter().flatten().flatten();
        let listed = tasks.filter_map(|task| fs::read_to_string(task.path().join("children")).ok()).collect::<String>();
        listed.split_whitespace().filter_map(|id| Pid::from_raw(id.parse().ok()?)).collect()
    }

    /// Waits for its end; gives what came out of it that nobody has read, of which the first may be pictures.
    #[track_caller]
    pub fn end(mut self, within: Duration) -> Ran {
        let status = found("the program ends", within, || self.0.try_wait().unwrap());
        let (mut stdout, mut stderr) = (Vec::new(), String::new());
        self.0.stdout.take().map(|mut pipe| pipe.read_to_end(&mut stdout).unwrap());
        self.0.stderr.take().map(|mut pipe| pipe.read_to_string(&mut stderr).unwrap());
        let stdout = String::from_utf8_lossy(&stdout).into_owned();
        Ran { code: status.code().expect("ended by itself"), stdout, stderr }
    }

    /// Asks it to end, and waits for that.
    #[track_caller]
    pub fn end_by(self, signal: Signal, within: Duration) -> Ran {
        self.signal(signal);
        self.end(within)
    }
}

impl Drop for Beside {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A file of JSON.
#[track_caller]
pub fn json(path: impl AsRef<Path>) -> Value {
    let path = path.as_ref();
    let text = fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_slice(&text).unwrap()
}

/// Each frame of a report was delivered, dropped for a reason, or under way at the end.
#[track_caller]
pub fn assert_accounted(report: &Value) {
    let frames = &report["frames"];
    let count = |value: &Value| value.as_u64().unwrap_or_else(|| panic!("{report}"));
    let dropped: u64 = frames["dropped"].as_object().unwrap().values().map(count).sum();
    let accounted = count(&frames["delivered"]) + dropped + count(&frames["in_flight"]);
    assert_eq!(count(&frames["captured"]), accounted, "{report}");
}
