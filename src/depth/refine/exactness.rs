//! Detects exact depth streams: known everywhere, without noise, and static where the picture is static.
//!
//! Refinement corrects sensor errors. On exact depth it can only do harm: it takes thin structures like hair for noise.
//! One frame is not conclusive, so that several decide, and a stream once recognised as a sensor's needs much longer to
//! become exact.

use super::noise::{NO_NOISE, NoiseEstimator};
use super::temporal::{MOVED, MOVED_BOUNDS};
use crate::frame::{ColorImage, DepthMap};

/// Once decided, the first two of this many frames are compared.
const PERIOD: u32 = 5;
/// Comparisons in a row that change the decision, and for depth that was ever inexact: five seconds at 30 frames per
/// second.
const DECISION_COUNT: u32 = 3;
const LONG_DECISION_COUNT: u32 = 30;
/// Maximum number of sampled rows and of sampled columns.
const GRID: usize = 96;
/// Minimum fraction of the picture with static colours for a comparison.
const MIN_STATIC_FRACTION: f32 = 0.1;

/// Measures of deviation from exact depth.
#[derive(Clone, Copy, Debug)]
struct Faults {
    /// Fraction of the pixels with unknown depth.
    holes: f32,
    /// Standard deviation of the noise, relative to the median of inverse depth.
    noise: f32,
    /// Fraction of the pixels with static colours whose depth is not static.
    unsteady: f32,
}

impl Faults {
    /// Limits to become exact, and to stay exact (hysteresis).
    const LIMITS: [Self; 2] = [
        Self { holes: 0.001, noise: NO_NOISE, unsteady: 0.01 },
        Self { holes: 0.01, noise: 2.0 * NO_NOISE, unsteady: 0.03 },
    ];

    fn are_within(self, limits: Self) -> bool {
        self.holes <= limits.holes && self.noise <= limits.noise && self.unsteady <= limits.unsteady
    }
}

/// Decides frame by frame; owns its buffers.
#[derive(Debug, Default)]
pub struct ExactnessDetector {
    is_exact: bool,
    /// Whether depth was ever found to be inexact.
    was_inexact: bool,
    /// Comparisons in a row that contradict the decision.
    against: u32,
    /// Number of frames so far.
    frames: u32,
    noise_estimator: NoiseEstimator,
    size: (u32, u32),
    /// Samples of the last frame, if it was sampled, and of this one.
    before: Vec<Sample>,
    now: Vec<Sample>,
    changes: Vec<f32>,
    sorted: Vec<f32>,
}

/// A sampled pixel.
#[derive(Clone, Copy, Debug)]
struct Sample {
    rgb: [u8; 3],
    /// Inverse depth in 1/m; 0 where unknown.
    inverse: f32,
}

impl ExactnessDetector {
    /// Whether the depth is considered exact.
    pub fn is_exact(&self) -> bool {
        self.is_exact
    }

    /// Starts a new scene: the next frame is not compared with the last one.
    pub fn reset(&mut self) {
        self.before.clear();
    }

    /// Processes the next frame with its depth as measured. Frames whose map does not have the size of the picture are
    /// ignored.
    pub fn add_frame(&mut self, map: &DepthMap, color: &ColorImage) {
        let is_decided = self.is_exact || self.was_inexact;
        let frame_of_period = self.frames % PERIOD;
        self.frames = self.frames.wrapping_add(1);
        // Once decided, only frames 0 and 1 of a period are sampled, and 1 is compared with 0.
        if map.size() != color.size() || map.metres.is_empty() || is_decided && frame_of_period > 1 {
            return self.reset();
        }
        self.sample(map, color);
        if self.size == map.size()
            && self.before.len() == self.now.len()
            && let Some(unsteady) = unsteady_fraction(&self.now, &self.before, &mut self.changes, &mut self.sorted)
        {
            self.update_decision(map, unsteady);
        }
        self.size = map.size();
        std::mem::swap(&mut self.now, &mut self.before);
    }

    /// Samples the pixels of a grid.
    fn sample(&mut self, map: &DepthMap, color: &ColorImage) {
        let (width, height) = (map.width as usize, map.height as usize);
        self.now.clear();
        for y in (0..height).step_by(height.div_ceil(GRID)) {
            for at in (y * width..(y + 1) * width).step_by(width.div_ceil(GRID)) {
                let rgb = [0, 1, 2].map(|p| color.rgb[3 * at + p]);
                self.now.push(Sample { rgb, inverse: DepthMap::inverse_depth(map.metres[at]) });
            }
        }
    }

