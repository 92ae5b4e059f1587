//! Starts the `bokehcam` program in an isolated environment, and collects its output.
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
#[allow(unused_imports)] // Not every test binary uses them.
pub use waiting::{found, until};

pub const PROGRAM: &str = env!("CARGO_BIN_EXE_bokehcam");
/// The repository's root folder.
pub const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
/// The recordings bundled with the repository.
pub const PORTRAIT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../recordings/portrait");
pub const STEREO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../recordings/stereo");

/// Removes the environment variables whose names start with one of the prefixes `begins`.
pub fn without(mut command: Command, begins: &[&str]) -> Command {
    for (name, _) in std::env::vars_os() {
        if begins.iter().any(|begin| name.as_encoded_bytes().starts_with(begin.as_bytes())) {
            command.env_remove(name);
        }
    }
    command
}

/// Runs the command in the tester's session, but without their settings for the program, without the networks of the
/// build's folder, and with an empty stdin.
pub fn in_session(command: Command) -> Command {
    let mut command = without(command, &["BOKEHCAM_", "RUST_LOG", "NO_COLOR"]);
    command.env("BOKEHCAM_MODELS", "/dev/null");
    command.stdin(Stdio::null());
    command
}

/// Returns a command that runs the program in that session.
pub fn bokehcam(args: &[&str]) -> Command {
    let mut command = in_session(Command::new(PROGRAM));
    command.args(args);
    command
}

/// Runs the program as a new user, in an empty home.
pub fn run(args: &[&str]) -> Ran {
    Home::new().run(args)
}

/// A new user: a temporary folder that is both the working directory and the parent of empty XDG folders.
pub struct Home(pub tempfile::TempDir);

impl Home {
    pub fn new() -> Self {
        Self::at(tempfile::tempdir().unwrap())
    }

    pub fn at(folder: tempfile::TempDir) -> Self {
        // A runtime folder must be private to its user.
        DirBuilder::new().recursive(true).mode(0o700).create(folder.path().join("run")).unwrap();
        Self(folder)
    }

    pub fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.0.path().join(name)
    }

    /// Returns a path in the home as a command-line argument.
    pub fn arg(&self, name: &str) -> String {
        self.path(name).into_os_string().into_string().unwrap()
    }

    /// Returns the path of the default settings file.
    pub fn settings(&self) -> PathBuf {
        self.path("config/bokehcam/config.toml")
    }

    pub fn with_settings(self, text: &str) -> Self {
        fs::create_dir_all(self.settings().parent().unwrap()).unwrap();
        fs::write(self.settings(), text).unwrap();
        self
    }

    /// Adds a shell script as a program in the folder `bin`; returns a `PATH` that finds it first.
    pub fn add_program(&self, name: &str, script: &str) -> String {
        fs::create_dir_all(self.path("bin")).unwrap();
        let program = self.path("bin").join(name);
        fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        format!("{}:{}", self.arg("bin"), std::env::var("PATH").unwrap())
    }

    /// Confines a command to this home, by its XDG folders and working directory.
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

    /// Returns a shell command that runs `before`, such as `ulimit -v 1000;`, and then becomes the program.
    pub fn shell(&self, before: &str, args: &str) -> Command {
        let mut command = self.within(Command::new("sh"));
        command.args(["-c", &format!("{before} exec '{PROGRAM}' {args}")]);
        command
    }

    /// Returns a command that finds GPU drivers: they are in the system's data folders, as are installed networks.
    pub fn with_drivers(&self, args: &[&str]) -> Command {
        let mut command = self.command(args);
        command.env_remove("XDG_DATA_DIRS");
        command
    }

    pub fn run(&self, args: &[&str]) -> Ran {
        Ran::of(&mut self.command(args))
    }
}

