//! Decides between two surfaces by the colours around a pixel.

use std::array;

use pulp::WithSimd;

use super::guide::Channels;
use super::jumps::{NONE, SURFACE};

/// Pixels that are decided at once.
pub const LANES: usize = 16;
/// Samples are this far apart in px, and up to [`REACH`] times as far away across and down: beyond what is in doubt.
const SPACING_PX: usize = 5;
const REACH: usize = 2;
/// Colours that differ by this much, in 8-bit codes summed over three channels, are not alike at all: a kernel of
/// [`WIDTH`] less the difference.
const WIDTH: u16 = 90;
/// A sample counts this often, but only once where it lies on the nearer side of a jump and so is in doubt itself.
const TRUST: u16 = 3;
/// Of any surface, this share of the pixels has any colour: what has a colour of neither stays as it is.
const OUTLIERS: f32 = 0.1;
/// How many times likelier the farther surface must be for a pixel of the nearer one, with colour and without: many
/// things have the same grey, and there little but the outermost of what is fat is taken away.
const FARTHER: [f32; 2] = [1.6, 4.0];
/// How many times likelier the nearer surface must be for a pixel of the farther one.
const NEARER: f32 = 1.35;

/// Decides the pixels of a row.
pub struct Row<'a> {
    /// Disparities of all rows.
    pub found: &'a [u16],
    /// Those beyond the nearest jump, or [`NONE`].
    pub others: &'a [u16],
    pub guide: Channels<'a>,
    pub width: usize,
    pub y: usize,
    pub out: &'a mut [u16],
}

/// What is sampled of a row.
#[derive(Clone, Copy)]
struct Samples<'a> {
    found: &'a [u16],
    others: &'a [u16],
    channels: [&'a [u8]; 3],
}

impl WithSimd for Row<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(mut self, _: S) {
        let Self { found, others, guide, width, y, .. } = self;
        let height = found.len() / width;
        let samples = |y: usize| {
            let pixels = y * width..(y + 1) * width;
            Samples { found: &found[pixels.clone()], others: &others[pixels], channels: guide.row(y) }
        };
        let here = samples(y);
        let around: [_; 2 * REACH + 1] = array::from_fn(|row| {
            let y = (y + SPACING_PX * row).checked_sub(SPACING_PX * REACH).filter(|&y| y < height);
            y.map(samples)
        });
        let mut x = 0;
        while x < width {
            let ahead = &here.others[x..(x + LANES).min(width)];
            // The least, not a search: vector code tells the many places apart where there is nothing to decide.
            if ahead.iter().fold(NONE, |least, &other| least.min(other)) == NONE {
                x += LANES;
                continue;
            }
            let next = ahead.iter().take_while(|&&other| other == NONE).count();
            // The last ones begin earlier: pixels may be decided twice.
            let first = (x + next).min(width - LANES);
            self.decide(first, here, &around);
            x = first + LANES;
        }
    }
}

impl Row<'_> {
    /// Decides the pixels from `first` on.
    #[inline(always)]
    fn decide(&mut self, first: usize, here: Samples, around: &[Option<Samples>]) {
        let (own, other) = (lanes(here.found, first), lanes(here.others, first));
        let [red, green, blue] = here.channels;
        let here = [lanes(red, first), lanes(green, first), lanes(blue, first)];
        let (mut alike, mut count) = ([[0u16; LANES]; 2], [[0u16; LANES]; 2]);
        for row in around.iter().flatten() {
            let [red, green, blue] = row.channels;
            for column in 0..=2 * REACH {
                let Some(x) = (first + SPACING_PX * column).checked_sub(SPACING_PX * REACH) else { continue };
                if x + LANES > self.width {
                    continue;
                }
                let (sample, beyond) = (lanes(row.found, x), lanes(row.others, x));
                let there = [lanes(red, x), lanes(green, x), lanes(blue, x)];
                for k in 0..LANES {
                    let difference = apart(here[0][k].into(), there[0][k].into())
                        + apart(here[1][k].into(), there[1][k].into())
                        + apart(here[2][k].into(), there[2][k].into());
                    let kernel = WIDTH.saturating_sub(difference);
                    let trust = if beyond[k] < sample[k] { 1 } else { TRUST };
                    let (from_own, from_other) = (apart(sample[k], own[k]), apart(sample[k], other[k]));
                    let is_own = (from_own < from_other) & (from_own <= SURFACE);
                    let is_other = (from_other < from_own) & (from_other <= SURFACE);
                    let (of_own, of_other) = (if is_own { trust } else { 0 }, if is_other { trust } else { 0 });
                    alike[0][k] += of_own * kernel;
                    alike[1][k] += of_other * kernel;
                    count[0][k] += of_own;
                    count[1][k] += of_other;
                }
            }
        }
        let farther = FARTHER[usize::from(!self.guide.is_color)];
        let mut decided = own;
        for k in 0..LANES {
            let ratio = if own[k] > other[k] { farther } else { NEARER };
            // Times the other's count instead of over the own one: the ratio is what counts.
            let likelihood = |surface: usize| {
                let outliers = OUTLIERS * f32::from(WIDTH) * f32::from(count[surface][k]);
                (f32::from(alike[surface][k]) + outliers) * f32::from(count[1 - surface][k])
            };
            // Without samples of either, both are 0.
            let changes = (other[k] != NONE) & (likelihood(1) > ratio * likelihood(0));
            decided[k] = if changes { other[k] } else { own[k] };
        }
        self.out[first..first + LANES].copy_from_slice(&decided);
    }
}

/// Not `abs_diff`, which is computed in 32 bits.
#[inline(always)]
fn apart(a: u16, b: u16) -> u16 {
    a.max(b) - a.min(b)
}

/// [`LANES`] values from `first` on.
#[inline(always)]
fn lanes<T: Copy>(row: &[T], first: usize) -> [T; LANES] {
    *row[first..].first_chunk().expect("chunks lie within rows")
}
