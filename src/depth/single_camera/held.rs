//! Completes masks: adds what a subject holds, such as a mug, and removes persons further away.

use super::belongings::Belongings;
use super::relief::Relief;
use crate::depth::tap::nearest;
use crate::frame::Mask;

/// Minimum mean nearness of a subject; persons further away are others.
const OTHERS: f32 = 0.55;
/// Hysteresis of that threshold.
const HYSTERESIS: f32 = 0.07;
/// Minimum mask value of a region.
const THRESHOLD: f32 = 0.5;

/// Completes masks by nearness; owns the memory for it.
#[derive(Default)]
pub struct Held {
    mask: Mask,
    /// Nearness of each mask pixel.
    nearness: Vec<f32>,
    /// Whether a pixel was another person's in the previous frame.
    others: Vec<bool>,
    /// Visited pixels, and the queue of the flood fill.
    seen: Vec<bool>,
    front: Vec<u32>,
    belongings: Belongings,
}

impl Held {
    /// Returns the mask of the subject with held objects.
    pub fn mask(&self) -> &Mask {
        &self.mask
    }

    /// Resets the state, for a new scene.
    pub fn forget(&mut self) {
        self.others.clear();
        self.belongings.forget();
    }

    /// Adds held objects to a mask, and removes other persons.
    pub fn complete(&mut self, mask: &Mask, relief: &Relief) {
        let (width, height) = (mask.width as usize, mask.height as usize);
        self.mask.clone_from(mask);
        let near = |at: usize| relief.nearness()[nearest(at, (width, height), relief.size())];
        self.nearness.clear();
        self.nearness.extend((0..width * height).map(near));
        self.remove_others();
        self.belongings.add(&mut self.mask.alpha, &self.nearness, width, THRESHOLD);
    }

    /// Removes regions of the mask whose mean nearness is low: other persons.
    fn remove_others(&mut self) {
        let count = self.mask.alpha.len();
        self.seen.clear();
        self.seen.resize(count, false);
        let is_first = self.others.len() != count;
        self.others.resize(count, false);
        for start in 0..self.mask.alpha.len() {
            if self.seen[start] || self.mask.alpha[start] < THRESHOLD {
                continue;
            }
            self.front.clear();
            self.flood(start, |held, at| held.mask.alpha[at] >= THRESHOLD);
            let near: f32 = self.front.iter().map(|&at| self.nearness[at as usize]).sum();
            let were_others = self.front.iter().filter(|&&at| self.others[at as usize]).count();
            let least = match () {
                () if is_first => OTHERS,
                () if 2 * were_others > self.front.len() => OTHERS + HYSTERESIS,
                () => OTHERS - HYSTERESIS,
            };
            let are_others = near < least * self.front.len() as f32;
            self.front.iter().for_each(|&at| self.others[at as usize] = are_others);
            if are_others {
                // Including their soft outlines.
                let component = std::mem::take(&mut self.front);
                for &at in &component {
                    self.clear_around(at as usize);
                }
                self.front = component;
            }
        }
        self.others.iter_mut().zip(&self.seen).for_each(|(is_other, seen)| *is_other &= seen);
    }

    /// Appends to `front` the pixels connected to `start` that belong to it (4-connected).
    fn flood(&mut self, start: usize, belongs: impl Fn(&Self, usize) -> bool) {
        let (width, height) = (self.mask.width as usize, self.mask.height as usize);
        let mut next = self.front.len();
        self.seen[start] = true;
        self.front.push(start as u32);
        while let Some(&at) = self.front.get(next) {
            next += 1;
            let (x, y) = (at as usize % width, at as usize / width);
            let beside = [
                (x > 0, (at as usize).wrapping_sub(1)),
                (x + 1 < width, at as usize + 1),
                (y > 0, (at as usize).wrapping_sub(width)),
                (y + 1 < height, at as usize + width),
            ];
            for (_, at) in beside.into_iter().filter(|(inside, _)| *inside) {
                if !self.seen[at] && belongs(self, at) {
                    self.seen[at] = true;
                    self.front.push(at as u32);
                }
            }
        }
    }

