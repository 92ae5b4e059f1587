//! Held objects: regions as near as the subject and connected to it, decided per region.
//!
//! A network's depth fluctuates, and around a person it mixes both surfaces. So pixels are selected by a threshold with
//! hysteresis; regions have to extend beyond the rim of the person; and they are added after some frames, as a whole.

use super::components::Components;
use bokehcam::depth::dilation::dilate;

/// Minimum nearness of a held object's pixels, if held in the previous frame, and if not (hysteresis).
const MIN_NEARNESS: [f32; 2] = [0.83, 0.92];
/// Uncertainty of the network's outlines around a person, in mask pixels.
const RIM_PX: usize = 5;
/// Radius in which an object's mask replaces the soft outline of the person, in pixels.
const SEAM_PX: usize = 2;
/// Number of frames after which a region is added, and after which a disconnected one is removed.
const JOIN_FRAMES: u8 = 5;
const LEAVE_FRAMES: u8 = 8;

/// Decides from frame to frame; owns the memory for it.
#[derive(Debug, Default)]
pub struct HeldObjects {
    /// Whether a pixel belongs to a held object.
    held: Vec<bool>,
    /// Number of frames for which a pixel was connected but not held, or held but not connected.
    waited_frames: Vec<u8>,
    /// Whether a pixel is a person's, and within [`RIM_PX`] of one.
    persons: Vec<bool>,
    rim: Vec<bool>,
    /// Whether a pixel is near enough to be held, whether it is also connected to the subject, and whether such pixels
    /// beyond the rim are close.
    is_near: Vec<bool>,
    connected: Vec<bool>,
    beyond_rim: Vec<bool>,
    queue: Vec<u32>,
    line: Vec<bool>,
    components: Components,
}

impl HeldObjects {
    /// Resets the state, for a new scene.
    pub fn reset(&mut self) {
        self.held.clear();
    }

    /// Adds held objects to a mask `width` pixels wide, given the nearness of each pixel (1 at the subject). Persons
    /// are pixels above `threshold`.
    pub fn add_to_mask(&mut self, alphas: &mut [f32], nearness: &[f32], width: usize, threshold: f32) {
        let is_first = self.held.len() != alphas.len();
        if is_first {
            self.held.clear();
            self.held.resize(alphas.len(), false);
            self.waited_frames.clear();
            self.waited_frames.resize(alphas.len(), JOIN_FRAMES);
        }
        self.find_connected(alphas, nearness, width, threshold);
        // Without a person, nothing is held.
        if self.queue.is_empty() {
            self.reset();
            return;
        }
        self.update_held(width);
        // Where an object continues, the person's soft outline is inside of both.
        self.beyond_rim.clone_from(&self.held);
        dilate(&mut self.beyond_rim, &mut self.line, width, SEAM_PX);
        for (alpha, (beyond_rim, person)) in alphas.iter_mut().zip(self.beyond_rim.iter().zip(&self.persons)) {
            *alpha = if *beyond_rim & *person { 1.0 } else { *alpha };
        }
        for (alpha, _) in alphas.iter_mut().zip(&self.held).filter(|(_, held)| **held) {
            *alpha = 1.0;
        }
    }

    /// Finds the pixels as near as the subject and connected to it (4-connected), in regions that extend beyond the
    /// rim.
    fn find_connected(&mut self, alphas: &[f32], nearness: &[f32], width: usize, threshold: f32) {
        let Self { held, persons, rim, is_near, connected, beyond_rim, queue, line, .. } = self;
        persons.clear();
        persons.extend(alphas.iter().map(|&alpha| alpha > threshold));
        rim.clone_from(persons);
        dilate(rim, line, width, RIM_PX);
        is_near.clear();
        let as_near = |(&near, &held): (&f32, &bool)| near > MIN_NEARNESS[usize::from(!held)];
        is_near.extend(nearness.iter().zip(&*held).zip(&*persons).map(|(pixel, &person)| as_near(pixel) && !person));
        connected.clear();
        connected.resize(alphas.len(), false);
        queue.clear();
        for start in (0..alphas.len()).filter(|&at| alphas[at] > 0.9) {
            connected[start] = true;
            queue.push(start as u32);
        }
        // Flood fill from the person's sure pixels.
        let mut next = 0;
        while let Some(&at) = queue.get(next) {
            next += 1;
            let at = at as usize;
            let x = at % width;
            let neighbours = [
                (x > 0, at.wrapping_sub(1)),
                (x + 1 < width, at + 1),
                (true, at.wrapping_sub(width)),
                (true, at + width),
            ];
            for (_, at) in neighbours.into_iter().filter(|&(inside, at)| inside && at < alphas.len()) {
                if !connected[at] && (persons[at] || is_near[at]) {
                    connected[at] = true;
                    queue.push(at as u32);
                }
            }
        }
        beyond_rim.clear();
        beyond_rim.extend((0..alphas.len()).map(|at| is_near[at] && !rim[at] && (connected[at] || held[at])));
        dilate(beyond_rim, line, width, RIM_PX);
        for at in 0..alphas.len() {
            connected[at] &= is_near[at] && beyond_rim[at];
        }
    }

    /// Adds a connected region once more than half of its pixels are held, or have been connected for `JOIN_FRAMES`
    /// frames. Removes a pixel after it has been disconnected for `LEAVE_FRAMES` frames.
    fn update_held(&mut self, width: usize) {
        let Self { held, waited_frames, is_near, connected, beyond_rim, components, .. } = self;
        components.find(connected, width, |at| [held[at] || waited_frames[at] >= JOIN_FRAMES, false]);
        for (pixels, component) in components.runs() {
            let joins = component.is_person && 2 * component.matches[0] > component.pixels;
            for at in pixels {
                let stays = held[at] && is_near[at] && beyond_rim[at] && waited_frames[at] < LEAVE_FRAMES;
                let was = std::mem::replace(&mut held[at], joins || stays);
                waited_frames[at] = match () {
                    () if joins || component.is_person && was => 0,
                    () if component.is_person || held[at] => waited_frames[at].saturating_add(1),
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
        held_objects: HeldObjects,
    }

    impl Scene {
        fn new() -> Self {
            Self { held_objects: HeldObjects::default() }
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
            self.held_objects.add_to_mask(&mut alphas, &nearness, SIZE.0, 0.5);
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
        let connected = (0..20).map(|_| scene.sees(40, 1.0)).position(|columns_now| columns_now == columns(40));
        assert!(connected.is_some_and(|frames| frames <= usize::from(JOIN_FRAMES)), "{connected:?}");
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
