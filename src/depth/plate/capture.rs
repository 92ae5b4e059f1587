//! Captures a plate: the per-pixel median of pictures without motion.

use crate::depth::reduced::Reducer;
use crate::frame::{ColorImage, Mask};

/// Minimum time between the pictures.
const MIN_INTERVAL_NS: u64 = 80_000_000;
/// A picture shows motion if more than this fraction of its reduced pixels differs from the first one by more than
/// `MIN_DIFFERENCE`.
const MAX_MOVING: f32 = 0.003;
const MIN_DIFFERENCE: f32 = 12.0;
/// Minimum fraction of a picture that counts as a person.
const MIN_PERSON: f32 = 0.004;

/// Time without motion after which a person in the picture counts as at rest.
const MIN_REST_NS: u64 = 1_000_000_000;

/// Why a picture is no part of a plate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Obstacle {
    /// Something moves.
    Motion,
    /// A person seems to be there, at rest. It may be an object that the network takes for one.
    Person,
}

/// The result of adding a picture.
#[derive(Clone, Debug, PartialEq)]
pub enum CaptureResult {
    /// More pictures are needed; the progress, 0 to 1.
    Collecting(f32),
    /// The previous pictures were discarded.
    Rejected(Obstacle),
    /// The finished plate.
    Finished(ColorImage),
}

/// Pictures collected for a plate.
#[derive(Debug, Default)]
pub struct Capture {
    pictures: Vec<ColorImage>,
    last_ns: Option<u64>,
    reducer: Reducer,
    /// The picture that later ones are compared with.
    first: Vec<[f32; 3]>,
    now: Vec<[f32; 3]>,
    /// Time of the last motion.
    moved_ns: Option<u64>,
}

impl Capture {
    /// Number of pictures for the median.
    pub const PICTURES: usize = 11;

    /// Adds a picture at media time `time_ns`; all have the same size. With a mask of `persons`, pictures with a person
    /// are rejected.
    pub fn add(&mut self, color: &ColorImage, time_ns: u64, persons: Option<&Mask>) -> CaptureResult {
        self.reducer.reduce(color, &mut self.now);
        let are_there = persons.is_some_and(|persons| {
            let count = persons.alpha.iter().filter(|alpha| **alpha > 0.5).count();
            count as f32 > MIN_PERSON * persons.alpha.len() as f32
        });
        let moves = self.first.len() == self.now.len() && differing_fraction(&self.first, &self.now) > MAX_MOVING;
        if moves || self.first.len() != self.now.len() {
            self.first.clone_from(&self.now);
        }
        if moves {
            self.moved_ns = Some(time_ns);
        }
        if moves || are_there {
            self.discard();
            let rests = !moves && self.moved_ns.is_none_or(|moved_ns| time_ns >= moved_ns + MIN_REST_NS);
            return CaptureResult::Rejected(if rests { Obstacle::Person } else { Obstacle::Motion });
        }
        if self.last_ns.is_none_or(|last_ns| time_ns >= last_ns + MIN_INTERVAL_NS) {
            self.last_ns = Some(time_ns);
            return self.add_unchecked(color);
        }
        CaptureResult::Collecting(self.progress())
    }

    /// Adds a picture unconditionally, without the checks of [`Self::add`].
    pub fn add_unchecked(&mut self, color: &ColorImage) -> CaptureResult {
        self.pictures.push(color.clone());
        match self.pictures.len() {
            Self::PICTURES => CaptureResult::Finished(self.finish()),
            _ => CaptureResult::Collecting(self.progress()),
        }
    }

    fn progress(&self) -> f32 {
        self.pictures.len() as f32 / Self::PICTURES as f32
    }

    /// Returns the plate of the pictures so far, at least one.
    pub fn finish(&mut self) -> ColorImage {
        let mut plate = self.pictures[0].clone();
        let mut values = Vec::with_capacity(Self::PICTURES);
        for (at, code) in plate.rgb.iter_mut().enumerate() {
            values.clear();
            values.extend(self.pictures.iter().map(|picture| picture.rgb[at]));
            let middle = values.len() / 2;
            *code = *values.select_nth_unstable(middle).1;
        }
        self.discard();
        self.first.clear();
        plate
    }

    fn discard(&mut self) {
        self.pictures.clear();
        self.last_ns = None;
    }
}

/// Returns the fraction of pixels in which two reduced pictures differ.
fn differing_fraction(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    let differ = |(a, b): &(&[f32; 3], &[f32; 3])| (0..3).any(|p| (a[p] - b[p]).abs() > MIN_DIFFERENCE);
    a.iter().zip(b).filter(differ).count() as f32 / a.len().max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_walks_out_is_not_in_the_plate_and_noise_is_not_either() {
        let picture = |step: u32, person: bool| {
            let mut picture = ColorImage::new(64, 48);
            for (at, code) in picture.rgb.iter_mut().enumerate() {
                *code = (100 + (at as u32 * 7 + step * 13) % 5) as u8;
            }
            if person {
                picture.rgb[3 * 64 * 20..3 * 64 * 30].fill(30);
            }
            picture
        };
        let mut capture = Capture::default();
        let mut moved = 0;
        for step in 0..40 {
            match capture.add(&picture(step, step < 6), u64::from(step) * 100_000_000, None) {
                CaptureResult::Collecting(progress) => assert!(progress < 1.0),
                CaptureResult::Rejected(why) => {
                    assert_eq!(why, Obstacle::Motion);
                    moved += 1;
                }
                CaptureResult::Finished(plate) => {
                    assert!(moved == 1 && step > 12, "{moved} {step}");
                    return assert!(plate.rgb.iter().all(|code| (101..=103).contains(code)));
                }
            }
        }
        panic!("no plate");
    }

    #[test]
    fn who_rests_is_told_from_what_moves() {
        let room = ColorImage::new(64, 48);
        let mut passing = room.clone();
        passing.rgb[3 * 64 * 20..3 * 64 * 30].fill(90);
        let mut person = Mask::default();
        person.resize(64, 48);
        person.alpha[..300].fill(1.0);
        let mut capture = Capture::default();
        let mut add = |picture: &ColorImage, time_ms: u64, persons| capture.add(picture, time_ms * 1_000_000, persons);
        let (moves, rests) = (CaptureResult::Rejected(Obstacle::Motion), CaptureResult::Rejected(Obstacle::Person));
        assert_eq!(add(&room, 0, Some(&person)), rests, "a rucksack that a network takes for a person");
        assert_eq!(add(&passing, 100, Some(&person)), moves);
        assert_eq!(add(&passing, 200, Some(&person)), moves, "who stands still for a moment");
        assert_eq!(add(&passing, 1200, Some(&person)), rests);
        assert_eq!(add(&room, 1300, Some(&person)), moves);
        // A caller who knows that it is no person leaves the mask out.
        for step in 0..Capture::PICTURES as u64 {
            match add(&room, 1400 + 100 * step, None) {
                CaptureResult::Finished(plate) => return assert!(plate == room),
                other => assert!(matches!(other, CaptureResult::Collecting(_)), "{other:?}"),
            }
        }
        panic!("no plate");
    }
}
