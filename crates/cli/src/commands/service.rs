//! `service`: starts the virtual camera with every session, by a systemd user unit.

mod browser_flags;
mod manager;

use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;

use clap::{Args, Subcommand};

use manager::{self as systemd, State, Unit};

use crate::error::CliError;
use crate::files::{create_parent_folder, write_atomically};
use crate::log;
use crate::settings::file;
use crate::terminal::{print_to_stderr, print_to_stdout};
use bokehcam_files::data::user_dir;
use bokehcam_files::input;

/// Start the camera for calls with your session, or stop doing so
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam service on
  bokehcam service off
  bokehcam service status

The source and options are one line in ~/.config/bokehcam/stream.conf, such as
  STREAM=\"C920 --to pipewire --on-demand --preset cinematic\"
A change takes effect at the next start: `systemctl --user restart bokehcam`. The look comes from your settings file.")]
pub struct ServiceCommand {
    #[command(subcommand)]
    what: Option<What>,
}

#[derive(Clone, Copy, Debug, Subcommand)]
enum What {
    /// Start it now, and with every session from now on
    On {
        /// Add --enable-features=WebRtcPipeWireCamera to the flags files of browsers of the Chromium family, without asking
        #[arg(long)]
        browser_flags: bool,
    },
    /// Stop it now, do not start it any more, and remove the flags that it added for browsers
    Off,
    /// Print the status; `service` alone does the same
    Status,
}

/// The unit file of the packages, and the program in it.
const UNIT: &str = include_str!("../../../../packaging/bokehcam.service");
const PROGRAM: &str = "/usr/bin/bokehcam";
/// Begin of the line in it with the default arguments of `bokehcam stream`.
const DEFAULT: &str = "Environment=\"STREAM=";
/// Maximum size of stream.conf, in bytes.
const MAX_BYTES: u64 = 64 * 1024;
/// A stream that cannot start fails within this time.
const STARTUP_TIME: Duration = Duration::from_secs(1);

/// Runs the command.
///
/// # Errors
/// Fails if there is no systemd user session, the unit cannot be written, or systemd refuses.
pub fn run(command: &ServiceCommand) -> Result<(), CliError> {
    match command.what.unwrap_or(What::Status) {
        What::On { browser_flags } => {
            enable(Unit::query()?)?;
            thread::sleep(STARTUP_TIME);
            let unit = Unit::query()?;
            print_status(&unit)?;
            let (arguments, _) = read_stream_arguments(&unit.arguments)?;
            if is_pipewire_camera(&arguments) { browser_flags::offer(browser_flags) } else { Ok(()) }
        }
        What::Off => {
            disable(&Unit::query()?)?;
            browser_flags::remove()
        }
        What::Status => print_status(&Unit::query()?),
    }
}

/// Returns the default arguments of `bokehcam stream`, as the packages' unit has them.
fn default_stream_arguments() -> &'static str {
    UNIT.lines().find_map(|line| line.strip_prefix(DEFAULT)).map_or("", |arguments| arguments.trim_end_matches('"'))
}

fn enable(mut unit: Unit) -> Result<(), CliError> {
    if unit.state == State::Missing {
        let path = unit_path()?;
        if path.symlink_metadata().is_err() {
            write_unit(&path)?;
            print_to_stderr(&format!("wrote {}, as no package has installed the unit", path.display()));
        }
        systemd::run_systemctl(&["daemon-reload"])?;
        unit = Unit::query()?;
        if unit.state == State::Missing {
            let what = "systemd does not accept it as a unit: remove it, then `bokehcam service on` writes a new one";
            return Err(CliError::Service(format!("{}: {what}", path.display())));
        }
    }
    if let Some(program) = unit.program.as_ref().filter(|program| !program.exists()) {
        return Err(CliError::Service(format!(
            "{} starts {}, which does not exist: correct or remove it, then `bokehcam service on`",
            unit.file.display(),
            program.display()
        )));
    }
    systemd::run_systemctl(&["enable", "--now", systemd::NAME])
}

fn disable(unit: &Unit) -> Result<(), CliError> {
    if unit.state == State::Missing {
        print_to_stderr("it is off: there is no unit bokehcam.service");
        return Ok(());
    }
    systemd::run_systemctl(&["disable", "--now", systemd::NAME])?;
    print_to_stderr("it is off, and stays off");
    Ok(())
}

