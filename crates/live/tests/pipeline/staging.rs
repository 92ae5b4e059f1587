//! The subject of a stream is put before a virtual background, and kept in the middle.
#![allow(missing_docs)]

use crate::common;

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use bokehcam::depth::backdrop::Background;
use bokehcam::depth::focus::FocusRule;
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam::link;
use bokehcam::look::{Effect, FramingZoom, Look, Strength};
use bokehcam_live::capture::{Camera, Captured, FrameData, SourceInfo};
use bokehcam_live::pipeline::{Run, View, run};
use bokehcam_live::sink::Null;
use common::{color, depth};

use crate::fakes::{camera_by, sink_by};

const SIZE: (u32, u32) = (320, 180);
const FRAMES: u32 = 90;
const PERSON: [u8; 3] = [200, 170, 40];
const WALL: [u8; 3] = [190, 30, 160];

/// A person who walks from the left to the right before a wall.
struct Walk;

impl Walk {
    /// Returns the person's centre, as a fraction of the width; the last frames stand still to let the framing settle.
    fn place(frame: u32) -> f32 {
        0.35 + 0.3 * (frame.saturating_sub(10) as f32 / 40.0).min(1.0)
    }

    fn is_person(frame: u32, x: u32, y: u32) -> bool {
        let off = (x as f32 + 0.5) / SIZE.0 as f32 - Self::place(frame);
        off.abs() < if y > 130 { 0.1 } else { 0.05 } && y > 90
    }

    fn taken(frame: u32) -> (ColorImage, DepthMap) {
        let is = |x, y| Self::is_person(frame, x, y);
        let light = |x: u32, y: u32, of: [u8; 3]| of.map(|code| code - ((x + y) % 5) as u8);
        let image = color(SIZE.0, SIZE.1, |x, y| light(x, y, if is(x, y) { PERSON } else { WALL }));
        (image, depth(SIZE.0, SIZE.1, |x, y| if is(x, y) { 1.0 } else { 3.0 }))
    }

    fn camera() -> Box<dyn Camera> {
        let (name, frames) = ("walk".into(), Some(u64::from(FRAMES)));
        let info =
            SourceInfo { name, size: SIZE, period_ns: 33_333_333, frames, live: false, frame_data: FrameData::Depth };
        camera_by(info, |index, shot| {
            if index == FRAMES as usize {
                return Captured::End;
            }
            (*shot.color, *shot.depth) = Self::taken(index as u32);
            Captured::Frame(Stamp { index, time_ns: index as u64 * 33_333_333, captured_ns: None })
        })
    }
}

fn stream(look: &Look, mirror: bool) -> Vec<ColorImage> {
    let (kept, stop) = (Arc::<Mutex<Vec<ColorImage>>>::default(), AtomicBool::new(false));
    let keeps = Arc::clone(&kept);
    let sink = sink_by(move |picture| keeps.lock().unwrap().push(picture.clone()));
    let made = Run::new(Walk::camera(), None, look.clone(), sink, &stop).unwrap();
    run(Run { mirror, ..made }).unwrap();
    let kept = std::mem::take(&mut *kept.lock().unwrap());
    assert_eq!(kept.len(), FRAMES as usize);
    kept
}

fn dof() -> Look {
    let strength = Strength::AtInfinity(6.0);
    Look { focus: FocusRule::Metres(1.0), strength, ..Look::with_effect(Effect::Dof) }
}

