//! How near everything is: a network's relative inverse depth, and what it is measured against.
//!
//! Its numbers grow with nearness, in a scale and from a zero that wander from frame to frame. Two anchors of the picture
//! itself do away with both: the subject, and what is farthest.

use super::aside::Aside;
use super::feed::Feed;
use crate::depth::tap::nearest;
use crate::frame::{ColorImage, Mask};

/// Of all numbers, sorted, this share is farther than what counts as the farthest, or nearer than the nearest.
const OUTLIERS: f32 = 0.03;
/// How far the network's outlines are off, in its pixels: so far around a person nothing is told of what is behind.
const MARGIN_PX: usize = 7;
/// What is around a person is carried on behind them over so many pixels and more.
const SPREAD_PX: usize = 24;
/// Nothing behind a subject is nearer than this: it would be the subject's own.
const NEAREST_BEHIND: f32 = 0.9;

/// Nearness from frame to frame.
pub struct Relief {
    /// What was found last.
    found: Found,
    /// Away while the thread has it.
    finder: Option<Box<Finder>>,
    aside: Option<Aside<Box<Finder>>>,
}

/// How near everything in a picture is.
#[derive(Default)]
struct Found {
    /// Columns and rows.
    size: (usize, usize),
    /// Relative inverse depth: 1 at the subject, 0 at what is farthest.
    nearness: Vec<f32>,
    /// The same of what is behind the subject.
    behind: Vec<f32>,
}

/// Finds it.
struct Finder {
    feed: Feed,
    found: Found,
    outcome: Result<(), String>,
    /// The mask of the subject in the picture that was shown; nobody's where it is empty.
    mask: Mask,
    /// How far each is the subject's.
    subject: Vec<f32>,
    known: Vec<f32>,
    spread: Vec<f32>,
    sorted: Vec<f32>,
    line: Vec<f32>,
}

impl Relief {
    pub fn new(feed: Feed) -> Self {
        let finder = Finder {
            feed,
            found: Found::default(),
            outcome: Ok(()),
            mask: Mask::default(),
            subject: Vec::new(),
            known: Vec::new(),
            spread: Vec::new(),
            sorted: Vec::new(),
            line: Vec::new(),
        };
        Self { found: Found::default(), finder: Some(Box::new(finder)), aside: None }
    }

    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        self.found.size
    }

    /// Relative inverse depth of the picture that was seen last, 1 at the subject and 0 at what is farthest.
    pub fn nearness(&self) -> &[f32] {
        &self.found.nearness
    }

    /// The same, with the subject away: below 1.
    pub fn behind(&self) -> &[f32] {
        &self.found.behind
    }

    /// Finds the nearness of all that a picture shows, the subject being what `mask` has, or else what is nearest.
    ///
    /// # Errors
    /// As for [`Feed::see`].
    pub fn look(&mut self, color: &ColorImage, mask: Option<&Mask>) -> Result<(), String> {
        self.take_in(true)?;
        let Some(mut finder) = self.finder.take() else { return Ok(()) };
        finder.show(color, mask);
        finder.find();
        self.take_back(finder)
    }

    /// The same in a thread of its own, once anything was found: [`Self::take_in`] has it later. Nothing is begun while
    /// another picture is under way.
    ///
    /// # Errors
    /// As for [`Feed::see`].
    pub fn look_aside(&mut self, color: &ColorImage, mask: Option<&Mask>) -> Result<(), String> {
        if self.found.nearness.is_empty() {
            return self.look(color, mask);
        }
        self.take_in(false)?;
        let Some(mut finder) = self.finder.take() else { return Ok(()) };
        finder.show(color, mask);
        if self.aside.is_none() {
            self.aside = Aside::new("inference", |finder: &mut Box<Finder>| finder.find());
        }
        let given = match &self.aside {
            Some(aside) => aside.give(finder),
            None => Err(finder),
        };
        given.or_else(|mut finder| {
            finder.find();
            self.take_back(finder)
        })
    }

    /// Takes in what the thread has found, or will have with `wait`.
    ///
    /// # Errors
    /// As for [`Feed::see`].
    pub fn take_in(&mut self, wait: bool) -> Result<(), String> {
        match self.aside.as_ref().filter(|_| self.finder.is_none()).map(|aside| aside.take(wait)).transpose()? {
            Some(Some(finder)) => self.take_back(finder),
            _ => Ok(()),
        }
    }

    fn take_back(&mut self, mut finder: Box<Finder>) -> Result<(), String> {
        let outcome = std::mem::replace(&mut finder.outcome, Ok(()));
        if outcome.is_ok() {
            std::mem::swap(&mut self.found, &mut finder.found);
        }
        self.finder = Some(finder);
        outcome
    }
}

impl Finder {
    fn show(&mut self, color: &ColorImage, mask: Option<&Mask>) {
        self.feed.show(color);
        match mask {
            Some(mask) => self.mask.clone_from(mask),
            None => self.mask.resize(0, 0),
        }
    }

    fn find(&mut self) {
        let Self { feed, found: Found { size, nearness, .. }, mask, subject, outcome, .. } = self;
        let answer = match feed.answer() {
            Ok(answer) => answer,
            Err(why) => {
                *outcome = Err(why);
                return;
            }
        };
        *size = answer.size;
        let pixels = answer.size.0 * answer.size.1;
        nearness.clear();
        nearness.extend((0..pixels).map(|pixel| answer.at(pixel, 0)));
        subject.clear();
        let of_mask = (mask.width as usize, mask.height as usize);
        let share = |at: usize| if of_mask.0 == 0 { 0.0 } else { mask.share[nearest(at, answer.size, of_mask)] };
        subject.extend((0..pixels).map(share));
        self.measure();
        self.look_behind();
    }

