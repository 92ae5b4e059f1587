//! `cargo bench --bench soak -- [OPTIONS] [FOLDER]`: plays a recording as a live camera for any length of time, and
//! checks that pictures come at even intervals and in time, without growing delay.
//!
//! | file | what |
//! |---|---|
//! | `stages` | the camera, the executor that may be slowed down, the sink that stamps |
//! | `loader` | the other process |
//! | `verdict` | what is measured, and against what |
//! | `footprint` | what the process holds |

#[path = "../common/mod.rs"]
mod common;
mod footprint;
mod loader;
mod stages;
mod verdict;

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use bokehcam::bokeh::{Backend, Bokeh, BokehError};
use bokehcam::budget::Quality;
use bokehcam::clock::Clock;
use bokehcam::computing::ComputeOptions;
use bokehcam::look::number::OrAuto;
use bokehcam::look::{Effect, Look, Refine, Strength};
use bokehcam_live::depth::recorded::RecordedDepth;
use bokehcam_live::pipeline::{self, BlurSetup, Destination, Pace, Run};
use bokehcam_live::stats::Report;
use bokehcam_media::recording::{Options as Reading, Recording};
use clap::Parser;

use footprint::Footprint;
use loader::Loader;
use stages::{LoopedCamera, PERIOD_NS, SlowedBokeh, StampingSink, Stamps};
use verdict::print_verdict;

