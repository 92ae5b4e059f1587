//! Checks the remembered background against the surfaces seen beside outlines.
//!
//! An object may be put behind a subject, or change there, so that only a part of it is visible, beside the subject's
//! outline. If it differs from the remembered background, the background next to it is doubtful and is forgotten:
//! behind the subject, and behind the object too, or else the old background would appear where the object continues
//! behind the subject.

use std::iter::StepBy;
use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::cells::CELL;
use super::{BackgroundMemory, MIN_ROUNDS, TURNS};
use crate::depth::reduced::block_px;
use crate::frame::{ColorImage, DepthMap};

/// Sampling step at outlines, in pixels.
const STEP: usize = 2;
/// Distance from a sampled pixel at which the surface beyond an outline is read, and the further distance over which it
/// has to continue, in pixels: closer by, camera and depth map mix both surfaces.
const BESIDE_PX: usize = 7;
const GOES_ON_PX: usize = 3;
/// Minimum step at an outline, in units of the step between surfaces: heads are round.
const MIN_STEP: f32 = 2.0;

/// Evidence about the background, from beside the outlines in a cell.
#[derive(Clone, Copy, Debug, Default)]
pub struct OutlineEvidence {
    /// Numbers of places that contradict the background next to them, and that agree with it.
    contradicting: u16,
    agreeing: u16,
    /// Smallest and largest inverse depth of the contradicted background, in 1/m.
    least: f32,
    most: f32,
}

impl OutlineEvidence {
    fn add_contradiction(&mut self, least: f32, most: f32) {
        let is_first = self.contradicting == 0;
        self.least = if is_first { least } else { self.least.min(least) };
        self.most = if is_first { most } else { self.most.max(most) };
        self.contradicting = self.contradicting.saturating_add(1);
    }

    /// Whether the evidence contradicts a background at this inverse depth.
    fn contradicts(&self, inverse: f32) -> bool {
        self.contradicting > self.agreeing && (self.least..=self.most).contains(&inverse)
    }
}

impl BackgroundMemory {
    /// Forgets the background next to outlines beside which something else is seen, in every `interval`-th row of cells from
    /// `first` on.
    pub(super) fn check_outlines(
        &mut self,
        map: &DepthMap,
        color: &ColorImage,
        surface_step: f32,
        first: usize,
        interval: usize,
    ) {
        let (width, height) = self.size;
        let (across, down) = (width.div_ceil(CELL), height.div_ceil(CELL));
        let mut cell_evidence = std::mem::take(&mut self.cell_evidence);
        cell_evidence.clear();
        cell_evidence.resize(across * down, OutlineEvidence::default());
        let seen = Comparison { memory: self, metres: &map.metres, surface_step, block_px: block_px(color.width) };
        Arch::new().dispatch(CompareOutlines {
            seen,
            rows: (first..down).step_by(interval),
            cell_evidence: &mut cell_evidence,
        });
        let mut forgets = false;
        for (at, evidence) in
            cell_evidence.iter().enumerate().filter(|(_, evidence)| evidence.contradicting > evidence.agreeing)
        {
            // The neighbouring cells, too: as far as blur reveals.
            let around = |at: usize, most: usize| at.saturating_sub(1) * CELL..((at + 2) * CELL).min(most);
            for y in around(at / across, height) {
                for at in around(at % across, width).map(|x| y * width + x) {
                    let is_hidden = DepthMap::inverse_depth(map.metres[at]) - self.inverse[at] > surface_step;
                    if is_hidden && self.rounds[at] > 0 && evidence.contradicts(self.inverse[at]) {
                        self.rounds[at] = 0;
                        forgets = true;
                    }
                }
            }
        }
        self.cell_evidence = cell_evidence;
        if forgets {
            self.assign_rounds_revision();
        }
    }

    /// Forgets visible surfaces whose colour has changed, away from hair and outlines, in the rows that were compared last.
    pub(super) fn forget_changed(&mut self, map: &DepthMap, color: &ColorImage, surface_step: f32) {
        let ((width, height), block_px) = (self.size, block_px(color.width));
        let across = width.div_ceil(block_px);
        let mut forgets = false;
        for group in 0..self.changed.len() {
            if !self.changed[group] {
                continue;
            }
            let block = (group / across * TURNS + self.turn()) * across + group % across;
            let (x, y) = (block % across * block_px, block / across * block_px);
            let (right, below) = ((x + CELL).min(width - 1), (y + CELL).min(height - 1));
            let around = [(x, y), (x.saturating_sub(CELL), y), (right, y), (x, y.saturating_sub(CELL)), (x, below)];
            // Hair and outlines are where a neighbour hides the background.
            let is_open = |(x, y): (usize, usize)| {
                let at = y * width + x;
                DepthMap::inverse_depth(map.metres[at]) - self.inverse[at] <= surface_step
            };
            if around.into_iter().all(is_open) {
                (self.has_value[block], forgets) = (false, true);
                for y in y..(y + block_px).min(height) {
                    self.rounds[y * width + x..y * width + (x + block_px).min(width)].fill(0);
                }
            }
        }
        if forgets {
            self.assign_rounds_revision();
        }
    }
}