    fn clear_around(&mut self, at: usize) {
        const RADIUS: usize = 3;
        let (width, height) = (self.mask.width as usize, self.mask.height as usize);
        let (x, y) = (at % width, at / width);
        for y in y.saturating_sub(RADIUS)..(y + RADIUS + 1).min(height) {
            for x in x.saturating_sub(RADIUS)..(x + RADIUS + 1).min(width) {
                // Keeps the pixels of a subject beside them.
                let at = y * width + x;
                if self.others[at] || self.nearness[at] < OTHERS {
                    self.mask.alpha[at] = 0.0;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (32, 16);

    /// A range of columns, the end excluded.
    type Columns = (usize, usize);

    /// Returns which columns are the subject's, for a mask with these persons and nearness in these columns; the rest
    /// is far.
    fn joined(persons: &[Columns], near: &[(Columns, f32)]) -> Vec<bool> {
        let inside = |at: usize| near.iter().find(|((from, to), _)| (*from..*to).contains(&(at % SIZE.0)));
        let persons = columns(persons);
        let mut held = Held {
            mask: Mask {
                width: SIZE.0 as u32,
                height: SIZE.1 as u32,
                alpha: (0..SIZE.0 * SIZE.1).map(|at| f32::from(u8::from(persons[at % SIZE.0]))).collect(),
            },
            nearness: (0..SIZE.0 * SIZE.1).map(|at| inside(at).map_or(0.1, |(_, nearness)| *nearness)).collect(),
            ..Held::default()
        };
        held.remove_others();
        held.belongings.add(&mut held.mask.alpha, &held.nearness, SIZE.0, THRESHOLD);
        held.mask.alpha[8 * SIZE.0..][..SIZE.0].iter().map(|share| *share > 0.5).collect()
    }

    fn columns(ranges: &[Columns]) -> Vec<bool> {
        (0..SIZE.0).map(|column| ranges.iter().any(|&(from, to)| (from..to).contains(&column))).collect()
    }

    #[test]
    fn what_is_held_is_the_subjects_and_what_is_as_near_elsewhere_is_not() {
        let near = [((4, 18), 1.0), ((24, 28), 1.0)];
        assert_eq!(joined(&[(4, 10)], &near), columns(&[(4, 18)]));
    }

    #[test]
    fn who_is_about_as_far_as_others_are_does_not_come_and_go() {
        let persons = |at: usize| (4..10).contains(&(at % SIZE.0)) || (20..26).contains(&(at % SIZE.0));
        let is_there = |held: &mut Held, nearness: f32| {
            let share = (0..SIZE.0 * SIZE.1).map(|at| f32::from(u8::from(persons(at)))).collect();
            held.mask = Mask { width: SIZE.0 as u32, height: SIZE.1 as u32, alpha: share };
            held.nearness = (0..SIZE.0 * SIZE.1).map(|at| if at % SIZE.0 < 16 { 1.0 } else { nearness }).collect();
            held.remove_others();
            held.mask.alpha[8 * SIZE.0 + 23] > 0.5
        };
        for first in [OTHERS - 0.02, OTHERS + 0.02] {
            let mut held = Held::default();
            let was = is_there(&mut held, first);
            for trembling in [0.01, -0.01, 0.05, -0.05] {
                assert_eq!(is_there(&mut held, OTHERS + trembling), was, "{first} {trembling}");
            }
            assert!(is_there(&mut held, 0.9) && !is_there(&mut held, 0.3));
        }
    }

    #[test]
    fn others_further_away_are_not_the_subject() {
        let near = [((4, 10), 1.0), ((20, 26), 0.3)];
        assert_eq!(joined(&[(4, 10), (20, 26)], &near), columns(&[(4, 10)]));
        // Two persons side by side, about as near, are both subjects.
        let near = [((4, 10), 1.0), ((20, 26), 0.9)];
        assert_eq!(joined(&[(4, 10), (20, 26)], &near), columns(&[(4, 10), (20, 26)]));
    }
}
