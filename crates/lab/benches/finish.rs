//! `cargo bench --bench finish -- RECORDING [OPTIONS]`: the cost per frame of postprocessing measured depth: holes,
//! refinement, matte, and background memory. One thread; reading the recording is not counted.
//!
//! The variants take turns, so that other load on the machine affects all alike. An equal checksum shows that another
//! build gives the same result for the same frames, to the bit.

mod common;

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;
use std::process::ExitCode;

use bokehcam::clock::process_cpu_ns;
use bokehcam::depth::focus::FocusRule;
use bokehcam::engine::{CocCalculator, Postprocess};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::look::{CocAtInfinity, CocRule};
use bokehcam_media::recording::{Options as Reading, Recording, Scratch};
use clap::Parser;

/// The variants: the postprocessing, and whether the background is remembered. Each includes all of the previous one.
const VARIANTS: [(&str, Postprocess, bool); 4] = [
    ("matte", Postprocess::Keep, false),
    ("+ holes", Postprocess::Fill, false),
    ("+ refinement", Postprocess::Refine, false),
    ("+ memory", Postprocess::Refine, true),
];

#[derive(Parser)]
struct Options {
    /// A recording with measured depth
    recording: PathBuf,
    /// Its first frames
    #[arg(long, default_value_t = 24)]
    frames: usize,
    /// How often these are played, forth and back
    #[arg(long, default_value_t = 4)]
    rounds: usize,
    /// CoC of what is infinitely far, in pixels
    #[arg(long, default_value_t = 16.0)]
    coc_at_infinity: f32,
    /// Passed by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    let options = match common::options::<Options>() {
        Ok(options) => options,
        Err(code) => return code,
    };
    match measure_postprocessing(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn measure_postprocessing(options: &Options) -> Result<(), Box<dyn std::error::Error>> {
    let recording = Recording::open(&options.recording, &Reading::default())?;
    let mut scratch = Scratch::default();
    let mut frames = Vec::new();
    for index in 0..options.frames.min(recording.len()) {
        let (mut color, mut map) = (ColorImage::default(), DepthMap::default());
        recording.read_color(index, &mut scratch, &mut color)?;
        recording.read_depth(index, &mut scratch, &mut map)?;
        frames.push((color, map));
    }
    let lens = CocAtInfinity::Px(options.coc_at_infinity);
    let rule = CocRule::Depth { focus: FocusRule::Auto, lens, range_m: 0.0, max_coc_px: 64.0 };
    let mut calculators = VARIANTS.map(|(_, finish, remembers)| {
        let mut calculator = CocCalculator::new(rule, finish);
        calculator.set_background_memory(remembers);
        calculator
    });
    let (mut taken_ms, mut sums) = (VARIANTS.map(|_| Vec::new()), VARIANTS.map(|_| DefaultHasher::new()));
    let mut map = DepthMap::default();
    for k in 0..options.rounds * frames.len() {
        let there = k % (2 * frames.len());
        let (color, measured) = &frames[there.min(2 * frames.len() - 1 - there)];
        for ((calculator, taken_ms), sum) in calculators.iter_mut().zip(&mut taken_ms).zip(&mut sums) {
            map.clone_from(measured);
            let began_ns = process_cpu_ns();
            calculator.compute(&mut map, color, k as u64 * 33_333_333);
            taken_ms.push((process_cpu_ns() - began_ns) as f64 / 1e6);
            map.metres.iter().for_each(|metres| metres.to_bits().hash(sum));
            for pixel in &map.matte.pixels {
                (pixel.at, pixel.alpha.to_bits(), pixel.difference.map(f32::to_bits)).hash(sum);
            }
        }
    }
    println!("{:14} {:>8} {:>8}  checksum", "processor ms", "best", "median");
    for (((name, ..), taken_ms), sum) in VARIANTS.iter().zip(&mut taken_ms).zip(&sums) {
        taken_ms.sort_unstable_by(f64::total_cmp);
        println!("{name:14} {:8.2} {:8.2}  {:016x}", taken_ms[0], taken_ms[taken_ms.len() / 2], sum.finish());
    }
    Ok(())
}