/// Compares the background with what is beside the outlines of all cells.
struct CompareOutlines<'a> {
    seen: Comparison<'a>,
    rows: StepBy<Range<usize>>,
    cell_evidence: &'a mut [OutlineEvidence],
}

impl WithSimd for CompareOutlines<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { seen, rows, cell_evidence } = self;
        let ((width, height), min_step) = (seen.memory.size, MIN_STEP * seen.surface_step);
        let across = width.div_ceil(CELL);
        for row in rows {
            for columns in seen.memory.cells.outline_columns(row, min_step) {
                let evidence = &mut cell_evidence[row * across + columns.start / CELL];
                for y in (row * CELL..((row + 1) * CELL).min(height)).step_by(STEP) {
                    let steps = seen.find_steps(columns.clone(), y);
                    for x in columns.clone().step_by(STEP).filter(|x| steps[x - columns.start] > min_step) {
                        seen.collect_evidence((x, y), evidence);
                    }
                }
            }
        }
    }
}

/// The current depth map, and the background to check.
struct Comparison<'a> {
    memory: &'a BackgroundMemory,
    metres: &'a [f32],
    surface_step: f32,
    block_px: usize,
}

impl Comparison<'_> {
    /// Computes the largest step of inverse depth from each pixel of a cell's row down to the surfaces on its four sides, in
    /// 1/m: few pixels are at outlines.
    #[inline(always)]
    fn find_steps(&self, columns: Range<usize>, y: usize) -> [f32; CELL] {
        let ((width, height), first, inverse) = (self.memory.size, columns.start, DepthMap::inverse_depth);
        // Beyond the picture, the row itself stands in: it has no step to itself.
        let above = y.checked_sub(BESIDE_PX).unwrap_or(y);
        let below = Some(y + BESIDE_PX).filter(|&below| below < height).unwrap_or(y);
        let [above, own, below] = [above, y, below].map(|y| &self.metres[y * width..][..width]);
        let mut steps = [0.0; CELL];
        let farthest = &mut steps[..columns.len()];
        for ((farthest, &above), &below) in
            farthest.iter_mut().zip(&above[columns.clone()]).zip(&below[columns.clone()])
        {
            *farthest = inverse(above).min(inverse(below));
        }
        let hidden = BESIDE_PX.saturating_sub(first).min(farthest.len());
        for (farthest, &left) in farthest[hidden..].iter_mut().zip(&own[(first + hidden).saturating_sub(BESIDE_PX)..]) {
            *farthest = farthest.min(inverse(left));
        }
        for (farthest, &right) in farthest.iter_mut().zip(&own[(first + BESIDE_PX).min(width)..]) {
            *farthest = farthest.min(inverse(right));
        }
        for (step, &own) in farthest.iter_mut().zip(&own[columns]) {
            *step = inverse(own) - *step;
        }
        steps
    }

    /// Reads the surface beyond an outline on each side of a pixel in front, and adds the evidence to `evidence`.
    fn collect_evidence(&self, (x, y): (usize, usize), evidence: &mut OutlineEvidence) {
        let (width, height) = self.memory.size;
        let (at, surface_step) = (y * width + x, self.surface_step);
        let own = self.inverse_depth_at(at);
        for (dx, dy) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
            let beside = |by_px: usize| {
                let [x, y] = [(x, dx), (y, dy)].map(|(place, step)| place.wrapping_add_signed(step * by_px as isize));
                (x < width && y < height).then_some((x, y))
            };
            let Some((first, second)) = beside(BESIDE_PX).zip(beside(BESIDE_PX + GOES_ON_PX)) else { continue };
            let [near, further] = [first, second].map(|(x, y)| self.inverse_depth_at(y * width + x));
            if own - near <= MIN_STEP * surface_step || (near - further).abs() > surface_step {
                continue;
            }
            let known = |at: usize| (self.memory.rounds[at] >= MIN_ROUNDS).then(|| self.memory.inverse[at]);
            let is_there = |inverse: f32| (near - inverse).abs() <= surface_step;
            if known(at).is_some_and(is_there) {
                if self.has_changed(second) {
                    evidence.add_contradiction(near - surface_step, near + surface_step);
                } else {
                    evidence.agreeing = evidence.agreeing.saturating_add(1);
                }
            } else if known(first.1 * width + first.0).is_some_and(|inverse| near - inverse > surface_step) {
                // The surface is new: it hides a background that was seen.
                evidence.add_contradiction(0.0, near - surface_step);
            }
        }
    }

    fn inverse_depth_at(&self, at: usize) -> f32 {
        DepthMap::inverse_depth(self.metres[at])
    }

    fn has_changed(&self, (x, y): (usize, usize)) -> bool {
        let across = self.memory.size.0.div_ceil(self.block_px);
        let group = y / self.block_px / TURNS * across + x / self.block_px;
        self.memory.changed.get(group).is_some_and(|&changed| changed)
    }
}
