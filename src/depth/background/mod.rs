//! What lies behind things, remembered from when it was seen.
//!
//! Whoever moves in front of a room uncovers some of it and covers it again: around their outline, where blur shows what is
//! hidden, it was mostly seen a moment ago. Per pixel, the farthest surface that lasted is kept, colour and depth; it is
//! known while it is seen or was seen often enough, and fades while it is hidden. All is forgotten when the camera moves.

mod cells;
mod reveal;

use crate::color::light_of_codes;
use crate::compute::thread_pool::ThreadPool;
use crate::frame::{ColorImage, DepthMap, MixedPixel};
use crate::optics::DepthCoc;

use super::alignment::{Aligner, Alignment};
use super::matting::{FROM_PX, Matting};
use super::reduced::{MOST, Reducer, block_px, reduced_size};
use cells::Cells;

/// Surfaces are another where the CoC differs by so many pixels.
const OTHER_PX: f32 = 2.0 * FROM_PX;
/// One frame of so many teaches, and one row of so many of it: a round is the product of both.
const LESSONS: usize = 4;
const ROWS: usize = 2;
/// A pixel is known that was seen in so many rounds; so many more make it no surer.
const KNOWN: u8 = 2;
const SUREST: u8 = 250;
/// From this many on its colour is looked at in one round of so many.
const SURE: u8 = 8;
const REFRESH: usize = 4;
/// What is hidden is surer by one round less in so many rounds.
const FADES: usize = 2;
/// Nothing is learned so close to another surface, in pixels: camera and depth map mix them there.
const CLEAR_PX: usize = 3;
/// A change of more codes than this is another colour.
const CHANGED: i16 = 20;
/// A new picture counts as one of so many.
const MEMORY: i16 = 4;
/// A camera has moved that is off by so many pixels, or where more than this share of what is remembered looks otherwise,
/// by more than so much of [`MOST`].
const MOVED_PX: f32 = 1.0;
const UNLIKE_SHARE: f32 = 0.25;
const UNLIKE: f32 = 24.0;
/// Nothing is learned from one for so long after.
const REST_NS: u64 = 500_000_000;
/// Pixels of a row that are looked at at once.
const BLOCK: usize = 32;
/// Frames further apart in time are of another place.
const LONGEST_GAP_NS: u64 = 2_000_000_000;

/// A memory of what lies behind.
#[derive(Debug)]
pub struct Background {
    size: (usize, usize),
    /// Per pixel: sRGB as the camera exposed at first, inverse depth in 1/m, and for how many rounds it was seen.
    rgb: Vec<u8>,
    inverse: Vec<f32>,
    rounds: Vec<u8>,
    frame: usize,
    time_ns: u64,
    /// The camera moved before this time: nothing is learned until then.
    resumes_ns: u64,
    /// What is remembered, in few pixels; whether each has any, and whether it cannot be compared with this frame.
    reduced: Vec<[f32; 3]>,
    has: Vec<bool>,
    hidden: Vec<bool>,
    reducer: Reducer,
    now: Vec<[f32; 3]>,
    aligner: Aligner,
    gain: [f32; 3],
    /// The light of each code that is remembered, by channel, as the camera exposes now.
    light: Box<[[f32; 256]; 3]>,
    own_light: Box<[f32; 256]>,
    /// What each code of now would have been at first, by channel.
    codes: Box<[[u8; 256]; 3]>,
    rows: [Vec<f32>; 3],
    mixed: Vec<bool>,
    cells: Cells,
    /// What is revealed in each band.
    pixels: Vec<Vec<MixedPixel>>,
}

impl Default for Background {
    fn default() -> Self {
        Self {
            size: (0, 0),
            rgb: Vec::new(),
            inverse: Vec::new(),
            rounds: Vec::new(),
            frame: 0,
            time_ns: 0,
            resumes_ns: 0,
            reduced: Vec::new(),
            has: Vec::new(),
            hidden: Vec::new(),
            reducer: Reducer::default(),
            now: Vec::new(),
            aligner: Aligner::default(),
            gain: [1.0; 3],
            light: Box::new([[0.0; 256]; 3]),
            own_light: light_of_codes(),
            codes: Box::new([[0; 256]; 3]),
            rows: Default::default(),
            mixed: Vec::new(),
            cells: Cells::default(),
            pixels: Vec::new(),
        }
    }
}

