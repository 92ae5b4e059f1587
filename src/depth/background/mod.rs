//! Background memory: colour and depth behind moving foreground, remembered from when they were visible.
//!
//! A person who moves in a room uncovers and covers parts of it: around the outline, where blur reveals the background,
//! it was mostly visible a moment ago. Per pixel, the farthest stable surface is kept, with colour and depth. It is
//! known once it was seen often enough; its counter fades while it is hidden. A pixel is forgotten at once if something
//! else was put between, and all are if the camera moves.

mod cells;
mod covering;
mod learning;
mod reveal;
mod verification;

use std::sync::atomic::{AtomicU64, Ordering};

use crate::color::srgb_to_linear_table;
use crate::compute::thread_pool::ThreadPool;
use crate::frame::{ColorImage, DepthMap, MixedPixel, reset_buffer, resize_buffer};
use crate::optics::DepthCoc;

use super::alignment::{Aligner, Alignment};
use super::bitmap::Bitmap;
use super::matting::{KnownBackground, MIN_STEP_PX, Matting, Revision};
use super::reduced::{MAX_VALUE, Reducer, block_px, reduced_size};
use cells::Cells;
use verification::OutlineEvidence;

/// Minimum difference of the CoC between different surfaces, in pixels.
const SURFACE_STEP_PX: f32 = 2.0 * MIN_STEP_PX;
/// Interval of the updates, in frames.
const FRAMES_PER_UPDATE: usize = 4;
/// Updates in which the rows of the reduced picture are compared in turn.
const TURNS: usize = 4;
/// Maximum relative change of the gain for which its tables stay valid: less than half a code.
const GAIN_STEP: f32 = 1e-3;
/// Number of rounds from which on a pixel is known; each round updates every row once.
const MIN_ROUNDS: u8 = 2;
/// The camera counts as moved if the alignment is off by more than this, in pixels, or if a larger fraction of the
/// remembered pixels differs by more than `CHANGE_THRESHOLD` (of [`MAX_VALUE`]).
const MOVED_PX: f32 = 1.0;
const MAX_CHANGED: f32 = 0.25;
const CHANGE_THRESHOLD: f32 = 24.0;
/// Time without updates after a camera movement.
const PAUSE_NS: u64 = 500_000_000;
/// Frames further apart in media time are unrelated: the memory starts anew.
const MAX_GAP_NS: u64 = 2_000_000_000;

/// A memory of the hidden background.
#[derive(Debug)]
pub struct BackgroundMemory {
    size: (usize, usize),
    /// Per pixel: sRGB at the initial exposure, inverse depth in 1/m, and number of rounds in which it was seen.
    rgb: Vec<u8>,
    inverse: Vec<f32>,
    rounds: Vec<u8>,
    /// Inverse depth of the covering surface, in 1/m; 0 without one.
    covering: Vec<f32>,
    /// The revision of the three.
    revision: Revision,
    frame: usize,
    time_ns: u64,
    /// Updates resume at this media time, after a camera movement.
    resumes_ns: u64,
    /// The memory in reduced resolution; whether each pixel has a value, and whether it is excluded from the alignment.
    reduced: Vec<[f32; 3]>,
    has_value: Vec<bool>,
    hidden: Vec<bool>,
    /// Whether it is visible and looks different from the memory, in the row of [`TURNS`] that was compared last.
    changed: Vec<bool>,
    /// Evidence from beside the outlines, per cell.
    cell_evidence: Vec<OutlineEvidence>,
    reducer: Reducer,
    now: Vec<[f32; 3]>,
    aligner: Aligner,
    gain: [f32; 3],
    /// The gain of the tables.
    table_gain: [f32; 3],
    /// Linear light of each remembered code, by channel, at the current exposure.
    light: Box<[[f32; 256]; 3]>,
    own_light: Box<[f32; 256]>,
    /// Per current code and channel, the code at the initial exposure.
    codes: Box<[[u8; 256]; 3]>,
    /// Mixed pixels of the current matte, beside which nothing is learned.
    mixed: Bitmap,
    cells: Cells,
    /// Whether the cells are those of the current map.
    is_classified: bool,
    /// The revealed pixels of each band, and scratch.
    pixels: Vec<BandPixels>,
}

