//! `stream`: blurs a source into one or more sinks.

mod control;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Args;

use control::{ControlServer, LookChanger, RunInfo, RunStats};

use crate::controlled;
use crate::error::CliError;
use crate::files::warn_of_leftovers;
use crate::focus;
use crate::log;
use crate::options;
use crate::report;
use crate::settings::file::SettingsFile;
use crate::settings::layers::GivenSettings;
use crate::settings::look::RequestedLook;
use crate::settings::unused;
use crate::sinks;
use crate::terminal;
use bokehcam::clock::Clock;
use bokehcam::compute::Backend;
use bokehcam::computing::ExecutorFactory;
use bokehcam::depth::backdrop::Background;
use bokehcam::depth::focus::FocusRule;
use bokehcam::link::demand::Demand;
use bokehcam::look::{Look, LookFacts};
use bokehcam_live::capture::SourceInfo;
use bokehcam_live::control::{Claim, Name, Status};
use bokehcam_live::pipeline::{self, BlurSetup, Destination, Pace, PipelineError, Run};
use bokehcam_live::sink::{self, Backpressure, Shutter, ShutterControl, Sink, Target};
use bokehcam_live::source::{self, DepthOrigin, Source, SourceName};
use bokehcam_live::stats::Report;

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
  bokehcam stream somewhere/clip.mp4 --to blurred.mp4
  bokehcam stream demo --frames 90 --to out.mp4 --aperture polygon:6 --focus 1.2
  bokehcam stream demo --to - --quiet --pace realtime | ffplay -
  bokehcam stream synthetic --frames 90 --pace realtime --to null --report report.json")]
pub struct StreamCommand {
    /// A camera (/dev/videoN, N, a name under /dev/v4l/by-id, or part of its name), two of them as LEFT,RIGHT, a
    /// PipeWire camera (pipewire:NAME), a recording (a folder, .mcap, .r3d or Kinect's .mkv), a video (FILE.mp4
    /// and others, by ffmpeg), a photo, - (y4m on standard input), `demo` (the demonstration) or `synthetic` (a scene,
    /// rendered frame by frame)
    #[arg(value_parser = options::source_name_parser())]
    source: SourceName,
    #[arg(long, value_name = "SINK", required = true, help = TO)]
    to: Vec<Target>,
    /// Name of this run for `bokehcam ctl` [default: stream, or stream-2 and so on]
    #[arg(long, value_name = "NAME")]
    name: Option<Name>,
    /// Show an icon in the desktop's tray that switches the camera off and on, and listen on the session's message bus
    #[arg(long)]
    tray: bool,
    #[command(flatten)]
    parts: options::Streaming,
    #[cfg(feature = "window")]
    #[command(flatten)]
    window: options::window::Window,
}

const TO: &str = "pipewire, pipewire:NAME or /dev/videoN (virtual camera), filter (all readers of the source, \
                  pipewire:NAME), window, DIR/ (numbered PNG), FILE.y4m, - (y4m on standard output), FILE.mp4, .mkv, \
                  .webm or .mov (ffmpeg), or null; may be given more than once";
/// Runs the command; `given` serves warnings and the window. The report is written whenever the pipeline ran, even if
/// it failed.
///
/// # Errors
/// Fails if the options do not fit the source, an output exists, or a stage of the pipeline fails.
pub fn run(command: &StreamCommand, global: &options::Global, given: GivenSettings) -> Result<(), CliError> {
    let StreamCommand { parts, .. } = command;
    sinks::check_targets(&command.to, parts, &command.source)?;
    #[cfg(feature = "window")]
    if command.to.contains(&Target::Window) {
        let others: Vec<Target> = command.to.iter().filter(|target| **target != Target::Window).cloned().collect();
        return crate::commands::preview::show_source(
            &command.source.to_string(),
            &others,
            &command.window,
            parts,
            (global, given),
            command.name.as_ref(),
        );
    }
    let options::Streaming { stream, output, .. } = parts;
    report::check_path(stream.report.as_deref(), output.force, &command.to)?;
    if stream.pace == Some(Pace::Asap) && !command.source.device_nodes().is_empty() {
        let what = "--pace asap: a camera delivers frames at its own pace; leave --pace out";
        return Err(CliError::Usage(what.to_string()));
    }
    let claim = controlled::claim_name(command.name.as_ref(), "stream")?;
    let opened = Opened::open(command, &given)?;
    run_stream(command, global, opened, claim)
}

/// An opened source, and settings derived from it.
struct Opened {
    source: Source,
    options: source::Options,
    info: SourceInfo,
    /// The look, limited to the source's abilities.
    look: Look,
    /// What later looks may be.
    facts: LookFacts,
    pace: Pace,
    /// Facts for warnings about settings without effect.
    unused: unused::RunFacts,
}

