//! Stability of the disparity in static regions, and its accuracy at moving edges: with the memory of earlier frames,
//! and without.

use bokehcam::depth::focus::{Focus, FocusRule};
use bokehcam::depth::refine::Refiner;
use bokehcam::depth::stereo::{Effort, Pair, source};
use bokehcam::frame::{DepthMap, DisparityMap};
use bokehcam::optics::StereoRig;
use serde::Serialize;

use super::options::{Flicker, Options, effort_name};
use super::quality::picture::Plane;
use super::sequence::{Frame, Sequence, load_bundled, load_euroc, load_kitti};
use super::{Outcome, matcher, print_record};

/// Frames at the start of a sequence that are not measured: the memory has little content there.
const WARM_UP: usize = 2;
/// With ground truth, a pixel is static if, in the square of radius `STILL_REACH` around it, the true disparity changes
/// by no more than `STILL_PX` pixels, and each colour by no more than `STILL_CODES` (before noise is added).
const STATIC_PX: f32 = 1.0 / 128.0;
const STATIC_CODES: u8 = 1;
const STATIC_RADIUS_PX: i32 = 3;
/// Without ground truth, a pixel is static if the mean change of grey over that square is no more than this, in codes.
const STATIC_MEAN_CODES: f32 = 3.0;
/// A change of more than this, in pixels, counts as a jump.
const JUMP_PX: f32 = 1.0;
/// A moving edge is where the true disparity changes by more than `EDGE_PX` pixels, grown by `EDGE_REACH` pixels;
/// without the leftmost columns, as wide as the disparity range, which the right camera may not see.
const EDGE_PX: f32 = 1.5;
const EDGE_RADIUS_PX: i32 = 5;

/// The scores of one method on one sequence.
#[derive(Serialize)]
struct Record {
    sequence: &'static str,
    effort: &'static str,
    /// The processing step.
    step: &'static str,
    /// Whether earlier frames were remembered.
    memory: bool,
    /// Percentage of static pixels.
    still_percent: f64,
    /// Mean absolute change from frame to frame of still pixels, in pixels of disparity.
    still_change_px: f64,
    /// Percentage of static pixels that jump from one frame to the next.
    still_jumps_percent: f64,
    /// Percentage of pixels around moving edges that are off by more than 1 px.
    moving_bad1_percent: Option<f64>,
    /// Their mean error.
    moving_error_px: Option<f64>,
}

/// Measures and prints.
///
/// # Errors
/// Fails if a recording is unreadable, or a matcher cannot be created or fails.
pub fn run(flicker: &Flicker, options: &Options) -> Outcome {
    let mut sequences = vec![load_bundled()?];
    if let Some(data) = &flicker.data {
        sequences.extend(load_kitti(data)?.into_iter().chain(load_euroc(data)?));
    }
    if !options.json {
        println!("sequence  effort step     memory  still %  change px  jumps %   moving bad1 %  error px");
    }
    for mut sequence in sequences {
        let regions = find_regions(&sequence);
        if sequence.frames[0].truth.is_some() {
            (1..).zip(&mut sequence.frames).for_each(|(seed, frame)| frame.add_noise(flicker.noise, seed));
        }
        for &effort in &options.efforts {
            let [without, with] = [false, true].map(|memory| compute_disparities(&sequence, options, effort, memory));
            let (without, with) = (without?, with?);
            for (step, name) in ["matched", "refined"].into_iter().enumerate() {
                for (memory, maps) in [(false, &without[step]), (true, &with[step])] {
                    let record = score_flicker(&sequence, &regions, effort, maps);
                    let record = Record { step: name, memory, ..record };
                    print_record(options, &record.to_row(), &record)?;
                }
            }
        }
    }
    Ok(())
}

/// Returns the disparities of all frames, as matched and as refined. Without memory, every frame is treated as the
/// first.
fn compute_disparities(
    sequence: &Sequence,
    options: &Options,
    effort: Effort,
    memory: bool,
) -> Outcome<[Vec<Plane<f32>>; 2]> {
    let create = || {
        let size = sequence.frames[0].left.size();
        matcher::create_matcher(options, effort, sequence.disparities, size, None)
    };
    let (mut matcher, mut refiner) = (create()?, Refiner::new());
    let mut focus = Focus::new(FocusRule::Auto);
    let (mut matched, mut refined) = (Vec::new(), Vec::new());
    for frame in &sequence.frames {
        if !memory {
            (matcher, refiner) = (create()?, Refiner::new());
        }
        let mut map = DisparityMap::default();
        let [left, right] = frame.to_gray();
        matcher.compute_disparity(Pair { left: &left, color: Some(&frame.left), right: &right }, &mut map)?;
        let mut depth = disparity_to_depth(&map, &sequence.rig);
        refiner.set_focus(focus.focus_m(&depth, frame.time_ns));
        refiner.refine(&mut depth, &frame.left, frame.time_ns);
        let (width, height) = (map.width as usize, map.height as usize);
        let steady = depth.metres.iter().map(|&z_m| sequence.rig.disparity_px(z_m)).collect();
        refined.push(Plane { width, height, data: steady });
        matched.push(Plane { width, height, data: map.px });
    }
    Ok([matched, refined])
}

/// Converts a disparity map to depth, in a stream's way.
pub fn disparity_to_depth(map: &DisparityMap, rig: &StereoRig) -> DepthMap {
    let mut depth = DepthMap::default();
    source::disparity_to_depth(map, rig, &mut depth);
    depth
}