/// Exit code and output of a program that has ended.
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

    /// Asserts this exit code and a single line of output, on stderr, that contains all of `said`; returns the line.
    #[track_caller]
    pub fn refused(&self, code: i32, said: &[&str]) -> &str {
        assert_eq!((self.code, self.stdout.as_str(), self.stderr.lines().count()), (code, "", 1), "{}", self.stderr);
        self.failed(code, said)
    }

    /// Asserts this exit code and exactly one error line, possibly among other lines, that contains all of `said`.
    #[track_caller]
    pub fn failed(&self, code: i32, said: &[&str]) -> &str {
        let errors = self.stderr.lines().filter(|line| line.starts_with("error: ")).count();
        assert_eq!((self.code, errors), (code, 1), "{}", self.stderr);
        said.iter().for_each(|said| assert!(self.stderr.contains(said), "{said:?} is not in {}", self.stderr));
        &self.stderr
    }

    /// Asserts success; returns stderr.
    #[track_caller]
    pub fn done(&self) -> &str {
        assert_eq!(self.code, 0, "{}", self.stderr);
        &self.stderr
    }

    /// Asserts success; returns stdout.
    #[track_caller]
    pub fn printed(self) -> String {
        self.done();
        self.stdout
    }

    /// Asserts success and at most one warning; returns the warning, or an empty string.
    #[track_caller]
    pub fn warning(&self) -> &str {
        let mut warnings = self.done().lines().filter(|line| line.starts_with("warning: "));
        let first = warnings.next().unwrap_or_default();
        assert_eq!(warnings.next(), None, "{}", self.stderr);
        first
    }

    /// Parses stdout as JSON.
    #[track_caller]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {}{}", self.stdout, self.stderr))
    }
}

/// A background process, killed when dropped.
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

    /// Returns the process ids of its children.
    pub fn children(&self) -> Vec<Pid> {
        let tasks = fs::read_dir(format!("/proc/{}/task", self.0.id())).into_iter().flatten().flatten();
        let listed = tasks.filter_map(|task| fs::read_to_string(task.path().join("children")).ok()).collect::<String>();
        listed.split_whitespace().filter_map(|id| Pid::from_raw(id.parse().ok()?)).collect()
    }

    /// Returns the ids of its threads of this name.
    pub fn threads(&self, name: &str) -> Vec<std::ffi::OsString> {
        let tasks = fs::read_dir(format!("/proc/{}/task", self.0.id())).into_iter().flatten().flatten();
        let is_named =
            |task: &fs::DirEntry| fs::read_to_string(task.path().join("comm")).is_ok_and(|comm| comm.trim() == name);
        tasks.filter(is_named).map(|task| task.file_name()).collect()
    }

    /// Waits for the process to end; returns the unread output. Stdout may be binary.
    #[track_caller]
    pub fn end(mut self, within: Duration) -> Ran {
        let status = found("the program ends", within, || self.0.try_wait().unwrap());
        let (mut stdout, mut stderr) = (Vec::new(), String::new());
        self.0.stdout.take().map(|mut pipe| pipe.read_to_end(&mut stdout).unwrap());
        self.0.stderr.take().map(|mut pipe| pipe.read_to_string(&mut stderr).unwrap());
        let stdout = String::from_utf8_lossy(&stdout).into_owned();
        Ran { code: status.code().expect("ended by itself"), stdout, stderr }
    }

    /// Sends a signal, and waits for the process to end.
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

/// Reads a JSON file.
#[track_caller]
pub fn json(path: impl AsRef<Path>) -> Value {
    let path = path.as_ref();
    let text = fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_slice(&text).unwrap()
}

/// Asserts that a report accounts for each captured frame: delivered, dropped with a cause, or in flight at the end.
#[track_caller]
pub fn assert_accounted(report: &Value) {
    let frames = &report["frames"];
    let count = |value: &Value| value.as_u64().unwrap_or_else(|| panic!("{report}"));
    let dropped: u64 = frames["dropped"].as_object().unwrap().values().map(count).sum();
    let accounted = count(&frames["delivered"]) + dropped + count(&frames["in_flight"]);
    assert_eq!(count(&frames["captured"]), accounted, "{report}");
}
