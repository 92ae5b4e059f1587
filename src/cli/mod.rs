//! The command line: arguments to options, and one function per command.

mod aperture;
mod aperture_plot;
mod aperture_sheet;
mod arguments;
mod bench;
#[cfg(feature = "window")]
mod command_line;
mod config;
mod debug;
mod debug_pictures;
mod defaults;
mod devices;
mod disparity;
mod disparity_preview;
mod doctor;
mod dump;
mod environment;
mod error;
mod files;
mod focus;
mod layers;
mod log;
mod options;
#[doc(hidden)]
pub mod parsers;
#[cfg(feature = "window")]
mod presets;
#[cfg(feature = "window")]
mod preview;
mod record;
mod render;
mod save;
mod screen;
mod settings;
mod sinks;
mod stream;
mod terminal;
mod unused;

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;

use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};

pub use error::CliError;
use layers::Layers;
use settings::SettingsFile;

/// Depth-aware, disc-shaped background blur for cameras, recordings and stills
#[derive(Parser, Debug)]
#[command(name = "bokehcam", version, arg_required_else_help = true, max_term_width = 110)]
#[command(after_help = "\
Examples:
  bokehcam stream recordings/portrait --to out/
  bokehcam render photo.jpg --depth-map depth.png --out portrait.png
  bokehcam aperture --out kernels/

Settings come from flags, then the environment (BOKEHCAM_RIM for --rim), then the preset, then the settings file,
then defaults.
`bokehcam config dump` shows them all. Exit code: 0 done, 1 failed, 2 wrong arguments.")]
struct Cli {
    #[command(flatten)]
    global: options::Global,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    #[cfg(feature = "window")]
    Preview(Box<preview::PreviewCommand>),
    Stream(Box<stream::StreamCommand>),
    Render(Box<render::RenderCommand>),
    Depth(Box<disparity::DepthCommand>),
    Record(Box<record::RecordCommand>),
    Aperture(aperture::ApertureCommand),
    Bench(Box<bench::BenchCommand>),
    Devices(devices::DevicesCommand),
    Doctor(doctor::DoctorCommand),
    /// Print a script that completes commands and options in a shell
    #[command(after_help = "\
Examples:
  bokehcam completions bash > ~/.local/share/bash-completion/completions/bokehcam
  bokehcam completions zsh > ~/.zfunc/_bokehcam
  bokehcam completions fish > ~/.config/fish/completions/bokehcam.fish")]
    Completions {
        /// The shell
        #[arg(value_enum)]
        shell: clap_complete::Shell,
    },
    /// Show the settings
    #[command(subcommand, after_help = "Examples:\n  bokehcam config dump\n  bokehcam config save --rim 0.1")]
    Config(ConfigCommand),
}

#[derive(Subcommand, Debug)]
enum ConfigCommand {
    /// Print every setting with its value and where that comes from, as a settings file
    #[command(after_help = "\
Examples:
  bokehcam config dump
  bokehcam config dump --preset cinematic --rim 0.3")]
    Dump {
        /// Settings to print with these values.
        #[command(flatten)]
        every: Box<options::Every>,
    },
    /// Save the settings given as flags in the settings file, whose other settings and comments stay
    #[command(after_help = "\
Examples:
  bokehcam config save --aperture polygon:6 --rim 0.1
  bokehcam config save --preset cinematic --config other.toml")]
    Save {
        /// Settings to save.
        #[command(flatten)]
        every: Box<options::Every>,
    },
}

/// Runs the program. What goes wrong becomes one line on stderr and an exit code: 1 at run time, 2 in the arguments.
pub fn run(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args = arguments::joined(args);
    log::tell_of_panics();
    log::write_as(arguments::log_format(&args));
    let code = run_to_end(&args);
    log::flush();
    code
}

