//! Decides the unsure regions of a network's mask: person or background.
//!
//! A mask value between 0 and 1 has two meanings: on an outline, a mixed pixel; elsewhere, an unsure network. Away from
//! outlines, no pixel is half a person, so each is decided either way. An enclosed hole of which the network is unsure
//! is filled; a region of which it is mostly unsure is no person. In a live picture, a region that was not there in the
//! mask before is background, too: what shows a room to others takes two masks that agree. What rests completely while
//! a person moves is an object, such as a rucksack on a chair.

use super::components::Components;
use bokehcam::frame::Mask;

/// Hysteresis of the threshold 1/2: lower by this if the pixel was a person's in the previous frame, and higher if not.
const HYSTERESIS: f32 = 0.1;
/// Mask value below which an enclosed hole is certain, if it was not filled in the previous frame, and if it was.
const SURE_HOLE_ALPHA: [f32; 2] = [0.15, 0.1];
/// Maximum size of a filled hole, as a fraction of the mask: an arm akimbo encloses more.
const MAX_HOLE_FRACTION: f32 = 0.02;
/// Minimum mask value of a certain person pixel.
const MIN_SURE_ALPHA: f32 = 0.9;
/// Minimum fraction of certain pixels in a person's region, if no person was there in the mask before, and if one was.
const MIN_SURE_FRACTION: [f32; 2] = [0.6, 0.4];
/// Minimum size of a person's region, as a fraction of the mask.
const MIN_COMPONENT_FRACTION: f32 = 0.001;
/// Minimum fraction of a region that was a person's in the mask before, if it is the same person: they move.
const MIN_AGREEING_FRACTION: f32 = 0.25;

/// Radius of the neighbourhood for decisions: equal pixels within 1 decide half, within 2 fully.
const RADIUS: usize = 2;

/// Decides from frame to frame; owns the memory for it.
#[derive(Debug, Default)]
pub struct MaskPostProcessor {
    /// Whether a pixel is a person's, in this and in the previous frame.
    persons: Vec<bool>,
    previous: Vec<bool>,
    /// Whether a pixel was in a region of which the network was sure, in the previous frame, and in this one.
    sure_before: Vec<bool>,
    sure: Vec<bool>,
    /// Whether a sure region waits for a second mask.
    is_waiting: bool,
    /// Whether a pixel's place has long been at rest, and whether it was in a region taken for an object; empty if unknown.
    at_rest: Vec<bool>,
    objects: Vec<bool>,
    components: Components,
    /// Vertical sums of person pixels around each pixel of a row, within 1 and within [`RADIUS`], from [`RADIUS`] pixels
    /// beyond the border on.
    columns: [Vec<u8>; 2],
}

impl MaskPostProcessor {
    /// Resets the state, for a new scene.
    pub fn reset(&mut self) {
        self.previous.clear();
        self.objects.clear();
        self.is_waiting = false;
    }

    /// Sets which pixels of the next mask have long been at rest, by filling a vector. Without this call, nothing counts as
    /// that.
    pub fn set_at_rest(&mut self, fill: impl FnOnce(&mut Vec<bool>)) {
        self.at_rest.clear();
        fill(&mut self.at_rest);
    }

    /// Whether the last mask had a sure region that takes a second mask to be a person.
    pub fn is_waiting(&self) -> bool {
        self.is_waiting
    }

    /// Writes the decided mask of a picture to `decided`. `mask` is smoothed over time; of what the network is sure, its
    /// own values say, `own`. If it `takes_two`, a region is a person's from the second mask on that has it.
    pub fn postprocess(&mut self, mask: &Mask, own: &[f32], takes_two: bool, decided: &mut Mask) {
        decided.clone_from(mask);
        self.classify_pixels(&mask.alpha);
        let width = mask.width as usize;
        let Self { persons, previous, sure_before, at_rest, objects, components, .. } = self;
        at_rest.resize(persons.len(), false);
        if objects.len() != persons.len() {
            objects.clear();
            objects.resize(persons.len(), false);
        }
        components.find(persons, width, |at| match persons[at] {
            true => [own[at] > MIN_SURE_ALPHA, sure_before[at], !at_rest[at], objects[at]],
            false => [own[at] < SURE_HOLE_ALPHA[usize::from(previous[at])], false, false, false],
        });
        self.drop_unsure_regions(takes_two);
        self.drop_objects();
        self.fill_holes();
        self.binarize_interior(width, &mut decided.alpha);
        std::mem::swap(&mut self.persons, &mut self.previous);
        std::mem::swap(&mut self.sure, &mut self.sure_before);
    }