/// Revealed pixels of a band, and scratch.
type BandPixels = (Vec<MixedPixel>, Vec<(usize, u32)>);

impl Default for BackgroundMemory {
    fn default() -> Self {
        Self {
            size: (0, 0),
            rgb: Vec::new(),
            inverse: Vec::new(),
            rounds: Vec::new(),
            covering: Vec::new(),
            revision: Revision::default(),
            frame: 0,
            time_ns: 0,
            resumes_ns: 0,
            reduced: Vec::new(),
            has_value: Vec::new(),
            hidden: Vec::new(),
            changed: Vec::new(),
            cell_evidence: Vec::new(),
            reducer: Reducer::default(),
            now: Vec::new(),
            aligner: Aligner::default(),
            gain: [1.0; 3],
            table_gain: [0.0; 3],
            light: Box::new([[0.0; 256]; 3]),
            own_light: srgb_to_linear_table(),
            codes: Box::new([[0; 256]; 3]),
            mixed: Bitmap::default(),
            cells: Cells::default(),
            is_classified: false,
            pixels: Vec::new(),
        }
    }
}

impl BackgroundMemory {
    /// Updates the memory from the picture at media time `time_ns` and its depth map, which has no holes and has its
    /// matte. `lens` defines which surfaces differ. Resets the memory if the map and the picture differ in size.
    pub fn update(
        &mut self,
        workers: &mut ThreadPool,
        (map, color): (&DepthMap, &ColorImage),
        lens: &DepthCoc,
        time_ns: u64,
    ) {
        let size = (color.width as usize, color.height as usize);
        self.is_classified = false;
        if map.size() != color.size() || map.metres.is_empty() {
            self.size = (0, 0);
            return;
        }
        let follows = (self.time_ns..=self.time_ns.saturating_add(MAX_GAP_NS)).contains(&time_ns);
        if self.size != size || !follows {
            self.reset(size);
            self.resumes_ns = time_ns;
        }
        self.time_ns = time_ns;
        self.frame += 1;
        if time_ns < self.resumes_ns {
            return;
        }
        let surface_step = lens.inverse_depth_step(SURFACE_STEP_PX);
        self.classify_cells(workers, map, surface_step);
        self.is_classified = true;
        if !self.frame.is_multiple_of(FRAMES_PER_UPDATE) {
            return;
        }
        if !self.estimate_exposure(map, color, surface_step) {
            self.reset(size);
            self.resumes_ns = time_ns.saturating_add(PAUSE_NS);
            return;
        }
        self.update_rows(workers, (map, color), surface_step);
        self.check_outlines(map, color, surface_step, self.turn() % 2, 2);
        self.forget_changed(map, color, surface_step);
    }

    /// Finds the matte of a picture by `matting`, using the known background.
    pub fn find_matte(
        &self,
        matting: &mut Matting,
        workers: &mut ThreadPool,
        (map, color): (&mut DepthMap, &ColorImage),
        lens: &DepthCoc,
    ) {
        let (depth_step, surface_step) = [MIN_STEP_PX, SURFACE_STEP_PX].map(|px| lens.inverse_depth_step(px)).into();
        let background = self.is_usable_for(color).then(|| self.as_known_background(surface_step));
        matting.find_with_background(workers, (map, color), depth_step, background.as_ref());
    }

    /// Whether the memory is usable for a picture of this size.
    fn is_usable_for(&self, color: &ColorImage) -> bool {
        self.size == (color.width as usize, color.height as usize) && self.time_ns >= self.resumes_ns
    }

