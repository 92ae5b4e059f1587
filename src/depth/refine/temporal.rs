//! The temporal filter: keeps depth static where the picture is static.
//!
//! A recursive average of the inverse depth of each pixel. It restarts where the colour changed, because something
//! moved there, and follows where the depth changes by more than noise. A depth that switches between two surfaces
//! while the colours around are static is mostly sensor noise: the outline of a still person flickers by some pixels.
//! Such a step is accepted only once it lasts.
//!
//! twin: shaders/refine/change.wgsl, shaders/refine/steady.wgsl

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::smooth::invert;
use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;

/// Maximum number of frames in the average: the variance of static noise falls to 1/15.
pub const MAX_FRAMES: f32 = 8.0;
/// Frames for which a step under static colours is held back: a tenth of a second at 30 per second.
pub const HOLD_FRAMES: u8 = 2;
/// A pixel is static up to a change of colour (of red, green and blue together, in steps of 8-bit sRGB, averaged over
/// 3x3 pixels) of this many factor the median change, which is mostly camera noise, within these bounds; at twice that
/// it has moved completely.
pub const MOVED: f32 = 2.5;
pub const MOVED_BOUNDS: (f32, f32) = (8.0, 24.0);
/// Frames further apart than this in media time, or not in order, are not consecutive.
const MAX_GAP_NS: u64 = 500_000_000;
/// Maximum number of rows and of columns sampled for the median change.
pub const GRID: usize = 64;

/// Whether two frames are consecutive by their media factor.
pub fn are_consecutive(before_ns: u64, time_ns: u64) -> bool {
    (before_ns..=before_ns.saturating_add(MAX_GAP_NS)).contains(&time_ns)
}

/// Thresholds for changes of inverse depth.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Changes below this are noise, and averaged.
    pub noise: f32,
    /// Changes above this are another surface.
    pub depth_step: f32,
}

/// Filters maps of inverse depth in time; stores the last frame.
#[derive(Debug, Default)]
pub struct TemporalFilter {
    width: usize,
    time_ns: u64,
    /// Filtered inverse depth; empty before the first frame.
    mean: Vec<f32>,
    /// Number of frames in the mean.
    count: Vec<f32>,
    /// Number of frames for which a step was held back.
    held: Vec<u8>,
    /// The last picture.
    rgb: Vec<u8>,
    /// Change of colour since the last frame, summed over 3x3 pixels.
    change: Vec<u16>,
    /// One per thread.
    lines: Vec<Lines>,
    /// Buffer for the samples of the median.
    samples: Vec<f32>,
}

/// Colour changes of three rows, summed horizontally; and those of single pixels of one row.
#[derive(Debug, Default)]
struct Lines {
    rows: [Vec<u16>; 3],
    single: Vec<u16>,
}

impl TemporalFilter {
    /// Multiplies the stored inverse depth by `factor`, after a change of its unit.
    pub fn rescale(&mut self, factor: f32) {
        self.mean.iter_mut().for_each(|v| *v *= factor);
    }

    /// Discards the state, so that the next frame starts anew.
    pub fn reset(&mut self) {
        self.mean.clear();
    }