impl Opened {
    /// Opens the source, and warns of settings without effect on it.
    fn open(command: &StreamCommand, given: &GivenSettings) -> Result<Self, CliError> {
        let StreamCommand { parts, to, .. } = command;
        let requested = RequestedLook::new(&parts.blur, &parts.computing.quality, given)?;
        let options = source::Options { filters: command.is_filter(), ..parts.source_options() };
        let source = Source::open(&command.source, &options, Some(&requested.for_opening()))?;
        let info = source.camera.info();
        let is_live = info.live || to.iter().any(Target::is_live);
        let pace = parts.stream.pace.unwrap_or(if is_live { Pace::Realtime } else { Pace::Asap });
        let (keeps_alpha, is_for_call) = (to.iter().all(Target::keeps_alpha), to.iter().any(Target::is_camera));
        let facts = LookFacts { keeps_alpha, is_for_call, ..source.look_facts(&options)? };
        let look = requested.fit(source.findings.focus, &facts)?;
        focus::note_place(&requested.look, &look);
        // Outputs have an alpha channel only if they are opened for it.
        let facts = LookFacts { keeps_alpha: look.background == Background::Transparent, ..facts };
        let unused = unused::RunFacts {
            realtime: pace == Pace::Realtime,
            cpu_only: parts.computing.backend == Backend::Cpu,
            compresses: to.iter().any(|target| matches!(target, Target::Video(_))),
            ..unused::RunFacts::default()
        };
        let origin = unused::FrameOrigin::Source(command.source.kind());
        unused::warn_of_unused(&given.settings, &unused.for_look(origin, source.depth_from, &look));
        source.findings.notes.iter().for_each(|note| log::note(note));
        if let Some(map) = source.first_depth.as_ref() {
            focus::warn_of_distances(&look, info.size, map, source.depth_from, options.depth.depth_scale);
        }
        Ok(Self { source, options, info, look, facts, pace, unused })
    }

    /// Whether the quality adapts to the available time.
    fn is_adaptive(&self) -> bool {
        self.pace == Pace::Realtime
    }
}

impl StreamCommand {
    /// Whether the stream filters a shared camera: then the camera is open only while others read it.
    fn is_filter(&self) -> bool {
        self.to.contains(&Target::Filter)
    }

    /// Opens the outputs. `demand` counts their watchers, `stop` ends them, and `closed` keeps pictures from them.
    fn open_outputs(
        &self,
        opened: &Opened,
        demand: Option<&Demand>,
        stop: &Arc<AtomicBool>,
        closed: &Arc<AtomicBool>,
    ) -> Result<Box<dyn Sink>, CliError> {
        let options::Streaming { stream, output, .. } = &self.parts;
        let Opened { info, options, pace, .. } = opened;
        let sink_options = sink::Options {
            force: output.force,
            out_size: stream.out_size.map(|size| (size.width, size.height)),
            threads: options.computing.threads,
            alpha: opened.facts.keeps_alpha,
            demand: demand.cloned(),
            filter_target: self.source.pipewire_name().map(str::to_owned),
            sound: sinks::find_sound(&self.to, &self.source, &self.parts.frames)?,
            stop: Arc::clone(stop),
            ..sink::Options::new(info.size, info.period_ns)
        };
        let backpressure = if *pace == Pace::Realtime { Backpressure::DropOldest } else { Backpressure::Block };
        let sink = sinks::open_targets(&self.to, &sink_options, backpressure, closed)?;
        // The outputs have cleaned up their own leftovers by now.
        warn_of_leftovers(self.to.iter().filter(|target| !target.is_camera()).filter_map(Target::path));
        Ok(sink)
    }

    /// Prints the source, the origin of its depth, and the outputs.
    fn announce(&self, Opened { source, info, look, .. }: &Opened, to: &str, quiet: bool) {
        let print_line = |line: &str| (!quiet).then(|| terminal::print_to_stderr(line));
        if let Some(networks) = &source.networks {
            print_line(&format!("depth by {networks}"));
        }
        let is_found = look.effect.follows_depth() && look.focus == FocusRule::Auto;
        if let Some(persons) = source.persons.as_ref().filter(|_| is_found) {
            print_line(&format!("focus on people found by {persons}"));
        }
        let takes_any_depth = self.parts.blur.accepts_any_depth();
        // The source's note on its depth map is irrelevant if no depth is wanted.
        if let Some(note) = self.source.describe_photo(source).filter(|_| source.has_depth() || takes_any_depth) {
            print_line(&note);
        }
        print_line(&format!("{}, to {to}{}", info.name, if info.live { "; Ctrl-C ends" } else { "" }));
        if takes_any_depth && !source.has_depth() {
            unused::warn_of_no_depth(unused::FrameOrigin::Source(self.source.kind()));
        }
    }

