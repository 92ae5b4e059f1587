//! `cargo bench --bench reuse -- RECORDING [OPTIONS]`: what it costs to steady the blurred background, how much less it
//! flickers, and how far the pictures are from fresh ones.
//!
//! Two executors blur the same frames in turn, so that other load on the machine affects both alike. The recording is
//! read, and its depth finished, before.

mod common;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use bokehcam::bokeh::PassTimes;
use bokehcam::bokeh::cpu::CpuBokeh;
use bokehcam::bokeh::plan::Plan;
use bokehcam::clock::process_cpu_ns;
use bokehcam::engine::{CocCalculator, Postprocess};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::look::{Effect, Look, Reuse};
use bokehcam::optics::CocField;
use bokehcam_media::recording::{Options as Reading, Recording, Scratch};
use clap::Parser;

#[derive(Parser)]
struct Options {
    /// A recording
    recording: PathBuf,
    /// Its first frames
    #[arg(long, default_value_t = 40)]
    frames: usize,
    /// How often these are played, forth and back
    #[arg(long, default_value_t = 3)]
    rounds: usize,
    /// Play the first frame alone, without noise of its own
    #[arg(long)]
    still: bool,
    /// Blur everything alike, without depth
    #[arg(long)]
    uniform: bool,
    /// Depth units per metre of a recording that does not say
    #[arg(long)]
    depth_scale: Option<f32>,
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Passed by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    let options = match common::options::<Options>() {
        Ok(options) => options,
        Err(code) => return code,
    };
    match measure_reuse(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// A frame whose depth is finished.
struct Finished {
    color: ColorImage,
    map: DepthMap,
    field: CocField,
}

fn read_frames(options: &Options, look: &Look) -> Result<Vec<Finished>, Box<dyn std::error::Error>> {
    let default = Reading::default();
    let reading = Reading { depth_scale: options.depth_scale, ..default };
    let recording = Recording::open(&options.recording, &reading)?;
    let mut scratch = Scratch::default();
    let mut calculator = None;
    let mut frames = Vec::new();
    for index in 0..options.frames.min(recording.len()) {
        let (mut color, mut map) = (ColorImage::default(), DepthMap::default());
        recording.read_color(index, &mut scratch, &mut color)?;
        let calculator = calculator.get_or_insert_with(|| {
            let mut calculator = CocCalculator::new(look.coc_rule(color.size()), Postprocess::Refine);
            calculator.set_background_memory(true);
            calculator
        });
        if !options.uniform {
            recording.read_depth(index, &mut scratch, &mut map)?;
        }
        let field = calculator.compute(&mut map, &color, index as u64 * 33_333_333);
        frames.push(Finished { color, map, field });
    }
    Ok(frames)
}

/// Sums over the frames of one executor.
#[derive(Default)]
struct Sums {
    cpu_ms: Vec<f64>,
    passes_ms: BTreeMap<&'static str, f64>,
    flicker: f64,
    before: ColorImage,
    out: ColorImage,
}

impl Sums {
    fn add(&mut self, passes: &PassTimes, cpu_ns: u64) {
        self.cpu_ms.push(cpu_ns as f64 / 1e6);
        for (name, time) in passes.iter() {
            *self.passes_ms.entry(name).or_default() += time.as_secs_f64() * 1e3;
        }
        if self.before.size() == self.out.size() {
            self.flicker += differences(&self.before, &self.out).1;
        }
        self.before.clone_from(&self.out);
    }
}

/// Returns the largest and the mean difference in codes, and the fraction of samples more than one code apart.
fn differences(a: &ColorImage, b: &ColorImage) -> (u8, f64, f64) {
    let apart = a.rgb.iter().zip(&b.rgb).map(|(a, b)| a.abs_diff(*b));
    let (mut largest, mut sum, mut many) = (0, 0u64, 0u64);
    apart.for_each(|apart| {
        largest = largest.max(apart);
        sum += u64::from(apart);
        many += u64::from(apart > 1);
    });
    let count = a.rgb.len().max(1) as f64;
    (largest, sum as f64 / count, many as f64 / count)
}

fn measure_reuse(options: &Options) -> Result<(), Box<dyn std::error::Error>> {
    let look = Look { effect: if options.uniform { Effect::Blur } else { Effect::Dof }, ..Look::default() };
    let frames = read_frames(options, &look)?;
    let size = frames.first().ok_or("the recording has no frames")?.color.size();
    let mut executors = [Reuse::Off, Reuse::On].map(|reuse| {
        let settings = Look { reuse, ..look.clone() }.blur_settings(size, false).expect("a look that blurs");
        (CpuBokeh::new(Plan::new(&settings, size.0, size.1), Some(options.threads)), Sums::default())
    });
    let (mut largest, mut sum, mut many) = (0, 0.0, 0.0);
    let count = options.rounds * frames.len();
    for k in 0..count {
        let there = if options.still { 0 } else { k % (2 * frames.len()) };
        let Finished { color, map, field } = &frames[there.min(2 * frames.len() - 1 - there)];
        for (executor, sums) in &mut executors {
            let began_ns = process_cpu_ns();
            let passes = executor.blur(color, Some(map), field, &mut sums.out)?;
            sums.add(&passes, process_cpu_ns() - began_ns);
        }
        let [(_, fresh), (_, steady)] = &executors;
        let apart = differences(&fresh.out, &steady.out);
        (largest, sum, many) = (largest.max(apart.0), sum + apart.1, many + apart.2);
    }
    println!("{}, {}x{}, {count} frames", options.recording.display(), size.0, size.1);
    for ((_, sums), name) in executors.iter_mut().zip(["fresh", "steady"]) {
        sums.cpu_ms.sort_unstable_by(f64::total_cmp);
        let mean = sums.cpu_ms.iter().sum::<f64>() / count as f64;
        let passes: Vec<String> =
            sums.passes_ms.iter().map(|(pass, ms)| format!("{pass} {:.2}", ms / count as f64)).collect();
        println!(
            "{name}: processor ms mean {mean:.2}, median {:.2}; flicker {:.3} codes; {}",
            sums.cpu_ms[count / 2],
            sums.flicker / (count - 1).max(1) as f64,
            passes.join(", ")
        );
    }
    let of = |sum: f64| sum / count as f64;
    println!(
        "apart: at most {largest} codes, mean {:.3}, {:.2} % of samples by more than one",
        of(sum),
        100.0 * of(many)
    );
    Ok(())
}
