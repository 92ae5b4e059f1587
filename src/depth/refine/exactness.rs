//! Whether the depth of a stream is exact: known everywhere, without noise, and at rest where its picture rests.
//!
//! Refinement mends what sensors get wrong. Where nothing is wrong it can only lose: what is thin, as hair is, it takes for
//! noise. One frame tells little, so that several decide, and depth that was found to be a sensor's remains so for long.

use super::noise::{NO_NOISE, NoiseMeter};
use super::temporal::{MOVED, MOVED_BOUNDS};
use crate::frame::{ColorImage, DepthMap};

/// Once something is decided, two frames that follow each other are compared in one of so many.
const EVERY: u32 = 5;
/// So many looks in a row decide, and so many that depth is exact which was not so before: five seconds at 30 frames a second.
const DECISION: u32 = 3;
const LONG_DECISION: u32 = 30;
/// Rows and columns that are looked at, at most.
const LOOKS: usize = 96;
/// Where colours rest in less than this share of the picture, nothing is learned of how steady depth is.
const LEAST_RESTING: f32 = 0.1;

/// What speaks against exact depth.
#[derive(Clone, Copy, Debug)]
struct Faults {
    /// Share of the pixels whose depth is unknown.
    holes: f32,
    /// Standard deviation of the noise, as a share of the median of inverse depth.
    noise: f32,
    /// Share of the pixels with resting colours whose depth does not rest.
    restless: f32,
}

impl Faults {
    /// Depth with less than these becomes exact, and remains so with less than those (hysteresis).
    const MOST: [Self; 2] = [
        Self { holes: 0.001, noise: NO_NOISE, restless: 0.01 },
        Self { holes: 0.01, noise: 2.0 * NO_NOISE, restless: 0.03 },
    ];

    fn are_within(self, most: Self) -> bool {
        self.holes <= most.holes && self.noise <= most.noise && self.restless <= most.restless
    }
}

/// Decides from frame to frame; owns the memory for it.
#[derive(Debug, Default)]
pub struct Exactness {
    is_exact: bool,
    /// Whether depth was ever found not to be exact.
    was_inexact: bool,
    /// Looks in a row that speak against what is decided.
    against: u32,
    /// Frames that were taken.
    frames: u32,
    meter: NoiseMeter,
    size: (u32, u32),
    /// Of the frame before, if that was looked at, and of this one.
    before: Vec<Look>,
    now: Vec<Look>,
    changes: Vec<f32>,
    sorted: Vec<f32>,
}

/// A pixel that is looked at.
#[derive(Clone, Copy, Debug)]
struct Look {
    rgb: [u8; 3],
    /// Inverse depth in 1/m; 0 where it is unknown.
    inverse: f32,
}

impl Exactness {
    /// Whether depth was found to be exact.
    pub fn is_exact(&self) -> bool {
        self.is_exact
    }

    /// Another scene comes: it is not compared with the frame before.
    pub fn forget(&mut self) {
        self.before.clear();
    }

    /// Takes the next frame with its depth as it was measured, and decides. Nothing is decided where the map has not the size
    /// of the picture.
    pub fn look(&mut self, map: &DepthMap, color: &ColorImage) {
        let is_decided = self.is_exact || self.was_inexact;
        let turn = self.frames % EVERY;
        self.frames = self.frames.wrapping_add(1);
        if map.size() != color.size() || map.metres.is_empty() || is_decided && turn > 1 {
            return self.before.clear();
        }
        self.sample(map, color);
        let (now, before) = (&self.now, &self.before);
        let restless = if self.size == map.size() && before.len() == now.len() {
            restless(now, before, (&mut self.changes, &mut self.sorted))
        } else {
            None
        };
        if let Some(restless) = restless {
            self.decide(map, restless);
        }
        self.size = map.size();
        std::mem::swap(&mut self.now, &mut self.before);
    }

    /// Looks at the pixels of a grid.
    fn sample(&mut self, map: &DepthMap, color: &ColorImage) {
        let (width, height) = (map.width as usize, map.height as usize);
        self.now.clear();
        for y in (0..height).step_by(height.div_ceil(LOOKS)) {
            for at in (y * width..(y + 1) * width).step_by(width.div_ceil(LOOKS)) {
                let rgb = [0, 1, 2].map(|p| color.rgb[3 * at + p]);
                self.now.push(Look { rgb, inverse: DepthMap::inverse_of(map.metres[at]) });
            }
        }
    }

    /// Lets a frame count, whose depth does not rest in this share of the pixels whose colours do.
    fn decide(&mut self, map: &DepthMap, restless: f32) {
        let size = (map.width as usize, map.height as usize);
        let inverse = |at: usize| DepthMap::inverse_of(map.metres[at]);
        let noise = self.meter.noise(inverse, |at| inverse(at) == 0.0, size);
        let known = self.sorted.len();
        let Some(median) = middle(&mut self.sorted) else { return };
        let holes = 1.0 - known as f32 / self.now.len() as f32;
        let faults = Faults { holes, noise: noise / median, restless };
        let speaks_against = faults.are_within(Faults::MOST[usize::from(self.is_exact)]) != self.is_exact;
        self.was_inexact |= !self.is_exact && !speaks_against;
        self.against = if speaks_against { self.against + 1 } else { 0 };
        let needed = if self.was_inexact && !self.is_exact { LONG_DECISION } else { DECISION };
        if self.against >= needed {
            (self.is_exact, self.against) = (!self.is_exact, 0);
            self.was_inexact |= !self.is_exact;
        }
    }
}

