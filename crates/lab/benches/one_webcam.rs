//! `cargo bench --bench one_webcam -- [OPTIONS]`: the cost per frame of depth and matte from one webcam: processor time
//! of all threads, without decoding and without blur.
//!
//! The pictures are a real sequence, `rgbd/person_turning` in the folder BOKEHCAM_DATA, enlarged; networks come from
//! its folder `models`. Sources take turns, so that other load on the machine affects all alike.

mod common;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use bokehcam::clock::process_cpu_ns;
use bokehcam::depth::plate::{Companion, PlateDepth};
use bokehcam::depth::{DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam_live::source::installed::find_best_in;
use bokehcam_media::recording::{self, Recording, Scratch};
use bokehcam_networks::network::Task;
use bokehcam_networks::single_camera::{Hints, SingleCamera};
use clap::Parser;
use image::imageops::{FilterType, resize};

/// Frames of the sequence that are played, back and forth.
const FRAMES: usize = 24;
/// The background of the sequence is farther than this, in metres.
const MIN_BACKGROUND_M: f32 = 1.8;

#[derive(Parser)]
struct Options {
    /// Rounds of frames each, forth and back
    #[arg(long, default_value_t = 4)]
    rounds: u32,
    /// Only this source
    #[arg(long, default_value = "")]
    only: String,
    /// Columns and rows
    #[arg(long, num_args = 2, default_values_t = [1280, 720])]
    size: Vec<u32>,
    /// Passed by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    common::measure_person_turning(measure_sources)
}

/// A source, and its times so far.
struct Case {
    name: &'static str,
    source: Box<dyn DepthSource>,
    frames: u32,
    wall_ms: f64,
    processor_ms: f64,
}

fn measure_sources(options: &Options, data: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let (pictures, plate) = load_pictures(data, (options.size[0], options.size[1]))?;
    let (matte, mono) = (find_model(data, Task::Matte)?, find_model(data, Task::Mono)?);
    let networks = |matte: Option<&Path>, mono: Option<&Path>| SingleCamera::open(matte, mono, &Hints::default());
    let mut cases = Vec::new();
    for name in ["matte", "mono", "matte,mono", "plate", "plate,matte", "plate,matte,mono"] {
        if !options.only.is_empty() && name != options.only {
            continue;
        }
        let has = |task: &str| name.split(',').any(|part| part == task);
        let files = (has("matte").then_some(matte.as_path()), has("mono").then_some(mono.as_path()));
        let loaded = if files == (None, None) { None } else { Some(networks(files.0, files.1)?) };
        let source: Box<dyn DepthSource> = match (has("plate"), loaded) {
            (false, Some(networks)) => Box::new(networks),
            (_, networks) => {
                let companion = networks.map(|networks| Box::new(networks) as Box<dyn Companion>);
                Box::new(PlateDepth::new(Some(plate.clone()), None, companion))
            }
        };
        cases.push(Case { name, source, frames: 0, wall_ms: 0.0, processor_ms: 0.0 });
    }
    let mut map = DepthMap::default();
    // The first round allocates, and is not counted.
    for round in 0..=options.rounds {
        for case in &mut cases {
            let (began, before_ns) = (Instant::now(), process_cpu_ns());
            for (k, color) in pictures.iter().chain(pictures.iter().rev()).enumerate() {
                let index = round as usize * 2 * pictures.len() + k;
                let stamp = Stamp { index, time_ns: index as u64 * 33_333_333, captured_ns: None };
                case.source.read(FrameInput { stamp, color, right: None }, &mut map)?;
            }
            if round > 0 {
                case.frames += 2 * pictures.len() as u32;
                case.wall_ms += began.elapsed().as_secs_f64() * 1e3;
                case.processor_ms += (process_cpu_ns() - before_ns) as f64 / 1e6;
            }
        }
    }
    println!("{} x {}, {} frames each", options.size[0], options.size[1], options.rounds as usize * 2 * pictures.len());
    println!("{:<18} {:>15} {:>10}", "source", "processor ms", "wall ms");
    for case in &cases {
        let frames = f64::from(case.frames.max(1));
        println!("{:<18} {:>15.2} {:>10.2}", case.name, case.processor_ms / frames, case.wall_ms / frames);
    }
    Ok(())
}

/// Returns the pictures of the sequence in this size, and its background: for each pixel, the colour at its farthest
/// depth.
fn load_pictures(data: &Path, size: (u32, u32)) -> Result<(Vec<ColorImage>, ColorImage), Box<dyn std::error::Error>> {
    let options = recording::Options { depth_scale: Some(1000.0), ..recording::Options::default() };
    let recording = Recording::open(&data.join("rgbd/person_turning"), &options)?;
    let (mut scratch, mut color, mut depth) = (Scratch::default(), ColorImage::default(), DepthMap::default());
    let (mut plate, mut farthest_m, mut pictures) = (ColorImage::default(), Vec::new(), Vec::new());
    for index in 0..recording.len().min(FRAMES) {
        recording.read_color(index, &mut scratch, &mut color)?;
        recording.read_depth(index, &mut scratch, &mut depth)?;
        if index == 0 {
            plate = color.clone();
            farthest_m = depth.metres.clone();
        }
        for (at, (farthest_m, &metres)) in farthest_m.iter_mut().zip(&depth.metres).enumerate() {
            if metres > *farthest_m {
                *farthest_m = metres;
                plate.rgb[3 * at..3 * at + 3].copy_from_slice(&color.rgb[3 * at..3 * at + 3]);
            }
        }
        pictures.push(crop_and_resize(&color, size));
    }
    // Pixels that no frame uncovered are filled from the left neighbour.
    for at in (1..farthest_m.len()).filter(|&at| farthest_m[at] < MIN_BACKGROUND_M) {
        plate.rgb.copy_within(3 * (at - 1)..3 * at, 3 * at);
    }
    Ok((pictures, crop_and_resize(&plate, size)))
}

/// Crops the middle of a picture and scales it to another size.
fn crop_and_resize(color: &ColorImage, (width, height): (u32, u32)) -> ColorImage {
    let rows = (color.width * height / width).min(color.height);
    let first = ((color.height - rows) / 2 * color.width * 3) as usize;
    let middle = color.rgb[first..][..(rows * color.width * 3) as usize].to_vec();
    let picture = image::RgbImage::from_raw(color.width, rows, middle).expect("as many bytes as that");
    ColorImage { width, height, rgb: resize(&picture, width, height, FilterType::CatmullRom).into_raw() }
}

/// Returns the file of the first known network for a task that exists.
fn find_model(data: &Path, task: Task) -> Result<PathBuf, Box<dyn std::error::Error>> {
    let folder = data.join("models");
    find_best_in(vec![folder.clone()], task)
        .ok_or_else(|| format!("{}: no known network for --depth {}", folder.display(), task.name()).into())
}
