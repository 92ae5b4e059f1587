//! The command line: arguments to one resolved configuration, one function per command.

mod aperture;
mod aperture_plot;
mod aperture_sheet;
mod bench;
#[cfg(feature = "camera")]
mod calibration;
mod command_line;
mod config;
mod debug;
mod debug_pictures;
mod defaults;
mod depth;
mod devices;
mod disparity;
mod disparity_preview;
mod doctor;
mod dump;
mod error;
mod files;
mod layers;
mod options;
#[doc(hidden)]
pub mod parsers;
mod presets;
#[cfg(feature = "window")]
mod preview;
mod quality;
mod record;
mod render;
mod settings;
mod sinks;
mod source;
mod stereo;
mod stream;
mod terminal;
mod values;

use std::ffi::OsString;
use std::io::{self, Write};
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};

pub use error::CliError;
use layers::Layers;
use settings::SettingsFile;

/// Depth-aware, disc-shaped background blur for RGB-D recordings and stills
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
    #[command(subcommand, after_help = "Example:\n  bokehcam config dump")]
    Config(ConfigCommand),
}

#[derive(Subcommand, Debug)]
enum ConfigCommand {
    /// Print every setting with its value and where that comes from, as a settings file
    #[command(after_help = "\
Examples:
  bokehcam config dump
  bokehcam config dump --aperture polygon:6 > ~/.config/bokehcam/config.toml")]
    Dump {
        /// Settings to print with these values.
        #[command(flatten)]
        every: Box<options::Every>,
    },
}

/// Runs the program. What goes wrong becomes one line on stderr and an exit code: 1 at run time, 2 in the arguments.
pub fn run(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args: Vec<OsString> = args.into_iter().collect();
    let Parsed { cli, matches, file, layers } = match parse(&args) {
        Ok(parsed) => parsed,
        Err(Refusal::Settings(error)) => return fail(&error),
        Err(Refusal::Arguments(error)) => return refuse(&error),
    };
    terminal::start_log(&cli.global);
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
        Command::Render(command) => render::run(&command, &cli.global),
        Command::Depth(command) => disparity::run(&command, &cli.global),
        Command::Record(command) => record::run(&command, &cli.global),
        Command::Aperture(command) => aperture::run(&command, &cli.global),
        Command::Bench(command) => bench::run(&command),
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
    let file = SettingsFile::load(chosen.as_deref()).map_err(Refusal::Settings)?;
    let layers = Layers::of(&file, &given).map_err(Refusal::Settings)?;
    let matches = layers.as_defaults(command).try_get_matches_from(args)?;
    Ok(Parsed { cli: Cli::from_arg_matches(&matches)?, matches, file, layers })
}

/// The matches of the innermost command.
fn leaf(matches: &ArgMatches) -> &ArgMatches {
    matches.subcommand().map_or(matches, |(_, below)| leaf(below))
}

fn print(bytes: &[u8]) -> Result<(), CliError> {
    let mut stdout = io::stdout().lock();
    stdout.write_all(bytes).and_then(|()| stdout.flush()).map_err(CliError::io("standard output".as_ref()))
}

fn fail(error: &CliError) -> ExitCode {
    terminal::say(&format!("error: {error}"));
    error.exit_code()
}

fn refuse(error: &clap::Error) -> ExitCode {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            // A reader that is gone needs no help.
            let _ = error.print();
            ExitCode::SUCCESS
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let _ = error.print();
            ExitCode::from(2)
        }
        _ => {
            terminal::say(&format!("error: {}", one_line(error)));
            ExitCode::from(2)
        }
    }
}

/// What clap says in paragraphs, in one line and without the usage.
fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let told = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with("Usage:") && !line.starts_with("For more information"));
    let mut sentence = String::new();
    for line in told {
        let joint = match sentence.chars().last() {
            None => "",
            Some(':') => " ",
            Some(_) if line.starts_with('[') => " ",
            Some(_) => "; ",
        };
        sentence.push_str(joint);
        sentence.push_str(line.strip_prefix("error: ").unwrap_or(line));
    }
    sentence
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        settings::with_environment(Cli::command()).debug_assert();
    }
}
