//! Checks the remembered background against what is seen beside outlines.
//!
//! An object may be put behind a subject, or change there, so that only a part of it is visible, beside the subject's
//! outline. If it differs from the remembered background, the background next to it is doubtful and is forgotten:
//! behind the subject, and behind the object too, or else the old background would appear where the object continues
//! behind the subject.

use super::cells::CELL;
use super::{Background, MIN_ROUNDS};
use crate::depth::reduced::block_px;
use crate::frame::{ColorImage, DepthMap};

/// Sampling step of the search for outlines, in pixels.
const STEP: usize = 2;
/// Distance from a sampled pixel at which the surface beyond an outline is read, and the further distance over which it
/// has to continue, in pixels: closer by, camera and depth map mix both surfaces.
const BESIDE_PX: usize = 7;
const GOES_ON_PX: usize = 3;
/// Minimum step at an outline, in units of the step between surfaces: heads are round.
const MIN_STEP: f32 = 2.0;

/// Evidence about the background, from beside the outlines in a cell.
#[derive(Clone, Copy, Debug, Default)]
pub struct Witness {
    /// Numbers of places that contradict the background next to them, and that agree with it.
    against: u16,
    agreeing: u16,
    /// Smallest and largest inverse depth of the contradicted background, in 1/m.
    least: f32,
    most: f32,
}

impl Witness {
    fn contradict(&mut self, (least, most): (f32, f32)) {
        let is_first = self.against == 0;
        self.least = if is_first { least } else { self.least.min(least) };
        self.most = if is_first { most } else { self.most.max(most) };
        self.against = self.against.saturating_add(1);
    }

    /// Whether the evidence contradicts a background at this inverse depth.
    fn is_against(&self, inverse: f32) -> bool {
        self.against > self.agreeing && (self.least..=self.most).contains(&inverse)
    }
}

impl Background {
    /// Forgets the background next to outlines beside which something else is seen.
    pub(super) fn check_outlines(&mut self, map: &DepthMap, color: &ColorImage, other: f32) {
        let (width, height) = self.size;
        let (across, down) = (width.div_ceil(CELL), height.div_ceil(CELL));
        let mut witnesses = std::mem::take(&mut self.witnesses);
        witnesses.clear();
        witnesses.resize(across * down, Witness::default());
        let seen = Comparison { memory: self, metres: &map.metres, other, block_px: block_px(color.width) };
        for y in (0..height).step_by(STEP) {
            for x in (0..width).step_by(STEP) {
                seen.collect_evidence((x, y), &mut witnesses[y / CELL * across + x / CELL]);
            }
        }
        let mut forgets = false;
        for (at, witness) in witnesses.iter().enumerate().filter(|(_, witness)| witness.against > witness.agreeing) {
            // The neighbouring cells, too: as far as blur reveals.
            let around = |at: usize, most: usize| at.saturating_sub(1) * CELL..((at + 2) * CELL).min(most);
            for y in around(at / across, height) {
                for at in around(at % across, width).map(|x| y * width + x) {
                    let is_hidden = DepthMap::inverse_of(map.metres[at]) - self.inverse[at] > other;
                    if is_hidden && self.rounds[at] > 0 && witness.is_against(self.inverse[at]) {
                        self.rounds[at] = 0;
                        forgets = true;
                    }
                }
            }
        }
        self.witnesses = witnesses;
        if forgets {
            self.assign_revision();
        }
    }

    /// Forgets visible surfaces whose colour has changed, away from hair and outlines.
    pub(super) fn forget_changed(&mut self, map: &DepthMap, color: &ColorImage, other: f32) {
        let ((width, height), block_px) = (self.size, block_px(color.width));
        let across = width.div_ceil(block_px);
        let mut forgets = false;
        for block in 0..self.unlike.len() {
            if !self.unlike[block] {
                continue;
            }
            let (x, y) = (block % across * block_px, block / across * block_px);
            let (right, below) = ((x + CELL).min(width - 1), (y + CELL).min(height - 1));
            let around = [(x, y), (x.saturating_sub(CELL), y), (right, y), (x, y.saturating_sub(CELL)), (x, below)];
            // Hair and outlines are where a neighbour hides the background.
            let is_open = |(x, y): (usize, usize)| {
                let at = y * width + x;
                DepthMap::inverse_of(map.metres[at]) - self.inverse[at] <= other
            };
            if around.into_iter().all(is_open) {
                (self.has[block], forgets) = (false, true);
                for y in y..(y + block_px).min(height) {
                    self.rounds[y * width + x..y * width + (x + block_px).min(width)].fill(0);
                }
            }
        }
        if forgets {
            self.assign_revision();
        }
    }
}

/// The current depth map, and the background to check.
struct Comparison<'a> {
    memory: &'a Background,
    metres: &'a [f32],
    other: f32,
    block_px: usize,
}

impl Comparison<'_> {
    /// Reads the surface beyond an outline on each side of a pixel in front, and adds the evidence to `witness`.
    fn collect_evidence(&self, (x, y): (usize, usize), witness: &mut Witness) {
        let (width, height) = self.memory.size;
        let (at, other) = (y * width + x, self.other);
        let own = self.near(at);
        for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
            let beside = |by_px: usize| {
                let [x, y] = [(x, dx), (y, dy)].map(|(place, step)| place.wrapping_add_signed(step * by_px as isize));
                (x < width && y < height).then_some((x, y))
            };
            let Some((first, second)) = beside(BESIDE_PX).zip(beside(BESIDE_PX + GOES_ON_PX)) else { continue };
            let [near, further] = [first, second].map(|(x, y)| self.near(y * width + x));
            if own - near <= MIN_STEP * other || (near - further).abs() > other {
                continue;
            }
            let known = |at: usize| (self.memory.rounds[at] >= MIN_ROUNDS).then(|| self.memory.inverse[at]);
            let is_there = |inverse: f32| (near - inverse).abs() <= other;
            match () {
                () if known(at).is_some_and(is_there) && self.looks_otherwise(second) => {
                    witness.contradict((near - other, near + other));
                }
                () if known(at).is_some_and(is_there) => witness.agreeing = witness.agreeing.saturating_add(1),
                // The surface is new: it hides a background that was seen.
                () if known(first.1 * width + first.0).is_some_and(|inverse| near - inverse > other) => {
                    witness.contradict((0.0, near - other));
                }
                () => {}
            }
        }
    }

    fn near(&self, at: usize) -> f32 {
        DepthMap::inverse_of(self.metres[at])
    }

    fn looks_otherwise(&self, (x, y): (usize, usize)) -> bool {
        let across = self.memory.size.0.div_ceil(self.block_px);
        self.memory.unlike.get(y / self.block_px * across + x / self.block_px).is_some_and(|&unlike| unlike)
    }
}
