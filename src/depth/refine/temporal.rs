//! The temporal filter: depth that rests where the picture rests.
//!
//! A recursive average of the inverse depth of each pixel. It forgets where the colour changed, because something
//! moved there, and follows where the depth changes by more than noise. A depth that jumps from one surface to another
//! while the colours around rest is mostly the sensor's: the outline of a still person flickers by some pixels. Such a
//! jump is believed only once it lasts.

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::smooth::over;
use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;

/// Frames that the average spans, at most: the variance of still noise falls to 1/15.
pub const LONGEST: f32 = 8.0;
/// Frames for which a jump under resting colours is held back: a tenth of a second at 30 per second.
pub const HOLD: u8 = 2;
/// A pixel rests up to a change of colour (of red, green and blue together, in steps of 8-bit sRGB, averaged over 3x3
/// pixels) of this many times the median change, which is mostly camera noise, within these bounds; at twice that it
/// has moved.
pub const MOVED: f32 = 2.5;
pub const MOVED_BOUNDS: (f32, f32) = (8.0, 24.0);
/// Frames further apart than this in media time, or not in order, do not follow each other.
const LONGEST_GAP_NS: u64 = 500_000_000;
/// Rows and columns sampled for the median change, at most.
pub const LOOKS: usize = 64;

/// Whether a frame follows the one before, by their media times.
pub fn follows(before_ns: u64, time_ns: u64) -> bool {
    (before_ns..=before_ns.saturating_add(LONGEST_GAP_NS)).contains(&time_ns)
}

/// What a change of inverse depth means.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Below this it is noise, and averaged.
    pub noise: f32,
    /// Above this it is another surface.
    pub jump: f32,
}

/// Steadies maps of inverse depth; remembers the last frame.
#[derive(Debug, Default)]
pub struct TemporalFilter {
    width: usize,
    time_ns: u64,
    /// Inverse depth as it was given out; empty before the first frame.
    mean: Vec<f32>,
    /// Frames in the mean.
    count: Vec<f32>,
    /// Frames for which a jump was held back.
    held: Vec<u8>,
    /// The last picture.
    rgb: Vec<u8>,
    /// Change of colour since the last frame, summed up over 3x3 pixels.
    change: Vec<u16>,
    /// Of every thread.
    lines: Vec<Lines>,
    /// Memory for the samples of the median.
    looks: Vec<f32>,
}

/// Changes of colour of three rows, summed up along them; and of the pixels of one.
#[derive(Debug, Default)]
struct Lines {
    rows: [Vec<u16>; 3],
    single: Vec<u16>,
}

impl TemporalFilter {
    /// Multiplies the remembered inverse depth, as its unit has become `times` smaller.
    pub fn rescale(&mut self, times: f32) {
        self.mean.iter_mut().for_each(|v| *v *= times);
    }

    /// Starts anew with the next frame.
    pub fn forget(&mut self) {
        self.mean.clear();
    }

    /// Steadies `inverse` of the frame at `time_ns`, with the picture `rgb`; gives it out as `metres`, `focus_m` over it.
    pub fn steady(
        &mut self,
        (arch, workers): (Arch, &mut ThreadPool),
        inverse: &[f32],
        (rgb, width, time_ns): (&[u8], usize, u64),
        limits: Limits,
        (metres, focus_m): (&mut [f32], f32),
    ) {
        let same_size = self.mean.len() == inverse.len() && self.width == width && self.rgb.len() == rgb.len();
        let in_order = follows(self.time_ns, time_ns);
        let bands = Bands::new(inverse.len() / width, 1, workers);
        if same_size && in_order {
            self.change.resize(inverse.len(), 0);
            // Before they start: a thread that has no part of this frame would allocate in a later one.
            self.lines.resize_with(workers.thread_count(), Lines::default);
            let rows = self.lines.iter_mut().flat_map(|Lines { rows, single }| rows.iter_mut().chain([single]));
            rows.for_each(|row| row.resize(width, 0));
            let Self { change, lines, rgb: before, .. } = self;
            let pictures = [rgb, &before[..]];
            workers.run_each_with(lines, bands.rows().zip(bands.split(change, width)), &|lines, (rows, change)| {
                arch.dispatch(Change { pictures, width, lines, rows, change });
            });
            let moved = (MOVED * self.median_change()).clamp(MOVED_BOUNDS.0, MOVED_BOUNDS.1);
            let Self { mean, count, held, change, rgb: before, .. } = self;
            let state = bands.split(mean, width).zip(bands.split(count, width)).zip(bands.split(held, width));
            let remembered = state.zip(bands.split(before, 3 * width));
            let parts = bands.rows().zip(bands.split(metres, width)).zip(remembered);
            workers.run_each(parts, &|((rows, metres), (((mean, count), held), before))| {
                let pixels = rows.start * width..rows.end * width;
                before.copy_from_slice(&rgb[3 * pixels.start..3 * pixels.end]);
                let (inverse, change) = (&inverse[pixels.clone()], &change[pixels]);
                arch.dispatch(Average { inverse, mean, count, held, change, moved, limits, metres, focus_m });
            });
        } else {
            self.mean.clear();
            self.mean.extend_from_slice(inverse);
            self.count.clear();
            self.count.resize(inverse.len(), 1.0);
            self.held.clear();
            self.held.resize(inverse.len(), 0);
            self.rgb.clear();
            self.rgb.extend_from_slice(rgb);
            over((arch, workers), focus_m, (inverse, metres), width);
        }
        (self.width, self.time_ns) = (width, time_ns);
    }