    /// Starts the control server, if the run could claim its name; otherwise logs the reason where control is likely
    /// wanted.
    fn serve_control(
        &self,
        claim: Result<Claim, String>,
        opened: &Opened,
        (demand, shutter, stats): (Option<Demand>, ShutterControl, Arc<RunStats>),
        looks: LookChanger,
        config: Option<&Path>,
    ) -> Result<Option<ControlServer>, CliError> {
        let Opened { source, info, facts, unused, .. } = opened;
        let claim = match claim {
            Ok(claim) => claim,
            Err(why) => {
                let is_live = info.live || self.to.iter().any(Target::is_live);
                if is_live || opened.is_adaptive() || self.name.is_some() {
                    tracing::warn!("{why}");
                }
                return Ok(None);
            }
        };
        let run = RunInfo {
            status: Status {
                source: self.source.to_string(),
                size: Some(info.size),
                sinks: self.to.iter().map(Target::to_string).collect(),
                ..Status::default()
            },
            facts: *facts,
            kind: self.source.kind(),
            depth_from: if facts.has_depth { source.depth_from } else { DepthOrigin::Nothing },
            demand,
            shutter,
            stats,
        };
        let command_line = controlled::command_line(config.map(Path::to_owned), *unused);
        let tray = self.tray.then(|| SettingsFile::load(config)).transpose()?;
        control::serve(claim, run, looks, command_line, tray.map(|file| file.preset_names())).map(Some)
    }
}

/// Runs the opened source into the outputs, with the control server.
fn run_stream(
    command: &StreamCommand,
    global: &options::Global,
    opened: Opened,
    claim: Result<Claim, String>,
) -> Result<(), CliError> {
    let options::Streaming { stream, output, .. } = &command.parts;
    let (info, computing) = (opened.info.clone(), opened.options.computing.clone());
    pipeline::check_memory(info.size, info.frames)?;
    let adaptive = opened.is_adaptive();
    // Executors for later looks run on the same device.
    let mut executors = ExecutorFactory::new(computing.clone());
    let create_blur = |settings: &_| executors.create_blur(settings, info.size);
    let (blurring, changes) = BlurSetup::create(opened.look.clone(), (info.size, adaptive), create_blur)?;
    // Outputs are opened last: none is begun if the run cannot start.
    let demand = Demand::new();
    let on_demand = stream.on_demand || command.is_filter();
    // Without `--on-demand`, the run counts as watched all the time.
    let _watch = (!on_demand).then(|| demand.watch());
    let watchers = on_demand.then(|| demand.clone());
    let stop = terminal::stop_flag()?;
    report::check_writable(stream.report.as_deref())?;
    let closed = Arc::default();
    let sink = command.open_outputs(&opened, watchers.as_ref(), &stop, &closed)?;
    command.announce(&opened, &sink.describe(), global.quiet);
    let guidance = terminal::Guidance::new(opened.source.guide.clone(), global);
    let bar = terminal::Progress::new(info.frames, global);
    let period = Duration::from_nanos(info.period_ns);
    let (sink, shutter) = Shutter::new(sink, info.size, period, demand.clone(), Clock::system(), closed);
    let stats = Arc::new(RunStats::default());
    let looks = LookChanger { look: opened.look.clone(), changes, executors };
    let shared_state = (watchers, shutter, Arc::clone(&stats));
    let server = command.serve_control(claim, &opened, shared_state, looks, global.config.as_deref())?;
    let pace = opened.pace;
    let run = opened.source.into_run(blurring, Destination::Owned(Box::new(sink)), &stop);
    let ended = pipeline::run(Run {
        threads: computing.thread_count(),
        changes: run.changes.filter(|_| server.is_some()),
        pace,
        budget_ns: stream.budget_ms.map_or(info.period_ns, |ms| (f64::from(ms) * 1e6) as u64),
        keep_going: stream.keep_going,
        demand: Some(demand),
        mirror: stream.mirror,
        progress: &|progress| {
            bar.set_delivered(progress.delivered);
            stats.record(&progress);
            guidance.print_step();
        },
        ..run
    });
    drop((server, bar));
    finish_run(ended, stream.report.as_deref(), output.force, global)
}

/// Writes and prints the report.
///
/// # Errors
/// Fails if the run failed or its report cannot be written.
fn finish_run(
    ended: Result<Report, PipelineError>,
    path: Option<&Path>,
    force: bool,
    global: &options::Global,
) -> Result<(), CliError> {
    let (report, ended) = match ended {
        Ok(report) => (Box::new(report), Ok(())),
        Err(failed) => (failed.report, Err(failed.fault.into())),
    };
    let written = path.map_or(Ok(()), |path| report::write_report(path, &report, force));
    terminal::print_report(&report, global);
    match (ended, written) {
        // The run's own error takes precedence.
        (Err(ended), Err(unwritten)) => {
            terminal::print_to_stderr(&format!("the report was not written: {unwritten}"));
            Err(ended)
        }
        (ended, written) => ended.and(written),
    }
}
