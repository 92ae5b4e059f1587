//! Keeps a plate up to date: sure background is learned continuously, and objects that were put down are added. A
//! person in front of the plate is never learned.

use super::subject::{Component, Subject};
use crate::depth::alignment::Alignment;
use crate::depth::reduced::{Reducer, block_px, reduced_size};
use crate::frame::ColorImage;

/// Time in which every row is learned from once.
const ROUND_NS: u64 = 2_000_000_000;
/// A pixel is learned after this many rounds without foreground within `NEAR_PX` reduced pixels.
const ROUNDS: u8 = 2;
const NEAR_PX: usize = 6;
/// Length of the running average: a new value has weight `1 / MEMORY`.
const MEMORY: u16 = 4;
/// Time after which a region at rest is no person, and the minimum fraction of its pixels at rest.
const MIN_REST_NS: u64 = 5_000_000_000;
const MIN_RESTING_FRACTION: f32 = 0.95;
/// Minimum change of a pixel in motion.
const MIN_DIFFERENCE: f32 = 6.0;

/// The age of the scene's content.
#[derive(Debug, Default)]
pub struct PlateUpdater {
    /// Per reduced pixel, number of rounds without foreground nearby.
    rounds: Vec<u8>,
    /// Per foreground pixel, its value at the last change, and the time of that.
    changed: Vec<([f32; 3], u64)>,
    /// The next row to learn from, and the time of the last one.
    row: usize,
    last_ns: Option<u64>,
    /// Rotating rounding offset, so that rounding errors average out.
    turn: u16,
}

/// The input of an update.
#[derive(Clone, Copy)]
pub struct UpdateInput<'a> {
    pub color: &'a ColorImage,
    /// The picture in reduced resolution.
    pub now: &'a [[f32; 3]],
    pub subject: &'a Subject,
    pub alignment: &'a Alignment,
    pub time_ns: u64,
}

impl PlateUpdater {
    /// Updates the plate from a picture. Returns whether the plate has changed.
    pub fn update_plate(
        &mut self,
        input: UpdateInput,
        reducer: &Reducer,
        plate: &mut ColorImage,
        reduced: &mut [[f32; 3]],
    ) -> bool {
        let (across, down) = reduced_size(input.color);
        self.rounds.resize(across * down, 0);
        self.changed.resize(across * down, ([0.0; 3], 0));
        let mut blender = BlockBlender { input, reducer, plate, reduced, turn: self.turn, changed: false };
        self.turn = (self.turn + 1) % MEMORY;
        let since_ns = self.last_ns.map_or(0, |last_ns| input.time_ns.saturating_sub(last_ns));
        let rows = (since_ns.min(ROUND_NS) * down as u64 / ROUND_NS) as usize;
        if rows > 0 || self.last_ns.is_none() {
            self.last_ns = Some(input.time_ns);
        }
        for _ in 0..rows {
            for column in 0..across {
                let at = self.row * across + column;
                if is_near_foreground(&input.subject.foreground, (across, down), (column, self.row)) {
                    self.rounds[at] = 0;
                } else if self.rounds[at] < ROUNDS {
                    self.rounds[at] += 1;
                } else {
                    blender.blend_block((column, self.row), MEMORY);
                }
            }
            self.row = (self.row + 1) % down;
        }
        self.record_changes(&input);
        for component in self.find_placed_objects(&input) {
            for &at in &input.subject.pixels[component.first..component.end] {
                blender.blend_block((at as usize % across, at as usize / across), 1);
            }
        }
        blender.changed
    }

    /// Records changes of the foreground pixels.
    fn record_changes(&mut self, input: &UpdateInput) {
        for &at in &input.subject.pixels {
            let (now, (last, since_ns)) = (&input.now[at as usize], &mut self.changed[at as usize]);
            if (0..3).any(|p| (now[p] - last[p]).abs() > MIN_DIFFERENCE) {
                (*last, *since_ns) = (*now, input.time_ns);
            }
        }
    }

    /// Returns the regions of objects that were put down: all at rest, except the one that may be the person.
    fn find_placed_objects<'a>(&self, input: &UpdateInput<'a>) -> impl Iterator<Item = Component> + use<'a> {
        let Subject { components, pixels, .. } = input.subject;
        let rests = |component: &Component| {
            let pixels = &pixels[component.first..component.end];
            let resting =
                pixels.iter().filter(|&&at| self.changed[at as usize].1 + MIN_REST_NS < input.time_ns).count();
            resting as f32 >= MIN_RESTING_FRACTION * pixels.len() as f32
        };
        let resting: Vec<bool> = components.iter().map(rests).collect();
        let size = |k: &usize| components[*k].end - components[*k].first;
        let main = (0..components.len()).filter(|&k| !resting[k]).max_by_key(size);
        let main = main.or_else(|| (0..components.len()).max_by_key(size));
        let others = components.iter().copied().enumerate().filter(move |(k, _)| resting[*k] && main != Some(*k));
        others.map(|(_, component)| component)
    }
}

fn is_near_foreground(foreground: &[bool], (across, down): (usize, usize), (column, row): (usize, usize)) -> bool {
    let columns = column.saturating_sub(NEAR_PX)..(column + NEAR_PX + 1).min(across);
    (row.saturating_sub(NEAR_PX)..(row + NEAR_PX + 1).min(down))
        .any(|row| foreground[row * across..][columns.clone()].contains(&true))
}

/// Copies blocks of a picture to its plate.
struct BlockBlender<'a> {
    input: UpdateInput<'a>,
    reducer: &'a Reducer,
    plate: &'a mut ColorImage,
    reduced: &'a mut [[f32; 3]],
    turn: u16,
    changed: bool,
}

impl BlockBlender<'_> {
    /// Averages a block into the plate, with weight one in `of`.
    fn blend_block(&mut self, (column, row): (usize, usize), of: u16) {
        let (width, height) = (self.plate.width as usize, self.plate.height as usize);
        let Alignment { gain, shift } = *self.input.alignment;
        let block_px = block_px(self.plate.width);
        // Current position of the plate's points, rounded to pixels.
        let off = shift.map(|shift| (shift * block_px as f32).round() as isize);
        let mut sums = [0.0f32; 3];
        let lines = row * block_px..((row + 1) * block_px).min(height);
        let columns = column * block_px..((column + 1) * block_px).min(width);
        for y in lines.clone() {
            for x in columns.clone() {
                let (Some(from_x), Some(from_y)) = (x.checked_add_signed(off[0]), y.checked_add_signed(off[1])) else {
                    return;
                };
                if from_x >= width || from_y >= height {
                    return;
                }
                let (to, from) = (3 * (y * width + x), 3 * (from_y * width + from_x));
                for p in 0..3 {
                    let new = self.reducer.without_gain(self.input.color.rgb[from + p], gain[p]);
                    let old = u16::from(self.plate.rgb[to + p]);
                    let code = ((of - 1) * old + u16::from(new) + self.turn % of) / of;
                    self.plate.rgb[to + p] = code as u8;
                    sums[p] += f32::from(code);
                }
            }
        }
        let scale = 1.0 / (lines.len() * columns.len()) as f32;
        let at = row * self.input.color.width.div_ceil(block_px as u32) as usize + column;
        self.reduced[at] = sums.map(|sum| self.reducer.sqrt_light(sum * scale));
        self.changed = true;
    }
}
