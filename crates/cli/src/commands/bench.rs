//! `bench`: measures the blur on this machine.

#[cfg_attr(not(feature = "lab"), path = "bench/demo_picture.rs")]
mod picture;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use clap::Args;
use serde::Serialize;

use crate::error::CliError;
use crate::log;
use crate::options;
use crate::settings::layers::GivenSettings;
use crate::settings::look;
use crate::settings::unused;
use crate::terminal::{Progress, print_to_stdout};
use bokehcam::bokeh::{Bokeh, BokehError, Job, PassTimes};
use bokehcam::budget::Quality;
use bokehcam::compute::Backend;
use bokehcam::computing::ComputeOptions;
use bokehcam::engine::still::{Depth, compute_coc_and_depth};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::link::pool::Pool;
use bokehcam::look::number::{in_range_parser, parse_count, whole_number_parser};
use bokehcam::look::{COC_AT_INFINITY_PER_HEIGHT, Change, Look, LookFacts, MAX_RADIUS_PX, Metres, Strength};
use bokehcam::optics::CocField;
use bokehcam_live::source::{DepthChoice, DepthOrigin, Size};

/// Frames measured by default, if the time limit allows.
const FRAMES: u32 = 20;
const MIN_FRAMES: usize = 5;
const TIME_LIMIT: Duration = Duration::from_secs(2);
/// Unmeasured frames at the start: caches fill, and the processor's clock rises.
const WARM_UP_FRAMES: usize = 2;

/// Column titles of the table.
const HEADING: &str = "size        coc px  quality    p50 ms   p95 ms   max ms     fps  executor\n";

/// Measure the blur on this machine, without reading or writing files
///
/// Blurs one picture repeatedly, one frame at a time, for every combination of the given lists. Times are per frame, in
/// milliseconds, from submission to result.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  bokehcam bench
  bokehcam bench --sizes 1280x720 --quality draft,balanced,best --threads 1,2,4
  bokehcam bench --sizes 1920x1080 --coc 10,20,40 --frames 100 --json > bench.jsonl")]
pub struct BenchCommand {
    /// Picture sizes
    #[arg(long, value_name = "WxH", value_delimiter = ',', default_value = "640x480,1280x720,1920x1080")]
    sizes: Vec<Size>,
    /// Blur radii at infinity, in pixels [default: height / 45]
    #[arg(long, value_name = "PX", value_delimiter = ',', value_parser = in_range_parser(0.0..=MAX_RADIUS_PX))]
    coc: Vec<f32>,
    /// Quality levels [default: balanced]
    #[arg(id = "benched_quality", long = "quality", value_name = "LEVELS", value_delimiter = ',',
          value_parser = options::named_value_parser::<Quality>())]
    quality: Vec<Quality>,
    /// Numbers of threads of the CPU backend [default: one per core]
    #[arg(id = "benched_threads", long = "threads", value_name = "N", value_delimiter = ',',
          value_parser = whole_number_parser(1..=1024_u16))]
    threads: Vec<u16>,
    /// Content of the picture
    #[arg(long, value_parser = options::named_value_parser::<picture::Scene>(), value_name = "WHICH", default_value_t)]
    scene: picture::Scene,
    /// Frames to measure [default: 20, or fewer if they would take more than 2 s]
    #[arg(id = "benched_frames", long = "frames", value_name = "N", value_parser = parse_count::<u32>)]
    frames: Option<u32>,
    /// Let frames arrive at this rate, as in a live stream, instead of one after another: threads sleep in between
    #[arg(id = "benched_fps", long = "fps", value_name = "N", value_parser = in_range_parser(1.0..=1000.0))]
    fps: Option<f32>,
    /// Where the blur runs
    #[arg(long, value_parser = options::named_value_parser::<Backend>(), value_name = "WHICH", default_value = "auto")]
    backend: Backend,
    /// GPU to use, by a part of its name
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// One JSON object per line, instead of a table
    #[arg(long)]
    json: bool,
    /// Also the median of each pass, in milliseconds
    #[arg(long)]
    passes: bool,
    #[command(flatten)]
    blur: options::Blur,
}

/// One row of the result.
#[derive(Serialize)]
struct Measurement {
    size_px: (u32, u32),
    coc_px: f32,
    quality: &'static str,
    executor: String,
    frames: u32,
    p50_ms: f64,
    p95_ms: f64,
    max_ms: f64,
    frames_per_s: f64,
    passes_ms: BTreeMap<&'static str, f64>,
}