    /// Updates the decision; `unsteady` is the fraction of pixels with static colours whose depth is not static.
    fn update_decision(&mut self, map: &DepthMap, unsteady: f32) {
        let size = (map.width as usize, map.height as usize);
        let inverse = |at: usize| DepthMap::inverse_depth(map.metres[at]);
        let noise = self.noise_estimator.estimate(inverse, |at| inverse(at) == 0.0, size);
        let known = self.sorted.len();
        let Some(median) = median(&mut self.sorted) else { return };
        let holes = 1.0 - known as f32 / self.now.len() as f32;
        let faults = Faults { holes, noise: noise / median, unsteady };
        let speaks_against = faults.are_within(Faults::LIMITS[usize::from(self.is_exact)]) != self.is_exact;
        self.was_inexact |= !self.is_exact && !speaks_against;
        self.against = if speaks_against { self.against + 1 } else { 0 };
        let needed = if self.was_inexact && !self.is_exact { LONG_DECISION_COUNT } else { DECISION_COUNT };
        if self.against >= needed {
            self.is_exact = !self.is_exact;
            self.against = 0;
            self.was_inexact |= !self.is_exact;
        }
    }
}

/// Returns the fraction of the pixels with static colours whose depth is not static; `None` if there are too few. Fills
/// `sorted` with the inverse depths known now.
fn unsteady_fraction(now: &[Sample], before: &[Sample], changes: &mut Vec<f32>, sorted: &mut Vec<f32>) -> Option<f32> {
    let change = |(now, before): (&Sample, &Sample)| {
        now.rgb.iter().zip(before.rgb).map(|(now, before)| f32::from(now.abs_diff(before))).sum::<f32>()
    };
    changes.clear();
    changes.extend(now.iter().zip(before).map(change));
    let moved = (MOVED * median(changes)?).clamp(MOVED_BOUNDS.0, MOVED_BOUNDS.1);
    sorted.clear();
    sorted.extend(now.iter().map(|sample| sample.inverse).filter(|&inverse| inverse > 0.0));
    let least = NO_NOISE * median(sorted)?;
    let (mut resting, mut unsteady) = (0, 0);
    for pair @ (now, before) in now.iter().zip(before) {
        if change(pair) <= moved {
            resting += 1;
            unsteady += usize::from((now.inverse - before.inverse).abs() > least);
        }
    }
    let is_enough = resting as f32 >= MIN_STATIC_FRACTION * now.len() as f32;
    is_enough.then(|| unsteady as f32 / resting as f32)
}

/// Returns the median; reorders the values.
fn median(values: &mut [f32]) -> Option<f32> {
    let at = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(at, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (u32, u32) = (128, 96);

    /// Modifies the depth of a pixel.
    type Damage = fn(at: u32, frame: u32, z_m: f32) -> f32;

    /// Returns a picture with thin structures, and its modified depth.
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
    const UNSTEADY: Damage = |at, frame, z_m| if at % 13 == frame % 2 { z_m * 1.01 } else { z_m };

    /// Returns the decision after each frame, for a number of frames of each kind.
    fn decisions(exactness: &mut ExactnessDetector, kinds: &[(Damage, u32)]) -> Vec<bool> {
        let mut looks = Vec::new();
        for &(damage, count) in kinds {
            for number in 0..count {
                let (color, map) = frame(number, damage);
                exactness.add_frame(&map, &color);
                looks.push(exactness.is_exact());
            }
        }
        looks
    }

    #[test]
    fn exact_depth_is_known_after_a_few_frames() {
        let looks = decisions(&mut ExactnessDetector::default(), &[(EXACT, 200)]);
        assert_eq!(looks.iter().position(|&exact| exact), Some(DECISION_COUNT as usize));
        assert!(looks[DECISION_COUNT as usize..].iter().all(|&exact| exact));
    }

    #[test]
    fn depth_with_holes_or_noise_or_that_flickers_is_not_exact() {
        for damage in [HOLES, NOISE, UNSTEADY] {
            assert!(decisions(&mut ExactnessDetector::default(), &[(damage, 300)]).iter().all(|&exact| !exact));
        }
    }

    #[test]
    fn a_single_frame_decides_nothing_and_a_sensor_is_believed_late() {
        let exactness = &mut ExactnessDetector::default();
        assert!(decisions(exactness, &[(EXACT, 20), (HOLES, 3), (EXACT, 40)])[10..].iter().all(|&exact| exact));
        let looks =
            decisions(exactness, &[(HOLES, 4 * PERIOD * DECISION_COUNT), (EXACT, PERIOD * (LONG_DECISION_COUNT - 1))]);
        assert!(looks[(2 * PERIOD * DECISION_COUNT) as usize..].iter().all(|&exact| !exact), "held back for long");
        assert!(decisions(exactness, &[(EXACT, 3 * PERIOD)])[2 * PERIOD as usize], "and found in the end");
    }

    #[test]
    fn of_another_size_nothing_is_told() {
        let (mut exactness, (color, _)) = (ExactnessDetector::default(), frame(0, EXACT));
        for _ in 0..100 {
            exactness.add_frame(&DepthMap { metres: vec![1.0; 64 * 48], ..DepthMap::new(64, 48) }, &color);
        }
        assert!(!exactness.is_exact());
    }
}
