//! Which pixels of a network's mask are a person's, decided as a whole where the network is unsure.
//!
//! Between 0 and 1 a mask means two things: on an outline, that a pixel is mixed; elsewhere, that the network does not know.
//! Nobody's hand is half there, so away from outlines a pixel is a person's, or it is not. An enclosed hole that the network is
//! unsure of is none, and a mask in which it is sure of nothing shows nobody.

use super::parts::Parts;
use crate::frame::Mask;

/// A pixel is a person's from one half on: less, if it was so in the frame before, and more if it was not.
const HYSTERESIS: f32 = 0.1;
/// Where an enclosed hole has less than this, the network is sure that it is one; and the same once it was filled.
const SURE_HOLE: [f32; 2] = [0.15, 0.1];
/// Larger holes stay, as a share of the mask: an arm akimbo encloses more.
const LARGEST_HOLE: f32 = 0.02;
/// The network is sure that a pixel is a person's from here on.
const SURE: f32 = 0.9;
/// A part is a person's whose pixels are sure by this share; and the same while somebody is there.
const PERSON: [f32; 2] = [0.6, 0.4];
/// Smaller parts are nobody's, as a share of the mask.
const LEAST_PART: f32 = 0.001;
/// For so long, somebody who was there or may have been is not gone.
const DOUBT_NS: u64 = 300_000_000;

/// Pixels all around that one is decided with: half with those beside it, the rest with those beside them.
const REACH: usize = 2;

/// Decides from frame to frame; owns the memory for it.
#[derive(Debug, Default)]
pub struct Decision {
    /// Whether pixels are a person's, and in the frame before.
    persons: Vec<bool>,
    before: Vec<bool>,
    parts: Parts,
    /// How many of the pixels above, below and at a pixel are a person's, within one and within [`REACH`].
    columns: [Vec<u8>; 2],
    /// When a person was seen last; `None` before the first frame.
    seen_ns: Option<u64>,
    is_present: bool,
}

impl Decision {
    /// Forgets the frame before: the next one is another scene.
    pub fn forget(&mut self) {
        self.before.clear();
        (self.seen_ns, self.is_present) = (None, false);
    }

    /// Makes `decided` what `mask` is with all decided that can be, in a picture that was taken at this time.
    pub fn decide(&mut self, mask: &Mask, now_ns: u64, decided: &mut Mask) {
        decided.clone_from(mask);
        self.classify(&mask.share);
        let width = mask.width as usize;
        let Self { persons, before, parts, .. } = self;
        parts.find(persons, width, |at| match persons[at] {
            true => mask.share[at] > SURE,
            false => mask.share[at] < SURE_HOLE[usize::from(before[at])],
        });
        if !self.is_somebody_there(now_ns) {
            decided.share.fill(0.0);
            self.before.clear();
            return;
        }
        self.fill_holes();
        self.settle(width, &mut decided.share);
        std::mem::swap(&mut self.persons, &mut self.before);
    }

    /// Whether each pixel is a person's, by its share and the frame before.
    fn classify(&mut self, shares: &[f32]) {
        let Self { persons, before, .. } = self;
        persons.clear();
        if before.len() == shares.len() {
            let least = |was: bool| if was { 0.5 - HYSTERESIS } else { 0.5 + HYSTERESIS };
            persons.extend(shares.iter().zip(&*before).map(|(&share, &was)| share > least(was)));
        } else {
            persons.extend(shares.iter().map(|&share| share > 0.5));
            before.clear();
            before.resize(shares.len(), false);
        }
    }

    /// Whether a part of the mask is a person, or was so until just now.
    fn is_somebody_there(&mut self, now_ns: u64) -> bool {
        let least = LEAST_PART * self.persons.len() as f32;
        let sure = PERSON[usize::from(self.is_present)];
        let is_person = |pixels: u32, found: u32| pixels as f32 > least && found as f32 >= sure * pixels as f32;
        if self.parts.all().any(|part| part.is_person && is_person(part.pixels, part.found)) {
            (self.seen_ns, self.is_present) = (Some(now_ns), true);
        }
        // Nobody is seen at once that the network is unsure of: before, it may have been somebody. Time goes back where a
        // recording begins anew.
        let seen_ns = *self.seen_ns.get_or_insert(now_ns);
        self.is_present &= now_ns.saturating_sub(seen_ns) <= DOUBT_NS;
        now_ns.saturating_sub(seen_ns) <= DOUBT_NS
    }

    /// Enclosed holes that the network is nowhere sure of become the person's.
    fn fill_holes(&mut self) {
        let largest = (LARGEST_HOLE * self.persons.len() as f32) as u32;
        for (pixels, part) in self.parts.runs() {
            if !part.is_person && !part.is_open && part.found == 0 && part.pixels <= largest {
                self.persons[pixels].fill(true);
            }
        }
    }

