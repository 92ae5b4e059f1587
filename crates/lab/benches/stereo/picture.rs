//! The blur from stereo depth, from true depth and from rivals' depth, against a true lens.

use std::fs;
use std::path::Path;

use bokehcam::bokeh::aperture::{Aperture, Shape};
use bokehcam::budget::Quality;
use bokehcam::depth::stereo::Pair;
use bokehcam::frame::{ColorImage, DepthMap, DisparityMap};
use serde::Serialize;

use super::flicker::disparity_to_depth;
use super::options::{Options, Picture, effort_name};
use super::quality::methods::{Blurrer, Method, Shot};
use super::quality::metrics::{edge_band, psnr};
use super::quality::picture::Plane;
use super::quality::sheet;
use super::sequence::{Sequence, load_bundled, read_pfm, recording_path};
use super::{Outcome, matcher, print_record};

/// The lens of `recordings/portrait/truth`, from its `camera.txt`.
const COC_AT_INFINITY_PX: f32 = 14.0;
const FOCUS_M: f32 = 1.2;

/// The scores of a blur over all frames with truth.
#[derive(Serialize)]
struct Record {
    /// The source of the depth.
    depth: String,
    /// Whether depth was refined, with memory, as a stream's is; else only its holes are filled.
    refined: bool,
    /// PSNR in sRGB, mean over the frames.
    psnr_db: f64,
    /// PSNR within 12 px of depth edges.
    edge_db: f64,
    /// PSNR without the leftmost columns, as wide as the disparity range, which the right camera may not see.
    inner_db: f64,
    /// Frames with truth.
    frames: usize,
}

/// Measures and prints.
///
/// # Errors
/// Fails if a recording or a rival's map is unreadable, or the matcher or the blur fails.
pub fn run(picture: &Picture, options: &Options) -> Outcome {
    let sequence = load_bundled()?;
    let mut sources = vec![("true".to_owned(), true_depth_maps(&sequence))];
    for &effort in &options.efforts {
        let size = sequence.frames[0].left.size();
        let mut matcher = matcher::create_matcher(options, effort, sequence.disparities, size, None)?;
        let mut maps = Vec::new();
        for frame in &sequence.frames {
            let ([left, right], mut map) = (frame.to_gray(), DisparityMap::default());
            matcher.compute_disparity(Pair { left: &left, color: Some(&frame.left), right: &right }, &mut map)?;
            maps.push(disparity_to_depth(&map, &sequence.rig));
        }
        sources.push((format!("ours {}", effort_name(effort)), maps));
    }
    for (name, folder) in &picture.rivals {
        let map =
            |index: usize| Ok(disparity_to_depth(&read_pfm(&folder.join(format!("{index:06}.pfm")))?, &sequence.rig));
        sources.push((name.clone(), (0..sequence.frames.len()).map(map).collect::<Outcome<_>>()?));
    }
    if let Some(out) = &picture.out {
        fs::create_dir_all(out)?;
    }
    if !options.json {
        println!("depth         refined   PSNR dB   edge dB  inner dB  frames");
    }
    for (depth, maps) in sources {
        for refined in [false, true] {
            let record = score_blur(&sequence, &depth, &maps, refined, picture.out.as_deref())?;
            let refined = if refined { "yes" } else { "no" };
            let Record { psnr_db, edge_db, inner_db, frames, .. } = record;
            let line = format!("{depth:13} {refined:7} {psnr_db:9.2} {edge_db:9.2} {inner_db:9.2} {frames:7}");
            print_record(options, &line, &record)?;
        }
    }
    Ok(())
}

fn true_depth_maps(sequence: &Sequence) -> Vec<DepthMap> {
    let map = |truth: &Plane<f32>| {
        let (width, height) = (truth.width as u32, truth.height as u32);
        disparity_to_depth(&DisparityMap { width, height, px: truth.data.clone() }, &sequence.rig)
    };
    sequence.frames.iter().filter_map(|frame| frame.truth.as_ref().map(map)).collect()
}

/// Returns the true lens's picture of a frame, if it exists.
pub fn read_lens_picture(index: usize) -> Option<ColorImage> {
    sheet::read_png(&recording_path(&format!("portrait/truth/disc_clipped_{index:06}.png")))
}

/// Returns a shot with this depth, for that lens.
pub fn create_shot(image: &ColorImage, depth: &DepthMap) -> Shot {
    let lens = Shot::lens(COC_AT_INFINITY_PX, FOCUS_M, image.height as usize);
    let aperture = Aperture { shape: Shape::Disc, intensity: 0.0 };
    Shot { image: image.clone(), depth: depth.clone(), lens, aperture }
}

fn score_blur(
    sequence: &Sequence,
    depth: &str,
    maps: &[DepthMap],
    refined: bool,
    out: Option<&Path>,
) -> Outcome<Record> {
    let method = if refined { Method::Refined } else { Method::Layered(Quality::default()) };
    let mut blurrer = Blurrer::new(method, &create_shot(&sequence.frames[0].left, &maps[0]))?;
    let true_depth = true_depth_maps(sequence);
    let (width, height) = (maps[0].width as usize, maps[0].height as usize);
    let inner = Plane::from_fn(width, height, |x, _| x >= sequence.disparities as usize);
    let (mut psnr_db, mut edge_db, mut inner_db, mut frames) = (0.0, 0.0, 0.0, 0);
    for (index, (frame, map)) in sequence.frames.iter().zip(maps).enumerate() {
        let blurred = blurrer.blur(&create_shot(&frame.left, map))?;
        let Some(lens) = read_lens_picture(index) else { continue };
        let edges = edge_band(&create_shot(&frame.left, &true_depth[index]).coc());
        psnr_db += psnr(&blurred, &lens, None);
        edge_db += psnr(&blurred, &lens, Some(&edges));
        inner_db += psnr(&blurred, &lens, Some(&inner));
        frames += 1;
        if let Some(out) = out {
            let step = if refined { "refined" } else { "matched" };
            sheet::write_png(&out.join(format!("{}-{step}-{index:06}.png", depth.replace(' ', "-"))), &blurred)?;
        }
    }
    let mean = |sum: f64| sum / frames as f64;
    let (psnr_db, edge_db, inner_db) = (mean(psnr_db), mean(edge_db), mean(inner_db));
    Ok(Record { depth: depth.to_owned(), refined, psnr_db, edge_db, inner_db, frames })
}