    /// Classifies each pixel by its mask value and the previous frame (hysteresis).
    fn classify_pixels(&mut self, alphas: &[f32]) {
        let Self { persons, previous, sure_before, .. } = self;
        persons.clear();
        if previous.len() == alphas.len() {
            let least = |was: bool| if was { 0.5 - HYSTERESIS } else { 0.5 + HYSTERESIS };
            persons.extend(alphas.iter().zip(&*previous).map(|(&alpha, &was)| alpha > least(was)));
        } else {
            persons.extend(alphas.iter().map(|&alpha| alpha > 0.5));
            for before in [previous, sure_before] {
                before.clear();
                before.resize(alphas.len(), false);
            }
        }
    }

    /// Makes regions background that are small, mostly unsure, or not yet confirmed.
    fn drop_unsure_regions(&mut self, takes_two: bool) {
        let Self { persons, sure, components, .. } = self;
        let least = MIN_COMPONENT_FRACTION * persons.len() as f32;
        self.is_waiting = false;
        sure.clear();
        sure.resize(persons.len(), false);
        for (run, component) in components.runs().filter(|(_, component)| component.is_person) {
            let [sure_pixels, known_pixels, ..] = component.matches.map(|count| count as f32);
            let pixels = component.pixels as f32;
            let is_known = known_pixels >= MIN_AGREEING_FRACTION * pixels;
            let is_sure = pixels > least && sure_pixels >= MIN_SURE_FRACTION[usize::from(is_known)] * pixels;
            let is_waiting = is_sure && takes_two && !is_known;
            self.is_waiting |= is_waiting;
            sure[run.clone()].fill(is_sure);
            persons[run].fill(is_sure && !is_waiting);
        }
    }

    /// Makes regions background that rest completely while a person moves, and from then on until they move. The largest
    /// region stays a person.
    fn drop_objects(&mut self) {
        let Self { persons, objects, components, .. } = self;
        let (mut is_one_moving, mut largest) = (false, 0);
        for (_, component) in
            components.runs().filter(|(run, component)| persons[run.start] && component.matches[3] == 0)
        {
            is_one_moving |= component.matches[2] > 0;
            largest = largest.max(component.pixels);
        }
        for (run, component) in components.runs().filter(|(_, component)| component.is_person) {
            let [_, _, moving, known_objects] = component.matches;
            let is_object = moving == 0 && (known_objects > 0 || is_one_moving && component.pixels < largest);
            objects[run.clone()].fill(is_object);
            if is_object {
                persons[run].fill(false);
            }
        }
    }

    /// Fills small holes without certain pixels that persons enclose.
    fn fill_holes(&mut self) {
        let Self { persons, components, .. } = self;
        let largest = (MAX_HOLE_FRACTION * persons.len() as f32) as u32;
        for (pixels, component) in components.runs() {
            let is_small_hole = !component.is_person && !component.touches_border && component.pixels <= largest;
            // The region around it, which the pixel before is of, may have been dropped.
            if is_small_hole && component.matches[0] == 0 && persons[pixels.start - 1] {
                persons[pixels].fill(true);
            }
        }
    }

