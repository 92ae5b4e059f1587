//! Segmentation by background plate, under changes of light and camera position.
#![allow(missing_docs)]

use bokehcam::color::{linear_to_srgb, srgb_to_linear};
use bokehcam::depth::plate::{PlateDepth, Step};
use bokehcam::depth::{DepthSource, FrameInput};
use bokehcam::frame::{ColorImage, DepthMap, Stamp};
use bokehcam::recording::still;

use crate::program::Home;

const SIZE: (u32, u32) = (640, 360);
const FRAME_NS: u64 = 33_333_333;

/// Hashes three integers to a number from 0 to 1.
fn random(x: u32, y: u32, seed: u32) -> f32 {
    let mut bits = x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77) ^ seed.wrapping_mul(0xc2b2_ae3d);
    for _ in 0..3 {
        bits = (bits ^ bits >> 15).wrapping_mul(0x2c1b_3c6d);
    }
    (bits >> 8) as f32 / (1u32 << 24) as f32
}

/// A synthetic camera picture of a room.
#[derive(Clone, Copy)]
struct Shown {
    /// Centre of the person's head: column and row, in pixels.
    person: Option<(f32, f32)>,
    /// Factor of the light, per channel.
    light: [f32; 3],
    /// Displacement of the camera, in pixels.
    nudge_px: (f32, f32),
    /// Light in the person's shadow, as a fraction; 1 disables the shadow.
    shadow: f32,
    /// Brightness of a warm lamp that lights the wall on the left, relative to the room.
    lamp: f32,
    /// Whether a vase is on the sideboard.
    vase: bool,
    /// Seed of the noise.
    frame: u32,
}

const ROOM: Shown =
    Shown { person: None, light: [1.0; 3], nudge_px: (0.0, 0.0), shadow: 1.0, lamp: 0.0, vase: false, frame: 0 };

impl Shown {
    /// Returns the room's colour codes at a point: a wall with a pattern, a shelf, a bright window.
    fn room(x: f32, y: f32) -> [f32; 3] {
        let wave = (x * 0.045).sin() * (y * 0.06).cos() + 0.4 * (x * 0.21 + y * 0.13).sin();
        let wall = [120.0 + 22.0 * wave, 105.0 + 20.0 * wave, 90.0 + 15.0 * wave];
        match (x, y) {
            (x, y) if (430.0..560.0).contains(&x) && (40.0..150.0).contains(&y) => [225.0, 232.0, 240.0],
            (x, y) if y > 230.0 && y < 242.0 && x < 300.0 => [70.0, 45.0, 30.0],
            _ => wall,
        }
    }

    /// Whether the person, a head on shoulders, covers a point.
    fn covers((head_x, head_y): (f32, f32), x: f32, y: f32) -> bool {
        let head = ((x - head_x) / 48.0).hypot((y - head_y) / 62.0) < 1.0;
        head || ((x - head_x) / 120.0).powi(2) + ((y - head_y - 190.0) / 130.0).powi(2) < 1.0
    }

    fn picture(&self) -> (ColorImage, Vec<bool>) {
        let mut picture = ColorImage::new(SIZE.0, SIZE.1);
        let mut covered = Vec::new();
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                let (fx, fy) = (x as f32, y as f32);
                let is_person = self.person.is_some_and(|middle| Self::covers(middle, fx, fy));
                let vase = self.vase && (90.0..130.0).contains(&fx) && (170.0..230.0).contains(&fy);
                let mut codes = match () {
                    () if is_person && fy < self.person.unwrap().1 + 70.0 => [190.0, 140.0, 115.0],
                    () if is_person => [45.0, 60.0 + 10.0 * (fx * 0.3).sin(), 95.0],
                    () if vase => [60.0, 120.0, 70.0],
                    () => Self::room(fx - self.nudge_px.0, fy - self.nudge_px.1),
                };
                // A soft-edged shadow on the wall beside the person.
                let beside =
                    self.person.map_or(9.0, |(px, py)| ((fx - px - 110.0) / 90.0).hypot((fy - py - 60.0) / 120.0));
                let depth = ((1.6 - beside) / 1.2).clamp(0.0, 1.0);
                let shade = if is_person { 1.0 } else { 1.0 - (1.0 - self.shadow) * depth };
                let lit =
                    if is_person { 0.0 } else { self.lamp / (1.0 + ((fx - 90.0).hypot(fy - 60.0) / 110.0).powi(2)) };
                for ((code, light), warm) in codes.iter_mut().zip(self.light).zip([1.0, 0.8, 0.6]) {
                    let linear = srgb_to_linear(*code / 255.0) * (light * shade + warm * lit);
                    let noise = 5.0 * (random(x, y, self.frame * 3 + 1) + random(x, y, self.frame * 3 + 2) - 1.0);
                    *code = 255.0 * linear_to_srgb(linear.min(1.0)) + noise;
                }
                let at = 3 * (y * SIZE.0 + x) as usize;
                picture.rgb[at..at + 3].copy_from_slice(&codes.map(|code| code.round().clamp(0.0, 255.0) as u8));
                covered.push(is_person);
            }
        }
        (picture, covered)
    }
}

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