    /// Filters `inverse` of the frame at `time_ns` with the picture `rgb`, and writes `focus_m` over it to `metres`.
    pub fn filter(
        &mut self,
        (arch, workers): (Arch, &mut ThreadPool),
        inverse: &[f32],
        (rgb, width, time_ns): (&[u8], usize, u64),
        limits: Limits,
        (metres, focus_m): (&mut [f32], f32),
    ) {
        let same_size = self.mean.len() == inverse.len() && self.width == width && self.rgb.len() == rgb.len();
        let in_order = are_consecutive(self.time_ns, time_ns);
        let bands = Bands::new(inverse.len() / width, 1, workers);
        if same_size && in_order {
            self.change.resize(inverse.len(), 0);
            // Sized here for every thread: one without a part of this frame would allocate in a later one.
            self.lines.resize_with(workers.thread_count(), Lines::default);
            let rows = self.lines.iter_mut().flat_map(|Lines { rows, single }| rows.iter_mut().chain([single]));
            rows.for_each(|row| row.resize(width, 0));
            let Self { change, lines, rgb: before, .. } = self;
            let pictures = [rgb, &before[..]];
            workers.run_each_with(lines, bands.rows().zip(bands.split(change, width)), &|lines, (rows, change)| {
                arch.dispatch(ColorChange { pictures, width, lines, rows, change });
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
                arch.dispatch(UpdateMean { inverse, mean, count, held, change, moved, limits, metres, focus_m });
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
            invert((arch, workers), focus_m, (inverse, metres), width);
        }
        (self.width, self.time_ns) = (width, time_ns);
    }

    /// Returns the median colour change over a grid of samples.
    fn median_change(&mut self) -> f32 {
        let height = self.change.len() / self.width;
        self.samples.clear();
        for y in (0..height).step_by(height.div_ceil(GRID)) {
            let row = &self.change[y * self.width..][..self.width];
            self.samples.extend(row.iter().step_by(self.width.div_ceil(GRID)).map(|&change| mean_per_pixel(change)));
        }
        let middle = self.samples.len() / 2;
        *self.samples.select_nth_unstable_by(middle, f32::total_cmp).1
    }
}

/// Returns the mean of a change that was summed over 3x3 pixels.
#[inline(always)]
fn mean_per_pixel(change: u16) -> f32 {
    f32::from(change) / 9.0
}

/// Computes the colour change around each pixel between two pictures, summed over 3x3 pixels; the border repeats.
struct ColorChange<'a> {
    pictures: [&'a [u8]; 2],
    width: usize,
    lines: &'a mut Lines,
    /// Range of output rows.
    rows: Range<usize>,
    change: &'a mut [u16],
}

impl WithSimd for ColorChange<'_> {
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
            // The row above now has all its neighbours; the last row is its own neighbour.
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

/// Moves the average of each pixel towards the new inverse depth, and outputs it in metres.
struct UpdateMean<'a> {
    inverse: &'a [f32],
    mean: &'a mut [f32],
    count: &'a mut [f32],
    held: &'a mut [u8],
    change: &'a [u16],
    /// Largest change of colour of a static pixel.
    moved: f32,
    limits: Limits,
    metres: &'a mut [f32],
    focus_m: f32,
}

impl WithSimd for UpdateMean<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { inverse, mean, count, held, change, moved, limits, metres, focus_m } = self;
        let (per_moved, per_noise) = (1.0 / moved, 1.0 / limits.noise);
        let state = mean.iter_mut().zip(count).zip(held).zip(change);
        for ((&inverse, metres), (((mean, count), held), &change)) in inverse.iter().zip(metres).zip(state) {
            // Weight of the past: 1 up to the bound, falling to 0 at twice the bound.
            let past_weight = saturate(2.0 - mean_per_pixel(change) * per_moved);
            let step = inverse - *mean;
            let noise_ratio = saturate(step.abs() * per_noise);
            let changed = noise_ratio >= 1.0;
            let hold = (step.abs() > limits.depth_step) & (past_weight >= 1.0) & (*held < HOLD_FRAMES);
            let frames = *count * past_weight;
            // The closer to the limit, the less likely it is noise: the weight of the new depth grows smoothly to 1
            // there.
            let squared = noise_ratio * noise_ratio;
            let alpha = 1.0 / (frames + 1.0);
            let alpha = alpha + (1.0 - alpha) * squared * squared;
            let v = if hold { *mean } else { *mean + alpha * step };
            let longer = frames + 1.0;
            let longer = if longer < MAX_FRAMES { longer } else { MAX_FRAMES };
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

/// Clamps `x` to 0 to 1.
#[inline(always)]
fn saturate(x: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < 1.0 { x } else { 1.0 }
}
