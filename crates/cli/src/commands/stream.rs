//! `stream`: a source, blurred, into a sink.

mod control;

use std::sync::Arc;
use std::time::Duration;

use clap::Args;

use control::{Beat, Facts, Looks};

#[cfg(feature = "window")]
use crate::commands::preview;
use crate::controlled;
use crate::error::CliError;
use crate::files::tell_of_leftovers;
use crate::focus;
use crate::options;
use crate::plausible;
use crate::report;
use crate::settings::file::SettingsFile;
use crate::settings::layers::Given;
use crate::settings::look;
use crate::settings::unused;
use crate::sinks;
use crate::terminal;
use bokehcam::clock::Clock;
use bokehcam::compute::Backend;
use bokehcam::computing::Executors;
use bokehcam::control::{Name, Status};
use bokehcam::depth::focus::FocusRule;
use bokehcam::link::demand::Demand;
use bokehcam::look::Strength;
use bokehcam::pipeline::{self, Changes, Pace, Run};
use bokehcam::sink::{self, Backpressure, Shutter, Target};
use bokehcam::source::{self, DepthChoice, DepthFrom, Source, SourceName};

/// Blur a camera, a recording, the demonstration or the synthetic scene, frame by frame
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam stream /dev/video0 --to /dev/video10
  bokehcam stream 0 --to pipewire --on-demand
  bokehcam stream pipewire:C920 --to filter
  bokehcam stream C920 --size 1920x1080 --fps 30 --control exposure_dynamic_framerate=0 --to /dev/video10
  bokehcam stream 0,2 --calib stereo.yml --to /dev/video10
  bokehcam stream /dev/video4 --side-by-side --rectified --to /dev/video10
  bokehcam stream demo --frames 90 --to out/
  bokehcam stream demo --frames 90 --to out.mp4 --aperture polygon:6 --focus 1.2
  bokehcam stream demo --to - --quiet --pace realtime | ffplay -
  bokehcam stream somewhere/rgbd --loop --to /dev/video10 --out-size 1280x720
  bokehcam stream somewhere/rgbd --depth-scale 1000 --loop --frames 500 --to out.mkv
  bokehcam stream synthetic --frames 90 --pace realtime --to null --report report.json")]
pub struct StreamCommand {
    /// A camera (/dev/videoN, N, a name under /dev/v4l/by-id, or part of what it is called), two of them as LEFT,RIGHT, a
    /// camera of PipeWire's (pipewire:NAME), a folder with a recording, a photo (PNG or JPEG), `demo` (the demonstration) or
    /// `synthetic` (a scene, rendered frame by frame)
    #[arg(value_parser = options::source_name())]
    source: SourceName,
    #[arg(long, value_name = "SINK", required = true, help = TO)]
    to: Vec<Target>,
    /// What `bokehcam ctl` knows this run by [default: stream, or stream-2 and so on]
    #[arg(long, value_name = "NAME")]
    name: Option<Name>,
    /// Show an icon in the desktop's tray that switches off and on, and listen on the session's message bus
    #[arg(long)]
    tray: bool,
    #[command(flatten)]
    parts: options::Streaming,
    #[cfg(feature = "window")]
    #[command(flatten)]
    window: options::Window,
}

#[cfg(feature = "window")]
const TO: &str = "pipewire, pipewire:NAME or /dev/videoN (virtual camera), filter (all who ask for the source, pipewire:NAME), \
                  window, DIR/ (numbered PNG), FILE.y4m, - (y4m on standard output), FILE.mp4, .mkv or .webm (ffmpeg), or \
                  null; may be given more than once";
#[cfg(not(feature = "window"))]
const TO: &str = "pipewire, pipewire:NAME or /dev/videoN (virtual camera), filter (all who ask for the source, pipewire:NAME), \
                  DIR/ (numbered PNG), FILE.y4m, - (y4m on standard output), FILE.mp4, .mkv or .webm (ffmpeg), or null; may \
                  be given more than once";

