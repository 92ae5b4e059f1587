//! `bench --chain`: the cost of a stream's frame on this machine, stage by stage, and the quality it affords.

mod result;

use result::{Chain, Cost, Stage};

use super::BenchCommand;
use crate::error::CliError;
use crate::options;
use crate::settings::layers::GivenSettings;
use crate::settings::look;
use crate::settings::unused;
use crate::terminal::print_to_stdout;
use bokehcam::bokeh::{Bokeh, BokehError, Job};
use bokehcam::budget::Quality;
use bokehcam::capture::{Captured, FrameBuffers};
use bokehcam::clock::{Clock, process_cpu_ns};
use bokehcam::compute::Backend;
use bokehcam::computing::{ComputeOptions, ExecutorFactory};
use bokehcam::depth::FrameInput;
use bokehcam::engine::{CocCalculator, Postprocess};
use bokehcam::frame::{ColorImage, DepthMap, GrayImage, Stamp};
use bokehcam::link::pool::Pooled;
use bokehcam::look::{BackgroundMemory, Look, Strength};
use bokehcam::sink::yuyv::Encoder;
use bokehcam::source::{self, DepthOrigin, Frames, Kind, Source, SourceName};
use bokehcam::stats::EnergyMeter;

/// Unmeasured frames at the start: caches fill, and the background memory builds up.
const WARM_UP_FRAMES: u64 = 8;

/// Measures the chain from source `name`, once per `--threads` value.
///
/// # Errors
/// Fails if the source is unreadable or a camera, or a stage fails.
pub(super) fn run(command: &BenchCommand, name: &SourceName, given: &GivenSettings) -> Result<(), CliError> {
    if !name.device_nodes().is_empty() || matches!(name.kind(), Kind::Camera) {
        let what =
            "--chain: a camera delivers frames only at its own pace; use a recording of it (bokehcam record), or demo";
        return Err(CliError::Usage(what.to_string()));
    }
    for (k, computing) in command.list_configurations().into_iter().enumerate() {
        let chain = measure_chain(command, name, computing, (k == 0).then_some(given))?;
        // Numbers and strings always serialise.
        let text =
            if command.json { serde_json::to_string(&chain).unwrap_or_default() + "\n" } else { chain.format_table() };
        print_to_stdout(text.as_bytes())?;
    }
    Ok(())
}

/// Stopwatch for the steps of a frame on its way through the chain.
struct StepTimer {
    clock: Clock,
    since: [u64; 2],
    steps: Vec<StepTimes>,
    is_recording: bool,
}

/// Times of a step in each frame, in nanoseconds.
struct StepTimes {
    name: &'static str,
    thread: &'static str,
    cpu_ns: Vec<u64>,
    wall_ns: Vec<u64>,
}

impl StepTimer {
    fn now(&self) -> [u64; 2] {
        [process_cpu_ns(), self.clock.now_ns()]
    }

    /// Records the time since the last call, or since [`StepTimer::restart`], as step `name`.
    fn record(&mut self, name: &'static str, thread: &'static str) {
        let [cpu_ns, wall_ns] = self.now();
        if self.is_recording {
            let place = self.steps.iter().position(|step| step.name == name).unwrap_or_else(|| {
                self.steps.push(StepTimes { name, thread, cpu_ns: Vec::new(), wall_ns: Vec::new() });
                self.steps.len() - 1
            });
            let [cpu_before_ns, wall_before_ns] = self.since;
            self.steps[place].cpu_ns.push(cpu_ns - cpu_before_ns);
            self.steps[place].wall_ns.push(wall_ns - wall_before_ns);
        }
        self.restart();
    }

    fn restart(&mut self) {
        self.since = self.now();
    }

    fn take_costs(&mut self) -> Vec<Stage> {
        let median_ms = |times_ns: &mut Vec<u64>| {
            times_ns.sort_unstable();
            times_ns[times_ns.len() / 2] as f64 / 1e6
        };
        let cost =
            |step: &mut StepTimes| Cost { cpu_ms: median_ms(&mut step.cpu_ns), wall_ms: median_ms(&mut step.wall_ns) };
        self.steps.iter_mut().map(|step| Stage { name: step.name, thread: step.thread, cost: cost(step) }).collect()
    }
}

