//! A plate that stays true: what is surely background is learned again and again, and so is what was put down. Who stands
//! before it never is.

use super::subject::{Part, Subject};
use crate::depth::alignment::Alignment;
use crate::depth::reduced::{Reducer, block_px, reduced_size};
use crate::frame::ColorImage;

/// The whole picture is learned from once in this time.
const ROUND_NS: u64 = 2_000_000_000;
/// A pixel is learned from the second round in which nothing stood so near, in reduced pixels, on.
const ROUNDS: u8 = 2;
const NEAR: usize = 6;
/// A new picture counts as one of so many.
const MEMORY: u16 = 4;
/// What rested for so long is no person, if so much of it did.
const REST_NS: u64 = 5_000_000_000;
const AT_REST: f32 = 0.95;
/// A change of more than this is no rest.
const MOVES: f32 = 6.0;

/// What is known of how long things are as they are.
#[derive(Debug, Default)]
pub struct Learning {
    /// Of every reduced pixel, in how many rounds nothing was near.
    rounds: Vec<u8>,
    /// Of every pixel before the plate, what it last was when it changed, and when that was.
    changed: Vec<([f32; 3], u64)>,
    /// The row to learn from next, and when the last one was.
    row: usize,
    last_ns: Option<u64>,
    /// Rounding takes turns, so that it evens out.
    turn: u16,
}

/// What is learned from.
#[derive(Clone, Copy)]
pub struct Lesson<'a> {
    pub color: &'a ColorImage,
    /// The same, reduced.
    pub now: &'a [[f32; 3]],
    pub subject: &'a Subject,
    pub alignment: &'a Alignment,
    pub time_ns: u64,
}

impl Learning {
    /// Learns from a picture. Whether the plate is another now.
    pub fn learn(
        &mut self,
        lesson: Lesson,
        reducer: &Reducer,
        plate: &mut ColorImage,
        reduced: &mut [[f32; 3]],
    ) -> bool {
        let (across, down) = reduced_size(lesson.color);
        self.rounds.resize(across * down, 0);
        self.changed.resize(across * down, ([0.0; 3], 0));
        let mut brush = Brush { lesson, reducer, plate, reduced, turn: self.turn, changed: false };
        self.turn = (self.turn + 1) % MEMORY;
        let since_ns = self.last_ns.map_or(0, |last_ns| lesson.time_ns.saturating_sub(last_ns));
        let rows = (since_ns.min(ROUND_NS) * down as u64 / ROUND_NS) as usize;
        if rows > 0 || self.last_ns.is_none() {
            self.last_ns = Some(lesson.time_ns);
        }
        for _ in 0..rows {
            for column in 0..across {
                let at = self.row * across + column;
                if is_near(&lesson.subject.foreign, (across, down), (column, self.row)) {
                    self.rounds[at] = 0;
                } else if self.rounds[at] < ROUNDS {
                    self.rounds[at] += 1;
                } else {
                    brush.paint((column, self.row), MEMORY);
                }
            }
            self.row = (self.row + 1) % down;
        }
        self.take_note(&lesson);
        for part in self.put_down(&lesson) {
            for &at in &lesson.subject.pixels[part.first..part.end] {
                brush.paint((at as usize % across, at as usize / across), 1);
            }
        }
        brush.changed
    }

    /// Takes note of what changed of what is before the plate.
    fn take_note(&mut self, lesson: &Lesson) {
        for &at in &lesson.subject.pixels {
            let (now, (last, since_ns)) = (&lesson.now[at as usize], &mut self.changed[at as usize]);
            if (0..3).any(|p| (now[p] - last[p]).abs() > MOVES) {
                (*last, *since_ns) = (*now, lesson.time_ns);
            }
        }
    }

    /// The parts that were put down and left: all that rest, but the one that a person may be.
    fn put_down<'a>(&self, lesson: &Lesson<'a>) -> impl Iterator<Item = Part> + use<'a> {
        let Subject { parts, pixels, .. } = lesson.subject;
        let rests = |part: &Part| {
            let pixels = &pixels[part.first..part.end];
            let resting = pixels.iter().filter(|&&at| self.changed[at as usize].1 + REST_NS < lesson.time_ns).count();
            resting as f32 >= AT_REST * pixels.len() as f32
        };
        let resting: Vec<bool> = parts.iter().map(rests).collect();
        let size = |k: &usize| parts[*k].end - parts[*k].first;
        let main = (0..parts.len()).filter(|&k| !resting[k]).max_by_key(size);
        let main = main.or_else(|| (0..parts.len()).max_by_key(size));
        parts.iter().copied().enumerate().filter(move |(k, _)| resting[*k] && main != Some(*k)).map(|(_, part)| part)
    }
}

fn is_near(foreign: &[bool], (across, down): (usize, usize), (column, row): (usize, usize)) -> bool {
    let columns = column.saturating_sub(NEAR)..(column + NEAR + 1).min(across);
    (row.saturating_sub(NEAR)..(row + NEAR + 1).min(down))
        .any(|row| foreign[row * across..][columns.clone()].contains(&true))
}

/// Paints blocks of a picture onto its plate.
struct Brush<'a> {
    lesson: Lesson<'a>,
    reducer: &'a Reducer,
    plate: &'a mut ColorImage,
    reduced: &'a mut [[f32; 3]],
    turn: u16,
    changed: bool,
}

impl Brush<'_> {
    /// The new picture is one of so many.
    fn paint(&mut self, (column, row): (usize, usize), of: u16) {
        let (width, height) = (self.plate.width as usize, self.plate.height as usize);
        let Alignment { gain, shift } = *self.lesson.alignment;
        let block_px = block_px(self.plate.width);
        // Where a point of the plate is now, to the nearest pixel.
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
                    let new = self.reducer.without_gain(self.lesson.color.rgb[from + p], gain[p]);
                    let old = u16::from(self.plate.rgb[to + p]);
                    let code = ((of - 1) * old + u16::from(new) + self.turn % of) / of;
                    self.plate.rgb[to + p] = code as u8;
                    sums[p] += f32::from(code);
                }
            }
        }
        let share = 1.0 / (lines.len() * columns.len()) as f32;
        let at = row * self.lesson.color.width.div_ceil(block_px as u32) as usize + column;
        self.reduced[at] = sums.map(|sum| self.reducer.root(sum * share));
        self.changed = true;
    }
}
