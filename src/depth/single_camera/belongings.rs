//! Held objects: regions as near as the subject and connected to it, decided per region.
//!
//! A network's depth fluctuates, and around a person it mixes both surfaces. So pixels are selected by a threshold with
//! hysteresis; regions have to extend beyond the rim of the person; and they are added after some frames, as a whole.

use super::parts::Components;
use crate::depth::dilation::dilate;

/// Minimum nearness of a held object's pixels, if held in the previous frame, and if not (hysteresis).
const AS_NEAR: [f32; 2] = [0.83, 0.92];
/// Uncertainty of the network's outlines around a person, in mask pixels.
const RIM_PX: usize = 5;
/// Radius in which an object's mask replaces the soft outline of the person, in pixels.
const SEAM_PX: usize = 2;
/// Number of frames after which a region is added, and after which a disconnected one is removed.
const JOINS: u8 = 5;
const LEAVES: u8 = 8;

/// Decides from frame to frame; owns the memory for it.
#[derive(Debug, Default)]
pub struct Belongings {
    /// Whether a pixel belongs to a held object.
    held: Vec<bool>,
    /// Number of frames for which a pixel was connected but not held, or held but not connected.
    waited: Vec<u8>,
    /// Whether a pixel is a person's, and within [`RIM_PX`] of one.
    persons: Vec<bool>,
    rim: Vec<bool>,
    /// Whether a pixel is near enough to be held, whether it is also connected to the subject, and whether such pixels
    /// beyond the rim are close.
    may_be: Vec<bool>,
    joined: Vec<bool>,
    beyond: Vec<bool>,
    front: Vec<u32>,
    line: Vec<bool>,
    components: Components,
}

impl Belongings {
    /// Resets the state, for a new scene.
    pub fn forget(&mut self) {
        self.held.clear();
    }

    /// Adds held objects to a mask `width` pixels wide, given the nearness of each pixel (1 at the subject). Persons
    /// are pixels above `threshold`.
    pub fn add(&mut self, alphas: &mut [f32], nearness: &[f32], width: usize, threshold: f32) {
        let is_first = self.held.len() != alphas.len();
        if is_first {
            self.held.clear();
            self.held.resize(alphas.len(), false);
            self.waited.clear();
            self.waited.resize(alphas.len(), JOINS);
        }
        self.find_joined(alphas, nearness, width, threshold);
        self.decide(width);
        // Where an object continues, the person's soft outline is inside of both.
        self.beyond.clone_from(&self.held);
        dilate(&mut self.beyond, &mut self.line, width, SEAM_PX);
        for (alpha, (beyond, person)) in alphas.iter_mut().zip(self.beyond.iter().zip(&self.persons)) {
            *alpha = if *beyond & *person { 1.0 } else { *alpha };
        }
        for (alpha, _) in alphas.iter_mut().zip(&self.held).filter(|(_, held)| **held) {
            *alpha = 1.0;
        }
    }

    /// Finds the pixels as near as the subject and connected to it (4-connected), in regions that extend beyond the
    /// rim.
    fn find_joined(&mut self, alphas: &[f32], nearness: &[f32], width: usize, threshold: f32) {
        let Self { held, persons, rim, may_be, joined, beyond, front, line, .. } = self;
        persons.clear();
        persons.extend(alphas.iter().map(|&alpha| alpha > threshold));
        rim.clone_from(persons);
        dilate(rim, line, width, RIM_PX);
        may_be.clear();
        let as_near = |(&near, &held): (&f32, &bool)| near > AS_NEAR[usize::from(!held)];
        may_be.extend(nearness.iter().zip(&*held).zip(&*persons).map(|(pixel, &person)| as_near(pixel) && !person));
        joined.clear();
        joined.resize(alphas.len(), false);
        front.clear();
        for start in (0..alphas.len()).filter(|&at| alphas[at] > 0.9) {
            joined[start] = true;
            front.push(start as u32);
        }
        // Flood fill from the person's sure pixels.
        let mut next = 0;
        while let Some(&at) = front.get(next) {
            next += 1;
            let at = at as usize;
            let x = at % width;
            let beside = [
                (x > 0, at.wrapping_sub(1)),
                (x + 1 < width, at + 1),
                (true, at.wrapping_sub(width)),
                (true, at + width),
            ];
            for (_, at) in beside.into_iter().filter(|&(inside, at)| inside && at < alphas.len()) {
                if !joined[at] && (persons[at] || may_be[at]) {
                    joined[at] = true;
                    front.push(at as u32);
                }
            }
        }
        beyond.clear();
        beyond.extend((0..alphas.len()).map(|at| may_be[at] && !rim[at] && (joined[at] || held[at])));
        dilate(beyond, line, width, RIM_PX);
        for at in 0..alphas.len() {
            joined[at] &= may_be[at] && beyond[at];
        }
    }

