//! With how much effort depth is made, and how many frames share a map, as the blur stage has planned.

use std::sync::atomic::{AtomicU64, Ordering};

use super::held::HeldMap;
use crate::budget::Plan;
use crate::frame::{ColorImage, DepthMap};
use crate::optics::CocField;

/// What the blur stage tells the depth stage.
pub(super) struct Order(AtomicU64);

impl Order {
    pub(super) fn new(plan: Plan) -> Self {
        Self(AtomicU64::new(Self::bits(plan)))
    }

    /// Tells the plan for the next frames.
    pub(super) fn set(&self, plan: Plan) {
        self.0.store(Self::bits(plan), Ordering::Relaxed);
    }

    fn bits(Plan { frames, effort, .. }: Plan) -> u64 {
        (frames as u64) << 32 | effort as u64
    }

    /// Frames that share a map, and the effort.
    fn get(&self) -> (usize, usize) {
        let bits = self.0.load(Ordering::Relaxed);
        ((bits >> 32) as usize, bits as u32 as usize)
    }
}

/// Counts which frames are given the depth of an earlier one.
pub(super) struct Rate<'a> {
    order: &'a Order,
    /// Frames since depth was made, that one included.
    age: usize,
    /// The CoC of the last depth, while later frames may share both.
    last: Option<CocField>,
    /// The depth that goes with it.
    held: HeldMap,
}

impl<'a> Rate<'a> {
    pub(super) fn new(order: &'a Order) -> Self {
        Self { order, age: 0, last: None, held: HeldMap::new() }
    }

    /// The effort for the next depth.
    pub(super) fn effort(&self) -> usize {
        self.order.get().1
    }

    /// Counts a frame; returns the CoC of the last depth if the frame is given both, `None` if it needs its own.
    pub(super) fn holds(&mut self) -> Option<CocField> {
        if self.age >= self.order.get().0 {
            self.last = None;
        }
        self.age += 1;
        self.last
    }

    /// Nothing is held any more: the next frame's depth is made anew.
    pub(super) fn forget(&mut self) {
        self.last = None;
    }

    /// Gives a picture the depth that is held.
    pub(super) fn give_held(&mut self, map: &mut DepthMap, color: &ColorImage) {
        self.held.give(map, color);
    }

    /// Depth of a picture was made: keeps it if later frames may share it.
    pub(super) fn made(&mut self, (map, field): (&DepthMap, CocField), color: &ColorImage) {
        self.age = 1;
        // The first one in any case: then the memory is allocated, and not during a later frame.
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
        let plan = |frames| Plan { frames, effort: 1, rung: 0 };
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
                let held = rate.holds().is_some();
                if !held {
                    rate.made((&map, CocField::Uniform { radius_px: 1.0 }), &ColorImage::new(2, 2));
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
