//! Normalises a network's relative inverse depth.
//!
//! The network's values increase with nearness, but their scale and offset vary from frame to frame. Two anchors in the
//! picture fix both: the subject, and the farthest surface.

use super::aside::Worker;
use super::feed::Feed;
use crate::depth::tap::nearest;
use crate::frame::{ColorImage, Mask};

/// Fraction of the sorted values that is ignored at each end.
const OUTLIERS: f32 = 0.03;
/// Uncertainty of the network's outlines, in its pixels: within it around a person, the background is unknown.
const MARGIN_PX: usize = 7;
/// Radius of the box filter that extends the surroundings behind a person, in pixels.
const SPREAD_PX: usize = 24;
/// Upper bound of the nearness behind a subject, so that it stays background.
const NEAREST_BEHIND: f32 = 0.9;

/// Relative depth from frame to frame.
pub struct Relief {
    /// The latest result.
    found: Found,
    /// `None` while the worker thread has it.
    finder: Option<Box<Finder>>,
    worker: Option<Worker<Box<Finder>>>,
}

/// The result for one picture.
#[derive(Default)]
struct Found {
    /// Columns and rows.
    size: (usize, usize),
    /// Relative inverse depth: 1 at the subject, 0 at the farthest surface.
    nearness: Vec<f32>,
    /// Relative inverse depth with the subject removed.
    behind: Vec<f32>,
}

/// Computes relative depth; moved to the worker thread and back.
struct Finder {
    feed: Feed,
    found: Found,
    outcome: Result<(), String>,
    /// The subject's mask in the current picture; empty without a subject.
    mask: Mask,
    /// Mask value of each pixel, at the network's resolution.
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
        Self { found: Found::default(), finder: Some(Box::new(finder)), worker: None }
    }

    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        self.found.size
    }

    /// Returns the relative inverse depth of the latest picture: 1 at the subject, 0 at the farthest surface.
    pub fn nearness(&self) -> &[f32] {
        &self.found.nearness
    }

    /// Returns the relative inverse depth with the subject removed, below 1.
    pub fn behind(&self) -> &[f32] {
        &self.found.behind
    }

    /// Computes the relative depth of a picture. The subject is in `mask`; without a mask, it is the nearest surface.
    ///
    /// # Errors
    /// See [`Feed::infer`].
    pub fn run(&mut self, color: &ColorImage, mask: Option<&Mask>) -> Result<(), String> {
        self.collect(true)?;
        let Some(mut finder) = self.finder.take() else { return Ok(()) };
        finder.set_picture(color, mask);
        finder.find();
        self.store(finder)
    }

    /// Computes it on the worker thread, once there is a first result: [`Self::collect`] collects it later. Does
    /// nothing while another picture is in progress.
    ///
    /// # Errors
    /// See [`Feed::infer`].
    pub fn run_async(&mut self, color: &ColorImage, mask: Option<&Mask>) -> Result<(), String> {
        if self.found.nearness.is_empty() {
            return self.run(color, mask);
        }
        self.collect(false)?;
        let Some(mut finder) = self.finder.take() else { return Ok(()) };
        finder.set_picture(color, mask);
        if self.worker.is_none() {
            self.worker = Worker::new("inference", |finder: &mut Box<Finder>| finder.find());
        }
        let given = match &self.worker {
            Some(worker) => worker.submit(finder),
            None => Err(finder),
        };
        given.or_else(|mut finder| {
            finder.find();
            self.store(finder)
        })
    }

    /// Collects the thread's result if it is done; waits for it if `wait`.
    ///
    /// # Errors
    /// See [`Feed::infer`].
    pub fn collect(&mut self, wait: bool) -> Result<(), String> {
        match self.worker.as_ref().filter(|_| self.finder.is_none()).map(|worker| worker.collect(wait)).transpose()? {
            Some(Some(finder)) => self.store(finder),
            _ => Ok(()),
        }
    }

    fn store(&mut self, mut finder: Box<Finder>) -> Result<(), String> {
        let outcome = std::mem::replace(&mut finder.outcome, Ok(()));
        if outcome.is_ok() {
            std::mem::swap(&mut self.found, &mut finder.found);
        }
        self.finder = Some(finder);
        outcome
    }
}

impl Finder {
    fn set_picture(&mut self, color: &ColorImage, mask: Option<&Mask>) {
        self.feed.set_picture(color);
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
        let alpha = |at: usize| if of_mask.0 == 0 { 0.0 } else { mask.alpha[nearest(at, answer.size, of_mask)] };
        subject.extend((0..pixels).map(alpha));
        self.measure();
        self.extrapolate_behind();
    }

    /// Maps the network's values linearly to nearness: the farthest surface (a low quantile outside of the person) to
    /// 0, the subject (the median of the person, else a high quantile) to 1.
    fn measure(&mut self) {
        let Self { found: Found { nearness, .. }, subject: alphas, sorted, .. } = self;
        let mut anchor = |quantile: f32, counts: &dyn Fn(usize) -> bool| {
            sorted.clear();
            sorted.extend(nearness.iter().enumerate().filter(|(at, _)| counts(*at)).map(|(_, &value)| value));
            let at = (quantile * sorted.len().saturating_sub(1) as f32) as usize;
            (!sorted.is_empty()).then(|| *sorted.select_nth_unstable_by(at, f32::total_cmp).1)
        };
        let person = |at: usize| alphas[at] > 0.9;
        let farthest = anchor(OUTLIERS, &|at| !person(at)).or_else(|| anchor(OUTLIERS, &|_| true));
        let subject = anchor(0.5, &person).or_else(|| anchor(1.0 - OUTLIERS, &|_| true));
        let (Some(farthest), Some(subject)) = (farthest, subject) else { return };
        let scale = 1.0 / (subject - farthest).max(1e-6);
        nearness.iter_mut().for_each(|value| *value = (*value - farthest) * scale);
    }

    /// Extrapolates the surroundings behind the subject by normalised convolution.
    fn extrapolate_behind(&mut self) {
        let Self { found: Found { size, nearness, behind }, subject, known, spread, line, .. } = self;
        let size = *size;
        behind.clone_from(nearness);
        if subject.iter().all(|&alpha| alpha < 0.5) {
            return;
        }
        known.clear();
        known.extend(subject.iter().map(|&alpha| f32::from(u8::from(alpha < 0.5))));
        // Near an outline, the values mix both surfaces.
        erode(known, line, size);
        for (value, known) in behind.iter_mut().zip(&*known) {
            *value *= known;
        }
        let total = |plane: &[f32]| plane.iter().sum::<f32>();
        let elsewhere = total(behind) / total(known).max(1.0);
        spread.clone_from(known);
        for plane in [&mut *behind, &mut *spread] {
            // Two box filters: smooth, and as wide as a person.
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

/// Calls `change` with every row of a plane, then with every column.
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

/// Sets to 0 everything within [`MARGIN_PX`] of a 0.
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

/// Applies a box filter of radius [`SPREAD_PX`], rows then columns.
fn mean(plane: &mut [f32], line: &mut Vec<f32>, size: (usize, usize)) {
    by_lines(plane, line, size, |line, set| {
        let (mut sum, radius) = (0.0f64, SPREAD_PX.min(line.len() - 1));
        line[..radius].iter().for_each(|&value| sum += f64::from(value));
        for at in 0..line.len() {
            sum += line.get(at + radius).map_or(0.0, |&value| f64::from(value));
            set(at, (sum / (2 * radius + 1) as f64) as f32);
            sum -= at.checked_sub(radius).map_or(0.0, |left| f64::from(line[left]));
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