/// Prints the state of the service, and the location of its settings.
fn print_status(unit: &Unit) -> Result<(), CliError> {
    if unit.state == State::Missing {
        return print_to_stdout(
            b"off: there is no unit bokehcam.service yet; `bokehcam service on` writes and starts one\n",
        );
    }
    let last_line = || systemd::read_last_log_line().map_or_else(String::new, |line| format!("\n  says      {line}"));
    let is = match unit.state {
        State::Missing | State::Stopped => "does not run".to_owned(),
        State::Running => "runs".to_owned(),
        State::Restarting => format!("tries again every five seconds{}", last_line()),
        State::Failed => format!("gave up{}", last_line()),
    };
    let is_on = if unit.is_enabled { "on" } else { "off" };
    let (streams, from) = read_stream_arguments(&unit.arguments)?;
    print_to_stdout(
        format!("{is_on}: it {is}\n  streams   {streams}\n  settings  {from}\n  unit      {}\n", unit.file.display())
            .as_bytes(),
    )?;
    if unit.is_enabled && !systemd::has_graphical_session()? {
        let what = "this desktop does not start graphical-session.target of systemd, so the service does not start by \
                    itself: let the desktop run `systemctl --user start bokehcam` at login";
        log::warn(what);
    }
    Ok(())
}

/// Returns the arguments of `bokehcam stream`, and their origin: the user's file, or `default` of the unit.
fn read_stream_arguments(default: &str) -> Result<(String, String), CliError> {
    let no_home = || {
        CliError::Service(
            "there is no folder for settings: neither XDG_CONFIG_HOME nor HOME is an absolute path".into(),
        )
    };
    let path = file::user_file().ok_or_else(no_home)?.with_file_name("stream.conf");
    let text = match input::read_text(&path, MAX_BYTES) {
        Ok(text) => text,
        Err(_) if path.symlink_metadata().is_err() => String::new(),
        Err(error) => return Err(CliError::io(&path)(error)),
    };
    // The last assignment wins, as in systemd.
    let configured = text.lines().filter_map(|line| line.trim().strip_prefix("STREAM=")).next_back();
    Ok(match configured {
        Some(configured) => (configured.trim_matches(['"', '\'']).to_owned(), path.display().to_string()),
        None => (default.to_owned(), format!("to change it, write STREAM=\"...\" to {}", path.display())),
    })
}

/// Whether a stream with these arguments is a camera of PipeWire.
fn is_pipewire_camera(arguments: &str) -> bool {
    let words: Vec<&str> = arguments.split_whitespace().collect();
    let separate = words.windows(2).filter(|pair| pair[0] == "--to").map(|pair| pair[1]);
    let mut targets = separate.chain(words.iter().filter_map(|word| word.strip_prefix("--to=")));
    targets.any(|target| {
        let target = target.trim_matches(['"', '\'']);
        target == "pipewire" || target.starts_with("pipewire:")
    })
}

/// Returns the path of the user's own unit.
fn unit_path() -> Result<PathBuf, CliError> {
    let config = user_dir("XDG_CONFIG_HOME", ".config");
    let no_folder = || {
        CliError::Service("there is no folder for units: neither XDG_CONFIG_HOME nor HOME is an absolute path".into())
    };
    Ok(config.ok_or_else(no_folder)?.join("systemd/user").join(systemd::NAME))
}

/// Writes the unit with the path of this program.
fn write_unit(path: &Path) -> Result<(), CliError> {
    let program = std::env::current_exe().map_err(CliError::io("this program".as_ref()))?;
    let name = program
        .to_str()
        .ok_or_else(|| CliError::Usage(format!("{}: systemd accepts only names in UTF-8", program.display())))?;
    let quoted = name.replace('\\', "\\\\").replace('"', "\\\"").replace('%', "%%");
    create_parent_folder(path)?;
    let unit = UNIT.replace(&format!("ExecStart={PROGRAM} "), &format!("ExecStart=\"{quoted}\" "));
    write_atomically(path, unit.as_bytes(), false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_starts_one_program_with_the_arguments_of_one_line() {
        assert_eq!(UNIT.matches(&format!("ExecStart={PROGRAM} stream --tray $STREAM\n")).count(), 1);
        assert_eq!(UNIT.matches(DEFAULT).count(), 1);
        assert!(is_pipewire_camera(default_stream_arguments()));
    }

    #[test]
    fn only_outputs_make_a_pipewire_camera() {
        for arguments in ["0 --to pipewire", "0 --to /dev/video10 --to pipewire:Desk", "0 --to='pipewire:My desk'"] {
            assert!(is_pipewire_camera(arguments), "{arguments}");
        }
        for arguments in ["pipewire:cam --to /dev/video10", "0 --to pipewire.mp4", "0", "0 --to"] {
            assert!(!is_pipewire_camera(arguments), "{arguments}");
        }
    }
}
