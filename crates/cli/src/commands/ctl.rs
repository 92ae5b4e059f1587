//! `ctl`: sends a command to a running stream or preview.

use std::fmt::Write;
use std::path::{self, Path, PathBuf};

use clap::{Args, Subcommand};

use crate::error::CliError;
use crate::log;
use crate::options::Global;
use crate::settings::paths::resolve_paths;
use crate::terminal::{print_to_stderr, print_to_stdout};
use bokehcam::look::settings;
use bokehcam_live::control::client::{list_run_names, send_request};
use bokehcam_live::control::{Answer, ControlError, Name, Request, Status};

/// Control a stream or a preview while it runs: off and on, another look, a picture
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam ctl                              list all runs
  bokehcam ctl toggle
  bokehcam ctl preset dreamy
  bokehcam ctl set blur=3% focus=auto
  bokehcam ctl depth matte
  bokehcam ctl --name stream-2 status --json
  bokehcam ctl snapshot --to me.png

Off shows a still card in place of the picture, and closes the camera. The picture without blur is `set effect=none`.
docs/ctl.md (in a package /usr/share/doc/bokehcam/docs/ctl.md) has recipes for keys and bars, and the protocol.")]
pub struct CtlCommand {
    /// Name of the run, if there are several: its --name, or the name in `bokehcam ctl list`
    #[arg(long, global = true, value_name = "NAME")]
    name: Option<Name>,
    #[command(subcommand)]
    verb: Option<Verb>,
}

#[derive(Subcommand, Debug)]
enum Verb {
    /// List all runs: name, on or off, source and outputs; `ctl` alone does the same
    List,
    /// Show pictures again, as before
    On,
    /// Show a still card in place of the picture, and close the camera
    Off,
    /// Switch off if on, and on if off
    Toggle,
    /// Apply a preset, built in or your own
    Preset {
        /// Its name
        #[arg(id = "look", value_name = "PRESET")]
        preset: String,
    },
    /// Change settings of the look: all of them, or none if one is invalid
    Set {
        /// Settings as on the command line, without the dashes
        #[arg(id = "settings", value_name = "NAME=VALUE", required = true)]
        settings: Vec<String>,
    },
    /// Change the source of depth, in a window: recorded, stereo, matte, matte,mono or plate, if available
    Depth {
        /// The source of depth, written as for --depth
        #[arg(id = "way", value_name = "WAY")]
        from: String,
    },
    /// Print the status
    Status {
        /// Print it as one line of JSON
        #[arg(long)]
        json: bool,
    },
    /// Save the next picture, with its settings if it is a PNG: `render --like` uses them
    Snapshot {
        /// The file (PNG or JPEG), which must not exist [default: by date, in your folder of pictures]
        #[arg(id = "file", long = "to", value_name = "FILE")]
        to: Option<PathBuf>,
    },
}

/// Runs the command.
///
/// # Errors
/// Fails if no run matches, several do, or the run refuses.
pub fn run(command: CtlCommand, global: &Global) -> Result<(), CliError> {
    let CtlCommand { name, verb } = command;
    let verb = verb.unwrap_or(Verb::List);
    let as_json = matches!(verb, Verb::Status { json: true });
    let is_status = matches!(verb, Verb::Status { .. });
    let request = match verb {
        Verb::List => return list_runs(name.as_ref()),
        Verb::On => Request::On,
        Verb::Off => Request::Off,
        Verb::Toggle => Request::Toggle,
        Verb::Preset { preset } => Request::Preset { name: preset },
        Verb::Set { settings } => {
            Request::Set { settings: settings.into_iter().map(resolve_setting).collect::<Result<_, _>>()? }
        }
        Verb::Depth { from } => Request::Depth { from },
        Verb::Status { .. } => Request::Status,
        Verb::Snapshot { to } => Request::Snapshot { to: to.map(|to| to_absolute(&to)).transpose()? },
    };
    match send_request(name.as_ref(), &request)? {
        Answer::Done { status, note } => {
            note.iter().for_each(|note| log::warn(note));
            match (is_status, as_json) {
                (_, true) => print_to_stdout(format!("{}\n", format_status_json(&status)?).as_bytes()),
                (true, false) => print_to_stdout(format_status_text(&status).as_bytes()),
                // A key binding has no terminal: only people read this.
                (false, false) if global.quiet => Ok(()),
                (false, false) => {
                    print_to_stderr(&format!("{} is {}", status.name, describe_state(&status)));
                    Ok(())
                }
            }
        }
        Answer::Saved { saved } => print_to_stdout(format!("{}\n", saved.display()).as_bytes()),
        Answer::Refused { error, usage: true } => Err(CliError::Usage(error)),
        Answer::Refused { error, usage: false } => Err(CliError::Control(error)),
    }
}

