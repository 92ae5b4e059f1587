//! Skips a network while its input hardly changes: its output would hardly change either.

use bokehcam::frame::change::{Prediction, TILE, add_squares, average_squares};

/// Maximum number of pictures in turn without a run, so that a change too slight to be detected is followed, too.
const MAX_SKIPPED: u32 = 15;

/// Compares the inputs of a network.
pub struct StillnessDetector {
    prediction: Prediction,
    sums: Vec<u32>,
    height: usize,
    /// Pictures since the last run; `None` before the first.
    skipped: Option<u32>,
}

impl StillnessDetector {
    /// Creates the detector for inputs of `width` x `height` pixels.
    pub fn new((width, height): (usize, usize)) -> Self {
        let mut prediction = Prediction::new(width, height);
        prediction.means.ignore_coc();
        Self { prediction, sums: vec![0; width * 3], height, skipped: None }
    }

    /// Forgets the last run, for a new scene.
    pub fn reset(&mut self) {
        self.skipped = None;
    }

    /// Adds row `y` of an input, 8-bit RGB; rows come in order.
    pub fn add_row(&mut self, y: usize, row: &[u8]) {
        add_squares(&mut self.sums, row);
        if (y + 1).is_multiple_of(TILE) || y + 1 == self.height {
            let means = &mut self.prediction.means;
            let tiles = y / TILE * means.across..(y / TILE + 1) * means.across;
            let [red, green, blue, _] = &mut means.planes;
            let planes = [red, green, blue].map(|plane| &mut plane[tiles.clone()]);
            average_squares(&self.sums, y % TILE + 1, planes);
            self.sums.fill(0);
        }
    }

    /// Whether the input hardly differs from that of the last run; if not, a run follows.
    pub fn is_still(&mut self) -> bool {
        self.prediction.predict(0.0);
        let mut changed = [self.skipped.is_none_or(|skipped| skipped >= MAX_SKIPPED)];
        let (across, down) = (self.prediction.means.across, self.prediction.means.down);
        self.prediction.find_changed(0..down, across, &mut changed);
        if changed[0] {
            self.prediction.make_all();
        }
        self.skipped = Some(if changed[0] { 0 } else { self.skipped.unwrap_or(0) + 1 });
        !changed[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (64, 36);

    fn is_still(detector: &mut StillnessDetector, code: impl Fn(usize, usize) -> u8) -> bool {
        for y in 0..SIZE.1 {
            let row: Vec<u8> = (0..SIZE.0 * 3).map(|at| code(at / 3, y)).collect();
            detector.add_row(y, &row);
        }
        detector.is_still()
    }

    #[test]
    fn still_inputs_are_skipped_for_a_while_and_changed_ones_not() {
        let mut detector = StillnessDetector::new(SIZE);
        let room = |x: usize, y: usize| (40 + 2 * x + y) as u8;
        let run: Vec<bool> = (0..40).map(|_| !is_still(&mut detector, room)).collect();
        let runs: Vec<usize> = (0..run.len()).filter(|&k| run[k]).collect();
        assert_eq!(runs, [0, 16, 32], "{run:?}");
        assert!(!is_still(&mut detector, |x, y| if x > 50 && y > 30 { 90 } else { room(x, y) }), "a corner changed");
        // A drift too slow to be seen from picture to picture adds up.
        let mut still = 0;
        for step in 0..30 {
            still += u32::from(is_still(&mut detector, |x, y| room(x, y).saturating_add(step / 3)));
        }
        assert!(still < 25, "{still}");
        detector.reset();
        assert!(!is_still(&mut detector, room));
    }
}