    /// Scales the network's numbers by the two anchors.
    fn measure(&mut self) {
        let Self { found: Found { nearness, .. }, subject: shares, sorted, .. } = self;
        let mut anchor = |share: f32, counts: &dyn Fn(usize) -> bool| {
            sorted.clear();
            sorted.extend(nearness.iter().enumerate().filter(|(at, _)| counts(*at)).map(|(_, &value)| value));
            let at = (share * sorted.len().saturating_sub(1) as f32) as usize;
            (!sorted.is_empty()).then(|| *sorted.select_nth_unstable_by(at, f32::total_cmp).1)
        };
        let person = |at: usize| shares[at] > 0.9;
        let farthest = anchor(OUTLIERS, &|at| !person(at)).or_else(|| anchor(OUTLIERS, &|_| true));
        let subject = anchor(0.5, &person).or_else(|| anchor(1.0 - OUTLIERS, &|_| true));
        let (Some(farthest), Some(subject)) = (farthest, subject) else { return };
        let scale = 1.0 / (subject - farthest).max(1e-6);
        nearness.iter_mut().for_each(|value| *value = (*value - farthest) * scale);
    }

    /// What is around the subject, carried on behind it.
    fn look_behind(&mut self) {
        let Self { found: Found { size, nearness, behind }, subject, known, spread, line, .. } = self;
        let size = *size;
        behind.clone_from(nearness);
        if subject.iter().all(|&share| share < 0.5) {
            return;
        }
        known.clear();
        known.extend(subject.iter().map(|&share| f32::from(u8::from(share < 0.5))));
        // Near an outline the numbers of both surfaces are mixed.
        erode(known, line, size);
        for (value, known) in behind.iter_mut().zip(&*known) {
            *value *= known;
        }
        let total = |plane: &[f32]| plane.iter().sum::<f32>();
        let elsewhere = total(behind) / total(known).max(1.0);
        spread.clone_from(known);
        for plane in [&mut *behind, &mut *spread] {
            // A mean over a square, twice: smooth, and as far as a person is wide.
            for _ in 0..2 {
                mean(plane, line, size);
            }
        }
        for at in 0..nearness.len() {
            behind[at] = match () {
                () if known[at] > 0.0 => nearness[at],
                () if spread[at] > 1e-3 => behind[at] / spread[at],
                () => elsewhere,
            }
            .min(NEAREST_BEHIND);
        }
    }
}

/// Calls `change` with every row of a plane and then with every column, each as a line.
fn by_lines(
    plane: &mut [f32],
    line: &mut Vec<f32>,
    (width, height): (usize, usize),
    change: impl Fn(&[f32], &mut dyn FnMut(usize, f32)),
) {
    for y in 0..height {
        line.clear();
        line.extend_from_slice(&plane[y * width..][..width]);
        change(line, &mut |x, value| plane[y * width + x] = value);
    }
    for x in 0..width {
        line.clear();
        line.extend((0..height).map(|y| plane[y * width + x]));
        change(line, &mut |y, value| plane[y * width + x] = value);
    }
}

/// Where anything within [`MARGIN_PX`] is 0, all becomes 0.
fn erode(plane: &mut [f32], line: &mut Vec<f32>, size: (usize, usize)) {
    by_lines(plane, line, size, |line, set| {
        let mut last = None;
        for (at, &value) in line.iter().enumerate() {
            if value == 0.0 {
                let from = last.map_or(0, |last| last + 1).max(at.saturating_sub(MARGIN_PX));
                (from..at).for_each(|before| set(before, 0.0));
                last = Some(at);
            } else if last.is_some_and(|last| at <= last + MARGIN_PX) {
                set(at, 0.0);
            }
        }
    });
}

/// The mean of every pixel and those within [`SPREAD_PX`], row by row and column by column.
fn mean(plane: &mut [f32], line: &mut Vec<f32>, size: (usize, usize)) {
    by_lines(plane, line, size, |line, set| {
        let (mut sum, reach) = (0.0f64, SPREAD_PX.min(line.len() - 1));
        line[..reach].iter().for_each(|&value| sum += f64::from(value));
        for at in 0..line.len() {
            sum += line.get(at + reach).map_or(0.0, |&value| f64::from(value));
            set(at, (sum / (2 * reach + 1) as f64) as f32);
            sum -= at.checked_sub(reach).map_or(0.0, |left| f64::from(line[left]));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_pixels_spread_and_means_are_means() {
        let size = (40, 3);
        let mut plane = vec![1.0; 120];
        plane[40 + 20] = 0.0;
        erode(&mut plane, &mut Vec::new(), size);
        let row: Vec<usize> = (0..40).filter(|&x| plane[40 + x] == 0.0).collect();
        assert_eq!((row[0], row[row.len() - 1], row.len()), (20 - MARGIN_PX, 20 + MARGIN_PX, 2 * MARGIN_PX + 1));
        assert_eq!(plane[20], 0.0, "rows above and below, too");
        let mut wide = vec![0.0; 101];
        wide[50] = 49.0;
        mean(&mut wide, &mut Vec::new(), (101, 1));
        for (x, value) in wide.iter().enumerate() {
            let expected = if x.abs_diff(50) <= SPREAD_PX { 1.0 } else { 0.0 };
            assert!((value - expected).abs() < 1e-5, "{x}: {value}");
        }
    }
}
