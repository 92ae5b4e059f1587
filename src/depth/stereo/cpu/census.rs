//! The census transform: of each pixel, which of its neighbours are darker.
//!
//! Zabih and Woodfill, *Non-parametric local transforms for computing visual correspondence*, ECCV 1994. Neighbours are
//! every other pixel of a 9x9 window: 24 bits say as much as all 80, and a wide window tells more than a dense one. The
//! number of bits that differ compares two pixels whatever the exposure of the eyes.

use std::sync::atomic::AtomicBool;

use pulp::{Arch, WithSimd};

use crate::compute::thread_pool::{DisjointParts, ThreadPool};

/// Bits of a pixel.
const BITS: usize = 24;
/// The bits as bytes, each in a plane of its own.
pub const PLANES: usize = BITS / 8;
/// Columns and rows from a pixel to its outermost neighbours.
pub const REACH: usize = 4;

/// Column and row of the neighbour of bit `bit`, from the corner of the window.
const fn neighbour(bit: usize) -> (usize, usize) {
    // The middle one of the 25 is the pixel itself.
    let cell = if bit < BITS / 2 { bit } else { bit + 1 };
    (cell % 5 * 2, cell / 5 * 2)
}

/// The bits of every pixel of a picture.
pub struct Census {
    width: usize,
    height: usize,
    /// Whether columns run from the right to the left.
    mirrored: bool,
    /// The picture with a border of [`REACH`] in which the outermost pixels repeat.
    padded: Vec<u8>,
    /// `[row][plane][stride]`.
    codes: Vec<u8>,
    stride: usize,
}

impl Census {
    /// For pictures of this size; each row of codes is followed by `after` columns without meaning.
    pub fn new((width, height): (usize, usize), mirrored: bool, after: usize) -> Self {
        let stride = width + after;
        Self {
            width,
            height,
            mirrored,
            padded: vec![0; (width + 2 * REACH) * (height + 2 * REACH)],
            codes: vec![0; stride * PLANES * height],
            stride,
        }
    }

    /// Computes the census transform of `luma`, rows in parallel; `taken` has a flag for every row and border row, as
    /// each is written by one thread.
    pub fn compute(&mut self, luma: &[u8], workers: &mut ThreadPool, arch: Arch, taken: &mut [AtomicBool]) {
        let Self { width, height, mirrored, stride, .. } = *self;
        let padded_stride = width + 2 * REACH;
        let rows = DisjointParts::new(&mut self.padded, padded_stride, taken);
        workers.run(height + 2 * REACH, &|row| {
            let y = row.saturating_sub(REACH).min(height - 1);
            pad(&luma[y * width..(y + 1) * width], mirrored, rows.part(row));
        });
        let padded = &*self.padded;
        let codes = DisjointParts::new(&mut self.codes, stride * PLANES, taken);
        workers.run(height, &|y| {
            let window = &padded[y * padded_stride..(y + 2 * REACH + 1) * padded_stride];
            arch.dispatch(Row { window, width, mirrored, out: codes.part(y) });
        });
    }

    /// The codes of row `y`, plane by plane.
    pub fn row(&self, y: usize) -> [&[u8]; PLANES] {
        let mut planes = [&[][..]; PLANES];
        for (plane, codes) in planes.iter_mut().zip(self.codes[y * self.stride * PLANES..].chunks_exact(self.stride)) {
            *plane = codes;
        }
        planes
    }
}

/// Copies a row, reversed if `mirrored`, between borders that repeat its ends.
fn pad(row: &[u8], mirrored: bool, padded: &mut [u8]) {
    let (width, end) = (row.len(), row.len() + REACH);
    padded[REACH..end].copy_from_slice(row);
    if mirrored {
        padded[REACH..end].reverse();
    }
    let (first, last) = (padded[REACH], padded[REACH + width - 1]);
    padded[..REACH].fill(first);
    padded[end..].fill(last);
}

/// The codes of one row, plane by plane.
struct Row<'a> {
    /// `2 * REACH + 1` padded rows.
    window: &'a [u8],
    width: usize,
    mirrored: bool,
    out: &'a mut [u8],
}

impl WithSimd for Row<'_> {
    type Output = ();
    #[inline(always)]
    // No vectors by hand: the call lets the compiler make them of these loops, as wide as the processor has them.
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { window, width, mirrored, out } = self;
        let stride = width + 2 * REACH;
        let center = &window[REACH * stride + REACH..][..width];
        for (plane, out) in out.chunks_exact_mut(out.len() / PLANES).enumerate() {
            let out = &mut out[..width];
            out.fill(0);
            for bit in 0..8 {
                let (column, row) = neighbour(plane * 8 + bit);
                // A mirrored row has its neighbours mirrored back, so that bits of both pictures mean the same.
                let column = if mirrored { 2 * REACH - column } else { column };
                let beside = &window[row * stride + column..][..width];
                for ((code, &beside), &center) in out.iter_mut().zip(beside).zip(center) {
                    *code |= u8::from(beside < center) << bit;
                }
            }
        }
    }
}