    /// Returns the remembered background, for surfaces that are more than `surface_step` of inverse depth apart, in
    /// 1/m.
    fn as_known_background(&self, surface_step: f32) -> KnownBackground<'_> {
        let Self { rgb, inverse, rounds, light, revision, .. } = self;
        KnownBackground { rgb, inverse, rounds, min_rounds: MIN_ROUNDS, light, surface_step, revision: *revision }
    }

    /// Resets the memory.
    fn reset(&mut self, size: (usize, usize)) {
        let count = size.0 * size.1;
        self.size = size;
        resize_buffer(&mut self.rgb, 3 * count);
        resize_buffer(&mut self.inverse, count);
        reset_buffer(&mut self.rounds, count);
        reset_buffer(&mut self.covering, count);
        self.reduced.clear();
        self.cells.clear();
        self.is_classified = false;
        self.gain = [1.0; 3];
        self.assign_revision();
    }

    /// Assigns new revisions, since the content changes.
    fn assign_revision(&mut self) {
        self.assign_rounds_revision();
        self.revision.picture = self.revision.rounds;
    }

    /// Assigns a new revision to the rounds, since pixels were forgotten.
    fn assign_rounds_revision(&mut self) {
        static REVISIONS: AtomicU64 = AtomicU64::new(1);
        self.revision.rounds = REVISIONS.fetch_add(1, Ordering::Relaxed);
    }

    /// Returns the first of the rows of the reduced picture that are compared now.
    fn turn(&self) -> usize {
        self.frame / FRAMES_PER_UPDATE % TURNS
    }

    /// Estimates the current exposure, and returns whether the camera has stayed in place.
    fn estimate_exposure(&mut self, map: &DepthMap, color: &ColorImage, surface_step: f32) -> bool {
        let size = reduced_size(color);
        let block_px = block_px(color.width);
        let rows = (self.turn()..size.1).step_by(TURNS);
        let Self { now, reduced, has_value, hidden, rounds, inverse, changed, .. } = self;
        if reduced.len() != size.0 * size.1 {
            self.reducer.reduce(color, reduced);
            reset_buffer(has_value, reduced.len());
            reset_buffer(hidden, reduced.len());
            reset_buffer(changed, size.0 * size.1.div_ceil(TURNS));
            self.aligner.invalidate();
        }
        self.reducer.reduce_rows(color, rows.clone(), now);
        let middle = |at: usize, count: usize| (at * block_px + block_px / 2).min(count - 1);
        for row in rows.clone() {
            for column in 0..size.0 {
                let (at, place) =
                    (row * size.0 + column, middle(row, self.size.1) * self.size.0 + middle(column, self.size.0));
                let is_known = rounds[place] >= MIN_ROUNDS;
                let is_seen =
                    is_known && (DepthMap::inverse_depth(map.metres[place]) - inverse[place]).abs() <= surface_step;
                hidden[at] = !(is_seen && has_value[at]);
                if is_seen && !has_value[at] {
                    // Remembered values are at the initial exposure.
                    (reduced[at], has_value[at]) = (std::array::from_fn(|p| now[at][p] / self.gain[p]), true);
                    self.aligner.invalidate();
                }
            }
        }
        // Exposure changes are estimated as a gain per channel, from the visible background only.
        let mut alignment = Alignment { gain: self.gain, ..Alignment::default() };
        self.aligner.shift_plate(reduced, size, [0.0; 2]);
        self.aligner.update(now, hidden, (size.0, rows.clone()), &mut alignment);
        self.gain = alignment.gain;
        if (0..3).any(|p| (self.gain[p] - self.table_gain[p]).abs() > GAIN_STEP * self.gain[p]) {
            self.table_gain = self.gain;
            self.reducer.fill_exposure_tables(self.gain, &mut self.light);
            for (codes, gain) in self.codes.iter_mut().zip(self.gain) {
                codes.iter_mut().zip(0..=255).for_each(|(code, now)| *code = self.reducer.without_gain(now, gain));
            }
        }
        let mut counts = [0usize; 2];
        changed.fill(false);
        let places = rows.flat_map(|row| row * size.0..(row + 1) * size.0);
        for (at, changed) in places.zip(changed) {
            let (now, then, hidden) = (now[at], reduced[at], hidden[at]);
            let is_changed = (0..3).any(|p| {
                then[p] * self.gain[p] < MAX_VALUE && (now[p] - then[p] * self.gain[p]).abs() > CHANGE_THRESHOLD
            });
            *changed = is_changed & !hidden;
            counts[usize::from(is_changed)] += usize::from(!hidden);
        }
        let [x, y] = alignment.shift.map(|shift| shift * block_px as f32);
        x.hypot(y) <= MOVED_PX && counts[1] as f32 <= MAX_CHANGED * (counts[0] + counts[1]) as f32
    }
}
