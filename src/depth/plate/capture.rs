//! Taking a plate: the median of pictures in which nothing moves.

use crate::depth::reduced::Reducer;
use crate::frame::{ColorImage, Mask};

/// They are so far apart, at least.
const APART_NS: u64 = 80_000_000;
/// A picture in which more than this share of the pixels differ by more than so much from the first one is another.
const MOVES_SHARE: f32 = 0.003;
const MOVES: f32 = 12.0;
/// Less of a picture than this is no person.
const PERSONS_SHARE: f32 = 0.004;

/// What became of a picture.
#[derive(Clone, Debug, PartialEq)]
pub enum Taken {
    /// More are needed; so much of them there are, 0 to 1.
    More(f32),
    /// It differs from those before, which are given up: something moves.
    Moved,
    /// The plate.
    Whole(ColorImage),
}

/// Pictures on the way to a plate.
#[derive(Debug, Default)]
pub struct Capture {
    pictures: Vec<ColorImage>,
    last_ns: Option<u64>,
    reducer: Reducer,
    first: Vec<[f32; 3]>,
    now: Vec<[f32; 3]>,
}

impl Capture {
    /// Of so many pictures the median is taken.
    pub const PICTURES: usize = 11;

    /// Adds a picture at this time; all have the same size. Where `persons` are known, none may be there.
    pub fn add(&mut self, color: &ColorImage, time_ns: u64, persons: Option<&Mask>) -> Taken {
        self.reducer.reduce(color, &mut self.now);
        let are_there = persons.is_some_and(|persons| {
            let count = persons.share.iter().filter(|share| **share > 0.5).count();
            count as f32 > PERSONS_SHARE * persons.share.len() as f32
        });
        if are_there {
            self.forget();
            return Taken::Moved;
        }
        if self.first.len() == self.now.len() && differing(&self.first, &self.now) > MOVES_SHARE {
            self.forget();
            return Taken::Moved;
        }
        if self.pictures.is_empty() {
            self.first.clone_from(&self.now);
        }
        if self.last_ns.is_none_or(|last_ns| time_ns >= last_ns + APART_NS) {
            self.last_ns = Some(time_ns);
            return self.add_any(color);
        }
        Taken::More(self.share())
    }

    /// As [`Self::add`], whatever moves, and however soon.
    pub fn add_any(&mut self, color: &ColorImage) -> Taken {
        self.pictures.push(color.clone());
        match self.pictures.len() {
            Self::PICTURES => Taken::Whole(self.finish()),
            _ => Taken::More(self.share()),
        }
    }

    fn share(&self) -> f32 {
        self.pictures.len() as f32 / Self::PICTURES as f32
    }

    /// The plate of the pictures there are, of which there is one at least.
    pub fn finish(&mut self) -> ColorImage {
        let mut plate = self.pictures[0].clone();
        let mut values = Vec::with_capacity(Self::PICTURES);
        for (at, code) in plate.rgb.iter_mut().enumerate() {
            values.clear();
            values.extend(self.pictures.iter().map(|picture| picture.rgb[at]));
            let middle = values.len() / 2;
            *code = *values.select_nth_unstable(middle).1;
        }
        self.forget();
        plate
    }

    fn forget(&mut self) {
        self.pictures.clear();
        self.first.clear();
        self.last_ns = None;
    }
}

/// The share of the pixels in which two reduced pictures differ.
pub fn differing(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    let differ = |(a, b): &(&[f32; 3], &[f32; 3])| (0..3).any(|p| (a[p] - b[p]).abs() > MOVES);
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
                Taken::More(share) => assert!(share < 1.0),
                Taken::Moved => moved += 1,
                Taken::Whole(plate) => {
                    assert!(moved == 1 && step > 12, "{moved} {step}");
                    return assert!(plate.rgb.iter().all(|code| (101..=103).contains(code)));
                }
            }
        }
        panic!("no plate");
    }
}
