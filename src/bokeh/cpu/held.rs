//! What the CPU executor keeps from frame to frame ([`Settings::reuse`](crate::bokeh::Settings::reuse)): the last
//! result, and where it may be shown again. The bins' buffers keep their content where nothing changes.

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use super::encode::CHUNK;
use super::pixels::{Pixels, Radii};
use super::survey::SurveyRow;
use super::tiles::{TILE_H, TILE_W};
use super::unpack::InputFrame;
use super::{CpuBokeh, ThreadScratch};
use crate::bokeh::ladder::Compositing;
use crate::bokeh::plan::Plan;
use crate::bokeh::reuse::{ChangeDetector, Units};
use crate::compute::thread_pool::DisjointParts;
use crate::frame::change::TILE;
use crate::optics::CocField;

/// Minimum width and height, in pixels, of pictures whose results are kept.
const MIN_SIDE: usize = 64;

/// The last result, and what changed since.
pub struct Held {
    pub detector: ChangeDetector,
    /// The last result, 8-bit RGB.
    pub picture: Vec<u8>,
    /// Per row of tiles and chunk, whether `picture` shows kept bins alone there.
    pub is_complete: Vec<bool>,
    /// CoC rule of the last frame.
    field: Option<CocField>,
    /// Whether anything was in front of the focal plane in the last frame.
    had_near: bool,
    size: (usize, usize),
    taken: [Vec<AtomicBool>; 4],
}

/// The parts of [`Held`] that a frame's composite reads and writes, in rows of tiles.
pub struct HeldRows<'a> {
    units: Option<&'a Units>,
    picture: DisjointParts<'a, u8>,
    is_complete: DisjointParts<'a, bool>,
}

impl HeldRows<'_> {
    /// Returns a row of tiles.
    pub fn part(&self, row: usize) -> HeldRow<'_> {
        HeldRow { units: self.units, picture: self.picture.part(row), is_complete: self.is_complete.part(row) }
    }
}

/// A row of tiles of [`Held`].
pub struct HeldRow<'a> {
    /// What must be recomputed; `None` is everything.
    pub units: Option<&'a Units>,
    pub picture: &'a mut [u8],
    pub is_complete: &'a mut [bool],
}

impl Held {
    /// Allocates for frames of a plan; `None` if it keeps nothing.
    pub fn new(plan: &Plan) -> Option<Self> {
        // Recovered highlights outshine the means of tiles, and gathering has no bins to keep.
        if !plan.reuse || plan.expansion.is_finite() || plan.compositing == Compositing::Gather {
            return None;
        }
        let (width, height) = (plan.width, plan.height);
        // In small pictures border effects dominate: a few pixels stand for everything beyond them.
        if width.min(height) < MIN_SIDE {
            return None;
        }
        let flags = || std::iter::repeat_with(|| AtomicBool::new(false)).take(height.div_ceil(TILE)).collect();
        Some(Self {
            detector: ChangeDetector::new(width, height),
            picture: vec![0; width * height * 3],
            is_complete: vec![false; width.div_ceil(CHUNK) * height.div_ceil(TILE_H)],
            field: None,
            had_near: false,
            size: (width, height),
            taken: std::array::from_fn(|_| flags()),
        })
    }

    /// Returns the parts for a frame of which some units are kept, or none; `None` if the result is not held.
    pub fn rows(&mut self, some_kept: bool) -> Option<HeldRows<'_>> {
        if !self.detector.has_reference() {
            return None;
        }
        let Self { detector, picture, is_complete, taken: [first, second, ..], size, .. } = self;
        Some(HeldRows {
            units: some_kept.then_some(detector.results()),
            picture: DisjointParts::new(picture, size.0 * TILE_H * 3, first),
            is_complete: DisjointParts::new(is_complete, size.0.div_ceil(CHUNK), second),
        })
    }

    /// Forgets everything.
    fn clear(&mut self) {
        self.detector.clear();
        self.is_complete.fill(false);
    }
}

impl CpuBokeh {
    /// Pass `survey`: finds what may be kept from the last frame, after the bins are known. Returns false if nothing
    /// may.
    pub(super) fn find_kept(&mut self, frame: &InputFrame<'_>, held: &mut Held) -> bool {
        let Radii::Field(field, _) = frame.coc else {
            held.clear();
            return false;
        };
        let follows_depth = matches!(field, CocField::Depth(_));
        let is_other_rule = !follows_depth && held.field != Some(*field);
        held.field = Some(*field);
        // What is inpainted behind near objects is kept as well, while there are any.
        let has_near = self.plan.bins.iter().any(|bin| bin.near);
        let is_first_near = !std::mem::replace(&mut held.had_near, has_near) && has_near;
        if is_other_rule || is_first_near || !matches!(frame.pixels, Pixels::Srgb(_)) {
            held.clear();
        }
        if !held.detector.needs_survey() {
            held.detector.skip();
            return false;
        }
        self.survey(frame, held, follows_depth);
        let has_hidden = self.plan.layers().nth(1).is_some();
        let is_beside_fresh = |columns: Range<usize>, rows: Range<usize>| {
            // The background that is inpainted past a silhouette moves with it.
            let is_inpainted = || has_hidden && self.silhouettes.may_be_near(columns.clone(), rows.clone());
            [false, true].iter().all(|kept| self.has_content(*kept, &columns, &rows)) || is_inpainted()
        };
        self.arch.dispatch(|| held.detector.detect(&self.plan, is_beside_fresh))
    }

    /// Whether any bin that may be kept, or that may not, has content in some columns and rows.
    fn has_content(&self, kept: bool, columns: &Range<usize>, rows: &Range<usize>) -> bool {
        let columns = columns.start / TILE_W..columns.end.div_ceil(TILE_W);
        let rows = rows.start / TILE_H..rows.end.div_ceil(TILE_H);
        let mut bins = self.plan.bins.iter().enumerate().filter(|(_, bin)| bin.is_kept() == kept);
        bins.any(|(k, _)| self.tiles.any_overlapping(&self.plan.bin_weight(k), columns.clone(), rows.clone()))
    }

    fn survey(&mut self, frame: &InputFrame<'_>, held: &mut Held, follows_depth: bool) {
        let means = &mut held.detector.prediction.means;
        let (across, down) = (means.across, means.down);
        let mut planes = means.planes.iter_mut().zip(&mut held.taken);
        let planes: [_; 4] = std::array::from_fn(|_| {
            let (plane, taken) = planes.next().expect("four of each");
            DisjointParts::new(plane, across, taken)
        });
        let arch = self.arch;
        self.workers.run_with(&mut self.thread_scratch, down, &|thread: &mut ThreadScratch, row| {
            let means = std::array::from_fn(|p| planes[p].part(row));
            let ThreadScratch { survey, coc, .. } = thread;
            arch.dispatch(SurveyRow { source: frame, row, means, sums: survey, coc, follows_depth });
        });
    }
}