    /// The median of the mean change over a grid of samples.
    fn median_change(&mut self) -> f32 {
        let height = self.change.len() / self.width;
        self.looks.clear();
        for y in (0..height).step_by(height.div_ceil(LOOKS)) {
            let row = &self.change[y * self.width..][..self.width];
            self.looks.extend(row.iter().step_by(self.width.div_ceil(LOOKS)).map(|&change| per_pixel(change)));
        }
        let middle = self.looks.len() / 2;
        *self.looks.select_nth_unstable_by(middle, f32::total_cmp).1
    }
}

/// The mean of a change that was summed up over 3x3 pixels.
#[inline(always)]
fn per_pixel(change: u16) -> f32 {
    f32::from(change) / 9.0
}

/// How much the colours around each pixel changed between two pictures, summed up over 3x3 pixels: at the border the outermost
/// ones count twice.
struct Change<'a> {
    pictures: [&'a [u8]; 2],
    width: usize,
    lines: &'a mut Lines,
    /// The rows that are wanted, for `change`.
    rows: Range<usize>,
    change: &'a mut [u16],
}

impl WithSimd for Change<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { pictures, width, lines: Lines { rows: sums, single }, rows, change } = self;
        let (height, last) = (pictures[0].len() / (3 * width), width - 1);
        for y in rows.start.saturating_sub(1)..(rows.end + 1).min(height) {
            let [now, before] = pictures.map(|rgb| rgb[3 * y * width..][..3 * width].as_chunks::<3>().0);
            for ((now, before), single) in now.iter().zip(before).zip(&mut *single) {
                let apart = |p: usize| u16::from(now[p].abs_diff(before[p]));
                *single = apart(0) + apart(1) + apart(2);
            }
            let row = &mut sums[y % 3];
            row[0] = 2 * single[0] + single[1.min(last)];
            row[last] = single[last.saturating_sub(1)] + 2 * single[last];
            for (sum, three) in row.iter_mut().skip(1).zip(single.windows(3)) {
                *sum = three[0] + three[1] + three[2];
            }
            // The row above has all its neighbours now; the last one is its own.
            let end = if y + 1 < height { y } else { height };
            for y in y.saturating_sub(1).max(rows.start)..end.min(rows.end) {
                let [above, here, below] = [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(|y| &sums[y % 3]);
                let out = &mut change[(y - rows.start) * width..][..width];
                for (out, ((above, here), below)) in out.iter_mut().zip(above.iter().zip(here).zip(below)) {
                    *out = above + here + below;
                }
            }
        }
    }
}

/// Moves the average of each pixel towards the new inverse depth, and gives it out.
struct Average<'a> {
    inverse: &'a [f32],
    mean: &'a mut [f32],
    count: &'a mut [f32],
    held: &'a mut [u8],
    change: &'a [u16],
    /// Up to this change of colour a pixel rests.
    moved: f32,
    limits: Limits,
    metres: &'a mut [f32],
    focus_m: f32,
}

impl WithSimd for Average<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { inverse, mean, count, held, change, moved, limits, metres, focus_m } = self;
        let (per_moved, per_noise) = (1.0 / moved, 1.0 / limits.noise);
        let state = mean.iter_mut().zip(count).zip(held).zip(change);
        for ((&inverse, metres), (((mean, count), held), &change)) in inverse.iter().zip(metres).zip(state) {
            // From 1 up to the bound to 0 at twice the bound: the weight of the past.
            let rest = unit(2.0 - per_pixel(change) * per_moved);
            let step = inverse - *mean;
            let noise_share = unit(step.abs() * per_noise);
            let changed = noise_share >= 1.0;
            let hold = (step.abs() > limits.jump) & (rest >= 1.0) & (*held < HOLD);
            let frames = *count * rest;
            // The nearer to the limit, the less it is noise: the share of the new depth grows to 1 there, smoothly.
            let squared = noise_share * noise_share;
            let share = 1.0 / (frames + 1.0);
            let share = share + (1.0 - share) * squared * squared;
            let v = if hold { *mean } else { *mean + share * step };
            let longer = frames + 1.0;
            let longer = if longer < LONGEST { longer } else { LONGEST };
            *count = if hold {
                *count
            } else if changed {
                1.0
            } else {
                longer
            };
            *held = if hold { *held + 1 } else { 0 };
            (*mean, *metres) = (v, focus_m / v);
        }
    }
}

/// `x` cut to 0 to 1.
#[inline(always)]
fn unit(x: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < 1.0 { x } else { 1.0 }
}