/// Runs the command; each line is printed as soon as it is measured.
///
/// # Errors
/// Fails if the options conflict, the backend is missing, or the blur fails.
pub fn run(command: &BenchCommand, global: &options::Global, given: &GivenSettings) -> Result<(), CliError> {
    if command.blur.depth.is_external() || command.blur.depth == DepthChoice::Stereo {
        let what = "--depth is for `stream`: the measured scene has its own depth; leave --depth out, or use none";
        return Err(CliError::Usage(what.to_string()));
    }
    let look = look::build_look(&command.blur, &options::LookSettings::default())?;
    let facts = LookFacts { keeps_alpha: true, ..command.blur.depth.look_facts(true, Metres::Known)? };
    let (look, _) = Look { strength: Strength::Default, ..look }.change(&Change::default(), &facts)?;
    unused::warn_of_unused(
        &given.settings,
        &unused::RunFacts { cpu_only: command.backend == Backend::Cpu, ..unused::RunFacts::default() }.for_look(
            unused::FrameOrigin::Bench,
            DepthOrigin::Metres,
            &look,
        ),
    );
    if !command.json {
        print_to_stdout(HEADING.as_bytes())?;
    }
    let combinations = command.sizes.len() * command.coc.len().max(1) * command.quality.len().max(1);
    let combinations = (combinations * command.list_configurations().len()) as u64;
    let mut done = 0;
    let levels = if command.quality.is_empty() { &[Quality::default()][..] } else { &command.quality };
    for size in &command.sizes {
        let (color, depth) = picture::render_first_frame(command.scene, (size.width, size.height))?;
        let default_coc_px = [size.height as f32 * COC_AT_INFINITY_PER_HEIGHT];
        let radii_px = if command.coc.is_empty() { &default_coc_px[..] } else { &command.coc };
        for &coc_px in radii_px {
            for &quality in levels {
                for computing in command.list_configurations() {
                    // Each row erases the bar, so every combination starts a new one.
                    let progress =
                        Progress::new(Some(combinations * u64::from(command.frames.unwrap_or(FRAMES))), global);
                    let before = done * u64::from(command.frames.unwrap_or(FRAMES));
                    progress.set_delivered(before);
                    let measured = measure_blur(
                        &Sampling { frames: command.frames, fps: command.fps },
                        &look,
                        (&color, &depth),
                        (coc_px, quality),
                        &computing,
                        (&progress, before),
                    )?;
                    drop(progress);
                    done += 1;
                    print_to_stdout(measured.format_line(command.json, command.passes).as_bytes())?;
                }
            }
        }
    }
    Ok(())
}

/// Returns the table of one size at the default quality for `--backend auto` and for the CPU; takes some seconds.
pub fn run_short_benchmark() -> String {
    const SIZE: (u32, u32) = (1280, 720);
    let frame = match picture::render_first_frame(picture::Scene::default(), SIZE) {
        Ok(frame) => frame,
        Err(error) => return format!("{error}\n"),
    };
    let coc_px = SIZE.1 as f32 * COC_AT_INFINITY_PER_HEIGHT;
    let blur = (coc_px, Quality::default());
    let mut table = HEADING.to_owned();
    for backend in [Backend::Auto, Backend::Cpu] {
        let (computing, progress) = (ComputeOptions { backend, ..ComputeOptions::default() }, Progress::silent());
        match measure_blur(
            &Sampling::default(),
            &Look::default(),
            (&frame.0, &frame.1),
            blur,
            &computing,
            (&progress, 0),
        ) {
            Ok(measured) => {
                table += &measured.format_line(false, false);
                // `auto` chose the CPU: its row is already there.
                if measured.executor.starts_with(Backend::Cpu.name()) {
                    break;
                }
            }
            Err(error) => table += &format!("{}: {error}\n", backend.name()),
        }
    }
    table
}

impl BenchCommand {
    /// Returns one configuration per `--threads` value.
    fn list_configurations(&self) -> Vec<ComputeOptions> {
        let with_threads = |threads| ComputeOptions { backend: self.backend, adapter: self.adapter.clone(), threads };
        match &self.threads[..] {
            [] => vec![with_threads(None)],
            list => list.iter().map(|&threads| with_threads(Some(usize::from(threads)))).collect(),
        }
    }
}

/// Which frames are measured.
#[derive(Default)]
struct Sampling {
    /// [`FRAMES`], or fewer within [`TIME_LIMIT`], unless given.
    frames: Option<u32>,
    /// Rate at which frames arrive; one after another if `None`.
    fps: Option<f32>,
}