/// Runs the command; `given` is for warnings and for the window. The report is written whenever the pipeline ran,
/// however it ended.
///
/// # Errors
/// The options do not fit the source, something would be overwritten, or a stage of the pipeline failed.
pub fn run(command: &StreamCommand, global: &options::Global, given: Given) -> Result<(), CliError> {
    let StreamCommand { parts, .. } = command;
    let options::Streaming { stream, output, .. } = parts;
    sinks::check(&command.to, parts, &command.source)?;
    #[cfg(feature = "window")]
    if command.to.contains(&Target::Window) {
        let others: Vec<Target> = command.to.iter().filter(|target| **target != Target::Window).cloned().collect();
        return preview::show(
            &command.source.to_string(),
            &others,
            &command.window,
            parts,
            (global, given),
            command.name.as_ref(),
        );
    }
    report::check(stream.report.as_deref(), output.force, &command.to)?;
    if stream.pace == Some(Pace::Asap) && !command.source.devices().is_empty() {
        let what = "--pace asap: a camera gives its frames when it takes them; leave --pace out";
        return Err(CliError::Usage(what.to_string()));
    }
    let claim = controlled::claim(command.name.as_ref(), "stream")?;
    let look = look::look(&parts.blur, &parts.computing.quality)?;
    // Others have the camera while it is open, so that it opens with them alone.
    let filters = command.to.contains(&Target::Filter);
    let on_demand = stream.on_demand || filters;
    let options = source::Options { filters, ..parts.source_options() };
    let source = Source::open(&command.source, &options, Some(&look))?;
    let info = source.camera.info();
    let measured = source.is_measured();
    let has_depth = source.has_depth() && options.depth_choice != DepthChoice::None;
    let is_live = info.live || command.to.iter().any(Target::is_live);
    let pace = stream.pace.unwrap_or(if is_live { Pace::Realtime } else { Pace::Asap });
    let look = source.fitting_look(&look, &options)?;
    let adaptive = pace == Pace::Realtime;
    let unused = unused::Run {
        source: unused::From::Source(command.source.kind()),
        depth: source.depth_from,
        uses_depth: look.effect.follows_depth(),
        effect: look.effect,
        lens: matches!(look.strength, Strength::Lens(_)),
        realtime: adaptive,
        cpu_only: parts.computing.backend == Backend::Cpu,
        compresses: command.to.iter().any(|target| matches!(target, Target::Video(_))),
        window: false,
    };
    unused::warn(&given.settings, &unused);
    if !plausible::warn_of_source(&source, &look, &options)
        && let Some(map) = source.first_depth.as_ref()
    {
        focus::warn_of_focus(&look, info.size, map, source.depth_from == DepthFrom::Units);
    }
    let settings = look.settings(info.size, adaptive);
    pipeline::check_room(info.size, info.frames)?;
    // What a change of the look needs runs on the same device.
    let mut executors = Executors::new(options.computing.clone());
    let bokeh = settings.map(|settings| executors.blur(&settings, info.size)).transpose()?;
    // Outputs are opened last, so that none is begun where the run cannot start.
    let demand = Demand::new();
    // Where nobody notices who watches, somebody may at any time.
    let _watch = (!on_demand).then(|| demand.watch());
    let noticed = on_demand.then(|| demand.clone());
    let stop = terminal::stop_flag()?;
    let sink_options = sink::Options {
        frames: info.frames,
        force: output.force,
        out_size: stream.out_size.map(|size| (size.width, size.height)),
        threads: options.computing.threads,
        demand: noticed.clone(),
        stands_for: command.source.shared().map(str::to_owned),
        stop: Arc::clone(&stop),
        ..sink::Options::new(info.size, info.period_ns)
    };
    report::try_out(stream.report.as_deref())?;
    let backpressure = if pace == Pace::Realtime { Backpressure::DropOldest } else { Backpressure::Block };
    let closed = Arc::default();
    let sink = sinks::open(&command.to, &sink_options, backpressure, &closed)?;
    // By now the outputs have what was left of them.
    tell_of_leftovers(command.to.iter().filter(|target| !target.is_camera()).filter_map(Target::path));

    if let Some(networks) = source.networks.as_ref().filter(|_| !global.quiet) {
        terminal::say(&format!("depth by {networks}"));
    }
    let is_found = look.effect.follows_depth() && look.focus == FocusRule::Auto;
    if let Some(persons) = source.persons.as_ref().filter(|_| is_found && !global.quiet) {
        terminal::say(&format!("focus on persons by {persons}"));
    }
    // That a map would be taken is no news to who wants none.
    let is_wanted = source.has_depth() || parts.blur.takes_whatever_depth();
    if let Some(note) = command.source.note(&source).filter(|_| is_wanted && !global.quiet) {
        terminal::say(&note);
    }
    if !global.quiet {
        let ends = if info.live { "; Ctrl-C ends" } else { "" };
        terminal::say(&format!("{}, to {}{ends}", info.name, sink.describe()));
    }
    if parts.blur.takes_whatever_depth() && !source.has_depth() {
        unused::warn_of_no_depth(unused::From::Source(command.source.kind()));
    }
    let guidance = terminal::Guidance::new(source.guide, global);
    let bar = terminal::Progress::new(info.frames, global);
    let period = Duration::from_nanos(info.period_ns);
    let (sink, release) = Shutter::new(sink, info.size, period, demand.clone(), Clock::system(), closed);
    let (changes, to_come) = Changes::new(look.clone(), info.size, adaptive);
    if let Some(why) = claim.as_ref().err().filter(|_| is_live || adaptive || command.name.is_some()) {
        tracing::warn!("{why}");
    }
    let beat = Arc::new(Beat::default());
    let facts = |name: &Name| Facts {
        status: Status {
            name: name.to_string(),
            pid: std::process::id(),
            command: "stream".into(),
            source: command.source.to_string(),
            size: Some(info.size),
            sinks: command.to.iter().map(Target::to_string).collect(),
            ..Status::default()
        },
        size: info.size,
        depth_choice: options.depth_choice.clone(),
        has_depth,
        unused,
        config: global.config.clone(),
        demand: noticed,
        release,
        beat: Arc::clone(&beat),
    };
    let looks = Looks { look: look.clone(), adaptive, changes, executors };
    let tray = command.tray.then(|| SettingsFile::load(global.config.as_deref())).transpose()?;
    let tray = tray.map(|file| file.preset_names());
    let server = claim.ok().map(|claim| control::serve(claim, facts, looks, tray)).transpose()?;
    let ended = pipeline::run(Run {
        camera: source.camera,
        depth: source.depth,
        bokeh,
        look,
        adaptive,
        measured,
        threads: options.computing.threads(),
        changes: server.is_some().then_some(to_come),
        sink: Box::new(sink),
        pace,
        budget_ns: stream.budget_ms.map_or(info.period_ns, |ms| (f64::from(ms) * 1e6) as u64),
        keep_going: stream.keep_going,
        demand: Some(demand),
        mirror: stream.mirror,
        wanted: None,
        view: None,
        clock: Clock::system(),
        stop: &stop,
        progress: &|progress| {
            bar.delivered(progress.delivered);
            beat.note(&progress);
            guidance.tell();
        },
    });
    drop((server, bar));
    let (report, ended) = match ended {
        Ok(report) => (Box::new(report), Ok(())),
        Err(failed) => (failed.report, Err(failed.fault.into())),
    };
    let written = stream.report.as_ref().map_or(Ok(()), |path| report::write(path, &report, output.force));
    terminal::say_report(&report, global);
    match (ended, written) {
        // What ended the run is the error to tell.
        (Err(ended), Err(unwritten)) => {
            terminal::say(&format!("the report is not written: {unwritten}"));
            Err(ended)
        }
        (ended, written) => ended.and(written),
    }
}