impl Background {
    /// Learns from the picture taken at `time_ns` and its depth, without holes and with its matte, as far as `lens` tells
    /// surfaces apart. A map of another size than its picture's teaches nothing.
    pub fn learn(&mut self, map: &DepthMap, color: &ColorImage, lens: &DepthCoc, time_ns: u64) {
        let size = (color.width as usize, color.height as usize);
        if map.size() != color.size() || map.metres.is_empty() {
            self.size = (0, 0);
            return;
        }
        let follows = (self.time_ns..=self.time_ns.saturating_add(LONGEST_GAP_NS)).contains(&time_ns);
        if self.size != size || !follows {
            self.forget(size);
            self.resumes_ns = time_ns;
        }
        self.time_ns = time_ns;
        self.frame += 1;
        if time_ns < self.resumes_ns || !self.frame.is_multiple_of(LESSONS) {
            return;
        }
        let other = lens.inverse_depth_of_px(OTHER_PX);
        if !self.align(map, color, other) {
            self.forget(size);
            self.resumes_ns = time_ns.saturating_add(REST_NS);
            return;
        }
        for y in (self.frame / LESSONS % ROWS..size.1).step_by(ROWS) {
            pulp::Arch::new().dispatch(LearnRow { background: self, map, color, other, y });
        }
    }

    /// Finds the matte of a picture by `matting`, before what is known to lie behind.
    pub fn find_matte(
        &self,
        matting: &mut Matting,
        workers: &mut ThreadPool,
        (map, color): (&mut DepthMap, &ColorImage),
        lens: &DepthCoc,
    ) {
        let (jump, other) = [FROM_PX, OTHER_PX].map(|px| lens.inverse_depth_of_px(px)).into();
        let knows = self.knows(color);
        let behind = |at, near| if knows { self.light_behind(at, near, other) } else { None };
        matting.find_before(workers, (map, color), jump, behind);
    }

    /// Whether anything is known of pictures like this one.
    fn knows(&self, color: &ColorImage) -> bool {
        self.size == (color.width as usize, color.height as usize) && self.time_ns >= self.resumes_ns
    }

    /// The light behind pixel `at`, as the camera exposes now, whose nearer surface has inverse depth `near`, in 1/m; `None`
    /// where that is not known. Surfaces are another beyond a step `other` of it.
    fn light_behind(&self, at: usize, near: f32, other: f32) -> Option<[f32; 3]> {
        let is_known = self.rounds[at] >= KNOWN && near - self.inverse[at] > other;
        is_known.then(|| [0, 1, 2].map(|p| self.light[p][usize::from(self.rgb[3 * at + p])]))
    }

    /// Starts anew.
    fn forget(&mut self, size: (usize, usize)) {
        let count = size.0 * size.1;
        self.size = size;
        self.rgb.resize(3 * count, 0);
        self.inverse.resize(count, 0.0);
        self.rounds.clear();
        self.rounds.resize(count, 0);
        self.reduced.clear();
        self.gain = [1.0; 3];
    }

    /// Finds how the camera exposes now. Whether it stands where it stood.
    fn align(&mut self, map: &DepthMap, color: &ColorImage, other: f32) -> bool {
        let size = reduced_size(color);
        let block_px = block_px(color.width);
        self.reducer.reduce(color, &mut self.now);
        let Self { now, reduced, has, hidden, rounds, inverse, .. } = self;
        if reduced.len() != now.len() {
            reduced.clone_from(now);
            has.clear();
            has.resize(now.len(), false);
            hidden.resize(now.len(), false);
            self.aligner.forget();
        }
        let middle = |at: usize, count: usize| (at * block_px + block_px / 2).min(count - 1);
        for row in 0..size.1 {
            for column in 0..size.0 {
                let (at, place) =
                    (row * size.0 + column, middle(row, self.size.1) * self.size.0 + middle(column, self.size.0));
                let is_known = rounds[place] >= KNOWN;
                let is_seen = is_known && (DepthMap::inverse_of(map.metres[place]) - inverse[place]).abs() <= other;
                hidden[at] = !(is_seen && has[at]);
                if is_seen && !has[at] {
                    // What was learned is as the camera exposed at first.
                    (reduced[at], has[at]) = (std::array::from_fn(|p| now[at][p] / self.gain[p]), true);
                    self.aligner.forget();
                }
            }
        }
        let mut alignment = Alignment { gain: self.gain, ..Alignment::default() };
        self.aligner.shift(reduced, size, [0.0; 2]);
        self.aligner.step(now, hidden, size, &mut alignment);
        self.gain = alignment.gain;
        self.reducer.expose(self.gain, &mut self.light);
        for (codes, gain) in self.codes.iter_mut().zip(self.gain) {
            codes.iter_mut().zip(0..=255).for_each(|(code, now)| *code = self.reducer.without_gain(now, gain));
        }
        let mut counts = [0usize; 2];
        for ((now, then), _) in now.iter().zip(&*reduced).zip(&*hidden).filter(|(_, hidden)| !**hidden) {
            let is_unlike =
                (0..3).any(|p| then[p] * self.gain[p] < MOST && (now[p] - then[p] * self.gain[p]).abs() > UNLIKE);
            counts[usize::from(is_unlike)] += 1;
        }
        let [x, y] = alignment.shift.map(|shift| shift * block_px as f32);
        x.hypot(y) <= MOVED_PX && counts[1] as f32 <= UNLIKE_SHARE * (counts[0] + counts[1]) as f32
    }

