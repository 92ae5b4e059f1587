//! Pictures of every step, from the bundled recording, for `docs/stereo.md`.

use std::fs;
use std::path::Path;

use bokehcam::budget::Quality;
use bokehcam::depth::refine::Refiner;
use bokehcam::depth::stereo::{Effort, Pair};
use bokehcam::frame::{ColorImage, DisparityMap};
use image::RgbImage;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::imageops::{self, resize};

use super::flicker::disparity_to_depth;
use super::options::{Options, effort_name};
use super::picture::create_shot;
use super::quality::methods::{Blurrer, Method};
use super::sequence::load_bundled;
use super::{Outcome, matcher};

/// The frame that is shown, late enough for the memory to have content.
const FRAME: usize = 8;
/// Columns of a picture.
const WIDTH: u32 = 288;

/// Writes the pictures.
///
/// # Errors
/// Fails if the recording is unreadable, the matcher or the blur fails, or the folder cannot be written.
pub fn run(out: &Path, options: &Options) -> Outcome {
    let sequence = load_bundled()?;
    let frame = &sequence.frames[FRAME];
    let (width, height) = frame.left.size();
    fs::create_dir_all(out)?;
    write_thumbnail(out, "left", &frame.left)?;
    write_thumbnail(out, "right", &frame.right)?;
    let max_px = sequence.disparities as f32;
    if let Some(truth) = &frame.truth {
        write_thumbnail(out, "true", &colorize_disparity(&truth.data, (width, height), max_px))?;
    }
    for effort in [Effort::Fast, Effort::Full] {
        let mut matcher = matcher::create_matcher(options, effort, sequence.disparities, (width, height), None)?;
        let (mut refiner, mut map) = (Refiner::new(), DisparityMap::default());
        for (index, frame) in sequence.frames.iter().enumerate().take(FRAME + 1) {
            let [left, right] = frame.to_gray();
            matcher.compute_disparity(Pair { left: &left, color: Some(&frame.left), right: &right }, &mut map)?;
            let mut depth = disparity_to_depth(&map, &sequence.rig);
            refiner.refine(&mut depth, &frame.left, frame.time_ns);
            if index < FRAME {
                continue;
            }
            let refined: Vec<f32> = depth.metres.iter().map(|&z_m| sequence.rig.disparity_px(z_m)).collect();
            write_thumbnail(
                out,
                &format!("matched-{}", effort_name(effort)),
                &colorize_disparity(&map.px, (width, height), max_px),
            )?;
            if effort == Effort::Full {
                write_thumbnail(out, "refined", &colorize_disparity(&refined, (width, height), max_px))?;
                let shot = create_shot(&frame.left, &depth);
                write_thumbnail(
                    out,
                    "blurred",
                    &Blurrer::new(Method::Layered(Quality::default()), &shot)?.blur(&shot)?,
                )?;
            }
        }
    }
    Ok(())
}

fn write_thumbnail(out: &Path, name: &str, image: &ColorImage) -> Outcome {
    let whole = RgbImage::from_raw(image.width, image.height, image.rgb.clone()).unwrap_or_default();
    let small = resize(&whole, WIDTH, WIDTH * image.height / image.width, imageops::FilterType::Triangle);
    let path = out.join(format!("{name}.png"));
    let file = std::io::BufWriter::new(fs::File::create(&path)?);
    small.write_with_encoder(PngEncoder::new_with_quality(file, CompressionType::Best, FilterType::Adaptive))?;
    println!("{}: {} kB", path.display(), fs::metadata(&path)?.len() / 1000);
    Ok(())
}

/// Colours disparities: from blue (far) over green to red (near); black is unknown. Uses the square root, as most of a
/// room is far away.
fn colorize_disparity(px: &[f32], (width, height): (u32, u32), max_px: f32) -> ColorImage {
    let color = |&px: &f32| {
        if !(px > 0.0 && px.is_finite()) {
            return [0; 3];
        }
        let nearness = (px / max_px).min(1.0).sqrt();
        // Three ramps: red rises last, green is highest in the middle, blue falls first.
        [nearness * 2.0 - 0.7, 1.0 - (nearness - 0.5).abs() * 2.2, 1.3 - nearness * 2.0]
            .map(|light| (255.0 * light.clamp(0.05, 1.0)) as u8)
    };
    ColorImage { width, height, rgb: px.iter().flat_map(color).collect() }
}
