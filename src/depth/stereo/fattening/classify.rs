//! Classifies a pixel as one of two surfaces by a kernel density estimate of the colours around it.

use std::array;

use pulp::WithSimd;

use super::discontinuities::{NO_OTHER_SIDE, SAME_SURFACE};
use super::guide::Channels;

/// Number of pixels classified at once.
pub const LANES: usize = 16;
/// Samples lie on a grid with this spacing in px, up to [`RADIUS_STEPS`] times as far away across and down: beyond the
/// uncertain pixels.
const SPACING_PX: usize = 5;
const RADIUS_STEPS: usize = 2;
/// Half-width of the triangular kernel: colours that differ by more, in 8-bit codes summed over three channels, have
/// weight 0.
const KERNEL_WIDTH: u16 = 90;
/// Weight of a sample, but 1 if it lies on the nearer side of a discontinuity and so is itself uncertain.
const CERTAIN_WEIGHT: u16 = 3;
/// Uniform probability of outliers on any surface: a pixel with a colour of neither surface is not changed.
const OUTLIERS: f32 = 0.1;
/// Required likelihood ratio to move a pixel from the nearer to the farther surface, with colour and without: many
/// objects have the same grey, so that without colour little but the outermost pixels is corrected.
const FARTHER_RATIO: [f32; 2] = [1.6, 4.0];
/// Required likelihood ratio to move a pixel from the farther to the nearer surface.
const NEARER_RATIO: f32 = 1.35;

/// Classifies the pixels of a row.
pub struct ClassifyRow<'a> {
    /// Disparities of all rows.
    pub found: &'a [u16],
    /// Disparities beyond the nearest discontinuity, or [`NO_OTHER_SIDE`].
    pub other_sides: &'a [u16],
    pub guide: Channels<'a>,
    pub width: usize,
    pub y: usize,
    pub out: &'a mut [u16],
}

/// One row of the inputs.
#[derive(Clone, Copy)]
struct Samples<'a> {
    found: &'a [u16],
    other_sides: &'a [u16],
    channels: [&'a [u8]; 3],
}

impl WithSimd for ClassifyRow<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(mut self, _: S) {
        let Self { found, other_sides, guide, width, y, .. } = self;
        let height = found.len() / width;
        let samples = |y: usize| {
            let pixels = y * width..(y + 1) * width;
            Samples { found: &found[pixels.clone()], other_sides: &other_sides[pixels], channels: guide.row(y) }
        };
        let here = samples(y);
        let around: [_; 2 * RADIUS_STEPS + 1] = array::from_fn(|row| {
            let y = (y + SPACING_PX * row).checked_sub(SPACING_PX * RADIUS_STEPS).filter(|&y| y < height);
            y.map(samples)
        });
        let mut x = 0;
        while x < width {
            let ahead = &here.other_sides[x..(x + LANES).min(width)];
            // A minimum instead of a search: it is vector code, and skips most of the row.
            if ahead.iter().fold(NO_OTHER_SIDE, |least, &other| least.min(other)) == NO_OTHER_SIDE {
                x += LANES;
                continue;
            }
            let next = ahead.iter().take_while(|&&other| other == NO_OTHER_SIDE).count();
            // The last lanes begin earlier: some pixels are classified twice.
            let first = (x + next).min(width - LANES);
            self.classify_lanes(first, here, &around);
            x = first + LANES;
        }
    }
}

impl ClassifyRow<'_> {
    /// Classifies [`LANES`] pixels from `first` on.
    #[inline(always)]
    fn classify_lanes(&mut self, first: usize, here: Samples, around: &[Option<Samples>]) {
        let (own, other) = (load_lanes(here.found, first), load_lanes(here.other_sides, first));
        let [red, green, blue] = here.channels;
        let here = [load_lanes(red, first), load_lanes(green, first), load_lanes(blue, first)];
        let (mut density, mut total_weight) = ([[0u16; LANES]; 2], [[0u16; LANES]; 2]);
        for row in around.iter().flatten() {
            let [red, green, blue] = row.channels;
            for column in 0..=2 * RADIUS_STEPS {
                let Some(x) = (first + SPACING_PX * column).checked_sub(SPACING_PX * RADIUS_STEPS) else { continue };
                if x + LANES > self.width {
                    continue;
                }
                let (sample, beyond) = (load_lanes(row.found, x), load_lanes(row.other_sides, x));
                let there = [load_lanes(red, x), load_lanes(green, x), load_lanes(blue, x)];
                for k in 0..LANES {
                    let difference = abs_diff(here[0][k].into(), there[0][k].into())
                        + abs_diff(here[1][k].into(), there[1][k].into())
                        + abs_diff(here[2][k].into(), there[2][k].into());
                    let kernel = KERNEL_WIDTH.saturating_sub(difference);
                    let weight = if beyond[k] < sample[k] { 1 } else { CERTAIN_WEIGHT };
                    let (from_own, from_other) = (abs_diff(sample[k], own[k]), abs_diff(sample[k], other[k]));
                    let is_own = (from_own < from_other) & (from_own <= SAME_SURFACE);
                    let is_other = (from_other < from_own) & (from_other <= SAME_SURFACE);
                    let (of_own, of_other) = (if is_own { weight } else { 0 }, if is_other { weight } else { 0 });
                    density[0][k] += of_own * kernel;
                    density[1][k] += of_other * kernel;
                    total_weight[0][k] += of_own;
                    total_weight[1][k] += of_other;
                }
            }
        }
        let farther = FARTHER_RATIO[usize::from(!self.guide.is_color)];
        let mut decided = own;
        for k in 0..LANES {
            let ratio = if own[k] > other[k] { farther } else { NEARER_RATIO };
            // Both likelihoods are multiplied by both counts instead of divided by their own: only the ratio matters.
            let likelihood = |surface: usize| {
                let outliers = OUTLIERS * f32::from(KERNEL_WIDTH) * f32::from(total_weight[surface][k]);
                (f32::from(density[surface][k]) + outliers) * f32::from(total_weight[1 - surface][k])
            };
            // Without samples of one surface, both are 0.
            let changes = (other[k] != NO_OTHER_SIDE) & (likelihood(1) > ratio * likelihood(0));
            decided[k] = if changes { other[k] } else { own[k] };
        }
        self.out[first..first + LANES].copy_from_slice(&decided);
    }
}

/// Returns `|a - b|`. Not `abs_diff`, which is computed in 32 bits.
#[inline(always)]
fn abs_diff(a: u16, b: u16) -> u16 {
    a.max(b) - a.min(b)
}

/// Returns [`LANES`] values from `first` on.
#[inline(always)]
fn load_lanes<T: Copy>(row: &[T], first: usize) -> [T; LANES] {
    *row[first..].first_chunk().expect("chunks lie within rows")
}