/// The share of the pixels with resting colours whose depth does not rest; `None` if there are too few. Fills `sorted` with
/// the inverse depths that are known now.
fn restless(now: &[Look], before: &[Look], (changes, sorted): (&mut Vec<f32>, &mut Vec<f32>)) -> Option<f32> {
    let change = |(now, before): (&Look, &Look)| {
        now.rgb.iter().zip(before.rgb).map(|(now, before)| f32::from(now.abs_diff(before))).sum::<f32>()
    };
    changes.clear();
    changes.extend(now.iter().zip(before).map(change));
    let moved = (MOVED * middle(changes)?).clamp(MOVED_BOUNDS.0, MOVED_BOUNDS.1);
    sorted.clear();
    sorted.extend(now.iter().map(|look| look.inverse).filter(|&inverse| inverse > 0.0));
    let least = NO_NOISE * middle(sorted)?;
    let (mut resting, mut restless) = (0, 0);
    for pair @ (now, before) in now.iter().zip(before) {
        if change(pair) <= moved {
            resting += 1;
            restless += usize::from((now.inverse - before.inverse).abs() > least);
        }
    }
    let is_enough = resting as f32 >= LEAST_RESTING * now.len() as f32;
    is_enough.then(|| restless as f32 / resting as f32)
}

/// The median; changes the order.
fn middle(values: &mut [f32]) -> Option<f32> {
    let at = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(at, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (u32, u32) = (128, 96);

    /// What is done to the depth of a frame.
    type Damage = fn(at: u32, frame: u32, z_m: f32) -> f32;

    /// A picture with thin things, and its depth, damaged.
    fn frame(number: u32, damage: Damage) -> (ColorImage, DepthMap) {
        let (mut color, mut map) = (ColorImage::new(SIZE.0, SIZE.1), DepthMap::new(SIZE.0, SIZE.1));
        for at in 0..SIZE.0 * SIZE.1 {
            let is_near = (at % SIZE.0).is_multiple_of(9) || at / SIZE.0 > 60;
            color.rgb[3 * at as usize..][..3].fill(if is_near { 60 } else { 180 });
            map.metres[at as usize] = damage(at, number, if is_near { 1.0 } else { 3.0 });
        }
        (color, map)
    }

    fn noise(at: u32, frame: u32) -> f32 {
        let bits = at.wrapping_mul(0x9E37_79B9) ^ frame.wrapping_mul(0x85EB_CA6B);
        (bits ^ bits >> 15).wrapping_mul(0x2C1B_3C6D) as f32 / u32::MAX as f32 - 0.5
    }

    const EXACT: Damage = |_, _, z_m| z_m;
    const HOLES: Damage = |at, _, z_m| if at.is_multiple_of(50) { 0.0 } else { z_m };
    const NOISE: Damage = |at, _, z_m| z_m * (1.0 + 0.02 * noise(at, 0));
    const RESTLESS: Damage = |at, frame, z_m| if at % 13 == frame % 2 { z_m * 1.01 } else { z_m };

    /// Whether depth is found to be exact after each of so many frames of each kind.
    fn decisions(exactness: &mut Exactness, kinds: &[(Damage, u32)]) -> Vec<bool> {
        let mut looks = Vec::new();
        for &(damage, count) in kinds {
            for number in 0..count {
                let (color, map) = frame(number, damage);
                exactness.look(&map, &color);
                looks.push(exactness.is_exact());
            }
        }
        looks
    }

    #[test]
    fn exact_depth_is_known_after_a_few_frames() {
        let looks = decisions(&mut Exactness::default(), &[(EXACT, 200)]);
        assert_eq!(looks.iter().position(|&exact| exact), Some(DECISION as usize));
        assert!(looks[DECISION as usize..].iter().all(|&exact| exact));
    }

    #[test]
    fn depth_with_holes_or_noise_or_that_flickers_is_not_exact() {
        for damage in [HOLES, NOISE, RESTLESS] {
            assert!(decisions(&mut Exactness::default(), &[(damage, 300)]).iter().all(|&exact| !exact));
        }
    }

    #[test]
    fn a_single_frame_decides_nothing_and_a_sensor_is_believed_late() {
        let exactness = &mut Exactness::default();
        assert!(decisions(exactness, &[(EXACT, 20), (HOLES, 3), (EXACT, 40)])[10..].iter().all(|&exact| exact));
        let looks = decisions(exactness, &[(HOLES, 4 * EVERY * DECISION), (EXACT, EVERY * (LONG_DECISION - 1))]);
        assert!(looks[(2 * EVERY * DECISION) as usize..].iter().all(|&exact| !exact), "held back for long");
        assert!(decisions(exactness, &[(EXACT, 3 * EVERY)])[2 * EVERY as usize], "and found in the end");
    }

    #[test]
    fn of_another_size_nothing_is_told() {
        let (mut exactness, (color, _)) = (Exactness::default(), frame(0, EXACT));
        for _ in 0..100 {
            exactness.look(&DepthMap { metres: vec![1.0; 64 * 48], ..DepthMap::new(64, 48) }, &color);
        }
        assert!(!exactness.is_exact());
    }
}