    /// Adds a connected region once more than half of its pixels are held, or have been connected for `JOINS` frames.
    /// Removes a pixel after it has been disconnected for `LEAVES` frames.
    fn decide(&mut self, width: usize) {
        let Self { held, waited, may_be, joined, beyond, components, .. } = self;
        components.find(joined, width, |at| held[at] || waited[at] >= JOINS);
        for (pixels, component) in components.runs() {
            let joins = component.is_person && 2 * component.found > component.pixels;
            for at in pixels {
                let stays = held[at] && may_be[at] && beyond[at] && waited[at] < LEAVES;
                let was = std::mem::replace(&mut held[at], joins || stays);
                waited[at] = match () {
                    () if joins || component.is_person && was => 0,
                    () if component.is_person || held[at] => waited[at].saturating_add(1),
                    () => 0,
                };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (64, 32);

    /// A person in the left columns, near columns beside it, and the rest far.
    struct Scene {
        belongings: Belongings,
    }

    impl Scene {
        fn new() -> Self {
            Self { belongings: Belongings::default() }
        }

        /// Returns which columns are the subject's in the next frame, if those up to `up_to` beside the person have
        /// nearness `near`.
        fn sees(&mut self, up_to: usize, near: f32) -> Vec<bool> {
            let of = |at: usize, far: f32, near: f32| match at % SIZE.0 {
                0..20 => 1.0,
                x if x < up_to => near,
                _ => far,
            };
            let mut alphas: Vec<f32> = (0..SIZE.0 * SIZE.1).map(|at| of(at, 0.0, 0.0)).collect();
            let nearness: Vec<f32> = (0..SIZE.0 * SIZE.1).map(|at| of(at, 0.1, near)).collect();
            self.belongings.add(&mut alphas, &nearness, SIZE.0, 0.5);
            alphas[16 * SIZE.0..][..SIZE.0].iter().map(|&alpha| alpha == 1.0).collect()
        }
    }

    fn columns(up_to: usize) -> Vec<bool> {
        (0..SIZE.0).map(|x| x < up_to).collect()
    }

    #[test]
    fn what_is_about_as_near_as_the_subject_does_not_come_and_go() {
        for (first, up_to) in [(1.0, 40), (0.5, 20)] {
            let mut scene = Scene::new();
            assert_eq!(scene.sees(40, first), columns(up_to));
            for frame in 0..40 {
                let trembling = if frame % 2 == 0 { 0.84 } else { 0.91 };
                assert_eq!(scene.sees(40, trembling), columns(up_to), "{first}, frame {frame}");
            }
        }
    }

    #[test]
    fn what_is_near_for_a_moment_does_not_join_and_what_is_held_does() {
        let mut scene = Scene::new();
        scene.sees(40, 0.3);
        for frame in 0..40 {
            let near = if frame % 4 == 0 { 0.3 } else { 1.0 };
            assert_eq!(scene.sees(40, near), columns(20), "frame {frame}");
        }
        let joined = (0..20).map(|_| scene.sees(40, 1.0)).position(|columns_now| columns_now == columns(40));
        assert!(joined.is_some_and(|frames| frames <= usize::from(JOINS)), "{joined:?}");
        // Pixels added by motion are held at once, and removed ones are not.
        assert_eq!(scene.sees(43, 1.0), columns(43));
        assert_eq!(scene.sees(43, 0.3), columns(20));
    }

    #[test]
    fn the_rim_of_a_person_is_not_what_they_hold() {
        // The network's outlines are too wide.
        assert_eq!(Scene::new().sees(20 + RIM_PX, 1.0), columns(20));
    }
}