#[test]
fn the_wall_is_gone_to_the_last_trace_and_the_person_is_as_they_were() {
    let green = [0, 177, 64];
    let frames = stream(&Look { background: Background::Color(green), ..dof() }, false);
    for (frame, picture) in (0..FRAMES).zip(&frames) {
        let (taken, _) = Walk::taken(frame);
        for (at, (pixel, own)) in picture.rgb.as_chunks::<3>().0.iter().zip(taken.rgb.as_chunks::<3>().0).enumerate() {
            let (x, y) = (at as u32 % SIZE.0, at as u32 / SIZE.0);
            let off = |of: [u8; 3]| (0..3).map(|p| pixel[p].abs_diff(of[p])).max().unwrap();
            // The alpha of a pixel on the outline is not known to within a code.
            let near = |dx: i32| Walk::is_person(frame, (x as i32 + dx).clamp(0, 319) as u32, y);
            let above = [90, 91, 130, 131].contains(&y);
            if near(-2) != near(2) || above {
                assert!(pixel[2] < 100, "no magenta of the wall: {pixel:?} at {x}, {y} of {frame}");
            } else if Walk::is_person(frame, x, y) {
                assert!(off(*own) <= 2, "{pixel:?} not {own:?} at {x}, {y} of {frame}");
            } else {
                assert!(off(green) <= 1, "{pixel:?} at {x}, {y} of {frame}");
            }
        }
    }
}

#[test]
fn who_looks_on_sees_what_was_taken_beside_what_became_of_it() {
    let (green, stop) = ([0, 177, 64], AtomicBool::new(false));
    let (sender, mut views) = link::lossless::<View>();
    let look = Look { background: Background::Color(green), ..dof() };
    let made = Run::new(Walk::camera(), None, look, Box::new(Null), &stop).unwrap();
    let seen = std::thread::scope(|scope| {
        let seen = scope.spawn(move || {
            let mut count = 0;
            while let Some(view) = views.recv() {
                let (color, map) = Walk::taken(view.stamp.index as u32);
                assert!(view.color.as_deref() == Some(&color) && view.depth.as_ref().unwrap().metres == map.metres);
                let corner = &view.picture.memory().unwrap().rgb[..3];
                assert!(corner.iter().zip(green).all(|(code, green)| code.abs_diff(green) <= 1), "{corner:?}");
                count += 1;
            }
            count
        });
        run(Run { view: Some(sender), ..made }).unwrap();
        seen.join().unwrap()
    });
    assert_eq!(seen, FRAMES);
}

/// Returns the centre of the pixels of the person's colour, as a fraction of the width, and their fraction of the
/// picture.
fn seen(picture: &ColorImage) -> (f32, f32) {
    let is_person = |pixel: &[u8; 3]| pixel[1] > 120 && pixel[2] < 90;
    let pixels = picture.rgb.as_chunks::<3>().0;
    let columns: Vec<u32> =
        (0..).zip(pixels).filter(|(_, pixel)| is_person(pixel)).map(|(at, _)| at % SIZE.0).collect();
    let sum: u64 = columns.iter().map(|&x| u64::from(x)).sum();
    ((sum as f32 / columns.len() as f32 + 0.5) / SIZE.0 as f32, columns.len() as f32 / pixels.len() as f32)
}

#[test]
fn who_walks_stays_in_the_middle_and_is_no_larger_than_was_said() {
    let (whole, followed) =
        (stream(&dof(), false), stream(&Look { follow: FramingZoom::from_zoom(1.4), ..dof() }, false));
    let (before, after) = (seen(&whole[0]), seen(&followed[0]));
    assert!(
        (before.0 - 0.35).abs() < 0.02 && after.0 > 0.36 && after.0 < 0.5,
        "as far as the border lets it: {after:?}"
    );
    // While the person walks, the framing lags by a fraction of a second of the way.
    let most = (20..50).map(|k| (seen(&followed[k]).0 - 0.5).abs()).fold(0.0, f32::max);
    assert!(most < 0.15, "{most}");
    let last = seen(&followed[FRAMES as usize - 1]);
    assert!((last.0 - 0.5).abs() < 0.06, "{last:?}");
    let larger = (last.1 / seen(&whole[FRAMES as usize - 1]).1).sqrt();
    assert!((1.1..1.41).contains(&larger), "{larger}");
    let mirrored = stream(&Look { follow: FramingZoom::from_zoom(1.4), ..dof() }, true);
    for (picture, mirrored) in followed.iter().zip(&mirrored) {
        assert!((seen(picture).0 + seen(mirrored).0 - 1.0).abs() < 0.002, "mirrored after it was cut out");
    }
}