    /// Moves shares to 0 or 1, the farther from the outline the more.
    fn settle(&mut self, width: usize, shares: &mut [f32]) {
        let Self { persons, columns, .. } = self;
        let height = persons.len() / width.max(1);
        let clamped = |at: usize, by: usize, count: usize| (at + by).saturating_sub(REACH).min(count - 1);
        for y in 0..height {
            for (reach, sums) in columns.iter_mut().enumerate().map(|(k, sums)| (k + 1, sums)) {
                sums.clear();
                sums.resize(width, 0);
                for by in REACH - reach..=REACH + reach {
                    let row = &persons[clamped(y, by, height) * width..][..width];
                    sums.iter_mut().zip(row).for_each(|(sum, &is_person)| *sum += u8::from(is_person));
                }
            }
            let row = y * width..(y + 1) * width;
            for (x, (share, &is_person)) in shares[row.clone()].iter_mut().zip(&persons[row]).enumerate() {
                let alike = |reach: usize| {
                    let all = if is_person { 2 * reach as u8 + 1 } else { 0 };
                    let sums = &columns[reach - 1];
                    (REACH - reach..=REACH + reach).all(|by| sums[clamped(x, by, width)] == all)
                };
                let decided = if is_person { 1.0 } else { 0.0 };
                *share = match () {
                    () if *share == decided || !alike(1) => *share,
                    () if alike(REACH) => decided,
                    () => 0.5 * (*share + decided),
                };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (64, 48);
    const FRAME_NS: u64 = 33_000_000;

    /// A mask of a person, with the share of every other pixel `at` of `inside`, and none elsewhere.
    fn mask(share: impl Fn(usize, usize) -> f32) -> Mask {
        let share = (0..SIZE.0 * SIZE.1).map(|at| share(at % SIZE.0, at / SIZE.0)).collect();
        Mask { width: SIZE.0 as u32, height: SIZE.1 as u32, share }
    }

    fn is_body(x: usize, y: usize) -> bool {
        (16..48).contains(&x) && y >= 8
    }

    fn body(x: usize, y: usize) -> f32 {
        if is_body(x, y) { 1.0 } else { 0.0 }
    }

    /// The shares of a body with a hole of this size and share, decided.
    fn hole(side: usize, share: f32) -> Vec<f32> {
        let is_hole = |x: usize, y: usize| (20..20 + side).contains(&x) && (12..12 + side).contains(&y);
        let mut decided = Mask::default();
        let mask = mask(|x, y| if is_hole(x, y) { share } else { body(x, y) });
        Decision::default().decide(&mask, 0, &mut decided);
        (0..SIZE.0 * SIZE.1).filter(|at| is_hole(at % SIZE.0, at / SIZE.0)).map(|at| decided.share[at]).collect()
    }

    #[test]
    fn a_hole_that_the_network_is_unsure_of_is_filled_and_a_real_one_stays() {
        assert!(hole(4, 0.2).iter().all(|share| *share == 1.0), "an earring");
        assert!(hole(4, 0.05).iter().all(|share| *share <= 0.05), "what is between arm and body");
        assert!(hole(12, 0.2).iter().all(|share| *share <= 0.2), "a large one");
    }

    #[test]
    fn what_is_unsure_is_decided_but_for_the_outline() {
        let mut decided = Mask::default();
        // A hand of which the network is not sure, and a chair of which it is not either.
        let share = |x: usize, y: usize| match x {
            0..10 if y >= 30 => 0.3,
            48..60 if y >= 30 => 0.7,
            _ => body(x, y),
        };
        Decision::default().decide(&mask(share), 0, &mut decided);
        let at = |x: usize, y: usize| decided.share[y * SIZE.0 + x];
        assert_eq!((at(4, 40), at(54, 40)), (0.0, 1.0));
        assert_eq!((at(59, 40), at(60, 40)), (0.7, 0.0), "at the outline, it is as it was");
    }

    #[test]
    fn a_pixel_about_one_half_does_not_flicker() {
        let (mut decision, mut decided) = (Decision::default(), Mask::default());
        let mut seen = Vec::new();
        for frame in 0..20u64 {
            let hand = if frame % 2 == 0 { 0.55 } else { 0.45 };
            let share = |x: usize, y: usize| if (48..60).contains(&x) && y >= 20 { hand } else { body(x, y) };
            decision.decide(&mask(share), frame * FRAME_NS, &mut decided);
            seen.push(decided.share[40 * SIZE.0 + 54]);
        }
        assert!(seen.iter().all(|share| *share == seen[0]), "{seen:?}");
    }

    #[test]
    fn a_room_with_nobody_is_blurred_after_half_a_second_and_who_comes_in_is_found_at_once() {
        let (mut decision, mut decided) = (Decision::default(), Mask::default());
        // What a network makes of a room: much that may be somebody, and little that it is sure of.
        let room = mask(|x, y| match (x, y) {
            (30..34, 20..24) => 0.97,
            (10..40, 10..40) => 0.7,
            _ => 0.0,
        });
        let mut sharp = |mask: &Mask, frame: u64| {
            decision.decide(mask, frame * FRAME_NS, &mut decided);
            decided.share.iter().any(|share| *share > 0.0)
        };
        assert!((0..60).all(|frame| !sharp(&room, frame) || frame * FRAME_NS < 500_000_000));
        assert!(sharp(&mask(body), 60), "in the frame in which they come");
        // They go: the same.
        assert!((61..120).all(|frame| !sharp(&room, frame) || (frame - 60) * FRAME_NS < 500_000_000));
        // Who moves, and is not well seen for two frames, is still there.
        assert!(sharp(&mask(body), 120) && sharp(&room, 121) && sharp(&room, 122));
    }
}
