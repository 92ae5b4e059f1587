//! The effort of depth and how many frames share a map, as planned by the blur stage.

use std::sync::atomic::{AtomicU64, Ordering};

use super::held::HeldMap;
use crate::budget::Plan;
use crate::frame::{ColorImage, DepthMap};
use crate::optics::CocField;

/// The plan, shared by the blur stage (writer) and the depth stage (reader).
pub(super) struct Order(AtomicU64);

impl Order {
    pub(super) fn new(plan: Plan) -> Self {
        Self(AtomicU64::new(Self::bits(plan)))
    }

    /// Publishes the plan for the next frames.
    pub(super) fn set(&self, plan: Plan) {
        self.0.store(Self::bits(plan), Ordering::Relaxed);
    }

    fn bits(Plan { frames, effort, .. }: Plan) -> u64 {
        (frames as u64) << 32 | effort as u64
    }

    /// Returns how many frames share a map, and the effort.
    fn get(&self) -> (usize, usize) {
        let bits = self.0.load(Ordering::Relaxed);
        ((bits >> 32) as usize, bits as u32 as usize)
    }
}

/// Decides which frames reuse the depth of an earlier one.
pub(super) struct Rate<'a> {
    order: &'a Order,
    /// Frames since depth was made, that one included.
    age: usize,
    /// The CoC of the last depth, while later frames may reuse both.
    last: Option<CocField>,
    /// The depth that belongs to `last`.
    held: HeldMap,
}

impl<'a> Rate<'a> {
    pub(super) fn new(order: &'a Order) -> Self {
        Self { order, age: 0, last: None, held: HeldMap::new() }
    }

    /// Returns the effort for the next depth.
    pub(super) fn effort(&self) -> usize {
        self.order.get().1
    }

    /// Counts a frame; returns the CoC of the last depth if the frame reuses both, `None` if it needs its own.
    pub(super) fn next_held(&mut self) -> Option<CocField> {
        if self.age >= self.order.get().0 {
            self.last = None;
        }
        self.age += 1;
        self.last
    }

    /// Drops the held depth: the next frame gets its own.
    pub(super) fn forget(&mut self) {
        self.last = None;
    }

    /// Writes the held depth, warped to the picture, into `map`.
    pub(super) fn warp_held(&mut self, map: &mut DepthMap, color: &ColorImage) {
        self.held.warp_to(map, color);
    }

    /// Keeps newly computed depth of a picture if later frames may reuse it.
    pub(super) fn keep(&mut self, (map, field): (&DepthMap, CocField), color: &ColorImage) {
        self.age = 1;
        // The first one in any case, so that memory is allocated now and not during a later frame.
        if self.order.get().0 > 1 || self.held.is_empty() {
            self.held.keep(map, color, &field);
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
        let order = Order::new(plan(1));
        let mut rate = Rate::new(&order);
        let map = DepthMap { metres: vec![1.0; 4], ..DepthMap::new(2, 2) };
        let mut play = |frames: usize, forget: bool| -> Vec<bool> {
            order.set(plan(frames));
            assert_eq!(rate.effort(), 1);
            if forget {
                rate.forget();
            }
            let mut frame = |_| {
                let held = rate.next_held().is_some();
                if !held {
                    rate.keep((&map, CocField::Uniform { radius_px: 1.0 }), &ColorImage::new(2, 2));
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