/// A recording as a live camera of 30 frames a second, blurred in real time
///
/// Prints how evenly and how old the pictures come out, what was dropped, and at which quality they were made; the exit
/// code tells whether all criteria are met.
#[derive(Parser, Debug)]
#[command(
    name = "soak",
    bin_name = "cargo bench --bench soak --",
    after_help = "\
Examples:
  cargo bench --bench soak -- --minutes 10 --loader
  cargo bench --bench soak -- --minutes 2 --slow 3
  cargo bench --bench soak -- --starts 1000 --minutes 90
  cargo bench --bench soak -- --minutes 1 --quality balanced somewhere/rgbd"
)]
struct Options {
    /// A folder with a recording that has depth
    #[arg(default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../../recordings/portrait"))]
    folder: PathBuf,
    /// How long to run
    #[arg(long, value_name = "M", default_value_t = 1.0)]
    minutes: f64,
    /// First start and stop this number of times, and print the resources that the process then holds
    #[arg(long, value_name = "N", default_value_t = 0)]
    starts: u32,
    /// Let the blur take this many times as long, busy all the while
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    slow: f64,
    /// Let another process keep one core busy for 10 s of every 20
    #[arg(long)]
    loader: bool,
    /// auto, or a quality level for all frames
    #[arg(long, value_name = "LEVEL", default_value = "auto")]
    quality: OrAuto<Quality>,
    /// Time that the blur of one frame may take, in milliseconds [default: the frame period]
    #[arg(long, value_name = "MS")]
    budget_ms: Option<f64>,
    /// CoC radius at infinity, in pixels [default: height / 45]
    #[arg(long, value_name = "PX")]
    coc_at_infinity: Option<f32>,
    /// Units of a depth picture per metre
    #[arg(long, value_name = "UNITS", default_value_t = 5000.0)]
    depth_scale: f32,
    /// Only fill holes of the depth
    #[arg(long)]
    no_refine: bool,
    /// Blur on a GPU, if there is a hardware one
    #[arg(long)]
    gpu: bool,
    /// Also write the time of every picture, in milliseconds since the camera began, and its age, to this file
    #[arg(long, value_name = "FILE.csv")]
    series: Option<PathBuf>,
    /// Given by `cargo bench`
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    if std::env::args().nth(1).as_deref() == Some(loader::ARGUMENT) {
        loader::run_load();
    }
    let options: Options = match common::options() {
        Ok(options) => options,
        Err(code) => return code,
    };
    if !options.bench {
        println!("nothing measured: run it by `cargo bench --bench soak`");
        return ExitCode::SUCCESS;
    }
    match run(&options) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs the bench; returns whether the criteria are met.
fn run(options: &Options) -> Result<bool, Box<dyn Error>> {
    let begun = options.starts == 0 || measure_restarts(options)?;
    let frames = (options.minutes * 60e9 / PERIOD_NS as f64).round().max(2.0) as u64;
    let loader = options.loader.then(Loader::start).transpose()?;
    let (report, shown) = replay(options, frames)?;
    drop(loader);
    if let Some(path) = &options.series {
        let line = |&(at_ns, age_ns): &(u64, u64)| format!("{:.3},{:.3}\n", at_ns as f64 / 1e6, age_ns as f64 / 1e6);
        std::fs::write(path, shown.iter().map(line).collect::<String>())?;
    }
    println!(
        "{}, {:.1} minutes{}{}",
        report.source,
        options.minutes,
        if options.loader { ", one core busy for 10 s of every 20" } else { "" },
        if options.slow > 1.0 { format!(", blur {} times slower", options.slow) } else { String::new() }
    );
    println!("{report}\n");
    Ok(print_verdict(&shown, &report) && begun)
}

/// Starts and stops repeatedly; returns whether the process holds no more at the end than after a tenth of the starts.
fn measure_restarts(options: &Options) -> Result<bool, Box<dyn Error>> {
    const FRAMES: u64 = 4;
    let (mut warm, mut frames) = (Footprint::measure()?, 0);
    for start in 0..options.starts {
        frames += replay(options, FRAMES)?.0.frames.captured;
        if start == options.starts / 10 {
            warm = Footprint::measure()?;
        }
    }
    let end = Footprint::measure()?;
    let flat = end.has_not_grown_since(&warm);
    println!(
        "{} starts and stops, {frames} frames: {warm}, in the end {end}: {}\n",
        options.starts,
        verdict::criterion_word(flat)
    );
    Ok(flat)
}

/// The delivery time of each frame since the camera began, and its age, in nanoseconds.
type Deliveries = Vec<(u64, u64)>;

/// Plays frames of the recording in real time.
fn replay(options: &Options, frames: u64) -> Result<(Report, Deliveries), Box<dyn Error>> {
    let name = options.folder.display().to_string();
    let reading = Reading { depth_scale: Some(options.depth_scale), ..Reading::default() };
    let recording = Arc::new(Recording::open(&options.folder, &reading)?);
    let size = recording.size();
    let height = size.1 as f32;
    let coc_px = options.coc_at_infinity.unwrap_or(height / 45.0);
    let max_coc_px = coc_px.max(height * 0.06);
    let look = Look {
        strength: Strength::AtInfinity(coc_px),
        max_coc_px: Some(max_coc_px),
        refine: if options.no_refine { Refine::Off } else { Refine::On },
        quality: options.quality.value(),
        ..Look::with_effect(Effect::Dof)
    };
    let backend = if options.gpu { Backend::Auto } else { Backend::Cpu };
    let computing = ComputeOptions { backend, ..ComputeOptions::default() };
    let make = |settings: &_| -> Result<Box<dyn Bokeh>, BokehError> {
        Ok(Box::new(SlowedBokeh::new(computing.create_blur(settings, size)?, options.slow)))
    };
    let (blurring, _) = BlurSetup::create(look, (size, true), make)?;
    let clock = Clock::system();
    let stamps = Stamps::with_capacity(frames as usize);
    let stop = AtomicBool::new(false);
    let depth = Box::new(RecordedDepth::new(Arc::clone(&recording), &name)?);
    let camera = Box::new(LoopedCamera::new(recording, &name, frames, clock.clone(), stamps.clone()));
    let sink = Destination::Owned(Box::new(StampingSink::new(clock.clone(), stamps.clone())));
    let report = pipeline::run(Run {
        measured: true,
        changes: None,
        pace: Pace::Realtime,
        budget_ns: options.budget_ms.map_or(PERIOD_NS, |ms| (ms * 1e6) as u64),
        clock,
        ..Run::with_blur(camera, Some(depth), blurring, sink, &stop)
    })?;
    Ok((report, stamps.take_deliveries()))
}
