//! Decides the unsure regions of a network's mask: person or background.
//!
//! A mask value between 0 and 1 has two meanings: on an outline, a mixed pixel; elsewhere, an unsure network. Away from
//! outlines, no pixel is half a person, so each is decided either way. An enclosed hole of which the network is unsure
//! is filled, and a mask in which it is sure of nothing shows no person.

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
/// Minimum fraction of certain pixels in a person's region, if no person was there, and if one was.
const MIN_SURE_FRACTION: [f32; 2] = [0.6, 0.4];
/// Minimum size of a person's region, as a fraction of the mask.
const MIN_COMPONENT_FRACTION: f32 = 0.001;
/// Time for which a person may be unsure before it counts as gone.
const MAX_UNSURE_NS: u64 = 300_000_000;

/// Radius of the neighbourhood for decisions: equal pixels within 1 decide half, within 2 fully.
const RADIUS: usize = 2;

/// Decides from frame to frame; owns the memory for it.
#[derive(Debug, Default)]
pub struct MaskPostProcessor {
    /// Whether a pixel is a person's, in this and in the previous frame.
    persons: Vec<bool>,
    previous: Vec<bool>,
    components: Components,
    /// Vertical sums of person pixels around each pixel of a row, within 1 and within [`RADIUS`], from [`RADIUS`] pixels
    /// beyond the border on.
    columns: [Vec<u8>; 2],
    /// When a person was last seen; `None` before the first frame.
    seen_ns: Option<u64>,
    is_present: bool,
}

impl MaskPostProcessor {
    /// Resets the state, for a new scene.
    pub fn reset(&mut self) {
        self.previous.clear();
        (self.seen_ns, self.is_present) = (None, false);
    }

    /// Writes the decided mask of a picture at `now_ns` to `decided`.
    pub fn postprocess(&mut self, mask: &Mask, now_ns: u64, decided: &mut Mask) {
        decided.clone_from(mask);
        self.classify_pixels(&mask.alpha);
        let width = mask.width as usize;
        let Self { persons, previous, components, .. } = self;
        components.find(persons, width, |at| match persons[at] {
            true => mask.alpha[at] > MIN_SURE_ALPHA,
            false => mask.alpha[at] < SURE_HOLE_ALPHA[usize::from(previous[at])],
        });
        if !self.is_person_present(now_ns) {
            decided.alpha.fill(0.0);
            self.previous.clear();
            return;
        }
        self.fill_holes();
        self.binarize_interior(width, &mut decided.alpha);
        std::mem::swap(&mut self.persons, &mut self.previous);
    }

    /// Classifies each pixel by its mask value and the previous frame (hysteresis).
    fn classify_pixels(&mut self, alphas: &[f32]) {
        let Self { persons, previous, .. } = self;
        persons.clear();
        if previous.len() == alphas.len() {
            let least = |was: bool| if was { 0.5 - HYSTERESIS } else { 0.5 + HYSTERESIS };
            persons.extend(alphas.iter().zip(&*previous).map(|(&alpha, &was)| alpha > least(was)));
        } else {
            persons.extend(alphas.iter().map(|&alpha| alpha > 0.5));
            previous.clear();
            previous.resize(alphas.len(), false);
        }
    }

    /// Whether a region of the mask is a person, or was one until just now.
    fn is_person_present(&mut self, now_ns: u64) -> bool {
        let least = MIN_COMPONENT_FRACTION * self.persons.len() as f32;
        let sure = MIN_SURE_FRACTION[usize::from(self.is_present)];
        let is_person =
            |pixels: u32, sure_pixels: u32| pixels as f32 > least && sure_pixels as f32 >= sure * pixels as f32;
        if self
            .components
            .iter_all()
            .any(|component| component.is_person && is_person(component.pixels, component.matches))
        {
            (self.seen_ns, self.is_present) = (Some(now_ns), true);
        }
        // At the start, an unsure region may be a person, too. Time goes back when a recording restarts.
        let seen_ns = *self.seen_ns.get_or_insert(now_ns);
        self.is_present &= now_ns.saturating_sub(seen_ns) <= MAX_UNSURE_NS;
        now_ns.saturating_sub(seen_ns) <= MAX_UNSURE_NS
    }

    /// Fills small enclosed holes without certain pixels.
    fn fill_holes(&mut self) {
        let largest = (MAX_HOLE_FRACTION * self.persons.len() as f32) as u32;
        for (pixels, component) in self.components.runs() {
            if !component.is_person
                && !component.touches_border
                && component.matches == 0
                && component.pixels <= largest
            {
                self.persons[pixels].fill(true);
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
    const FRAME_NS: u64 = 33_000_000;

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
        MaskPostProcessor::default().postprocess(&mask, 0, &mut decided);
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
        MaskPostProcessor::default().postprocess(&mask(alpha), 0, &mut decided);
        let at = |x: usize, y: usize| decided.alpha[y * SIZE.0 + x];
        assert_eq!((at(4, 40), at(54, 40)), (0.0, 1.0));
        assert_eq!((at(59, 40), at(60, 40)), (0.7, 0.0), "at the outline, it is as it was");
    }

    #[test]
    fn a_pixel_about_one_half_does_not_flicker() {
        let (mut postprocessor, mut decided) = (MaskPostProcessor::default(), Mask::default());
        let mut seen = Vec::new();
        for frame in 0..20u64 {
            let hand = if frame % 2 == 0 { 0.55 } else { 0.45 };
            let alpha = |x: usize, y: usize| if (48..60).contains(&x) && y >= 20 { hand } else { body(x, y) };
            postprocessor.postprocess(&mask(alpha), frame * FRAME_NS, &mut decided);
            seen.push(decided.alpha[40 * SIZE.0 + 54]);
        }
        assert!(seen.iter().all(|alpha| *alpha == seen[0]), "{seen:?}");
    }

    #[test]
    fn a_room_with_nobody_is_blurred_after_half_a_second_and_who_comes_in_is_found_at_once() {
        let (mut postprocessor, mut decided) = (MaskPostProcessor::default(), Mask::default());
        // A network's mask of an empty room: a large unsure region, and few certain pixels.
        let room = mask(|x, y| match (x, y) {
            (30..34, 20..24) => 0.97,
            (10..40, 10..40) => 0.7,
            _ => 0.0,
        });
        let mut sharp = |mask: &Mask, frame: u64| {
            postprocessor.postprocess(mask, frame * FRAME_NS, &mut decided);
            decided.alpha.iter().any(|alpha| *alpha > 0.0)
        };
        assert!((0..60).all(|frame| !sharp(&room, frame) || frame * FRAME_NS < 500_000_000));
        assert!(sharp(&mask(body), 60), "in the frame in which they come");
        // The person leaves: the same delay.
        assert!((61..120).all(|frame| !sharp(&room, frame) || (frame - 60) * FRAME_NS < 500_000_000));
        // A moving person who is unsure for two frames remains.
        assert!(sharp(&mask(body), 120) && sharp(&room, 121) && sharp(&room, 122));
    }
}