fn measure_chain(
    command: &BenchCommand,
    name: &SourceName,
    computing: ComputeOptions,
    given: Option<&GivenSettings>,
) -> Result<Chain, CliError> {
    let look = look::build_look(&command.blur, &options::LookSettings::default())?;
    let wanted = command.frames.unwrap_or(super::FRAMES);
    let frames = WARM_UP_FRAMES + u64::from(wanted);
    let options = source::Options {
        // The demonstration and the synthetic scene are endless.
        frames: Frames {
            repeat: !matches!(name.kind(), Kind::Demo | Kind::Synthetic),
            frames: Some(frames),
            ..Frames::default()
        },
        depth: command.depth.clone(),
        depth_choice: command.blur.depth.clone(),
        computing: computing.clone(),
        ..source::Options::default()
    };
    let mut source = Source::open(name, &options, Some(&look))?;
    let look = source.adapt_look(&look, &options)?;
    if let Some(given) = given {
        warn_of_unused(command, name, &source, &look, given);
    }
    let info = source.camera.info();
    let size = info.size;
    let levels = if command.quality.is_empty() { &Quality::ALL[..] } else { &command.quality };
    // The levels share one device, as in a stream that changes its quality.
    let mut shared_device = ExecutorFactory::new(computing.clone());
    let mut executors: Vec<(Quality, Box<dyn Bokeh>)> = Vec::new();
    for &quality in levels {
        let look = Look { quality: Some(quality), ..look.clone() };
        let Some(settings) = look.blur_settings(size, false) else {
            let what = "--effect none leaves nothing to measure: use dof, tilt-shift or blur";
            return Err(CliError::Usage(what.to_string()));
        };
        executors.push((quality, shared_device.create_blur(&settings, size)?));
    }
    let executor = executors.first().map(|(_, executor)| executor.describe()).unwrap_or_default();

    let measured = source.is_measured();
    let coc = CocCalculator::new(look.coc_rule(size), Postprocess::for_measured(look.refines_depth(measured)));
    let mut coc = coc.with_threads(computing.thread_count());
    coc.use_device(executors.first().and_then(|(_, executor)| executor.device()));
    let knows_background = source.depth.as_ref().is_some_and(|source| source.knows_background());
    coc.set_background_memory(look.background_memory == BackgroundMemory::On && !knows_background);
    let mut timer = StepTimer { clock: Clock::system(), since: [0; 2], steps: Vec::new(), is_recording: false };
    let mut buffers = Buffers {
        color: Pooled::detached(ColorImage::new(size.0, size.1)),
        depth: Pooled::detached(DepthMap::default()),
        right: GrayImage::default(),
        out: Pooled::detached(ColorImage::new(size.0, size.1)),
        encoder: Encoder::new(),
        yuyv: vec![0; size.0 as usize * size.1 as usize / 2 * 4],
    };
    let mut energy = EnergyMeter::start();
    for frame in 0..frames {
        if frame == WARM_UP_FRAMES {
            (timer.is_recording, energy) = (true, EnergyMeter::start());
        }
        if !buffers.process_frame(&mut source, &mut coc, &mut executors, &mut timer)? {
            break;
        }
    }
    if timer.steps.is_empty() {
        return Err(CliError::Usage(format!("--chain: {name} has too few frames to measure")));
    }
    let energy_mj = energy.joules().map(|joules| 1e3 * joules / f64::from(wanted));
    Ok(Chain::new((info.name, size, executor, wanted), timer.take_costs(), energy_mj))
}

/// Buffers of one frame, reused for the next.
struct Buffers {
    color: Pooled<ColorImage>,
    depth: Pooled<DepthMap>,
    right: GrayImage,
    out: Pooled<ColorImage>,
    encoder: Encoder,
    yuyv: Vec<u8>,
}

impl Buffers {
    /// Runs one frame through the chain and blurs it at every level. Returns `false` at the end of the source.
    fn process_frame(
        &mut self,
        source: &mut Source,
        coc: &mut CocCalculator,
        executors: &mut [(Quality, Box<dyn Bokeh>)],
        timer: &mut StepTimer,
    ) -> Result<bool, CliError> {
        timer.restart();
        let shot = FrameBuffers { color: &mut self.color, depth: &mut self.depth, right: &mut self.right };
        let stamp = match source.camera.next(shot)? {
            Captured::Frame(stamp) => stamp,
            Captured::Corrupt(error) => return Err(error.into()),
            Captured::End => return Ok(false),
            Captured::Lost(..) | Captured::Waiting => return Ok(true),
        };
        timer.record("decode", "capture");
        let field = match coc.fixed_coc() {
            Some(field) => field,
            None => {
                if source.depth.is_some() {
                    self.read_depth(source, stamp)?;
                    timer.record("read depth", "depth");
                }
                coc.compute_with_steps(&mut self.depth, &self.color, stamp.time_ns, |step| timer.record(step, "depth"))
            }
        };
        for (quality, executor) in executors {
            let take_buffer =
                |buffer: &mut Pooled<ColorImage>| std::mem::replace(buffer, Pooled::detached(ColorImage::default()));
            // The job owns its buffers; they come back with the result.
            let (color, out) = (take_buffer(&mut self.color), take_buffer(&mut self.out));
            let depth = std::mem::replace(&mut self.depth, Pooled::detached(DepthMap::default()));
            let depth = coc.fixed_coc().is_none().then_some(depth);
            timer.restart();
            executor.submit(Job { quality: *quality, out, ..Job::new(color, depth, field) })?;
            let finished = executor.collect(true)?.ok_or(BokehError::Lost)?;
            timer.record(quality.name(), "blur");
            self.color = finished.color;
            self.depth = finished.depth.unwrap_or(Pooled::detached(DepthMap::default()));
            self.out = finished.picture.into_memory().ok_or(BokehError::Lost)?;
        }
        timer.restart();
        self.encoder.encode(&self.out, &mut self.yuyv);
        timer.record("encode", "sink");
        Ok(true)
    }

    fn read_depth(&mut self, source: &mut Source, stamp: Stamp) -> Result<(), CliError> {
        let Some(depth) = &mut source.depth else { return Ok(()) };
        depth.rectify(&mut self.color);
        let right = Some(&self.right).filter(|right| right.width > 0);
        depth.read(FrameInput { stamp, color: &self.color, right }, &mut self.depth)?;
        Ok(())
    }
}

fn warn_of_unused(command: &BenchCommand, name: &SourceName, source: &Source, look: &Look, given: &GivenSettings) {
    unused::warn_of_unused(
        &given.settings,
        &unused::RunFacts {
            source: unused::FrameOrigin::Source(name.kind()),
            depth: if source.has_depth() { source.depth_from } else { DepthOrigin::Nothing },
            uses_depth: look.effect.follows_depth(),
            effect: look.effect,
            lens: matches!(look.strength, Strength::Lens(_)),
            cpu_only: command.backend == Backend::Cpu,
            ..unused::RunFacts::default()
        },
    );
}
