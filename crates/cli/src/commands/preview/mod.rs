//! `preview`: shows a source in portrait mode in a window, live.

mod store;

use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;

use clap::Args;

use crate::controlled;
use crate::error::CliError;
use crate::options::window::Window;
use crate::options::{Global, Streaming};
use crate::report;
use crate::settings::file;
use crate::settings::layers::GivenSettings;
use crate::settings::look::RequestedLook;
use crate::settings::unused;
use crate::sinks;
use crate::terminal;
use bokehcam::compute::Backend;
use bokehcam::depth::backdrop::Background;
use bokehcam::link::demand::Demand;
use bokehcam::look::{Effect, Look, Metres};
use bokehcam_files::user_folders::Folders;
use bokehcam_live::control::Name;
use bokehcam_live::pipeline::Pace;
use bokehcam_live::sink::Target;
use bokehcam_live::source::SourceName;
use bokehcam_window::session::SessionConfig;
use bokehcam_window::state::{Output, State};
use bokehcam_window::system::System;
use bokehcam_window::texts;
use bokehcam_window::window::{self, Preview, PreviewOutcome, RemoteConfig, SavedState};

use store::FileStore;

/// Show a camera, a recording or the demonstration live in a window, and adjust the blur
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam preview                          the first camera found, else the demonstration
  bokehcam preview 0 --mirror --to /dev/video10
  bokehcam preview 0,2 --calib stereo.yml
  bokehcam preview somewhere/rgbd --preset cinematic
  bokehcam preview demo --split 0.5 --highlights 12
  bokehcam preview demo --full-screen

In the window, F1 shows all keys. Click to focus there, double-click on something to follow it. K copies the settings as a command.
A recording is played in a loop.")]
pub struct PreviewCommand {
    /// A camera (/dev/videoN, N, a name under /dev/v4l/by-id, or part of its name), two of them as LEFT,RIGHT, a
    /// PipeWire camera (pipewire:NAME), a recording (a folder, .mcap, .r3d or Kinect's .mkv), a photo, `demo` (the
    /// demonstration) or `synthetic` (rendered while it plays) [default: the first camera found, else `demo`]
    source: Option<String>,
    /// Also write to pipewire, pipewire:NAME or /dev/videoN (virtual camera), DIR/ (numbered PNG), FILE.y4m, FILE.mp4, .mkv,
    /// .webm or .mov from the start; may be given more than once
    #[arg(long, value_name = "SINK")]
    to: Vec<Target>,
    /// Name of this run for `bokehcam ctl` [default: preview, or preview-2 and so on]
    #[arg(long, value_name = "NAME")]
    name: Option<Name>,
    #[command(flatten)]
    window: Window,
    #[command(flatten)]
    parts: Streaming,
}

/// Runs the command; `given` serves warnings and the commands that the window composes.
///
/// # Errors
/// Fails if the options conflict, there is no display, or no frame ever arrived.
pub fn run(command: &PreviewCommand, global: &Global, given: GivenSettings) -> Result<(), CliError> {
    let mut parts = command.parts.clone();
    // Choosing a look takes longer than most recordings last.
    parts.frames.repeat = true;
    let source = command.source.as_deref().unwrap_or_default();
    show_source(source, &command.to, &command.window, &parts, (global, given), command.name.as_ref())
}

/// Shows a source in a window, and writes it to `to`. `run_name` is its name for `bokehcam ctl`.
///
/// # Errors
/// See [`run`].
pub fn show_source(
    name: &str,
    to: &[Target],
    window: &Window,
    parts: &Streaming,
    (global, given): (&Global, GivenSettings),
    run_name: Option<&Name>,
) -> Result<(), CliError> {
    let Streaming { frames, stream, output, computing, .. } = parts;
    check_options(parts, to)?;
    if !name.is_empty() {
        let source = SourceName::from_str(name).map_err(|error| error.with_prefix(name))?;
        sinks::check_targets(to, parts, &source)?;
        unused::warn_by_source(&given.settings, source.kind());
    }
    let outputs = list_outputs(to)?;
    report::check_writable(stream.report.as_deref())?;
    let look = initial_look(parts, &given)?;
    // `--fresh` neither reads nor overwrites the remembered state.
    let saved_state_file = file::state_folder().map(|folder| folder.join("window.toml")).filter(|_| !window.fresh);
    let saved_state = saved_state_file.as_deref().and_then(SavedState::read).unwrap_or_default();
    let source = if name.is_empty() { saved_state.restore_source().unwrap_or_default() } else { name.to_owned() };
    set_language(window)?;
    let mut state = initial_state(look, &source, window, stream.mirror, &saved_state);
    state.mirror_chosen = given.stated.iter().any(|name| name == "mirror");
    if !given.has_look() {
        restore_look(&mut state, &saved_state);
    }
    let store = FileStore { chosen: global.config.clone(), given };
    let unused = unused::RunFacts {
        cpu_only: computing.backend == Backend::Cpu,
        realtime: true,
        window: true,
        ..unused::RunFacts::default()
    };
    let command_line = controlled::command_line(global.config.clone(), unused);
    let control = controlled::claim_name(run_name, "preview")?.map(|claim| RemoteConfig { claim, command_line });
    let mut system = System::new(parts.source_options(), state.look.clone(), Box::new(store));
    system.out_size = stream.out_size.map(|size| (size.width, size.height));
    system.force = output.force;
    let device = system.executors.open_device()?;
    let session = configure_session(parts, window, (state.look.clone(), source, outputs), system);
    let close_at_end = frames.frames.is_some() || !frames.repeat;
    let outcome = window::run_preview(Preview {
        state,
        session,
        theme: window.theme,
        device,
        close_at_end,
        saved_state,
        saved_state_file,
        control,
        stop: terminal::stop_flag()?,
    })
    .map_err(|error| CliError::Part(error.into()))?;
    conclude(outcome, close_at_end, stream.report.as_deref(), output.force, global)
}

