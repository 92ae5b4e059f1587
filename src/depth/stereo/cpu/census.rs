//! The census transform: for each pixel, which of its neighbours are darker (Zabih and Woodfill, *Non-parametric local
//! transforms for computing visual correspondence*, ECCV 1994).
//!
//! The neighbours are every other pixel of a 9x9 window: 24 bits are as informative as all 80, and a wide window is
//! more distinctive than a dense one. The Hamming distance of two codes is independent of the exposure of the cameras.
//!
//! twin: shaders/stereo/census.wgsl

use std::sync::atomic::AtomicBool;

use pulp::{Arch, WithSimd};

use crate::compute::thread_pool::{DisjointParts, ThreadPool};

/// Bits of a code.
const BITS: usize = 24;
/// Bytes of a code, each stored in a plane of its own.
pub const PLANES: usize = BITS / 8;
/// Radius of the window in pixels.
pub const RADIUS: usize = 4;

/// Returns column and row of the neighbour of bit `bit`, from the corner of the window.
const fn neighbour_offset(bit: usize) -> (usize, usize) {
    // The 13th of the 5x5 samples is the pixel itself.
    let cell = if bit < BITS / 2 { bit } else { bit + 1 };
    (cell % 5 * 2, cell / 5 * 2)
}

/// The census codes of a picture.
pub struct Census {
    width: usize,
    height: usize,
    /// Whether columns are stored from right to left.
    mirrored: bool,
    /// The picture with a border of [`RADIUS`] pixels that repeats the outermost ones.
    padded: Vec<u8>,
    /// `[row][plane][stride]`.
    codes: Vec<u8>,
    stride: usize,
}

impl Census {
    /// Allocates for pictures of this size; each row of codes is followed by `after` unused columns.
    pub fn new((width, height): (usize, usize), mirrored: bool, after: usize) -> Self {
        let stride = width + after;
        Self {
            width,
            height,
            mirrored,
            padded: vec![0; (width + 2 * RADIUS) * (height + 2 * RADIUS)],
            codes: vec![0; stride * PLANES * height],
            stride,
        }
    }

    /// Computes the census transform of `luma`, with rows in parallel; `taken` has a flag for every padded row, as only
    /// one thread may write it.
    pub fn compute(&mut self, luma: &[u8], workers: &mut ThreadPool, arch: Arch, taken: &mut [AtomicBool]) {
        let Self { width, height, mirrored, stride, .. } = *self;
        let padded_stride = width + 2 * RADIUS;
        let rows = DisjointParts::new(&mut self.padded, padded_stride, taken);
        workers.run(height + 2 * RADIUS, &|row| {
            let y = row.saturating_sub(RADIUS).min(height - 1);
            pad(&luma[y * width..(y + 1) * width], mirrored, rows.part(row));
        });
        let padded = &*self.padded;
        let codes = DisjointParts::new(&mut self.codes, stride * PLANES, taken);
        workers.run(height, &|y| {
            let window = &padded[y * padded_stride..(y + 2 * RADIUS + 1) * padded_stride];
            arch.dispatch(CensusRow { window, width, mirrored, out: codes.part(y) });
        });
    }

    /// Returns the codes of row `y`, plane by plane.
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
    let (width, end) = (row.len(), row.len() + RADIUS);
    padded[RADIUS..end].copy_from_slice(row);
    if mirrored {
        padded[RADIUS..end].reverse();
    }
    let (first, last) = (padded[RADIUS], padded[RADIUS + width - 1]);
    padded[..RADIUS].fill(first);
    padded[end..].fill(last);
}

/// Computes the codes of one row, plane by plane.
struct CensusRow<'a> {
    /// `2 * RADIUS + 1` padded rows.
    window: &'a [u8],
    width: usize,
    mirrored: bool,
    out: &'a mut [u8],
}

impl WithSimd for CensusRow<'_> {
    type Output = ();
    #[inline(always)]
    // No explicit vectors: the compiler vectorises these loops for the instruction set that `pulp` selects.
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { window, width, mirrored, out } = self;
        let stride = width + 2 * RADIUS;
        let center = &window[RADIUS * stride + RADIUS..][..width];
        for (plane, out) in out.chunks_exact_mut(out.len() / PLANES).enumerate() {
            let out = &mut out[..width];
            out.fill(0);
            for bit in 0..8 {
                let (column, row) = neighbour_offset(plane * 8 + bit);
                // In a mirrored row the neighbours are mirrored back, so that a bit means the same in both pictures.
                let column = if mirrored { 2 * RADIUS - column } else { column };
                let beside = &window[row * stride + column..][..width];
                for ((code, &beside), &center) in out.iter_mut().zip(beside).zip(center) {
                    *code |= u8::from(beside < center) << bit;
                }
            }
        }
    }
}
