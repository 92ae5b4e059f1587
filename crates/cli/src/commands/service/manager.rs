//! systemd's manager of the user's session, by its own program.

use std::collections::HashMap;
use std::io::ErrorKind;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use crate::error::CliError;

/// The unit.
pub const NAME: &str = "bokehcam.service";
/// What a desktop starts that tells systemd of itself.
const DESKTOP: &str = "graphical-session.target";

/// Whether the service runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// There is no unit.
    Missing,
    Stopped,
    Runs,
    /// It ended, and is started again soon.
    Waits,
    /// It ended, and is not started again.
    Failed,
}

/// The unit as systemd knows it.
#[derive(Debug)]
pub struct Unit {
    pub state: State,
    /// Whether it starts with the session.
    pub is_enabled: bool,
    pub file: PathBuf,
    /// What it starts.
    pub program: Option<PathBuf>,
    /// What it streams where no file of settings says otherwise.
    pub streams: String,
}

impl Unit {
    /// Asks systemd.
    ///
    /// # Errors
    /// It is not there, or the unit is one that it cannot use.
    pub fn ask() -> Result<Self, CliError> {
        let told = told_of(NAME)?;
        let of = |name: &str| told.get(name).map_or("", String::as_str);
        let file = PathBuf::from(of("FragmentPath"));
        let state = match (of("LoadState"), of("ActiveState")) {
            ("not-found", _) => State::Missing,
            ("masked", _) => {
                return Err(CliError::Service(format!("{NAME} is masked: `systemctl --user unmask bokehcam` first")));
            }
            ("loaded", "active" | "reloading") => State::Runs,
            ("loaded", "activating") => State::Waits,
            ("loaded", "failed") => State::Failed,
            ("loaded", _) => State::Stopped,
            (other, _) => {
                let what =
                    format!("systemd cannot use it ({other}): `systemd-analyze --user verify {}`", file.display());
                return Err(CliError::Service(format!("{NAME}: {what}")));
            }
        };
        // `{ path=/usr/bin/bokehcam ; argv[]=... }`
        let program = of("ExecStart").split_once("path=").and_then(|(_, rest)| Some(rest.split_once(" ;")?.0.into()));
        let streams = of("Environment").split_once("STREAM=").map_or("", |(_, rest)| rest.trim_end_matches('"'));
        let is_enabled = of("UnitFileState").starts_with("enabled");
        Ok(Self { state, is_enabled, file, program, streams: streams.to_owned() })
    }
}

/// Whether the desktop has told systemd that it runs.
///
/// # Errors
/// systemd is not there.
pub fn has_graphical_session() -> Result<bool, CliError> {
    Ok(told_of(DESKTOP)?.get("ActiveState").is_some_and(|state| state == "active"))
}

/// What the service's program said last.
pub fn last_line() -> Option<String> {
    let args =
        ["--user", "--unit", NAME, "--identifier=bokehcam", "--lines=1", "--output=cat", "--no-pager", "--quiet"];
    let said = Command::new("journalctl").args(args).stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
    let said = String::from_utf8_lossy(&said.stdout).trim().to_owned();
    (!said.is_empty()).then_some(said)
}

/// Has systemd do something.
///
/// # Errors
/// It is not there, or refuses.
pub fn tell(args: &[&str]) -> Result<(), CliError> {
    asked(args).map(drop)
}

fn told_of(unit: &str) -> Result<HashMap<String, String>, CliError> {
    const PROPERTIES: &str = "--property=LoadState,ActiveState,UnitFileState,FragmentPath,ExecStart,Environment";
    let told = asked(&["show", PROPERTIES, unit])?;
    let lines = told.lines().filter_map(|line| line.split_once('='));
    Ok(lines.map(|(name, value)| (name.to_owned(), value.to_owned())).collect())
}

/// Runs `systemctl --user`, and gives what it printed.
fn asked(args: &[&str]) -> Result<String, CliError> {
    const INSTEAD: &str =
        "have your desktop start `bokehcam stream 0 --to pipewire --on-demand` with the session instead";
    let asked = Command::new("systemctl").arg("--user").args(args).stdin(Stdio::null()).output();
    let Output { status, stdout, stderr } = asked.map_err(|error| match error.kind() {
        ErrorKind::NotFound => CliError::Service(format!("there is no systemd here: {INSTEAD}")),
        _ => CliError::io("systemctl".as_ref())(error),
    })?;
    if status.success() {
        return Ok(String::from_utf8_lossy(&stdout).into_owned());
    }
    let said = String::from_utf8_lossy(&stderr);
    let said = said.lines().find(|line| !line.trim().is_empty()).unwrap_or("it does not say why").to_owned();
    Err(CliError::Service(match args {
        // Asking fails only where nobody can be asked.
        ["show", ..] => format!("this user has no session of systemd's ({said}): {INSTEAD}"),
        _ => format!("systemctl --user {}: {said}", args.join(" ")),
    }))
}
