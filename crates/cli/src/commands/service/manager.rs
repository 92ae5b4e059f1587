//! Client of systemd's user manager, through `systemctl`.

use std::collections::HashMap;
use std::io::ErrorKind;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use crate::error::CliError;

/// Name of the unit.
pub const NAME: &str = "bokehcam.service";
/// Target that a desktop with systemd support starts.
const DESKTOP: &str = "graphical-session.target";

/// Run state of the service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// The unit does not exist.
    Missing,
    Stopped,
    Running,
    /// It ended, and restarts soon.
    Restarting,
    /// It ended, and does not restart.
    Failed,
}

/// State and settings of the unit.
#[derive(Debug)]
pub struct Unit {
    pub state: State,
    /// Whether it starts with the session.
    pub is_enabled: bool,
    pub file: PathBuf,
    /// The program that it starts.
    pub program: Option<PathBuf>,
    /// Default arguments of `bokehcam stream`, without a settings file.
    pub arguments: String,
}

impl Unit {
    /// Queries systemd.
    ///
    /// # Errors
    /// Fails without systemd, or if systemd cannot use the unit.
    pub fn query() -> Result<Self, CliError> {
        let properties = query_properties(NAME)?;
        let value = |name: &str| properties.get(name).map_or("", String::as_str);
        let file = PathBuf::from(value("FragmentPath"));
        let state = match (value("LoadState"), value("ActiveState")) {
            ("not-found", _) => State::Missing,
            ("masked", _) => {
                return Err(CliError::Service(format!("{NAME} is masked: `systemctl --user unmask bokehcam` first")));
            }
            ("loaded", "active" | "reloading") => State::Running,
            ("loaded", "activating") => State::Restarting,
            ("loaded", "failed") => State::Failed,
            ("loaded", _) => State::Stopped,
            (other, _) => {
                let what =
                    format!("systemd cannot use it ({other}): `systemd-analyze --user verify {}`", file.display());
                return Err(CliError::Service(format!("{NAME}: {what}")));
            }
        };
        // `{ path=/usr/bin/bokehcam ; argv[]=... }`
        let program = value("ExecStart").split_once("path=");
        let program = program.and_then(|(_, rest)| Some(rest.split_once(" ;")?.0.into()));
        let arguments = value("Environment").split_once("STREAM=");
        let arguments = arguments.map_or("", |(_, rest)| rest.trim_end_matches('"'));
        let is_enabled = value("UnitFileState").starts_with("enabled");
        Ok(Self { state, is_enabled, file, program, arguments: arguments.to_owned() })
    }
}

/// Whether the desktop has started its systemd target.
///
/// # Errors
/// Fails without systemd.
pub fn has_graphical_session() -> Result<bool, CliError> {
    Ok(query_properties(DESKTOP)?.get("ActiveState").is_some_and(|state| state == "active"))
}

/// Returns the last log line of the service's program.
pub fn read_last_log_line() -> Option<String> {
    let args =
        ["--user", "--unit", NAME, "--identifier=bokehcam", "--lines=1", "--output=cat", "--no-pager", "--quiet"];
    let said = Command::new("journalctl").args(args).stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
    let said = String::from_utf8_lossy(&said.stdout).trim().to_owned();
    (!said.is_empty()).then_some(said)
}

/// Runs a `systemctl --user` command.
///
/// # Errors
/// Fails without systemd, or if systemd refuses.
pub fn run_systemctl(args: &[&str]) -> Result<(), CliError> {
    read_systemctl(args).map(drop)
}

fn query_properties(unit: &str) -> Result<HashMap<String, String>, CliError> {
    const PROPERTIES: &str = "--property=LoadState,ActiveState,UnitFileState,FragmentPath,ExecStart,Environment";
    let output = read_systemctl(&["show", PROPERTIES, unit])?;
    let lines = output.lines().filter_map(|line| line.split_once('='));
    Ok(lines.map(|(name, value)| (name.to_owned(), value.to_owned())).collect())
}

/// Runs `systemctl --user` and returns its output.
fn read_systemctl(args: &[&str]) -> Result<String, CliError> {
    let instead = || {
        let arguments = super::default_stream_arguments();
        format!("let your desktop start `bokehcam stream {arguments}` with the session instead")
    };
    let output = Command::new("systemctl").arg("--user").args(args).stdin(Stdio::null()).output();
    let Output { status, stdout, stderr } = output.map_err(|error| match error.kind() {
        ErrorKind::NotFound => CliError::Service(format!("there is no systemd here: {}", instead())),
        _ => CliError::io("systemctl".as_ref())(error),
    })?;
    if status.success() {
        return Ok(String::from_utf8_lossy(&stdout).into_owned());
    }
    let said = String::from_utf8_lossy(&stderr);
    let said = said.lines().find(|line| !line.trim().is_empty()).unwrap_or("it gives no reason").to_owned();
    Err(CliError::Service(match args {
        // Queries fail only without a user session.
        ["show", ..] => format!("this user has no systemd session ({said}): {}", instead()),
        _ => format!("systemctl --user {}: {said}", args.join(" ")),
    }))
}