impl From<ControlError> for CliError {
    fn from(error: ControlError) -> Self {
        match error {
            ControlError::SeveralRuns(_) => Self::Usage(error.to_string()),
            error => Self::Control(error.to_string()),
        }
    }
}

/// Prints one line per running instance.
fn list_runs(name: Option<&Name>) -> Result<(), CliError> {
    let runs: Vec<Name> = list_run_names()?.into_iter().filter(|run| name.is_none_or(|name| run == name)).collect();
    if runs.is_empty() {
        print_to_stderr("nothing is running: start `bokehcam stream` or `bokehcam preview`");
    }
    let line = |run: &Name| match send_request(Some(run), &Request::Status) {
        Ok(Answer::Done { status, .. }) => {
            let Status { on, source, sinks, .. } = *status;
            let source = if source.is_empty() { "no source" } else { &source };
            format!("{run:<12} {:<4} {source} to {}\n", if on { "on" } else { "off" }, sinks.join(", "))
        }
        Ok(_) => format!("{run:<12} ?    it is of another version\n"),
        Err(error) => format!("{run:<12} ?    {error}\n"),
    };
    print_to_stdout(runs.iter().map(line).collect::<String>().as_bytes())
}

/// Makes relative paths in a setting absolute: the run may have another working directory.
fn resolve_setting(setting: String) -> Result<String, CliError> {
    let Some((name, value)) = setting.split_once('=') else { return Ok(setting) };
    let folder = std::env::current_dir().map_err(CliError::io(".".as_ref()))?;
    let whole = resolve_paths(&folder, name, value);
    if whole == value {
        return Ok(setting);
    }
    to_absolute(&folder)?;
    Ok(format!("{name}={whole}"))
}

fn to_absolute(path: &Path) -> Result<PathBuf, CliError> {
    let whole = path::absolute(path).map_err(CliError::io(path))?;
    match whole.to_str() {
        Some(_) => Ok(whole),
        None => Err(CliError::Usage(format!("{}: use a name in UTF-8", whole.display()))),
    }
}

fn format_status_json(status: &Status) -> Result<String, CliError> {
    serde_json::to_string(status).map_err(|error| CliError::Control(error.to_string()))
}

fn describe_state(status: &Status) -> &'static str {
    if status.on { "on" } else { "off: a still card is shown in place of the picture" }
}

/// Formats the status as text.
fn format_status_text(status: &Status) -> String {
    let Status { name, pid, command, source, size, sinks, watched, quality, private, fps, look, uptime_s, .. } = status;
    let size = size.map_or_else(String::new, |(width, height)| format!(", {width}x{height}"));
    let watched = match watched {
        Some(true) => "; watched",
        Some(false) => "; not watched",
        None => "",
    };
    let sinks = if sinks.is_empty() { "nowhere else".to_owned() } else { sinks.join(", ") };
    let quality = quality.as_ref().map_or("not blurred".to_owned(), |quality| format!("quality {quality}"));
    let private = if *private { ", private" } else { "" };
    let is_alias = |name: &str| settings::resolve_alias(name) != name;
    let look = look.iter().filter(|(name, _)| !is_alias(name)).map(|(name, value)| format!("{name}={value}"));
    let look: Vec<String> = look.collect();
    let whole_s = *uptime_s as u64;
    let (hours, minutes, seconds) = (whole_s / 3600, whole_s / 60 % 60, whole_s % 60);
    let mut text = format!("{name} is {}\n", describe_state(status));
    // Writing to a String cannot fail.
    let _ = write!(
        text,
        "  run      {command}, process {pid}, since {hours}:{minutes:02}:{seconds:02}\n  source   {source}{size}\n  \
         to       {sinks}{watched}\n  frames   {fps:.1} a second, {quality}{private}\n  look     {}\n",
        look.join(" ")
    );
    text
}
