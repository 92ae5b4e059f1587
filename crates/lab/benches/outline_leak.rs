//! `cargo bench --bench outline_leak -- [OPTIONS]`: how right the matte of one webcam is beside the plain mask of its
//! network, and what of the room passes sharp.
//!
//! The pictures are a real sequence, `rgbd/person_turning` in the folder BOKEHCAM_DATA, played back and forth; what is
//! person and what is room tells its recorded depth. That is off by several pixels, and hair has none: the room is only
//! what has the room's colour, too. The network comes from `--models`, or the folder `models` there.
//! Sharp is what has an alpha above one half; a pixel counts if it was sharp in any frame in which it shows the room: an
//! attacker adds frames up.

mod common;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use bokehcam::depth::{DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam_live::source::installed::find_best_in;
use bokehcam_media::recording::{self, Recording, Scratch};
use bokehcam_networks::network::{self, Network, Task, Tensor};
use bokehcam_networks::single_camera::{Hints, SingleCamera};
use clap::Parser;
use image::imageops::{FilterType, resize};

/// The room of the sequence is farther than this, in metres, and the person nearer.
const MIN_ROOM_M: f32 = 1.8;
/// Largest difference of a code of the room from its median over all frames that show it.
const MAX_CHANGE: u8 = 16;
/// Distances from the person beyond which the room is counted, in pixels.
const BEYOND_PX: [i32; 3] = [0, 4, 12];
/// Distances from the other one from which person and room count for the overlap, in pixels: recorded outlines are off.
const MARGINS_PX: [i32; 3] = [2, 4, 7];

#[derive(Parser)]
struct Options {
    /// Frames in all
    #[arg(long, default_value_t = 300)]
    frames: usize,
    /// Folder of the network
    #[arg(long)]
    models: Option<PathBuf>,
    /// Also lists each frame in which more than this many pixels of the room are sharp
    #[arg(long, default_value_t = usize::MAX)]
    list: usize,
    /// Passed by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    common::measure_person_turning(measure)
}

/// A frame with its truth.
struct Shot {
    color: ColorImage,
    /// Per pixel, the distance from the person in pixels if it shows the room; minus the distance from all others if it
    /// shows the person; 0 if unknown.
    room_px: Vec<i32>,
}

/// How right the alpha of the frames so far was, at each of [`MARGINS_PX`].
#[derive(Default)]
struct Overlap {
    /// Sums over frames of the intersection over union, of the fractions of the person that is blurred and of the room
    /// that is sharp, and of the mean change of alpha from frame to frame where the person stays.
    sums: [[f64; 4]; MARGINS_PX.len()],
    frames: usize,
    /// Alpha, and what is the person, in the frame before.
    before: Option<(Vec<f32>, Vec<i32>)>,
}

impl Overlap {
    fn add(&mut self, shot: &Shot, alpha: Vec<f32>) {
        for (sums, margin_px) in self.sums.iter_mut().zip(MARGINS_PX) {
            let (mut persons, mut rooms, mut missed, mut spilt) = (0, 0, 0, 0);
            let (mut stays, mut changes) = (0, 0.0);
            for (at, (&room_px, &alpha)) in shot.room_px.iter().zip(&alpha).enumerate() {
                let (is_person, is_room) = (room_px < -margin_px, room_px > margin_px);
                persons += usize::from(is_person);
                rooms += usize::from(is_room);
                missed += usize::from(is_person && alpha <= 0.5);
                spilt += usize::from(is_room && alpha > 0.5);
                if let Some((before, _)) =
                    self.before.as_ref().filter(|(_, room_px)| is_person && room_px[at] < -margin_px)
                {
                    (stays, changes) = (stays + 1, changes + f64::from((alpha - before[at]).abs()));
                }
            }
            let ratio = |part: f64, whole: usize| part / whole.max(1) as f64;
            let of_frame = [
                ratio((persons - missed) as f64, persons + spilt),
                ratio(missed as f64, persons),
                ratio(spilt as f64, rooms),
                ratio(changes, stays),
            ];
            sums.iter_mut().zip(of_frame).for_each(|(sum, value)| *sum += value);
        }
        self.frames += 1;
        self.before = Some((alpha, shot.room_px.clone()));
    }
}

/// What of the room was sharp so far, by distance from the person.
#[derive(Default)]
struct Leak {
    name: &'static str,
    sharp: [Vec<bool>; BEYOND_PX.len()],
    /// Pixels in all frames, and those of the person that are blurred.
    pixels: [usize; BEYOND_PX.len()],
    missed: usize,
}

impl Leak {
    /// Adds a frame, given the alpha of each pixel; returns how many pixels of the room are sharp.
    fn add(&mut self, shot: &Shot, person: &[bool], alpha: impl Fn(usize) -> f32) -> usize {
        let mut count = 0;
        for (at, &room_px) in shot.room_px.iter().enumerate() {
            let is_sharp = alpha(at) > 0.5;
            self.missed += usize::from(person[at] && !is_sharp);
            count += usize::from(is_sharp && room_px > BEYOND_PX[0]);
            for (k, beyond_px) in BEYOND_PX.into_iter().enumerate() {
                let is_leak = is_sharp && room_px > beyond_px;
                self.sharp[k].resize(shot.room_px.len(), false);
                self.sharp[k][at] |= is_leak;
                self.pixels[k] += usize::from(is_leak);
            }
        }
        count
    }
}

fn measure(options: &Options, data: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let shots = load_shots(data)?;
    let models = options.models.clone().unwrap_or_else(|| data.join("models"));
    let file = find_best_in(vec![models.clone()], Task::Matte)
        .ok_or_else(|| format!("{}: no known network for --depth matte", models.display()))?;
    let mut plain = network::load(&file)?.network;
    let mut ours = SingleCamera::open(Some(&file), None, &Hints::default())?;
    // As in a call.
    ours.set_effort(0);
    let mut leaks = ["plain mask", "matte"].map(|name| Leak { name, ..Leak::default() });
    let mut overlaps = [Overlap::default(), Overlap::default()];
    let (mut map, mut blurred_whole, mut ever_room) = (DepthMap::default(), 0, Vec::new());
    for (index, shot) in back_and_forth(&shots).take(options.frames).enumerate() {
        let (width, at_mask) = (shot.color.width as usize, run_plain(&mut plain, &shot.color)?);
        let person: Vec<bool> = shot.room_px.iter().map(|room_px| *room_px < 0).collect();
        ever_room.resize(person.len(), false);
        ever_room.iter_mut().zip(&shot.room_px).for_each(|(ever, room_px)| *ever |= *room_px > 0);
        let stamp = Stamp { index, time_ns: index as u64 * 33_333_333, captured_ns: None };
        ours.read(FrameInput { stamp, color: &shot.color, right: None }, &mut map)?;
        let mut alpha: Vec<f32> =
            map.metres.iter().map(|&metres| f32::from(u8::from(metres <= DepthMap::SUBJECT_M))).collect();
        map.matte.pixels.iter().for_each(|pixel| alpha[pixel.at as usize] = pixel.alpha);
        blurred_whole += usize::from(alpha.iter().all(|alpha| *alpha == 0.0));
        let plain_count = leaks[0].add(shot, &person, |at| at_mask(at % width, at / width));
        let count = leaks[1].add(shot, &person, |at| alpha[at]);
        // The second frame is the first one that shows a person, and each comes once.
        if (1..shots.len()).contains(&index) {
            overlaps[0].add(shot, (0..alpha.len()).map(|at| at_mask(at % width, at / width)).collect());
            overlaps[1].add(shot, alpha);
        }
        if count > options.list {
            println!("frame {index}: {count} pixels of the room are sharp, {plain_count} with the plain mask");
        }
    }
    let room = ever_room.iter().filter(|ever| **ever).count().max(1);
    println!(
        "{} frames, {blurred_whole} of them blurred whole; the room is ever seen in {room} pixels",
        options.frames
    );
    print_overlaps(&overlaps);
    println!("sharp in any frame, pixels (percent of these) | pixels in a frame | person blurred, pixels in a frame");
    for leak in &leaks {
        for (k, beyond_px) in BEYOND_PX.into_iter().enumerate() {
            let sharp = leak.sharp[k].iter().filter(|sharp| **sharp).count();
            let frames = options.frames.max(1) as f64;
            println!(
                "{:<10} beyond {beyond_px:>2} px: {sharp:>7} ({:.3} %) | {:>8.1} | {:>8.1}",
                leak.name,
                100.0 * sharp as f64 / room as f64,
                leak.pixels[k] as f64 / frames,
                leak.missed as f64 / frames
            );
        }
    }
    Ok(())
}

fn print_overlaps(overlaps: &[Overlap; 2]) {
    println!(
        "by the margin, in pixels: overlap (IoU) | person blurred | room sharp | change of alpha of the person, 1/1000"
    );
    for (name, Overlap { sums, frames, .. }) in ["plain mask", "matte"].into_iter().zip(overlaps) {
        for (sums, margin_px) in sums.iter().zip(MARGINS_PX) {
            let [overlap, missed, spilt, change] = sums.map(|sum| sum / (*frames).max(1) as f64);
            let [missed, spilt, change] = [missed, spilt, change].map(|value| 1e3 * value);
            println!("{name:<10} {margin_px} px: {overlap:.4} | {missed:.2} | {spilt:.2} | {change:.2}");
        }
    }
}

/// Iterates over the frames without end, back and forth.
fn back_and_forth(shots: &[Shot]) -> impl Iterator<Item = &Shot> {
    shots.iter().chain(shots.iter().rev()).cycle()
}

/// Runs the network on a picture; returns its mask at each pixel, enlarged bilinearly.
fn run_plain(
    network: &mut Network,
    color: &ColorImage,
) -> Result<impl Fn(usize, usize) -> f32 + use<>, Box<dyn std::error::Error>> {
    let shape: Vec<usize> = network.inputs[0].shape.iter().map(|side| side.unwrap_or(1)).collect();
    let is_planar = shape[1] == 3;
    let [rows, columns] = if is_planar { [shape[2], shape[3]] } else { [shape[1], shape[2]] };
    let picture = image::RgbImage::from_raw(color.width, color.height, color.rgb.clone()).ok_or("no picture")?;
    let small = resize(&picture, columns as u32, rows as u32, FilterType::Triangle).into_raw();
    let value = |k: usize| match is_planar {
        true => small[3 * (k % (rows * columns)) + k / (rows * columns)],
        false => small[k],
    };
    let values = (0..small.len()).map(|k| f32::from(value(k)) / 255.0).collect();
    let mut outputs = Vec::new();
    network.run(&[Tensor { shape, values }], &mut outputs)?;
    let mask = outputs.pop().ok_or("no output")?.values;
    let (width, height) = (color.width as f32, color.height as f32);
    Ok(move |x: usize, y: usize| {
        let place = |at: usize, side: f32, count: usize| {
            let place = ((at as f32 + 0.5) * count as f32 / side - 0.5).clamp(0.0, (count - 1) as f32);
            (place as usize, (place as usize + 1).min(count - 1), place.fract())
        };
        let ((left, right, across), (above, below, down)) = (place(x, width, columns), place(y, height, rows));
        let row = |y: usize| mask[y * columns + left] * (1.0 - across) + mask[y * columns + right] * across;
        row(above) * (1.0 - down) + row(below) * down
    })
}

/// Loads the sequence, and what its depth says of each pixel.
fn load_shots(data: &Path) -> Result<Vec<Shot>, Box<dyn std::error::Error>> {
    let options = recording::Options { depth_scale: Some(1000.0), ..recording::Options::default() };
    let recording = Recording::open(&data.join("rgbd/person_turning"), &options)?;
    let (mut scratch, mut depth) = (Scratch::default(), DepthMap::default());
    let mut shots = Vec::new();
    for index in 0..recording.len() {
        let mut color = ColorImage::default();
        recording.read_color(index, &mut scratch, &mut color)?;
        recording.read_depth(index, &mut scratch, &mut depth)?;
        shots.push(Shot { color, room_px: find_room(&depth) });
    }
    for at in 0..shots.first().map_or(0, |shot| shot.room_px.len()) {
        let medians = [0, 1, 2].map(|p| {
            let codes = shots.iter().filter(|shot| shot.room_px[at] > 0).map(|shot| shot.color.rgb[3 * at + p]);
            let mut codes: Vec<u8> = codes.collect();
            let middle = codes.len() / 2;
            if codes.is_empty() { 0 } else { *codes.select_nth_unstable(middle).1 }
        });
        for Shot { color, room_px } in &mut shots {
            let is_room = (0..3).all(|p| color.rgb[3 * at + p].abs_diff(medians[p]) <= MAX_CHANGE);
            room_px[at] = if room_px[at] > 0 && !is_room { 0 } else { room_px[at] };
        }
    }
    Ok(shots)
}

/// Returns for each pixel of the room its distance from the person, by rows and columns; for one of the person minus the
/// distance from all others; 0 for unknown.
fn find_room(depth: &DepthMap) -> Vec<i32> {
    let size = (depth.width as usize, depth.height as usize);
    let is_near = |metres: f32| DepthMap::is_known(metres) && metres < MIN_ROOM_M;
    let distances_px = |is_near_source: bool| {
        let source = |&metres: &f32| if is_near(metres) == is_near_source { 0 } else { 1 << 20 };
        find_distances(depth.metres.iter().map(source).collect(), size)
    };
    let (from_person_px, from_others_px) = (distances_px(true), distances_px(false));
    let of_pixel = |(at, &metres): (usize, &f32)| match () {
        () if is_near(metres) => -from_others_px[at],
        () if DepthMap::is_known(metres) => from_person_px[at],
        () => 0,
    };
    depth.metres.iter().enumerate().map(of_pixel).collect()
}

/// Completes distances that are 0 at their sources: a distance transform in two passes, by the larger of both directions.
fn find_distances(mut distance_px: Vec<i32>, (width, height): (usize, usize)) -> Vec<i32> {
    for is_back in [false, true] {
        for k in 0..width * height {
            let at = if is_back { width * height - 1 - k } else { k };
            let (x, y) = (at % width, at / width);
            let mut least = distance_px[at];
            for (dx, dy) in
                [(1i32, 0i32), (-1, 1), (0, 1), (1, 1)].map(|(x, y)| if is_back { (x, y) } else { (-x, -y) })
            {
                let (x, y) = (x as i32 + dx, y as i32 + dy);
                if (0..width as i32).contains(&x) && (0..height as i32).contains(&y) {
                    least = least.min(distance_px[y as usize * width + x as usize] + 1);
                }
            }
            distance_px[at] = least;
        }
    }
    distance_px
}
