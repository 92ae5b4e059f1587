//! The effort of depth and how many frames share a map, as planned by the blur stage.

use std::sync::atomic::{AtomicU64, Ordering};

use super::reused_depth::ReusedDepth;
use bokehcam::budget::Plan;
use bokehcam::frame::{ColorImage, DepthMap};
use bokehcam::optics::CocField;

/// The plan, shared by the blur stage (writer) and the depth stage (reader).
pub(super) struct SharedPlan(AtomicU64);

impl SharedPlan {
    pub(super) fn new(plan: Plan) -> Self {
        Self(AtomicU64::new(Self::pack(plan)))
    }

    /// Publishes the plan for the next frames.
    pub(super) fn set(&self, plan: Plan) {
        self.0.store(Self::pack(plan), Ordering::Relaxed);
    }

    fn pack(Plan { frames, effort, .. }: Plan) -> u64 {
        (frames as u64) << 32 | effort as u64
    }

    /// Returns how many frames share a map, and the effort.
    fn get(&self) -> (usize, usize) {
        let bits = self.0.load(Ordering::Relaxed);
        ((bits >> 32) as usize, bits as u32 as usize)
    }
}

/// Decides which frames reuse the depth of an earlier one.
pub(super) struct DepthScheduler<'a> {
    shared_plan: &'a SharedPlan,
    /// Frames since depth was made, that one included.
    age: usize,
    /// The CoC of the last depth, while later frames may reuse both.
    last: Option<CocField>,
    /// The depth that belongs to `last`.
    held: ReusedDepth,
}

impl<'a> DepthScheduler<'a> {
    pub(super) fn new(shared_plan: &'a SharedPlan) -> Self {
        Self { shared_plan, age: 0, last: None, held: ReusedDepth::new() }
    }

    /// Returns the effort for the next depth.
    pub(super) fn effort(&self) -> usize {
        self.shared_plan.get().1
    }

    /// Counts a frame with the picture `color`; returns the CoC of the last depth if the frame reuses both, `None` if it
    /// needs its own.
    pub(super) fn reuse_next(&mut self, color: &ColorImage) -> Option<CocField> {
        if self.age >= self.shared_plan.get().0 || self.last.is_some() && !self.held.fits(color) {
            self.last = None;
        }
        self.age += 1;
        self.last
    }

    /// Drops the held depth: the next frame gets its own.
    pub(super) fn discard_held_depth(&mut self) {
        self.last = None;
    }

    /// Writes the held depth, warped to the picture of the frame that reuses it, into `map`.
    pub(super) fn warp_reused(&mut self, map: &mut DepthMap, color: &ColorImage) {
        self.held.warp_to(map, color);
    }

    /// Keeps newly computed depth of a picture if later frames may reuse it.
    pub(super) fn store_depth(&mut self, map: &DepthMap, field: CocField, color: &ColorImage) {
        self.age = 1;
        // The first one in any case, so that memory is allocated now and not during a later frame.
        if self.shared_plan.get().0 > 1 || self.held.is_empty() {
            self.held.store(map, color, &field);
            self.last = Some(field);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn so_many_frames_share_a_map_until_that_is_forgotten() {
        let plan = |frames| Plan { frames, effort: 1, level: 0 };
        let shared_plan = SharedPlan::new(plan(1));
        let mut scheduler = DepthScheduler::new(&shared_plan);
        let map = DepthMap { metres: vec![1.0; 4], ..DepthMap::new(2, 2) };
        let mut play = |frames: usize, forget: bool| -> Vec<bool> {
            shared_plan.set(plan(frames));
            assert_eq!(scheduler.effort(), 1);
            if forget {
                scheduler.discard_held_depth();
            }
            let mut frame = |_| {
                let held = scheduler.reuse_next(&ColorImage::new(2, 2)).is_some();
                if !held {
                    scheduler.store_depth(&map, CocField::Uniform { radius_px: 1.0 }, &ColorImage::new(2, 2));
                }
                held
            };
            (0..4).map(&mut frame).collect()
        };
        assert_eq!(play(1, false), [false; 4], "the first frame has no other to take it from");
        assert_eq!(play(2, false), [false, true, false, true]);
        assert_eq!(play(3, false), [true, false, true, true]);
        assert_eq!(play(3, true), [false, true, true, false]);
    }
}
