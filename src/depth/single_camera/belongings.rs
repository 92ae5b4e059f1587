//! What a subject holds: what is as near and joined to them, decided part by part.
//!
//! A network's nearness trembles, and around a person it is that of both surfaces mixed. So a pixel counts by a threshold with
//! hysteresis; a part counts that reaches beyond the rim of the person; and it joins after some frames, as a whole.

use super::parts::Parts;
use crate::depth::dilation::dilate;

/// What is no person is as near as the subject from here on, where it was theirs in the frame before, and where it was not.
const AS_NEAR: [f32; 2] = [0.83, 0.92];
/// So far around a person the network's outlines are off, in pixels of the mask.
const RIM_PX: usize = 5;
/// Where a thing meets the person, so many pixels of their soft outline are inside of both.
const SEAM_PX: usize = 2;
/// A part joins that was there for so many frames; and one that is joined to nobody any more is let go after so many.
const JOINS: u8 = 5;
const LEAVES: u8 = 8;

/// Decides from frame to frame; owns the memory for it.
#[derive(Debug, Default)]
pub struct Belongings {
    /// Whether pixels are the subject's, though no person's.
    held: Vec<bool>,
    /// For how many frames each has been to join, or is joined to nobody.
    waited: Vec<u8>,
    /// Whether pixels are a person's, and within [`RIM_PX`] of one.
    persons: Vec<bool>,
    rim: Vec<bool>,
    /// Whether they may be the subject's, whether they are joined to them, and whether anything beyond the rim is close.
    may_be: Vec<bool>,
    joined: Vec<bool>,
    beyond: Vec<bool>,
    front: Vec<u32>,
    line: Vec<bool>,
    parts: Parts,
}

impl Belongings {
    /// Forgets the frame before: the next one is another scene.
    pub fn forget(&mut self) {
        self.held.clear();
    }

    /// Adds what is held to the shares of a mask so wide, in which each pixel is so near: 1 at the subject. A person's is what
    /// has more than the share `part`.
    pub fn add(&mut self, shares: &mut [f32], nearness: &[f32], width: usize, part: f32) {
        let is_first = self.held.len() != shares.len();
        if is_first {
            self.held.clear();
            self.held.resize(shares.len(), false);
            self.waited.clear();
            self.waited.resize(shares.len(), JOINS);
        }
        self.find_joined(shares, nearness, width, part);
        self.decide(width);
        // Their soft outline is inside where a thing goes on.
        self.beyond.clone_from(&self.held);
        dilate(&mut self.beyond, &mut self.line, width, SEAM_PX);
        for (share, (beyond, person)) in shares.iter_mut().zip(self.beyond.iter().zip(&self.persons)) {
            *share = if *beyond & *person { 1.0 } else { *share };
        }
        for (share, _) in shares.iter_mut().zip(&self.held).filter(|(_, held)| **held) {
            *share = 1.0;
        }
    }

    /// Finds what is as near as the subject and joined to them, step by step, as far as it reaches beyond their rim.
    fn find_joined(&mut self, shares: &[f32], nearness: &[f32], width: usize, part: f32) {
        let Self { held, persons, rim, may_be, joined, beyond, front, line, .. } = self;
        persons.clear();
        persons.extend(shares.iter().map(|&share| share > part));
        rim.clone_from(persons);
        dilate(rim, line, width, RIM_PX);
        may_be.clear();
        let as_near = |(&near, &held): (&f32, &bool)| near > AS_NEAR[usize::from(!held)];
        may_be.extend(nearness.iter().zip(&*held).zip(&*persons).map(|(pixel, &person)| as_near(pixel) && !person));
        joined.clear();
        joined.resize(shares.len(), false);
        front.clear();
        for start in (0..shares.len()).filter(|&at| shares[at] > 0.9) {
            joined[start] = true;
            front.push(start as u32);
        }
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
            for (_, at) in beside.into_iter().filter(|&(inside, at)| inside && at < shares.len()) {
                if !joined[at] && (persons[at] || may_be[at]) {
                    joined[at] = true;
                    front.push(at as u32);
                }
            }
        }
        beyond.clear();
        beyond.extend((0..shares.len()).map(|at| may_be[at] && !rim[at] && (joined[at] || held[at])));
        dilate(beyond, line, width, RIM_PX);
        for at in 0..shares.len() {
            joined[at] &= may_be[at] && beyond[at];
        }
    }

    /// A part joins as a whole, and what was the subject's remains so for a while.
    fn decide(&mut self, width: usize) {
        let Self { held, waited, may_be, joined, beyond, parts, .. } = self;
        parts.find(joined, width, |at| held[at] || waited[at] >= JOINS);
        for (pixels, part) in parts.runs() {
            let joins = part.is_person && 2 * part.found > part.pixels;
            for at in pixels {
                let stays = held[at] && may_be[at] && beyond[at] && waited[at] < LEAVES;
                let was = std::mem::replace(&mut held[at], joins || stays);
                waited[at] = match () {
                    () if joins || part.is_person && was => 0,
                    () if part.is_person || held[at] => waited[at].saturating_add(1),
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

    /// A person in the left columns, beside whom some columns are near, and all else is far.
    struct Scene {
        belongings: Belongings,
    }

    impl Scene {
        fn new() -> Self {
            Self { belongings: Belongings::default() }
        }

        /// Which columns are the subject's in the next frame, where those beside the person, up to one, are so near.
        fn sees(&mut self, up_to: usize, near: f32) -> Vec<bool> {
            let of = |at: usize, far: f32, near: f32| match at % SIZE.0 {
                0..20 => 1.0,
                x if x < up_to => near,
                _ => far,
            };
            let mut shares: Vec<f32> = (0..SIZE.0 * SIZE.1).map(|at| of(at, 0.0, 0.0)).collect();
            let nearness: Vec<f32> = (0..SIZE.0 * SIZE.1).map(|at| of(at, 0.1, near)).collect();
            self.belongings.add(&mut shares, &nearness, SIZE.0, 0.5);
            shares[16 * SIZE.0..][..SIZE.0].iter().map(|&share| share == 1.0).collect()
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
        // What grows by some pixels, as it moves, is theirs at once, and what goes is not.
        assert_eq!(scene.sees(43, 1.0), columns(43));
        assert_eq!(scene.sees(43, 0.3), columns(20));
    }

    #[test]
    fn the_rim_of_a_person_is_not_what_they_hold() {
        // The network's outlines are fat.
        assert_eq!(Scene::new().sees(20 + RIM_PX, 1.0), columns(20));
    }
}