/// Measures one combination of settings: blurs the same picture repeatedly after a warm-up. `before` is the number of
/// frames that `progress` has already counted.
fn measure_blur(
    sampling: &Sampling,
    look: &Look,
    (color, depth): (&ColorImage, &DepthMap),
    (coc_px, quality): (f32, Quality),
    computing: &ComputeOptions,
    (progress, before): (&Progress, u64),
) -> Result<Measurement, CliError> {
    let look = Look { strength: Strength::AtInfinity(coc_px), quality: Some(quality), ..look.clone() };
    let size = color.size();
    look.small_blur(size).iter().for_each(|small| log::note(&small.to_string()));
    let Some(settings) = look.blur_settings(size, false) else {
        return Err(CliError::Usage(
            "--effect none leaves nothing to measure: use dof, tilt-shift or blur".to_string(),
        ));
    };
    let mut color = color.clone();
    let measured = Depth::Measured(depth.clone());
    let (coc, depth) = compute_coc_and_depth(&look, &mut color, Some(measured), computing.threads)?;
    // One frame at a time: the latency is measured, not the throughput.
    let mut bokeh = computing.create_blur(&settings, size)?;
    let buffers = Buffers {
        colors: Pool::new(bokeh.capacity(), || color.clone()),
        depths: depth.map(|depth| Pool::new(bokeh.capacity(), || depth.clone())),
        results: Pool::new(bokeh.capacity(), || ColorImage::new(size.0, size.1)),
    };
    for _ in 0..WARM_UP_FRAMES {
        buffers.time_frame(&mut *bokeh, coc)?;
    }
    let mut times = Vec::new();
    let mut passes = BTreeMap::<_, Vec<Duration>>::new();
    let began = Instant::now();
    for frame in 1..=sampling.frames.unwrap_or(FRAMES) {
        let is_over = sampling.frames.is_none() && times.len() >= MIN_FRAMES && began.elapsed() > TIME_LIMIT;
        if is_over {
            break;
        }
        if let Some(fps) = sampling.fps {
            let arrival = Duration::from_secs_f64(f64::from(frame) / f64::from(fps));
            std::thread::sleep(arrival.saturating_sub(began.elapsed()));
        }
        progress.set_delivered(before + u64::from(frame));
        let (time, in_passes) = buffers.time_frame(&mut *bokeh, coc)?;
        times.push(time);
        in_passes.iter().for_each(|(name, time)| passes.entry(name).or_default().push(time));
    }
    times.sort_unstable();
    Ok(Measurement {
        size_px: size,
        coc_px,
        quality: quality.name(),
        executor: bokeh.describe(),
        frames: times.len() as u32,
        p50_ms: quantile_ms(&times, 0.5),
        p95_ms: quantile_ms(&times, 0.95),
        max_ms: quantile_ms(&times, 1.0),
        frames_per_s: times.len() as f64 / times.iter().sum::<Duration>().as_secs_f64(),
        passes_ms: passes.into_iter().map(|(name, times)| (name, median_ms(times))).collect(),
    })
}

fn median_ms(mut times: Vec<Duration>) -> f64 {
    times.sort_unstable();
    quantile_ms(&times, 0.5)
}

/// Returns the quantile `fraction` (0 to 1) of sorted times, in milliseconds.
fn quantile_ms(sorted: &[Duration], fraction: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * fraction).round() as usize].as_secs_f64() * 1e3
}

/// Pools of copies of one frame, as large as the executor's capacity, so that copying is not measured.
struct Buffers {
    colors: Pool<ColorImage>,
    depths: Option<Pool<DepthMap>>,
    results: Pool<ColorImage>,
}

impl Buffers {
    /// Blurs the frame once; returns the time from submission to completion, and the time of each pass.
    fn time_frame(&self, bokeh: &mut dyn Bokeh, coc: CocField) -> Result<(Duration, PassTimes), CliError> {
        let (color, depth) = (self.colors.take(), self.depths.as_ref().map(Pool::take));
        let job = Job { out: self.results.take(), ..Job::new(color, depth, coc) };
        let began = Instant::now();
        bokeh.submit(job)?;
        let finished = bokeh.collect(true)?;
        let time = began.elapsed();
        finished.map(|finished| (time, finished.times)).ok_or(BokehError::Lost.into())
    }
}

impl Measurement {
    /// Formats the result as one JSON object, or as a table row with an optional second line for the passes.
    fn format_line(&self, json: bool, passes: bool) -> String {
        if json {
            // Numbers and strings always serialise.
            return serde_json::to_string(self).unwrap_or_default() + "\n";
        }
        let Self { size_px: (width, height), coc_px, quality, executor, p50_ms, p95_ms, max_ms, frames_per_s, .. } =
            self;
        let passes: String = if passes {
            self.passes_ms.iter().map(|(name, ms)| format!("    {name} {ms:.2}")).collect::<String>() + "\n"
        } else {
            String::new()
        };
        format!(
            "{:<10} {coc_px:>7.1}  {quality:<9} {p50_ms:>7.2}  {p95_ms:>7.2}  {max_ms:>7.2} {frames_per_s:>7.1}  {executor}\n{passes}",
            format!("{width}x{height}")
        )
    }
}
