//! Segmentation by background plate, under changes of light and camera position.
#![allow(missing_docs)]

use bokehcam::depth::plate::{PlateDepth, Step};
use bokehcam::depth::{DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Stamp};

use crate::room::{PERSON, ROOM, Shown};

const FRAME_NS: u64 = 33_333_333;

/// A plate depth source with a frame counter.
struct Watched {
    source: PlateDepth,
    frame: u32,
    map: DepthMap,
}

impl Watched {
    fn new(plate: Option<ColorImage>) -> Self {
        Self { source: PlateDepth::new(plate, None, None), frame: 0, map: DepthMap::default() }
    }

    /// Creates a source with a plate of the room.
    fn before_room() -> Self {
        Self::new(Some(ROOM.picture().0))
    }

    /// Processes a picture; returns the plate's state, the fraction of the person's pixels detected (recall), and the
    /// fraction of other pixels detected as the person (false positives).
    fn see(&mut self, shown: Shown) -> (Step, f32, f32) {
        self.frame += 1;
        let (color, covered) = Shown { frame: self.frame, ..shown }.picture();
        let time_ns = u64::from(self.frame) * FRAME_NS;
        let stamp = Stamp { index: self.frame as usize, time_ns, captured_ns: None };
        self.source.read(FrameInput { stamp, color: &color, right: None }, &mut self.map).unwrap();
        let share = |of: bool| {
            let near = |at: &usize| self.map.metres[*at] <= 1.0;
            let all: Vec<usize> = (0..covered.len()).filter(|&at| covered[at] == of).collect();
            all.iter().filter(|at| near(at)).count() as f32 / all.len().max(1) as f32
        };
        (self.source.guide().step(), share(true), share(false))
    }
}

#[test]
fn a_person_is_found_and_nobody_is_not() {
    let mut watched = Watched::before_room();
    assert_eq!(watched.see(ROOM), (Step::Ready, 0.0, 0.0));
    for step in 0..8 {
        let (step, found, mistaken) = watched.see(Shown { person: Some((250.0 + 8.0 * step as f32, 150.0)), ..ROOM });
        assert!(step == Step::Ready && found > 0.995 && mistaken < 0.002, "{step:?} {found} {mistaken}");
    }
}

#[test]
fn exposure_white_balance_a_nudge_shadows_and_lamps_are_no_persons() {
    for (what, shown) in [
        ("darker", Shown { light: [0.6, 0.6, 0.6], ..PERSON }),
        ("brighter", Shown { light: [1.3, 1.3, 1.3], ..PERSON }),
        ("warmer", Shown { light: [1.1, 1.0, 0.8], ..PERSON }),
        ("nudged", Shown { nudge_px: (2.5, -1.5), ..PERSON }),
        ("nudged more", Shown { nudge_px: (-5.0, 3.0), ..PERSON }),
        ("in shadow", Shown { shadow: 0.7, ..PERSON }),
        ("a lamp on", Shown { lamp: 0.9, ..PERSON }),
    ] {
        let mut watched = Watched::before_room();
        (0..4).for_each(|_| {
            watched.see(shown);
        });
        let (step, found, mistaken) = watched.see(shown);
        eprintln!("{what}: {found:.4} found, {mistaken:.4} mistaken");
        assert!(step == Step::Ready && found > 0.985 && mistaken < 0.01, "{what}: {step:?} {found} {mistaken}");
    }
}

#[test]
fn what_was_put_down_is_learned_and_who_sits_still_is_not() {
    let mut watched = Watched::before_room();
    let sits = Shown { vase: true, ..PERSON };
    let (_, found, mistaken) = watched.see(sits);
    assert!(found > 0.99 && mistaken > 0.005, "the vase is new: {found} {mistaken}");
    (0..240).for_each(|_| {
        watched.see(sits);
    });
    let (_, found, mistaken) = watched.see(sits);
    assert!(found > 0.99 && mistaken < 0.002, "after 8 s: {found} {mistaken}");
    // The vase remains background, and so does its former place, once seen.
    assert!(watched.see(Shown { vase: true, ..ROOM }).2 < 0.001);
}

#[test]
fn another_picture_is_said_and_all_is_blurred() {
    let other = |nudge_px| Shown { nudge_px, light: [0.35, 0.6, 1.4], ..PERSON };
    let mut watched = Watched::before_room();
    let moved = Shown { nudge_px: (160.0, 75.0), ..other((160.0, 75.0)) };
    let mut picture = moved.picture().0;
    // A different room.
    picture.rgb.chunks_exact_mut(3).enumerate().for_each(|(at, pixel)| {
        let code = (128.0 + 100.0 * (at as f32 * 0.013).sin()) as u8;
        pixel.copy_from_slice(&[code, 255 - code, code / 2]);
    });
    let stamp = Stamp { index: 0, time_ns: 0, captured_ns: None };
    watched.source.read(FrameInput { stamp, color: &picture, right: None }, &mut watched.map).unwrap();
    assert_eq!(watched.source.guide().step(), Step::Mismatched);
    assert!(watched.map.metres.iter().all(|&metres| metres > 100.0) && watched.map.matte.pixels.is_empty());
    // The known room is back.
    assert_eq!(watched.see(PERSON).0, Step::Ready);
}

#[test]
fn a_plate_is_taken_once_the_person_has_gone() {
    let mut watched = Watched::new(None);
    let mut steps = Vec::new();
    for frame in 0..240 {
        // The person is slow, and still in the picture after the countdown.
        let person = (frame < 120).then_some((300.0 + 4.0 * frame as f32, 150.0)).filter(|(x, _)| *x < 760.0);
        let (step, ..) = watched.see(Shown { person, ..ROOM });
        if steps.last() != Some(&step) {
            steps.push(step);
        }
        if step == Step::Ready {
            break;
        }
    }
    let is_taking = |step: &Step| matches!(step, Step::Capturing(_));
    assert_eq!(steps[..3], [Step::StepOut(3), Step::StepOut(2), Step::StepOut(1)], "{steps:?}");
    assert!(steps.contains(&Step::Moving) && steps.iter().any(is_taking), "{steps:?}");
    assert_eq!(steps.last(), Some(&Step::Ready));
    let (step, found, mistaken) = watched.see(PERSON);
    assert!(step == Step::Ready && found > 0.99 && mistaken < 0.002, "{found} {mistaken}");
    watched.source.guide().request_capture();
    assert_eq!(watched.see(PERSON).0, Step::StepOut(3));
}
