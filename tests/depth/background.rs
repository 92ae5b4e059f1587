//! The background memory keeps a surface where it was seen, and drops it where the scene contradicts it.
#![allow(missing_docs)]

use crate::common;

use std::ops::Range;
use std::sync::LazyLock;

use bokehcam::color::srgb_to_linear;
use bokehcam::compute::thread_pool::ThreadPool;
use bokehcam::depth::background::BackgroundMemory;
use bokehcam::depth::focus::FocusRule;
use bokehcam::engine::{CocCalculator, Postprocess};
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::look::{CocAtInfinity, CocRule};
use bokehcam::optics::DepthCoc;
use common::{color, depth, noise};

const SIZE: (u32, u32) = (160, 96);
const PERIOD_NS: u64 = 33_333_333;
const LENS: DepthCoc = DepthCoc { coc_at_infinity_px: 10.0, focus_m: 1.0, range_m: 0.0, max_coc_px: 20.0 };
const PERSON: [u8; 3] = [200, 90, 60];
/// Width of the person in columns, and the step to the right that they take.
const WIDE: u32 = 50;
const STEP: u32 = 20;

/// A person before a wall that is `brightness` times its first brightness, both `shift` columns further right; and,
/// behind the person, an object.
struct Shot {
    person: u32,
    shift: u32,
    brightness: f32,
    thing: Option<Thing>,
}

/// A green object, from the row [`THING_ROW`] down.
struct Thing {
    columns: Range<u32>,
    metres: f32,
}

const THING_ROW: u32 = 64;
const GREEN: [u8; 3] = [20, 160, 40];

impl Shot {
    fn wall(&self, x: u32, y: u32) -> [u8; 3] {
        static GRAIN: LazyLock<ColorImage> = LazyLock::new(|| noise(SIZE.0, SIZE.1));
        let (x, y) = ((x + SIZE.0 - self.shift) % SIZE.0 / 4 * 4, y / 4 * 4);
        let code = GRAIN.rgb[3 * (y * SIZE.0 + x) as usize];
        // Exposure scales light, which is about its square root in codes.
        [60 + code / 3, 80 + code / 4, 100 + code / 5].map(|code| (f32::from(code) * self.brightness) as u8)
    }

    /// Returns the depth of the object at a pixel, if it is there.
    fn thing_m(&self, x: u32, y: u32) -> Option<f32> {
        self.thing.as_ref().filter(|thing| y >= THING_ROW && thing.columns.contains(&x)).map(|thing| thing.metres)
    }

    fn is_person(&self, x: u32, y: u32) -> bool {
        y >= 20 && (self.person..self.person + WIDE).contains(&x)
    }

    fn taken(&self) -> (ColorImage, DepthMap) {
        let wall: Vec<[u8; 3]> = (0..SIZE.0 * SIZE.1).map(|at| self.wall(at % SIZE.0, at / SIZE.0)).collect();
        let person = PERSON.map(|code| (f32::from(code) * self.brightness) as u8);
        let color_of = |x: u32, y: u32| match () {
            () if self.is_person(x, y) => person,
            () if self.thing_m(x, y).is_some() => GREEN,
            () => wall[(y * SIZE.0 + x) as usize],
        };
        let depth_of = |x: u32, y: u32| if self.is_person(x, y) { 1.0 } else { self.thing_m(x, y).unwrap_or(4.0) };
        (color(SIZE.0, SIZE.1, color_of), depth(SIZE.0, SIZE.1, depth_of))
    }
}

const BEFORE: Shot = Shot { person: 40, shift: 0, brightness: 1.0, thing: None };

struct Seer {
    background: BackgroundMemory,
    time_ns: u64,
}

impl Seer {
    fn new() -> Self {
        Self { background: BackgroundMemory::default(), time_ns: 0 }
    }

