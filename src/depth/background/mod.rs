//! What lies behind things, remembered from when it was seen.
//!
//! Whoever moves in front of a room uncovers some of it and covers it again: around their outline, where blur shows what is
//! hidden, it was mostly seen a moment ago. Per pixel, the farthest surface that lasted is kept, colour and depth; it is
//! known while it is seen or was seen often enough, and fades while it is hidden. What is not behind a thing any more, as
//! something else was put between, is forgotten at once; and all is when the camera moves.

mod cells;
mod cover;
mod doubt;
mod learning;
mod reveal;

use std::sync::atomic::{AtomicU64, Ordering};

use crate::color::light_of_codes;
use crate::compute::thread_pool::ThreadPool;
use crate::frame::{ColorImage, DepthMap, MixedPixel};
use crate::optics::DepthCoc;

use super::alignment::{Aligner, Alignment};
use super::bits::Bits;
use super::matting::{Behind, FROM_PX, Matting};
use super::reduced::{MOST, Reducer, block_px, reduced_size};
use cells::Cells;
use doubt::Witness;

/// Surfaces are another where the CoC differs by so many pixels.
const OTHER_PX: f32 = 2.0 * FROM_PX;
/// One frame of so many teaches.
const LESSONS: usize = 4;
/// A pixel is known that was seen in so many rounds, in each of which every row teaches once.
const KNOWN: u8 = 2;
/// A camera has moved that is off by so many pixels, or where more than this share of what is remembered looks otherwise,
/// by more than so much of [`MOST`].
const MOVED_PX: f32 = 1.0;
const UNLIKE_SHARE: f32 = 0.25;
const UNLIKE: f32 = 24.0;
/// Nothing is learned from one for so long after.
const REST_NS: u64 = 500_000_000;
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
    /// Inverse depth of what hides it, in 1/m; 0 where nothing does.
    cover: Vec<f32>,
    /// A number that these three have for themselves ([`Behind::revision`]).
    revision: u64,
    frame: usize,
    time_ns: u64,
    /// The camera moved before this time: nothing is learned until then.
    resumes_ns: u64,
    /// What is remembered, in few pixels; whether each has any, and whether it cannot be compared with this frame.
    reduced: Vec<[f32; 3]>,
    has: Vec<bool>,
    hidden: Vec<bool>,
    /// Whether it is seen, and looks otherwise than remembered.
    unlike: Vec<bool>,
    /// What is seen beside the outlines in each cell.
    witnesses: Vec<Witness>,
    reducer: Reducer,
    now: Vec<[f32; 3]>,
    aligner: Aligner,
    gain: [f32; 3],
    /// The light of each code that is remembered, by channel, as the camera exposes now.
    light: Box<[[f32; 256]; 3]>,
    own_light: Box<[f32; 256]>,
    /// What each code of now would have been at first, by channel.
    codes: Box<[[u8; 256]; 3]>,
    /// Pixels of the matte that is learned beside.
    mixed: Bits,
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
            cover: Vec::new(),
            revision: 0,
            frame: 0,
            time_ns: 0,
            resumes_ns: 0,
            reduced: Vec::new(),
            has: Vec::new(),
            hidden: Vec::new(),
            unlike: Vec::new(),
            witnesses: Vec::new(),
            reducer: Reducer::default(),
            now: Vec::new(),
            aligner: Aligner::default(),
            gain: [1.0; 3],
            light: Box::new([[0.0; 256]; 3]),
            own_light: light_of_codes(),
            codes: Box::new([[0; 256]; 3]),
            mixed: Bits::default(),
            cells: Cells::default(),
            pixels: Vec::new(),
        }
    }
}

impl Background {
    /// Learns from the picture taken at `time_ns` and its depth, without holes and with its matte, as far as `lens` tells
    /// surfaces apart. A map of another size than its picture's teaches nothing.
    pub fn learn(
        &mut self,
        workers: &mut ThreadPool,
        (map, color): (&DepthMap, &ColorImage),
        lens: &DepthCoc,
        time_ns: u64,
    ) {
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
        self.learn_rows(workers, (map, color), other);
        self.doubt(map, color, other);
        self.renew(map, color, other);
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
        let behind = self.knows(color).then(|| self.seen(other));
        matting.find_before(workers, (map, color), jump, behind.as_ref());
    }

    /// Whether anything is known of pictures like this one.
    fn knows(&self, color: &ColorImage) -> bool {
        self.size == (color.width as usize, color.height as usize) && self.time_ns >= self.resumes_ns
    }

    /// What is remembered, where surfaces are another beyond a step `other` of inverse depth, in 1/m.
    fn seen(&self, other: f32) -> Behind<'_> {
        let Self { rgb, inverse, rounds, light, revision, .. } = self;
        Behind { rgb, inverse, rounds, known: KNOWN, light, other, revision: *revision }
    }

    /// Starts anew.
    fn forget(&mut self, size: (usize, usize)) {
        let count = size.0 * size.1;
        self.size = size;
        self.rgb.resize(3 * count, 0);
        self.inverse.resize(count, 0.0);
        self.rounds.clear();
        self.rounds.resize(count, 0);
        self.cover.clear();
        self.cover.resize(count, 0.0);
        self.reduced.clear();
        self.gain = [1.0; 3];
        self.revise();
    }

    /// What is remembered changes.
    fn revise(&mut self) {
        static REVISIONS: AtomicU64 = AtomicU64::new(1);
        self.revision = REVISIONS.fetch_add(1, Ordering::Relaxed);
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
            self.unlike.resize(now.len(), false);
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
        for (((now, then), hidden), unlike) in now.iter().zip(&*reduced).zip(&*hidden).zip(&mut self.unlike) {
            let is_unlike =
                (0..3).any(|p| then[p] * self.gain[p] < MOST && (now[p] - then[p] * self.gain[p]).abs() > UNLIKE);
            *unlike = is_unlike & !hidden;
            counts[usize::from(is_unlike)] += usize::from(!hidden);
        }
        let [x, y] = alignment.shift.map(|shift| shift * block_px as f32);
        x.hypot(y) <= MOVED_PX && counts[1] as f32 <= UNLIKE_SHARE * (counts[0] + counts[1]) as f32
    }
}