/// Refuses options that make no sense for a window.
fn check_options(parts: &Streaming, to: &[Target]) -> Result<(), CliError> {
    report::check_path(parts.stream.report.as_deref(), parts.output.force, to)?;
    let refuse = |what: &str| Err(CliError::Usage(what.to_string()));
    if parts.stream.pace == Some(Pace::Asap) {
        return refuse("--pace asap: a window shows frames in their own time; leave --pace out");
    }
    if parts.stream.on_demand {
        return refuse("--on-demand: the window always watches; leave --on-demand out, or use `bokehcam stream`");
    }
    Ok(())
}

/// Returns the outputs beside the window.
fn list_outputs(to: &[Target]) -> Result<Vec<Output>, CliError> {
    let outputs = to.iter().map(|target| match target {
        Target::Null | Target::Stdout | Target::Window => {
            Err(CliError::Usage("--to: beside a window, use a virtual camera, a folder or a file".to_string()))
        }
        target => Ok(Output { name: target.to_string(), is_camera: target.is_camera() }),
    });
    outputs.collect()
}

/// Returns the look of the command line, as if there were depth: the source's is known only once it is open, and the
/// window may open others.
fn initial_look(parts: &Streaming, given: &GivenSettings) -> Result<Look, CliError> {
    let facts = parts.blur.depth.look_facts(true, Metres::Unknown)?;
    let look = RequestedLook::new(&parts.blur, &parts.computing.quality, given)?.fit(None, &facts)?;
    let effect = if look.effect.follows_depth() { Effect::Auto } else { look.effect };
    Ok(Look { effect, ..look })
}

/// Writes and prints the report, also of a preview that failed.
fn conclude(
    outcome: PreviewOutcome,
    closes_at_end: bool,
    report: Option<&Path>,
    force: bool,
    global: &Global,
) -> Result<(), CliError> {
    let written = match (report, &outcome.report) {
        (Some(path), Some(report)) => report::write_report(path, report, force),
        _ => Ok(()),
    };
    outcome.report.iter().for_each(|report| terminal::print_report(report, global));
    match outcome.source_error {
        Some(why) if outcome.report.is_none() || closes_at_end => Err(CliError::NoFrames(why)),
        _ => outcome.output_error.map_or(written, |why| Err(CliError::OutputFailed(why))),
    }
}

/// Shown at the start if the previous session's look is restored.
const RESTORED_LOOK: &str = "This is the look of your last session. R goes back to the usual one.";

fn set_language(window: &Window) -> Result<(), CliError> {
    let texts = texts::load_translation(window.language.as_deref())
        .map_err(|line| CliError::Usage(format!("--language: {line}")))?;
    texts.into_iter().for_each(texts::set_translation);
    Ok(())
}

fn configure_session(
    Streaming { stream, computing, .. }: &Streaming,
    window: &Window,
    (look, source, outputs): (Look, String, Vec<Output>),
    system: System,
) -> SessionConfig {
    SessionConfig {
        services: Box::new(system),
        look,
        source,
        outputs,
        keep_going: stream.keep_going,
        budget_ns: stream.budget_ms.map(|ms| (f64::from(ms) * 1e6) as u64),
        threads: computing.to_compute_options().thread_count(),
        output_request: Arc::default(),
        demand: Demand::default(),
        off: Arc::default(),
        folders: window.save_to.clone().map_or_else(Folders::from_user_dirs, Folders::single),
    }
}

/// Applies the look of the last session, and notes what of it is unknown.
fn restore_look(state: &mut State, saved_state: &SavedState) {
    let mut dropped = Vec::new();
    let restored = saved_state.restore_look(|line| dropped.push(line));
    if let Some(restored) = restored.filter(|look| *look != state.look && look.background != Background::Transparent) {
        state.look = restored;
        state.note(RESTORED_LOOK);
    }
    dropped.into_iter().for_each(|line| state.note(line));
}

/// Returns the initial state of the window.
fn initial_state(look: Look, source: &str, window: &Window, mirror: bool, saved_state: &SavedState) -> State {
    let mut state = State::new(look, source.to_owned());
    state.shown = window.show;
    state.split = window.split;
    state.mirror = mirror;
    state.full_screen = window.full_screen;
    state.panel = window.panel;
    state.preferences = saved_state.preferences.clone();
    window.text_scale.into_iter().for_each(|scale| state.preferences.set_text_scale(scale));
    state.preferences.single_keys = window.single_keys.unwrap_or(state.preferences.single_keys);
    state
}
