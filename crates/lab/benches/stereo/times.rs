//! Time of the matcher.

use std::path::Path;
use std::time::Instant;

use bokehcam::depth::stereo::{Effort, Matcher, Pair};
use bokehcam::frame::{ColorImage, DisparityMap, GrayImage};
use image::imageops::{FilterType, resize};
use image::{DynamicImage, RgbImage};
use serde::Serialize;

use super::options::{Options, Times, effort_name};
use super::sequence::load_bundled;
use super::{Outcome, matcher, print_record};

/// The times of a matcher on a pair.
#[derive(Serialize)]
struct Record {
    size: (u32, u32),
    disparities: u32,
    effort: &'static str,
    threads: usize,
    matcher: String,
    median_ms: f64,
    best_ms: f64,
    /// In the order measured.
    times_ms: Vec<f64>,
}

/// Measures and prints.
///
/// # Errors
/// Fails if a picture is unreadable, or a matcher cannot be created or fails.
pub fn run(times: &Times, options: &Options) -> Outcome {
    if !options.json {
        println!("size       disparities effort threads  median ms    best ms  matcher");
    }
    for pair in load_pairs(times)? {
        for &disparities in &times.disparities {
            for record in measure_matchers(&pair, disparities, times, options)? {
                let line = format!(
                    "{:10} {:11} {:6} {:7} {:10.2} {:10.2}  {}",
                    format!("{}x{}", record.size.0, record.size.1),
                    record.disparities,
                    record.effort,
                    record.threads,
                    record.median_ms,
                    record.best_ms,
                    record.matcher
                );
                print_record(options, &line, &record)?;
            }
        }
    }
    Ok(())
}

/// Measures all efforts and thread counts in turn.
fn measure_matchers(pair: &[GrayImage; 2], disparities: u32, times: &Times, options: &Options) -> Outcome<Vec<Record>> {
    let size = pair[0].size();
    let mut cases: Vec<(Box<dyn Matcher>, Record)> = Vec::new();
    for &effort in &options.efforts {
        for &threads in &times.threads {
            let matcher = matcher::create_matcher(options, effort, disparities, size, Some(threads))?;
            cases.push((matcher, Record::new(size, disparities, effort, threads)));
        }
    }
    let mut map = DisparityMap::default();
    let mut time_matching = |matcher: &mut dyn Matcher| -> Outcome<f64> {
        let began = Instant::now();
        matcher.compute_disparity(Pair { left: &pair[0], color: None, right: &pair[1] }, &mut map)?;
        Ok(1e3 * began.elapsed().as_secs_f64())
    };
    for round in 0..=times.rounds {
        for (matcher, record) in &mut cases {
            let time_ms = time_matching(matcher.as_mut())?;
            // The first round allocates, and is not counted.
            if round > 0 {
                record.times_ms.push(time_ms);
            }
        }
    }
    let finished = cases.into_iter().map(|(matcher, mut record)| {
        let mut sorted = record.times_ms.clone();
        sorted.sort_by(f64::total_cmp);
        record.median_ms = sorted[sorted.len() / 2];
        record.best_ms = sorted[0];
        record.matcher = matcher.describe();
        record
    });
    Ok(finished.collect())
}

impl Record {
    fn new(size: (u32, u32), disparities: u32, effort: Effort, threads: usize) -> Self {
        let effort = effort_name(effort);
        let (matcher, times_ms) = (String::new(), Vec::new());
        Self { size, disparities, effort, threads, matcher, median_ms: 0.0, best_ms: 0.0, times_ms }
    }
}

fn load_pairs(times: &Times) -> Outcome<Vec<[GrayImage; 2]>> {
    if let [left, right] = &times.pair[..] {
        let read = |path: &Path| -> Outcome<GrayImage> {
            let image = image::open(path).map_err(|error| format!("{}: {error}", path.display()))?;
            Ok(to_gray(&image))
        };
        return Ok(vec![[read(left)?, read(right)?]]);
    }
    let first = load_bundled()?.frames.swap_remove(0);
    let scaled = |picture: &ColorImage, (width, height)| {
        let whole = RgbImage::from_raw(picture.width, picture.height, picture.rgb.clone()).unwrap_or_default();
        to_gray(&DynamicImage::from(resize(&whole, width, height, FilterType::CatmullRom)))
    };
    Ok(times.size.iter().map(|&size| [scaled(&first.left, size), scaled(&first.right, size)]).collect())
}

fn to_gray(image: &DynamicImage) -> GrayImage {
    let picture = image.to_rgb8();
    let mut gray = GrayImage::default();
    gray.set_luma_from(&ColorImage { width: picture.width(), height: picture.height(), rgb: picture.into_raw() });
    gray
}