const PERSON: Shown = Shown { person: Some((300.0, 150.0)), ..ROOM };

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

#[test]
fn commands_take_plates_and_use_them() {
    let home = Home::new();
    let at = |name: &str| home.path(name);
    let (color, covered) = PERSON.picture();
    still::write_color(&at("me.png"), &color, false).unwrap();
    still::write_color(&at("room.png"), &ROOM.picture().0, false).unwrap();
    still::write_color(&at("small.png"), &ColorImage::new(64, 36), false).unwrap();
    let options = ["--depth", "plate:room.png", "--coc-at-infinity", "12", "--out", "out.png"];
    home.run(&[&["render", "me.png"], &options[..]].concat()).done();
    let out = still::read_color(&at("out.png")).unwrap();
    let change = |of: bool| {
        let differ = |at: &usize| out.rgb[3 * at].abs_diff(color.rgb[3 * at]) as f32;
        let all: Vec<f32> = (0..covered.len()).filter(|&at| covered[at] == of).map(|at| differ(&at)).collect();
        all.iter().sum::<f32>() / all.len() as f32
    };
    assert!(change(true) < 0.5 && change(false) > 1.5, "{} {}", change(true), change(false));

    for (arguments, code, part) in [
        (&["render", "me.png", "--depth", "plate", "--out", "a.png"][..], 2, "give the picture"),
        (
            &["render", "me.png", "--depth", "plate:small.png", "--out", "a.png"],
            2,
            "64 x 36, and the pictures are 640 x 360",
        ),
        (&["render", "me.png", "--depth", "plate:none.png", "--out", "a.png"], 1, "none.png"),
        (&["render", "me.png", "--depth", "plate:", "--out", "a.png"], 2, "name a file after the colon"),
        (&["render", "me.png", "--depth", "plate:room.png", "--focus", "1.2", "--out", "a.png"], 2, "--focus"),
        (&["render", "me.png", "--depth", "plate:room.png", "--force", "--out", "room.png"], 2, "which is the input"),
        (&["stream", "synthetic", "--depth", "plate", "--to", "null"], 2, "leave --depth out"),
        (&["render", "me.png", "--depth", "defocus", "--out", "a.png"], 2, "equally sharp"),
        (&["stream", "synthetic", "--depth", "defocus", "--to", "null"], 2, "leave --depth out"),
        (&["plate", "synthetic", "--frames", "3", "--to", "room.png"], 1, "exists"),
        (&["plate", "synthetic", "--frames", "3", "--to", "room.gif"], 2, "room.gif"),
    ] {
        home.run(arguments).refused(code, &[part]);
        assert!(!at("a.png").exists(), "{arguments:?}");
    }
    // A plate without a person before it is reported.
    let ran = home.run(&["render", "me.png", "--depth", "plate:me.png", "--force", "--out", "b.png"]);
    let said = ran.done();
    assert!(said.contains("me.png: nothing in the picture differs from the plate"), "{said}");
    assert_eq!(said.matches("warning").count(), 1, "{said}");
    let ran = home.run(&["plate", "me.png", "--to", "photo.png"]);
    assert!(ran.done().contains("a person in it becomes part of the plate"), "{}", ran.stderr);
    let ran = home.run(&["plate", "synthetic", "--frames", "24", "--size", "160x120", "--to", "new/plate.png"]);
    assert!(ran.done().contains("--depth plate:new/plate.png"), "{}", ran.stderr);
    assert_eq!(still::read_color(&at("new/plate.png")).unwrap().size(), (160, 120));
}