/// Static pixels of a frame against the previous one, and pixels around moving edges.
struct Regions {
    still: Plane<bool>,
    moving: Option<Plane<bool>>,
}

/// Returns the regions of every frame but the first.
fn find_regions(sequence: &Sequence) -> Vec<Regions> {
    sequence
        .frames
        .windows(2)
        .map(|pair| Regions { still: find_static_pixels(&pair[0], &pair[1]), moving: find_moving_edges(pair) })
        .collect()
}

fn find_static_pixels(before: &Frame, now: &Frame) -> Plane<bool> {
    let (width, height) = (now.left.width as usize, now.left.height as usize);
    if let (Some(a), Some(b)) = (&before.truth, &now.truth) {
        let differs = Plane::from_fn(width, height, |x, y| {
            let at = y * width + x;
            let codes = before.left.rgb[3 * at..3 * at + 3].iter().zip(&now.left.rgb[3 * at..3 * at + 3]);
            (a.data[at] - b.data[at]).abs() > STATIC_PX || codes.into_iter().any(|(a, b)| a.abs_diff(*b) > STATIC_CODES)
        });
        return dilate(&differs, STATIC_RADIUS_PX).map(|differs| !differs);
    }
    let ([a, _], [b, _]) = (before.to_gray(), now.to_gray());
    let change =
        Plane::from_fn(width, height, |x, y| f32::from(b.luma[y * width + x]) - f32::from(a.luma[y * width + x]));
    let mean = |of: &Plane<f32>, dx: i32, dy: i32| {
        Plane::from_fn(width, height, |x, y| {
            let sum: f32 = window(STATIC_RADIUS_PX).map(|d| of.at(x as i32 + d * dx, y as i32 + d * dy)).sum();
            sum / window(STATIC_RADIUS_PX).count() as f32
        })
    };
    // The mean of the absolute change: the signed mean is near zero where texture moves.
    mean(&mean(&change.map(f32::abs), 1, 0), 0, 1).map(|codes| codes <= STATIC_MEAN_CODES)
}

fn find_moving_edges(pair: &[Frame]) -> Option<Plane<bool>> {
    let (a, b) = (pair[0].truth.as_ref()?, pair[1].truth.as_ref()?);
    let jumps = a.data.iter().zip(&b.data).map(|(a, b)| (a - b).abs() > EDGE_PX).collect();
    Some(dilate(&Plane { width: b.width, height: b.height, data: jumps }, EDGE_RADIUS_PX))
}

fn window(px: i32) -> std::ops::RangeInclusive<i32> {
    -px..=px
}

/// Dilates by a square of radius `px`.
fn dilate(of: &Plane<bool>, px: i32) -> Plane<bool> {
    let along = |of: &Plane<bool>, dx: i32, dy: i32| {
        Plane::from_fn(of.width, of.height, |x, y| window(px).any(|d| of.at(x as i32 + d * dx, y as i32 + d * dy)))
    };
    along(&along(of, 1, 0), 0, 1)
}

/// Computes all scores; the caller sets the step and the memory.
fn score_flicker(sequence: &Sequence, regions: &[Regions], effort: Effort, maps: &[Plane<f32>]) -> Record {
    let (mut fraction, mut change, mut jumps) = <(Mean, Mean, Mean)>::default();
    let (mut bad, mut error) = <(Mean, Mean)>::default();
    for index in 1 + WARM_UP..maps.len() {
        let (Regions { still, moving }, now, before) = (&regions[index - 1], &maps[index], &maps[index - 1]);
        let truth = sequence.frames[index].truth.as_ref();
        for at in 0..now.data.len() {
            let change_px = (now.data[at] - before.data[at]).abs();
            fraction.add(f32::from(still.data[at]));
            if still.data[at] && change_px.is_finite() {
                change.add(change_px);
                jumps.add(f32::from(change_px > JUMP_PX));
            }
            if let (Some(truth), Some(moving)) = (truth, moving)
                && moving.data[at]
                && at % now.width >= sequence.disparities as usize
            {
                let error_px = (now.data[at] - truth.data[at]).abs();
                bad.add(f32::from(error_px > 1.0));
                error.add(error_px);
            }
        }
    }
    Record {
        sequence: sequence.name,
        effort: effort_name(effort),
        step: "",
        memory: false,
        still_percent: 100.0 * fraction.value().unwrap_or(f64::NAN),
        still_change_px: change.value().unwrap_or(f64::NAN),
        still_jumps_percent: 100.0 * jumps.value().unwrap_or(f64::NAN),
        moving_bad1_percent: bad.value().map(|fraction| 100.0 * fraction),
        moving_error_px: error.value(),
    }
}

#[derive(Default)]
struct Mean {
    sum: f64,
    count: u64,
}

impl Mean {
    fn add(&mut self, value: f32) {
        self.sum += f64::from(value);
        self.count += 1;
    }

    fn value(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }
}

impl Record {
    fn to_row(&self) -> String {
        let cell = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2}"));
        format!(
            "{:9} {:6} {:8} {:6} {:8.1} {:10.4} {:8.3} {:>15} {:>9}",
            self.sequence,
            self.effort,
            self.step,
            if self.memory { "on" } else { "off" },
            self.still_percent,
            self.still_change_px,
            self.still_jumps_percent,
            cell(self.moving_bad1_percent),
            cell(self.moving_error_px)
        )
    }
}