    /// Learns from a row.
    #[inline(always)]
    fn learn_row(&mut self, map: &DepthMap, color: &ColorImage, other: f32, y: usize) {
        let (width, height) = self.size;
        let ys = [y.saturating_sub(CLEAR_PX), y, (y + CLEAR_PX).min(height - 1)];
        for (out, y) in self.rows.iter_mut().zip(ys) {
            out.clear();
            out.extend(map.metres[y * width..][..width].iter().map(|&metres| DepthMap::inverse_of(metres)));
        }
        self.mixed.clear();
        self.mixed.resize(width, false);
        for y in ys[0]..=ys[2] {
            for pixel in map.matte.within(y * width..(y + 1) * width) {
                let x = pixel.at as usize % width;
                self.mixed[x.saturating_sub(CLEAR_PX)..(x + CLEAR_PX + 1).min(width)].fill(true);
            }
        }
        let round = self.frame / (LESSONS * ROWS);
        let (fades, refreshes) = (round.is_multiple_of(FADES), (round + y).is_multiple_of(REFRESH));
        let turn = round as i16 % MEMORY;
        let [above, here, below] = &self.rows;
        let row = y * width;
        for columns in (0..width).step_by(BLOCK).map(|x| x..(x + BLOCK).min(width)) {
            // Most of a picture is known, or hides it: nothing to do, and `&` makes vector code of finding that out.
            let there = row + columns.start..row + columns.end;
            let before = self.rounds[there.clone()].iter().zip(&self.inverse[there]);
            let is_idle = here[columns.clone()].iter().zip(before).fold(true, |all, (own, (&seen, inverse))| {
                let step = own - inverse;
                let hides = (step > other) & (seen > 0);
                all & if hides { !fades } else { (seen >= SURE) & (step >= -other) & !refreshes }
            });
            if is_idle {
                continue;
            }
            for x in columns {
                let (at, own) = (row + x, here[x]);
                let seen = &mut self.rounds[at];
                let step = own - self.inverse[at];
                if step > other && *seen > 0 {
                    *seen -= u8::from(fades);
                    continue;
                }
                if *seen >= SURE && step >= -other && !refreshes {
                    continue;
                }
                let around =
                    [above[x], below[x], here[x.saturating_sub(CLEAR_PX)], here[(x + CLEAR_PX).min(width - 1)]];
                if self.mixed[x] || around.iter().any(|next| (next - own).abs() > other) {
                    continue;
                }
                let kept = &mut self.rgb[3 * at..3 * at + 3];
                let apart: [i16; 3] = std::array::from_fn(|p| {
                    i16::from(self.codes[p][usize::from(color.rgb[3 * at + p])]) - i16::from(kept[p])
                });
                let is_same = *seen > 0 && step.abs() <= other && apart.iter().all(|apart| apart.abs() <= CHANGED);
                // Rounding takes turns, so that it evens out.
                let moved = |apart: i16| if is_same { (apart + turn).div_euclid(MEMORY) } else { apart };
                for (kept, apart) in kept.iter_mut().zip(apart) {
                    *kept = (i16::from(*kept) + moved(apart)) as u8;
                }
                self.inverse[at] = if is_same { self.inverse[at] + step / f32::from(MEMORY) } else { own };
                *seen = if is_same { (*seen + 1).min(SUREST) } else { 1 };
            }
        }
    }
}

/// See [`Background::learn_row`].
struct LearnRow<'a> {
    background: &'a mut Background,
    map: &'a DepthMap,
    color: &'a ColorImage,
    other: f32,
    y: usize,
}

impl pulp::WithSimd for LearnRow<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.background.learn_row(self.map, self.color, self.other, self.y);
    }
}