    /// Passes a shot for some frames; returns the last map, with the known background.
    fn see(&mut self, shot: &Shot, frames: usize) -> DepthMap {
        let (picture, map) = shot.taken();
        let mut last = map.clone();
        for _ in 0..frames {
            let mut workers = ThreadPool::new("background", 2);
            self.background.update_covering(&mut workers, (&map, &picture), &LENS);
            self.background.update(&mut workers, (&map, &picture), &LENS, self.time_ns);
            last.clone_from(&map);
            self.background.reveal_background(&mut workers, &mut last, &picture, &LENS);
            self.time_ns += PERIOD_NS;
        }
        last
    }
}

/// Returns the mean error of the known background against the wall of a shot, and the number of pixels that have one.
fn off(map: &DepthMap, shot: &Shot) -> (f32, usize) {
    let (picture, _) = shot.taken();
    let (mut sum, count) = (0.0, map.matte.pixels.len());
    for pixel in &map.matte.pixels {
        assert_eq!((pixel.near_m, pixel.alpha, pixel.background_alpha), (1.0, 1.0, 1.0));
        assert!((pixel.far_m - 4.0).abs() < 1e-3, "{pixel:?}");
        let (x, y) = (pixel.at % SIZE.0, pixel.at / SIZE.0);
        assert!(shot.is_person(x, y));
        let wall = shot.wall(x, y);
        for (p, code) in wall.into_iter().enumerate() {
            let own = srgb_to_linear(f32::from(picture.rgb[3 * pixel.at as usize + p]) / 255.0);
            sum += (own - pixel.difference[p] - srgb_to_linear(f32::from(code) / 255.0)).abs();
        }
    }
    (sum / (3 * count).max(1) as f32, count)
}

#[test]
fn what_a_step_covers_is_known_and_nothing_else_is() {
    let mut seer = Seer::new();
    assert!(seer.see(&BEFORE, 40).matte.pixels.is_empty(), "nothing was seen of what is hidden");
    let after = Shot { person: BEFORE.person + STEP, ..BEFORE };
    let (off, count) = off(&seer.see(&after, 1), &after);
    assert!(off < 0.004, "{off}");
    // Everything that was seen as wall, but for a margin at the earlier outline.
    let covered = (STEP * (SIZE.1 - 20)) as usize;
    assert!(count <= covered && count * 5 >= covered * 4, "{count} of {covered}");
}

#[test]
fn another_exposure_makes_what_is_hidden_another_one_too() {
    let mut seer = Seer::new();
    seer.see(&BEFORE, 40);
    let after = Shot { person: BEFORE.person + STEP, brightness: 0.85, ..BEFORE };
    let (off, count) = off(&seer.see(&after, 20), &after);
    assert!(off < 0.015 && count > 1000, "{off}, {count}");
}

/// Counts the person's pixels with a known background, above the rows of the object and in them.
fn known_above_and_beside(map: &DepthMap, columns: Range<u32>) -> [usize; 2] {
    let count = |rows: Range<u32>| {
        let is_within = |at: u32| rows.contains(&(at / SIZE.0)) && columns.contains(&(at % SIZE.0));
        map.matte.pixels.iter().filter(|pixel| is_within(pixel.at)).count()
    };
    [count(20..THING_ROW - 32), count(THING_ROW..SIZE.1)]
}

#[test]
fn behind_who_steps_before_a_thing_is_not_the_wall_that_it_hides() {
    let mut seer = Seer::new();
    seer.see(&BEFORE, 40);
    let thing = || Some(Thing { columns: 120..150, metres: 2.0 });
    let hidden = seer.see(&Shot { thing: thing(), ..BEFORE }, 12);
    assert!(known_above_and_beside(&hidden, 120..150)[1] > 800, "the wall is behind the thing");
    // Dropped in the first frame already; and the wall does not show where the object continues, either.
    let after = seer.see(&Shot { person: 90, thing: thing(), ..BEFORE }, 1);
    let [above, beside] = known_above_and_beside(&after, 120..140);
    assert!(above > 150 && beside == 0, "{above} pixels before the wall, and {beside} before the thing");
    assert_eq!(known_above_and_beside(&after, 140..150), [0, 0]);
}

