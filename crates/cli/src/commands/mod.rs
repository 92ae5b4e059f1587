//! The commands: their names and help, one `run` function per module.

#[cfg(feature = "lab")]
mod aperture;
mod bench;
mod completions;
mod ctl;
mod depth;
mod devices;
mod doctor;
mod manual;
#[cfg(feature = "networks")]
mod models;
mod plate;
#[cfg(feature = "window")]
mod preview;
mod record;
mod render;
mod service;
mod stream;

use clap::{ArgMatches, CommandFactory, Parser, Subcommand};

use crate::error::CliError;
use crate::help;
use crate::options;
use crate::settings::file::SettingsFile;
use crate::settings::layers::Layers;
use crate::settings::{dump, save};
use crate::terminal::print_to_stdout;

/// Depth-aware, disc-shaped background blur for cameras, recordings and stills
#[derive(Parser, Debug)]
#[command(name = "bokehcam", version, long_version = describe_build(), arg_required_else_help = true, max_term_width = 110)]
#[command(after_help = "\
Examples:
  bokehcam preview
  bokehcam stream 0 --to pipewire --on-demand
  bokehcam stream demo --frames 90 --to out/
  bokehcam render photo.jpg --depth-map depth.png --out portrait.png

Settings come from flags, then the environment (BOKEHCAM_RIM for --rim), then the preset, then the
settings file, then defaults. `bokehcam config dump` shows them all.
Exit code: 0 done, 1 failed, 2 wrong arguments.")]
pub struct Cli {
    #[command(flatten)]
    pub global: options::Global,
    #[command(subcommand)]
    pub command: Command,
}

/// Returns the version, and on a second line the parts that were built in, which scripts/package reads.
fn describe_build() -> String {
    macro_rules! parts {
        ($($part:tt)*) => { [$(($part, cfg!(feature = $part))),*] };
    }
    let parts = parts!["avx512" "camera" "desktop" "gpu" "lab" "networks" "pipewire" "window"];
    let built_in: Vec<&str> = parts.iter().filter(|(_, is_built_in)| *is_built_in).map(|(part, _)| *part).collect();
    let built_in = if built_in.is_empty() { "no parts that can be left out".to_owned() } else { built_in.join(", ") };
    format!("{}\nbuilt with {built_in}", env!("CARGO_PKG_VERSION"))
}

#[derive(Subcommand, Debug)]
pub enum Command {
    #[cfg(feature = "window")]
    Preview(Box<preview::PreviewCommand>),
    Stream(Box<stream::StreamCommand>),
    Render(Box<render::RenderCommand>),
    Depth(Box<depth::DepthCommand>),
    Ctl(ctl::CtlCommand),
    Service(service::ServiceCommand),
    Record(Box<record::RecordCommand>),
    Plate(Box<plate::PlateCommand>),
    #[cfg(feature = "lab")]
    Aperture(aperture::ApertureCommand),
    Bench(Box<bench::BenchCommand>),
    Devices(devices::DevicesCommand),
    Doctor(doctor::DoctorCommand),
    #[cfg(feature = "networks")]
    Models(models::ModelsCommand),
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
    #[command(hide = true)]
    Manual(manual::ManualCommand),
    /// Show the settings
    #[command(subcommand, after_help = "Examples:\n  bokehcam config dump\n  bokehcam config save --rim 0.1")]
    Config(ConfigCommand),
}

#[derive(Subcommand, Debug)]
pub enum ConfigCommand {
    /// Print every setting with its value and origin, as a settings file
    #[command(after_help = "\
Examples:
  bokehcam config dump
  bokehcam config dump --preset cinematic --rim 0.3")]
    Dump {
        /// Settings to print with these values.
        #[command(flatten)]
        every: Box<options::Every>,
    },
    /// Save the settings given as flags in the settings file; its other settings and comments stay
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

/// Commands that need no settings: they read neither the settings file nor the variables of settings, so that a fault in
/// these does not stop them. `save` is that of `config`, which replaces a faulty value.
pub const WITHOUT_SETTINGS: [&str; 8] =
    ["completions", "ctl", "devices", "doctor", "manual", "models", "save", "service"];

/// Whether the command of these matches reads settings.
pub fn reads_settings(matches: &ArgMatches) -> bool {
    matches.subcommand().is_none_or(|(name, inner)| !WITHOUT_SETTINGS.contains(&name) && reads_settings(inner))
}

/// Runs a command.
///
/// # Errors
/// The error of the command.
pub fn run(cli: Cli, matches: &ArgMatches, file: &SettingsFile, layers: &Layers) -> Result<(), CliError> {
    match cli.command {
        #[cfg(feature = "window")]
        Command::Preview(command) => preview::run(&command, &cli.global, layers.given_settings(matches)),
        Command::Stream(command) => stream::run(&command, &cli.global, layers.given_settings(matches)),
        Command::Render(command) => render::run(*command, &cli.global, &layers.given_settings(matches)),
        Command::Depth(command) => depth::run(&command, &cli.global),
        Command::Ctl(command) => ctl::run(command, &cli.global),
        Command::Service(command) => service::run(&command),
        Command::Record(command) => record::run(&command, &cli.global, &layers.given_settings(matches)),
        Command::Plate(command) => plate::run(&command, &cli.global, &layers.given_settings(matches)),
        #[cfg(feature = "lab")]
        Command::Aperture(command) => aperture::run(&command, &cli.global),
        Command::Bench(command) => bench::run(&command, &cli.global, &layers.given_settings(matches)),
        Command::Devices(command) => devices::run(&command, &cli.global),
        Command::Doctor(command) => doctor::run(&command, &cli.global),
        #[cfg(feature = "networks")]
        Command::Models(command) => models::run(&command),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            let presets = completions::preset_names(cli.global.config.as_deref());
            let mut table = completions::add_completions(help::full_help(Cli::command()), &presets);
            clap_complete::generate(shell, &mut table, "bokehcam", &mut script);
            print_to_stdout(&script)
        }
        Command::Manual(command) => manual::run(&command, help::full_help(Cli::command())),
        Command::Config(ConfigCommand::Dump { .. }) => {
            print_to_stdout(dump::to_toml(&layers.resolve_settings(matches), &file.presets).as_bytes())
        }
        Command::Config(ConfigCommand::Save { .. }) => {
            save::save_settings(cli.global.config.as_deref(), &layers.resolve_settings(matches))
        }
    }
}
