//! Completes masks: adds what a subject holds, such as a mug, and removes persons further away.

use super::held_objects::HeldObjects;
use super::relative_depth::RelativeDepth;
use bokehcam::depth::tap::nearest_index;
use bokehcam::frame::Mask;

/// Minimum mean nearness of a subject; persons further away are others.
const MIN_SUBJECT_NEARNESS: f32 = 0.55;
/// Hysteresis of that threshold.
const HYSTERESIS: f32 = 0.07;
/// Minimum mask value of a region.
const PERSON_ALPHA: f32 = 0.5;

/// Completes masks by nearness; owns the memory for it.
#[derive(Default)]
pub struct SubjectMask {
    mask: Mask,
    /// Nearness of each mask pixel.
    nearness: Vec<f32>,
    /// Whether a pixel was another person's in the previous frame.
    others: Vec<bool>,
    /// Visited pixels, and the queue of the flood fill.
    visited: Vec<bool>,
    queue: Vec<u32>,
    held_objects: HeldObjects,
}

impl SubjectMask {
    /// Returns the mask of the subject with held objects.
    pub fn mask(&self) -> &Mask {
        &self.mask
    }

    /// Resets the state, for a new scene.
    pub fn reset(&mut self) {
        self.others.clear();
        self.held_objects.reset();
    }

    /// Adds held objects to a mask, and removes other persons.
    pub fn complete_mask(&mut self, mask: &Mask, relative_depth: &RelativeDepth) {
        let (width, height) = (mask.width as usize, mask.height as usize);
        self.mask.clone_from(mask);
        let near = |at: usize| relative_depth.nearness()[nearest_index(at, (width, height), relative_depth.size())];
        self.nearness.clear();
        self.nearness.extend((0..width * height).map(near));
        self.remove_others();
        self.held_objects.add_to_mask(&mut self.mask.alpha, &self.nearness, width, PERSON_ALPHA);
    }

    /// Removes regions of the mask whose mean nearness is low: other persons.
    fn remove_others(&mut self) {
        let count = self.mask.alpha.len();
        self.visited.clear();
        self.visited.resize(count, false);
        let is_first = self.others.len() != count;
        self.others.resize(count, false);
        for start in 0..self.mask.alpha.len() {
            if self.visited[start] || self.mask.alpha[start] < PERSON_ALPHA {
                continue;
            }
            self.queue.clear();
            self.flood_fill(start, |this, at| this.mask.alpha[at] >= PERSON_ALPHA);
            let near: f32 = self.queue.iter().map(|&at| self.nearness[at as usize]).sum();
            let were_others = self.queue.iter().filter(|&&at| self.others[at as usize]).count();
            let least = match () {
                () if is_first => MIN_SUBJECT_NEARNESS,
                () if 2 * were_others > self.queue.len() => MIN_SUBJECT_NEARNESS + HYSTERESIS,
                () => MIN_SUBJECT_NEARNESS - HYSTERESIS,
            };
            let are_others = near < least * self.queue.len() as f32;
            self.queue.iter().for_each(|&at| self.others[at as usize] = are_others);
            if are_others {
                // Including their soft outlines.
                let component = std::mem::take(&mut self.queue);
                for &at in &component {
                    self.clear_neighbourhood(at as usize);
                }
                self.queue = component;
            }
        }
        self.others.iter_mut().zip(&self.visited).for_each(|(is_other, visited)| *is_other &= visited);
    }

    /// Appends to `queue` the pixels connected to `start` that belong to it (4-connected).
    fn flood_fill(&mut self, start: usize, is_member: impl Fn(&Self, usize) -> bool) {
        let (width, height) = (self.mask.width as usize, self.mask.height as usize);
        let mut next = self.queue.len();
        self.visited[start] = true;
        self.queue.push(start as u32);
        while let Some(&at) = self.queue.get(next) {
            next += 1;
            let (x, y) = (at as usize % width, at as usize / width);
            let neighbours = [
                (x > 0, (at as usize).wrapping_sub(1)),
                (x + 1 < width, at as usize + 1),
                (y > 0, (at as usize).wrapping_sub(width)),
                (y + 1 < height, at as usize + width),
            ];
            for (_, at) in neighbours.into_iter().filter(|(inside, _)| *inside) {
                if !self.visited[at] && is_member(self, at) {
                    self.visited[at] = true;
                    self.queue.push(at as u32);
                }
            }
        }
    }

    /// Removes the other person's soft outline around the pixel at `index`.
    fn clear_neighbourhood(&mut self, index: usize) {
        const RADIUS: usize = 3;
        let (width, height) = (self.mask.width as usize, self.mask.height as usize);
        let (x, y) = (index % width, index / width);
        for y in y.saturating_sub(RADIUS)..(y + RADIUS + 1).min(height) {
            for x in x.saturating_sub(RADIUS)..(x + RADIUS + 1).min(width) {
                // Near pixels of no other person are the subject's.
                let neighbour = y * width + x;
                if self.others[neighbour] || self.nearness[neighbour] < MIN_SUBJECT_NEARNESS {
                    self.mask.alpha[neighbour] = 0.0;
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
        let mut held = SubjectMask {
            mask: Mask {
                width: SIZE.0 as u32,
                height: SIZE.1 as u32,
                alpha: (0..SIZE.0 * SIZE.1).map(|at| f32::from(u8::from(persons[at % SIZE.0]))).collect(),
            },
            nearness: (0..SIZE.0 * SIZE.1).map(|at| inside(at).map_or(0.1, |(_, nearness)| *nearness)).collect(),
            ..SubjectMask::default()
        };
        held.remove_others();
        held.held_objects.add_to_mask(&mut held.mask.alpha, &held.nearness, SIZE.0, PERSON_ALPHA);
        held.mask.alpha[8 * SIZE.0..][..SIZE.0].iter().map(|alpha| *alpha > 0.5).collect()
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
        let is_there = |held: &mut SubjectMask, nearness: f32| {
            let alpha = (0..SIZE.0 * SIZE.1).map(|at| f32::from(u8::from(persons(at)))).collect();
            held.mask = Mask { width: SIZE.0 as u32, height: SIZE.1 as u32, alpha };
            held.nearness = (0..SIZE.0 * SIZE.1).map(|at| if at % SIZE.0 < 16 { 1.0 } else { nearness }).collect();
            held.remove_others();
            held.mask.alpha[8 * SIZE.0 + 23] > 0.5
        };
        for first in [MIN_SUBJECT_NEARNESS - 0.02, MIN_SUBJECT_NEARNESS + 0.02] {
            let mut held = SubjectMask::default();
            let was = is_there(&mut held, first);
            for trembling in [0.01, -0.01, 0.05, -0.05] {
                assert_eq!(is_there(&mut held, MIN_SUBJECT_NEARNESS + trembling), was, "{first} {trembling}");
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