#[test]
fn what_is_seen_beside_somebody_tells_of_what_is_behind_them() {
    for metres in [2.0, 4.0] {
        let mut seer = Seer::new();
        seer.see(&BEFORE, 40);
        let before = Shot { person: BEFORE.person + STEP, ..BEFORE };
        let [above, beside] = known_above_and_beside(&seer.see(&before, 4), 90..110);
        assert!(above > 150 && beside > 400, "{above}, {beside}");
        // Half of the object is behind the person: there the wall is hidden, or looks different.
        let after = Shot { thing: Some(Thing { columns: 100..150, metres }), ..before };
        let [above, beside] = known_above_and_beside(&seer.see(&after, 8), 94..110);
        assert!(above > 100 && beside == 0, "{metres} m: {above} pixels before the wall, {beside} before the thing");
    }
}

#[test]
fn a_camera_that_moves_remembers_nothing() {
    let mut seer = Seer::new();
    seer.see(&BEFORE, 40);
    let after = Shot { person: BEFORE.person + STEP, shift: 4, ..BEFORE };
    assert!(seer.see(&after, 4).matte.pixels.is_empty());
    // The camera is still again, and learns the new view.
    seer.see(&after, 60);
    let back = Shot { person: after.person + STEP, ..after };
    let (off, count) = off(&seer.see(&back, 1), &back);
    assert!(off < 0.004 && count > 1000, "{off}, {count}");
}

#[test]
fn what_was_seen_shortly_and_is_hidden_for_long_fades() {
    let mut seer = Seer::new();
    seer.see(&BEFORE, 40);
    let after = Shot { person: BEFORE.person + STEP, ..BEFORE };
    assert!(seer.see(&after, 240).matte.pixels.is_empty(), "it was seen for a second, and hidden for eight");
}

#[test]
fn another_place_or_size_is_begun_anew() {
    let mut seer = Seer::new();
    seer.see(&BEFORE, 40);
    // A cut in a recording: time jumps back.
    seer.time_ns = 0;
    let after = Shot { person: BEFORE.person + STEP, ..BEFORE };
    assert!(seer.see(&after, 2).matte.pixels.is_empty());
    let (picture, mut map) = (noise(32, 24), depth(32, 24, |_, _| 1.0));
    let mut workers = ThreadPool::new("background", 2);
    seer.background.update(&mut workers, (&map, &picture), &LENS, seer.time_ns);
    seer.background.reveal_background(&mut workers, &mut map, &picture, &LENS);
    assert!(map.matte.pixels.is_empty());
    let small = depth(16, 12, |_, _| 1.0);
    seer.background.update(&mut workers, (&small, &picture), &LENS, seer.time_ns);
    seer.background.reveal_background(&mut workers, &mut map, &picture, &LENS);
    assert!(map.matte.pixels.is_empty(), "a map of another size");
}

/// Smooth depth has slopes for outlines: there the background cannot be separated from the foreground.
#[test]
fn of_smooth_depth_nothing_is_remembered() {
    let (focus, lens) = (FocusRule::Metres(1.0), CocAtInfinity::Px(10.0));
    let rule = CocRule::Depth { focus, lens, range_m: 0.0, max_coc_px: 20.0 };
    for is_smooth in [false, true] {
        let mut coc = CocCalculator::new(rule, Postprocess::Keep);
        coc.set_background_memory(true);
        let mut hidden = 0;
        for frame in 0..44 {
            let person = if frame < 40 { BEFORE.person } else { BEFORE.person + STEP };
            let (picture, mut map) = Shot { person, ..BEFORE }.taken();
            map.is_smooth = is_smooth;
            coc.compute(&mut map, &picture, frame * PERIOD_NS);
            hidden = map.matte.pixels.iter().filter(|pixel| pixel.alpha == 1.0).count();
        }
        assert_eq!(hidden > 0, !is_smooth, "{hidden} pixels hide something");
    }
}
