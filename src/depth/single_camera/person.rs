//! Where a person is: a network's mask, steady where it is undecided.

use super::decision::Decision;
use super::feed::{Answer, Feed};
use crate::frame::{ColorImage, Mask};

/// How far an undecided pixel stays what it was in the frame before; less where frames in between are missing.
const STEADINESS: f32 = 0.8;
const FRAME_NS: f32 = 1e9 / 30.0;

/// Finds persons, from frame to frame.
pub struct Person {
    feed: Feed,
    /// What the network says, steady where it is undecided.
    steady: Mask,
    decision: Decision,
    mask: Mask,
    /// Whether the numbers are those before the last step of a network: they were seen beyond 0 to 1.
    is_raw: bool,
    /// When the picture before was taken.
    seen_ns: Option<u64>,
}

impl Person {
    pub fn new(feed: Feed) -> Self {
        Self {
            feed,
            steady: Mask::default(),
            decision: Decision::default(),
            mask: Mask::default(),
            is_raw: false,
            seen_ns: None,
        }
    }

    /// Forgets the frame before: the next one is another scene.
    pub fn forget(&mut self) {
        self.feed.forget();
        self.decision.forget();
        self.seen_ns = None;
    }

    /// The mask of the last picture.
    pub fn mask(&self) -> &Mask {
        &self.mask
    }

    /// Finds the mask of a picture, taken at this time; undecided pixels are averaged with those of the one before, and decided ones not, so
    /// that nothing lags (as MediaPipe has it).
    ///
    /// # Errors
    /// As for [`Feed::see`].
    pub fn look(&mut self, color: &ColorImage, time_ns: u64) -> Result<(), String> {
        let answer = self.feed.see(color)?;
        let pixels = answer.size.0 * answer.size.1;
        let beyond = |share: f32| !(-0.01..=1.01).contains(&share);
        self.is_raw |= (0..pixels).any(|pixel| beyond(answer.at(pixel, answer.channels - 1)));
        let size = (answer.size.0 as u32, answer.size.1 as u32);
        let before_ns = self.seen_ns.filter(|_| (self.steady.width, self.steady.height) == size);
        let steadiness = before_ns.map_or(0.0, |before_ns| steadiness(time_ns.abs_diff(before_ns)));
        self.steady.resize(size.0, size.1);
        for (pixel, share) in self.steady.share.iter_mut().enumerate() {
            let new = share_of(&answer, pixel, self.is_raw);
            let keeps = steadiness * uncertainty(new);
            *share = new + (*share - new) * keeps;
        }
        self.seen_ns = Some(time_ns);
        self.decision.decide(&self.steady, time_ns, &mut self.mask);
        Ok(())
    }
}

/// How far an undecided pixel stays what it was so long ago: who moves is elsewhere by then.
fn steadiness(gap_ns: u64) -> f32 {
    STEADINESS.powf((gap_ns as f32 / FRAME_NS).max(1.0))
}

/// The share of a person: of two channels, the second is theirs.
fn share_of(answer: &Answer, pixel: usize, is_raw: bool) -> f32 {
    let own = answer.at(pixel, answer.channels - 1);
    match (is_raw, answer.channels) {
        (false, _) => own.clamp(0.0, 1.0),
        (true, 1) => sigmoid(own),
        (true, _) => sigmoid(own - answer.at(pixel, 0)),
    }
}

fn sigmoid(value: f32) -> f32 {
    1.0 / (1.0 + (-value).exp())
}

/// How undecided a share is: 1 at one half, 0 at 0 and at 1. Binary entropy is close to this parabola's root.
fn uncertainty(share: f32) -> f32 {
    let off = 2.0 * share - 1.0;
    (1.0 - off * off).max(0.0).powf(0.75)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_seen_long_ago_says_little() {
        assert!((steadiness(33_333_333) - 0.8).abs() < 1e-4 && steadiness(0) == 0.8, "nothing lags at a camera's pace");
        assert!((steadiness(66_666_666) - 0.64).abs() < 1e-4, "as if the missing one had been seen");
        assert!(steadiness(400_000_000) < 0.07);
    }

    #[test]
    fn uncertainty_is_that_of_a_coin() {
        for step in 1..100 {
            let share = step as f32 / 100.0;
            let entropy = -share * share.log2() - (1.0 - share) * (1.0 - share).log2();
            assert!((uncertainty(share) - entropy).abs() < 0.03, "{share}: {} {entropy}", uncertainty(share));
        }
        assert_eq!((uncertainty(0.0), uncertainty(1.0), uncertainty(0.5)), (0.0, 0.0, 1.0));
    }
}