fn run_to_end(args: &[OsString]) -> ExitCode {
    let fail = |error: &CliError| {
        log::error(&match error.is_wrong_argument() {
            true => environment::with_origin(&error.to_string(), args),
            false => error.to_string(),
        });
        error.exit_code()
    };
    let Parsed { cli, matches, file, layers } = match parse(args) {
        Ok(parsed) => parsed,
        Err(Refusal::Settings(error)) => return fail(&error),
        Err(Refusal::Arguments(error)) => return arguments::refuse(&error, args),
    };
    log::start(&cli.global);
    environment::warn_of_unknown();
    match perform(cli, &matches, &file, &layers) {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever read our output has seen enough.
        Err(error) if error.is_broken_pipe() => ExitCode::SUCCESS,
        Err(error) => fail(&error),
    }
}

fn perform(cli: Cli, matches: &ArgMatches, file: &SettingsFile, layers: &Layers) -> Result<(), CliError> {
    match cli.command {
        #[cfg(feature = "window")]
        Command::Preview(command) => preview::run(&command, &cli.global, layers.given(matches)),
        Command::Stream(command) => stream::run(&command, &cli.global, layers.given(matches)),
        Command::Render(command) => render::run(&command, &cli.global, &layers.given(matches)),
        Command::Depth(command) => disparity::run(&command, &cli.global),
        Command::Record(command) => record::run(&command, &cli.global, &layers.given(matches)),
        Command::Aperture(command) => aperture::run(&command, &cli.global),
        Command::Bench(command) => bench::run(&command, &layers.given(matches)),
        Command::Devices(command) => devices::run(&command),
        Command::Doctor(command) => doctor::run(&command),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "bokehcam", &mut script);
            print(&script)
        }
        Command::Config(ConfigCommand::Dump { .. }) => {
            print(dump::as_toml(&layers.resolved(matches), &file.presets).as_bytes())
        }
        Command::Config(ConfigCommand::Save { .. }) => {
            save::run(cli.global.config.as_deref(), &layers.resolved(matches))
        }
    }
}

enum Refusal {
    Arguments(clap::Error),
    Settings(CliError),
}

impl From<clap::Error> for Refusal {
    fn from(error: clap::Error) -> Self {
        Refusal::Arguments(error)
    }
}

/// A command line, and what stands behind it.
struct Parsed {
    cli: Cli,
    matches: ArgMatches,
    file: SettingsFile,
    layers: Layers,
}

fn parse(args: &[OsString]) -> Result<Parsed, Refusal> {
    let command = settings::with_environment(Cli::command());
    // Once without the settings file, to learn its name and the preset's; then again with their values as defaults.
    let given = command.clone().try_get_matches_from(args)?;
    let chosen = Cli::from_arg_matches(&given)?.global.config;
    let file = settings_for(&given, chosen.as_deref()).map_err(Refusal::Settings)?;
    let layers = Layers::of(&file, &given).map_err(Refusal::Settings)?;
    let matches = layers.as_defaults(command).try_get_matches_from(args)?;
    Ok(Parsed { cli: Cli::from_arg_matches(&matches)?, matches, file, layers })
}

/// The settings file, as the command needs it.
fn settings_for(given: &ArgMatches, chosen: Option<&Path>) -> Result<SettingsFile, CliError> {
    let config = given.subcommand_matches("config").and_then(ArgMatches::subcommand_name);
    match (config, chosen) {
        // It will be made.
        (Some("save"), Some(path)) if path.symlink_metadata().is_err() => return Ok(SettingsFile::default()),
        (Some("dump"), _) => save::refuse_redirect(chosen)?,
        _ => {}
    }
    SettingsFile::load(chosen)
}

/// The matches of the innermost command.
fn leaf(matches: &ArgMatches) -> &ArgMatches {
    matches.subcommand().map_or(matches, |(_, below)| leaf(below))
}

fn print(bytes: &[u8]) -> Result<(), CliError> {
    let mut stdout = io::stdout().lock();
    let text = String::from_utf8_lossy(bytes);
    stdout
        .write_all(log::printable(&text, &['\n', '\t']).as_bytes())
        .and_then(|()| stdout.flush())
        .map_err(CliError::io("standard output".as_ref()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        settings::with_environment(Cli::command()).debug_assert();
    }
}
