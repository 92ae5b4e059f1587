//! Segmentation by background plate: combined with networks, and compared with a depth sensor on a real sequence.

use bokehcam::depth::plate::{PlateDepth, Step};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam_networks::network::Task;
use bokehcam_networks::single_camera::{Hints, SingleCamera};

use tempfile::TempDir;

use super::onnx::matte;
use super::real::{Sequence, model, sure};
use super::{WEIGHTS, disc, read, written};

/// Maximum samples per background pixel; each must be more than `AWAY_PX` from the person.
const SAMPLES: usize = 15;
const AWAY_PX: usize = 10;

/// Estimates the background of a sequence as the median over frames in which the network sees the person elsewhere;
/// also returns where it is known.
fn background(sequence: &Sequence) -> (ColorImage, Vec<bool>) {
    let matte = model(Task::Matte);
    let mut person = SingleCamera::open(Some(&matte), None, &Hints::default()).unwrap();
    let mut samples: Vec<Vec<[u8; 3]>> = Vec::new();
    let mut size = (0, 0);
    for index in 0..sequence.len() {
        let (color, _) = sequence.frame(index);
        size = (color.width as usize, color.height as usize);
        let map = read(&mut person, &color, index as u64);
        let covered: Vec<bool> = {
            let mut rows = map.metres.iter().map(|&metres| metres <= 1.0).collect::<Vec<_>>();
            for (count, step, line) in [(size.0, 1, size.1), (size.1, size.0, size.0)] {
                let before = rows.clone();
                for at in 0..line {
                    let place = |k: usize| if step == 1 { at * size.0 + k } else { k * size.0 + at };
                    for k in 0..count {
                        let around = k.saturating_sub(AWAY_PX)..(k + AWAY_PX + 1).min(count);
                        rows[place(k)] = around.into_iter().any(|k| before[place(k)]);
                    }
                }
            }
            rows
        };
        samples.resize(size.0 * size.1, Vec::new());
        for (at, pixel) in color.rgb.chunks_exact(3).enumerate() {
            if !covered[at] && samples[at].len() < SAMPLES {
                samples[at].push([pixel[0], pixel[1], pixel[2]]);
            }
        }
    }
    let mut plate = ColorImage::new(size.0 as u32, size.1 as u32);
    let known: Vec<bool> = samples.iter().map(|samples| samples.len() >= 3).collect();
    let mut last = [128; 3];
    for (at, samples) in samples.iter().enumerate() {
        if known[at] {
            last = [0, 1, 2].map(|p| {
                let mut values: Vec<u8> = samples.iter().map(|sample| sample[p]).collect();
                values.sort_unstable();
                values[values.len() / 2]
            });
        }
        // Unseen pixels take their neighbour's colour; they are excluded from the evaluation.
        plate.rgb[3 * at..3 * at + 3].copy_from_slice(&last);
    }
    (plate, known)
}

#[test]
#[ignore = "needs BOKEHCAM_DATA, a folder with models and rgbd/person_turning"]
fn a_real_person_before_a_plate_is_found() {
    let sequence = Sequence::open();
    let (plate, known) = background(&sequence);
    let mut source = PlateDepth::new(Some(plate), None, None);
    let (mut found, mut persons, mut mistaken, mut walls) = (0u64, 0u64, 0u64, 0u64);
    let (mut flicker, mut resting) = (0.0f64, 0u64);
    let mut last: Option<(DepthMap, Vec<bool>)> = None;
    for index in 0..sequence.len() {
        let (color, depth) = sequence.frame(index);
        let (person, wall) = sure(&depth);
        let map = read(&mut source, &color, index as u64);
        for at in (0..known.len()).filter(|&at| known[at]) {
            let is_near = map.metres[at] <= 1.0;
            found += u64::from(person[at] && is_near);
            persons += u64::from(person[at]);
            mistaken += u64::from(wall[at] && is_near);
            walls += u64::from(wall[at]);
        }
        if let Some((before, wall_before)) = &last {
            for at in (0..known.len()).filter(|&at| wall[at] && wall_before[at]) {
                flicker += f64::from(u8::from((map.metres[at] <= 1.0) != (before.metres[at] <= 1.0)));
                resting += 1;
            }
        }
        last = Some((map, wall));
    }
    let (found, mistaken) = (found as f64 / persons as f64, mistaken as f64 / walls as f64);
    let flicker = 1e3 * flicker / resting as f64;
    eprintln!("person found {found:.4} of {persons}, wall mistaken {mistaken:.4}, flicker {flicker:.3}e-3");
    assert!(found >= 0.99 && mistaken <= 0.01, "{found} {mistaken}");
}

/// With networks, no plate is captured while a person is in the picture, however still they sit, and other changes,
/// such as a lamp's light on the wall, remain background.
#[test]
fn a_plate_and_networks_know_more_together() {
    let folder = TempDir::new().unwrap();
    let file = written(&folder, "m.onnx", &matte(64, 36, WEIGHTS, 0.0));
    let networks = SingleCamera::open(Some(&file), Some(&file), &Hints::default()).expect("the test's own network");
    let mut source = PlateDepth::new(None, None, Some(Box::new(networks)));
    let guide = source.guide();
    let (person, shares) = disc(320, 180, (160.0, 90.0), 40.0);
    let (room, _) = disc(320, 180, (-500.0, 90.0), 40.0);
    let near = |map: &DepthMap, x: usize, y: usize| map.metres[y * 320 + x] <= 1.0;
    // Frames are 33 ms apart.
    for frame in 0..150 {
        let map = read(&mut source, &person, frame);
        assert!(near(&map, 160, 90) && !near(&map, 20, 20), "frame {frame}: the networks know");
        assert!(
            matches!(guide.step(), Step::StepOut(_) | Step::Capturing(0) | Step::Moving | Step::PersonThere),
            "{:?}",
            guide.step()
        );
    }
    let taken = (150..300).find(|&frame| {
        read(&mut source, &room, frame);
        guide.step() == Step::Ready
    });
    let taken = taken.expect("a plate of the room");
    let mut lit = person.clone();
    for at in (0..320 * 180).filter(|at| at % 320 < 110) {
        // Green occurs neither in the person nor in the wall.
        lit.rgb[3 * at + 1] = 200;
    }
    for (picture, what) in [(&person, "as it was"), (&lit, "in another light")] {
        let mut map = DepthMap::default();
        (0..6).for_each(|k| map = read(&mut source, picture, taken + 1 + k));
        assert_eq!(guide.step(), Step::Ready);
        let wrong = (0..320 * 180).filter(|&at| (map.metres[at] <= 1.0) != (shares[at] > 0.5)).count();
        assert!(wrong < 320 * 180 / 100, "{what}: {wrong} pixels");
    }
}
