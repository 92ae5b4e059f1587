//! A plain matcher, until there is the real one: the least sum of absolute differences in a window.

use bokehcam::depth::stereo::{Effort, MatchError, Matcher};
use bokehcam::frame::{DisparityMap, GrayImage};

const REACH: usize = 4;

pub struct StandIn {
    pub disparities: u32,
}

impl Matcher for StandIn {
    fn describe(&self) -> String {
        "stand-in".into()
    }

    fn set_effort(&mut self, _: Effort) {}

    fn disparity(&mut self, left: &GrayImage, right: &GrayImage, into: &mut DisparityMap) -> Result<(), MatchError> {
        let (width, height) = (left.width as usize, left.height as usize);
        into.resize(left.width, left.height);
        let mut best = vec![u32::MAX; width * height];
        for d in 0..self.disparities as usize {
            // Sums over all above and to the left.
            let mut sums = vec![0u32; (width + 1) * (height + 1)];
            for y in 0..height {
                let mut row = 0;
                for x in 0..width {
                    row += u32::from(left.luma[y * width + x].abs_diff(right.luma[y * width + x.saturating_sub(d)]));
                    sums[(y + 1) * (width + 1) + x + 1] = sums[y * (width + 1) + x + 1] + row;
                }
            }
            for y in 0..height {
                let (top, bottom) = (y.saturating_sub(REACH) * (width + 1), (y + REACH + 1).min(height) * (width + 1));
                for x in 0..width {
                    let (from, to) = (x.saturating_sub(REACH), (x + REACH + 1).min(width));
                    let sum = sums[bottom + to] + sums[top + from] - sums[bottom + from] - sums[top + to];
                    if sum < best[y * width + x] {
                        best[y * width + x] = sum;
                        into.px[y * width + x] = d.max(1) as f32;
                    }
                }
            }
        }
        Ok(())
    }
}