    /// Moves mask values to 0 or 1, fully from [`RADIUS`] pixels off the outline, and by half next to it.
    fn binarize_interior(&mut self, width: usize, alphas: &mut [f32]) {
        let Self { persons, columns, .. } = self;
        let height = persons.len() / width.max(1);
        for (y, alphas) in alphas.chunks_exact_mut(width.max(1)).enumerate() {
            for (radius, sums) in columns.iter_mut().enumerate().map(|(k, sums)| (k + 1, sums)) {
                sums.clear();
                sums.resize(width + 2 * RADIUS, 0);
                for by in RADIUS - radius..=RADIUS + radius {
                    let row = (y + by).saturating_sub(RADIUS).min(height - 1);
                    let row = &persons[row * width..][..width];
                    sums[RADIUS..].iter_mut().zip(row).for_each(|(sum, &is_person)| *sum += u8::from(is_person));
                }
                // Beyond the border, the outermost pixels repeat.
                let [first, last] = [sums[RADIUS], sums[RADIUS + width - 1]];
                sums[..RADIUS].fill(first);
                sums[RADIUS + width..].fill(last);
            }
            let [near, wide] = columns.each_ref().map(|sums| &sums[..width + 2 * RADIUS]);
            let persons = &persons[y * width..][..width];
            for (x, (alpha, &is_person)) in alphas.iter_mut().zip(persons).enumerate() {
                let near = near[x + 1] + near[x + 2] + near[x + 3];
                let wide = wide[x] + wide[x + 1] + wide[x + 2] + wide[x + 3] + wide[x + 4];
                let decided = f32::from(u8::from(is_person));
                let is_alike = |sum: u8, all: u8| sum == if is_person { all } else { 0 };
                let halfway = if is_alike(near, 9) { 0.5 * (*alpha + decided) } else { *alpha };
                *alpha = if is_alike(wide, 25) { decided } else { halfway };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (64, 48);

    /// Creates a mask from a function of column and row.
    fn mask(alpha: impl Fn(usize, usize) -> f32) -> Mask {
        let alpha = (0..SIZE.0 * SIZE.1).map(|at| alpha(at % SIZE.0, at / SIZE.0)).collect();
        Mask { width: SIZE.0 as u32, height: SIZE.1 as u32, alpha }
    }

    fn is_body(x: usize, y: usize) -> bool {
        (16..48).contains(&x) && y >= 8
    }

    fn body(x: usize, y: usize) -> f32 {
        if is_body(x, y) { 1.0 } else { 0.0 }
    }

    /// Returns the decided values in a square hole of this side and mask value in a body.
    fn hole(side: usize, alpha: f32) -> Vec<f32> {
        let is_hole = |x: usize, y: usize| (20..20 + side).contains(&x) && (12..12 + side).contains(&y);
        let mut decided = Mask::default();
        let mask = mask(|x, y| if is_hole(x, y) { alpha } else { body(x, y) });
        MaskPostProcessor::default().postprocess(&mask, &mask.alpha, false, &mut decided);
        (0..SIZE.0 * SIZE.1).filter(|at| is_hole(at % SIZE.0, at / SIZE.0)).map(|at| decided.alpha[at]).collect()
    }

    #[test]
    fn a_hole_that_the_network_is_unsure_of_is_filled_and_a_real_one_stays() {
        assert!(hole(4, 0.2).iter().all(|alpha| *alpha == 1.0), "an earring");
        assert!(hole(4, 0.05).iter().all(|alpha| *alpha <= 0.05), "what is between arm and body");
        assert!(hole(12, 0.2).iter().all(|alpha| *alpha <= 0.2), "a large one");
    }

    #[test]
    fn what_is_unsure_is_decided_but_for_the_outline() {
        let mut decided = Mask::default();
        // An unsure hand, and an unsure chair.
        let alpha = |x: usize, y: usize| match x {
            0..10 if y >= 30 => 0.3,
            48..60 if y >= 30 => 0.7,
            _ => body(x, y),
        };
        let mask = mask(alpha);
        MaskPostProcessor::default().postprocess(&mask, &mask.alpha, false, &mut decided);
        let at = |x: usize, y: usize| decided.alpha[y * SIZE.0 + x];
        assert_eq!((at(4, 40), at(54, 40)), (0.0, 1.0));
        assert_eq!((at(59, 40), at(60, 40)), (0.7, 0.0), "at the outline, it is as it was");
    }

    #[test]
    fn a_pixel_about_one_half_does_not_flicker() {
        let (mut postprocessor, mut decided) = (MaskPostProcessor::default(), Mask::default());
        let mut seen = Vec::new();
        for frame in 0..20 {
            let hand = if frame % 2 == 0 { 0.55 } else { 0.45 };
            let alpha = |x: usize, y: usize| if (48..60).contains(&x) && y >= 20 { hand } else { body(x, y) };
            let mask = mask(alpha);
            postprocessor.postprocess(&mask, &mask.alpha, false, &mut decided);
            seen.push(decided.alpha[40 * SIZE.0 + 54]);
        }
        assert!(seen.iter().all(|alpha| *alpha == seen[0]), "{seen:?}");
    }

    /// Returns how many pixels of each of these masks are a person's at least in part.
    fn sharp_pixels(takes_two: bool, masks: &[&Mask]) -> Vec<usize> {
        let (mut postprocessor, mut decided) = (MaskPostProcessor::default(), Mask::default());
        let sharp = masks.iter().map(|mask| {
            postprocessor.postprocess(mask, &mask.alpha, takes_two, &mut decided);
            decided.alpha.iter().filter(|alpha| **alpha > 0.0).count()
        });
        sharp.collect()
    }

    /// A network's mask of an empty room: a large unsure region, and few certain pixels.
    fn room() -> Mask {
        mask(|x, y| match (x, y) {
            (30..34, 20..24) => 0.97,
            (10..40, 10..40) => 0.7,
            _ => 0.0,
        })
    }

    #[test]
    fn an_empty_room_is_blurred_from_the_first_mask_on_and_in_the_mask_in_which_a_person_is_lost() {
        let (room, person) = (room(), mask(body));
        let pixels = 32 * 40;
        assert_eq!(sharp_pixels(false, &[&room, &room, &person, &room, &room]), [0, 0, pixels, 0, 0]);
    }

    #[test]
    fn a_person_in_a_live_picture_takes_two_masks_that_agree() {
        let (room, person, pixels) = (room(), mask(body), 32 * 40);
        assert_eq!(sharp_pixels(true, &[&person, &person, &room, &person, &person]), [0, pixels, 0, 0, pixels]);
        // A region that the network is sure of once, at the other side, is never shown, and the person stays.
        let with_error = mask(|x, y| if x < 8 { 1.0 } else { body(x, y) });
        assert_eq!(sharp_pixels(true, &[&person, &person, &with_error, &person])[1..], [pixels; 3]);
        // A person who moves is the same person.
        let moved = [0, 6, 12].map(|by| mask(|x, y| body(x.saturating_sub(by), y)));
        assert!(sharp_pixels(true, &moved.each_ref())[1..].iter().all(|&sharp| sharp > 0));
    }

    #[test]
    fn where_somebody_was_is_not_sure_because_the_mask_is_smoothed() {
        let (mut postprocessor, mut decided) = (MaskPostProcessor::default(), Mask::default());
        let (person, unsure) = (mask(body), mask(|x, y| 0.6 * body(x, y)));
        let mut sharp = |own: &Mask| {
            postprocessor.postprocess(&person, &own.alpha, false, &mut decided);
            decided.alpha.iter().any(|alpha| *alpha > 0.0)
        };
        assert!(sharp(&person) && !sharp(&unsure));
    }

    #[test]
    fn an_unsure_region_beside_a_person_is_blurred_with_its_holes() {
        let chair = mask(|x, y| match (x, y) {
            (4..8, 14..18) => 0.3,
            (1..12, 10..22) => 0.7,
            _ => body(x, y),
        });
        assert_eq!(sharp_pixels(false, &[&chair]), [32 * 40]);
    }

    #[test]
    fn what_rests_while_a_person_moves_is_an_object_until_it_moves_itself() {
        let rucksack = |x: usize, y: usize| x < 10 && y >= 30;
        let both = mask(|x, y| if rucksack(x, y) { 1.0 } else { body(x, y) });
        let alone = mask(|x, y| f32::from(u8::from(rucksack(x, y))));
        let (mut postprocessor, mut decided) = (MaskPostProcessor::default(), Mask::default());
        let mut sharp = |mask: &Mask, at_rest: &dyn Fn(usize, usize) -> bool| {
            postprocessor
                .set_at_rest(|all| all.extend((0..SIZE.0 * SIZE.1).map(|at| at_rest(at % SIZE.0, at / SIZE.0))));
            postprocessor.postprocess(mask, &mask.alpha, false, &mut decided);
            [decided.alpha[40 * SIZE.0 + 4], decided.alpha[40 * SIZE.0 + 32]]
        };
        assert_eq!(sharp(&both, &|_, _| true), [1.0, 1.0], "all at rest: a photo, or persons who hold still");
        assert_eq!(sharp(&both, &|_, _| false), [1.0, 1.0]);
        assert_eq!(sharp(&both, &rucksack), [0.0, 1.0]);
        assert_eq!(sharp(&alone, &|_, _| true), [0.0, 0.0], "the person left");
        assert_eq!(sharp(&both, &|_, _| true), [0.0, 1.0], "and is back, and holds still");
        assert_eq!(sharp(&both, &|x, _| x > 2), [1.0, 1.0], "part of it moves");
        assert_eq!(sharp(&both, &|_, _| true), [1.0, 1.0]);
    }
}
