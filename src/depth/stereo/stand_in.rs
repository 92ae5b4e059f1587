//! A plain matcher that stands in for the real one: sums of absolute differences over a window, and the best wins.

use super::{Effort, MatchError, Matcher, Settings};
use crate::frame::{DisparityMap, GrayImage};

/// A window reaches so far to each side.
const REACH_PX: usize = 3;

/// A matcher with these settings.
///
/// # Errors
/// None; the real one may have no GPU.
pub fn create(settings: &Settings) -> Result<Box<dyn Matcher>, MatchError> {
    Ok(Box::new(StandIn { settings: *settings, costs: Vec::new(), sums: Vec::new(), best: Vec::new() }))
}

struct StandIn {
    settings: Settings,
    costs: Vec<u32>,
    sums: Vec<u32>,
    best: Vec<u32>,
}

impl Matcher for StandIn {
    fn describe(&self) -> String {
        "cpu, stand-in".to_owned()
    }

    fn set_effort(&mut self, effort: Effort) {
        self.settings.effort = effort;
    }

    fn disparity(&mut self, left: &GrayImage, right: &GrayImage, into: &mut DisparityMap) -> Result<(), MatchError> {
        if left.size() != right.size() {
            return Err(MatchError::Sizes { left: left.size(), right: right.size() });
        }
        into.resize(left.width, left.height);
        into.px.fill(0.0);
        let (width, height) = (left.width as usize, left.height as usize);
        let Self { settings, costs, sums, best } = self;
        for values in [&mut *costs, &mut *sums, &mut *best] {
            values.resize(width * height, 0);
        }
        best.fill(u32::MAX);
        for disparity in 0..settings.disparities as usize {
            for y in 0..height {
                let (left, right) = (&left.luma[y * width..][..width], &right.luma[y * width..][..width]);
                for x in 0..width {
                    // What the right eye does not see costs nothing like a match.
                    costs[y * width + x] =
                        x.checked_sub(disparity).map_or(255, |at| left[x].abs_diff(right[at]).into());
                }
            }
            for y in 0..height {
                for x in 0..width {
                    let columns = x.saturating_sub(REACH_PX)..(x + REACH_PX + 1).min(width);
                    sums[y * width + x] = costs[y * width..][columns].iter().sum();
                }
            }
            for y in 0..height {
                let rows = y.saturating_sub(REACH_PX)..(y + REACH_PX + 1).min(height);
                for x in 0..width {
                    let cost = rows.clone().map(|row| sums[row * width + x]).sum();
                    if cost < best[y * width + x] {
                        best[y * width + x] = cost;
                        into.px[y * width + x] = disparity as f32;
                    }
                }
            }
        }
        Ok(())
    }
}
