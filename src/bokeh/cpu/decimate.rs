//! Pass `decimate`: averages the colours of a bin over larger cells, with tents, and interpolates between them. What a cell
//! has averaged no filter can bring back ([`Settings::privacy`](crate::bokeh::Settings)). Coverage, which shows no more
//! than outlines, stays as it is.
//!
//! twin: shaders/blur/decimate.wgsl, shaders/blur/interpolate.wgsl

#![allow(clippy::needless_range_loop)] // Planes and columns index several arrays at once.

use std::sync::atomic::AtomicBool;

use pulp::{Arch, Simd, WithSimd};

use super::ThreadScratch;
use super::rows::{PlanarRows, STRIP, Strips, repeat_edges};
use crate::bokeh::plan::{Bin, CELL_SHARPNESS, Plan};
use crate::compute::simd::{fma, load, store};
use crate::compute::thread_pool::{DisjointParts, ThreadPool};

/// Rows of cells of a part of the pass.
const PART_ROWS: usize = 8;
/// Weight below which a colour has none, which avoids a division by 0.
const MIN_WEIGHT: f32 = 1e-20;

/// The colours of a bin, decimated.
pub struct Decimated {
    /// Mean colour and weight of each cell, `[row][column]`.
    means: Vec<[f32; 4]>,
    /// Rows of cells, with columns interpolated: weighted colours, and the weight.
    rows: PlanarRows<4>,
    /// Cells across and down.
    cells: [Cells; 2],
}

/// The cells along one axis.
#[derive(Clone, Copy)]
struct Cells {
    /// Bin pixels of a cell.
    size: usize,
    /// Bin pixels of the first cell that lie before the bin.
    phase: usize,
    count: usize,
    /// Bin pixels along the axis.
    length: usize,
}

impl Cells {
    fn new(size: usize, phase: usize, length: usize) -> Self {
        Self { size, phase, count: (length + phase).div_ceil(size), length }
    }

    /// Returns the bin pixels that count in a cell, and their weights: a tent, of sum 1. Outside the bin, the outermost
    /// pixels repeat.
    #[inline(always)]
    fn tent(self, cell: usize) -> impl Iterator<Item = (usize, f32)> {
        let count = 2 * self.size - self.size % 2;
        let first = (cell * self.size) as isize - (self.phase + self.size / 2) as isize;
        let (last, scale) = (self.length as isize - 1, 1.0 / (self.size * self.size) as f32);
        (0..count).map(move |k| {
            let to_middle = (2 * k + 1).abs_diff(count) as f32 * 0.5;
            ((first + k as isize).clamp(0, last) as usize, (self.size as f32 - to_middle) * scale)
        })
    }

    /// Returns the two cells between whose middles a bin pixel lies, and the weight of the second.
    #[inline(always)]
    fn around(self, pixel: usize) -> ([usize; 2], f32) {
        // From the middle of the first cell, in halves of a bin pixel: in integers, bands agree with the whole picture.
        let halves = (2 * (pixel + self.phase) + 1).saturating_sub(self.size);
        let (first, fraction) = (halves / (2 * self.size), (halves % (2 * self.size)) as f32 / (2 * self.size) as f32);
        ([first, (first + 1).min(self.count - 1)], fraction)
    }
}

impl Decimated {
    /// Allocates for bins with at most `width` columns and `height` rows, and with `pad` columns on both sides; the
    /// system provides pages only as frames touch them.
    pub fn new(width: usize, height: usize, pad: usize) -> Self {
        // Cells are at least two pixels wide and high, and the first of a band may begin before it.
        let (across, down) = (width.div_ceil(2), height.div_ceil(2) + 1);
        Self {
            means: vec![[0.0; 4]; across * down],
            rows: PlanarRows::new(width.next_multiple_of(STRIP), down, pad),
            cells: [Cells::new(1, 0, 1); 2],
        }
    }

    /// Takes the shape of a bin.
    pub fn reshape(&mut self, plan: &Plan, bin: &Bin) {
        let phase = plan.first_row() / bin.scale % bin.decimation;
        self.cells = [Cells::new(bin.decimation, 0, bin.width), Cells::new(bin.decimation, phase, bin.height)];
    }

    /// Whether the bin whose shape it has is decimated.
    pub fn is_in_use(&self) -> bool {
        self.cells[0].size > 1
    }

    /// Decimates the content of a bin: each part is some rows of cells.
    pub fn run(
        &mut self,
        source: &Strips,
        (workers, scratch): (&mut ThreadPool, &mut [ThreadScratch]),
        arch: Arch,
        taken: &mut [AtomicBool],
    ) {
        let [across, down] = self.cells;
        let (cells, parts) = (self.cells, down.count.div_ceil(PART_ROWS));
        let means = &mut self.means[..across.count * down.count];
        let out = DisjointParts::new(means, PART_ROWS * across.count, taken);
        workers.run_with(scratch, parts, &|thread: &mut ThreadScratch, part| {
            let (out, scratch) = (out.part(part), &mut thread.decimate);
            arch.dispatch(AverageCells { source, cells, first: part * PART_ROWS, out, scratch });
        });
        let (stride, pad, row_len) = (self.rows.stride, self.rows.pad, self.rows.row_len());
        let rows = &mut self.rows.data[..down.count * row_len];
        let (means, out) = (&*means, DisjointParts::new(rows, PART_ROWS * row_len, taken));
        workers.run(parts, &|part| {
            let (first, out) = (part * PART_ROWS, out.part(part));
            arch.dispatch(InterpolateColumns { means, cells, first, out, stride, pad });
        });
    }

    /// Replaces the colours in row `y` of a strip, copied to `line` with `pad` columns on both sides
    /// ([`Strips::copy_line`]), by the decimated ones.
    #[inline(always)]
    pub fn recolor_line<S: Simd>(&self, simd: S, (strip, y): (usize, usize), pad: usize, line: &mut [f32]) {
        let ([above, below], fraction) = self.cells[1].around(y);
        let (above, below, fraction) = (self.rows.row(above), self.rows.row(below), simd.splat_f32s(fraction));
        let (span, first) = (STRIP + 2 * pad, strip * STRIP + self.rows.pad - pad);
        let floor = simd.splat_f32s(MIN_WEIGHT);
        for x in (0..span).step_by(S::F32_LANES) {
            let mut values = [floor; 4];
            for p in 0..4 {
                let at = p * self.rows.stride + first + x;
                let (above, below) = (load::<S>(above, at), load::<S>(below, at));
                values[p] = fma(simd, simd.sub_f32s(below, above), fraction, above);
            }
            let coverage = load::<S>(line, 3 * span + x);
            let factor = simd.div_f32s(coverage, simd.max_f32s(values[3], floor));
            for p in 0..3 {
                store::<S>(line, p * span + x, simd.mul_f32s(values[p], factor));
            }
        }
    }
}

/// Scratch memory of a thread.
pub struct DecimateScratch {
    /// Planes of the mean of some rows.
    planes: [Vec<f32>; 4],
    /// Same, pixel by pixel.
    pixels: Vec<[f32; 4]>,
}

impl DecimateScratch {
    /// Allocates for bins of at most `width` columns.
    pub fn new(width: usize) -> Self {
        let width = width.next_multiple_of(STRIP);
        Self { planes: std::array::from_fn(|_| vec![0.0; width]), pixels: vec![[0.0; 4]; width] }
    }
}

/// Averages a bin over some rows of cells, from number `first` on.
struct AverageCells<'a> {
    source: &'a Strips,
    cells: [Cells; 2],
    first: usize,
    /// Mean colour and weight of each cell.
    out: &'a mut [[f32; 4]],
    scratch: &'a mut DecimateScratch,
}

impl WithSimd for AverageCells<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let [across, down] = self.cells;
        let DecimateScratch { planes, pixels } = self.scratch;
        for (k, means) in self.out.chunks_exact_mut(across.count).enumerate() {
            average_rows(simd, self.source, down.tent(self.first + k), planes);
            for x in 0..across.length {
                pixels[x] = [planes[0][x], planes[1][x], planes[2][x], planes[3][x]];
            }
            for (cell, mean) in means.iter_mut().enumerate() {
                let mut sum = [0.0; 4];
                for (x, weight) in across.tent(cell) {
                    for p in 0..4 {
                        sum[p] += weight * pixels[x][p];
                    }
                }
                let inverse = 1.0 / sum[3].max(MIN_WEIGHT);
                *mean = [sum[0] * inverse, sum[1] * inverse, sum[2] * inverse, sum[3]];
            }
        }
    }
}

/// Averages rows of a bin, given with their weights.
#[inline(always)]
fn average_rows<S: Simd>(
    simd: S,
    source: &Strips,
    rows: impl Iterator<Item = (usize, f32)>,
    planes: &mut [Vec<f32>; 4],
) {
    for (k, (y, weight)) in rows.enumerate() {
        let weight = simd.splat_f32s(weight);
        for strip in 0..source.across {
            let row = source.row(strip, y);
            for (p, plane) in planes.iter_mut().enumerate() {
                for x in (0..STRIP).step_by(S::F32_LANES) {
                    let at = strip * STRIP + x;
                    let sum = if k == 0 { simd.splat_f32s(0.0) } else { load::<S>(plane, at) };
                    store::<S>(plane, at, fma(simd, load::<S>(row, p * STRIP + x), weight, sum));
                }
            }
        }
    }
}

/// Sharpens the colours of some rows of cells, from number `first` on, and interpolates them between columns.
struct InterpolateColumns<'a> {
    means: &'a [[f32; 4]],
    cells: [Cells; 2],
    first: usize,
    /// `[row][4][stride]`: weighted colour, and the weight.
    out: &'a mut [f32],
    stride: usize,
    pad: usize,
}

impl InterpolateColumns<'_> {
    /// Returns the sharpened colour of a cell times its weight, and its weight.
    #[inline(always)]
    fn sharpen(&self, x: usize, y: usize) -> [f32; 4] {
        let [across, down] = self.cells.map(|cells| cells.count);
        let own = self.means[y * across + x];
        let around = [
            (x > 0).then(|| self.means[y * across + x - 1]),
            (x + 1 < across).then(|| self.means[y * across + x + 1]),
            (y > 0).then(|| self.means[(y - 1) * across + x]),
            (y + 1 < down).then(|| self.means[(y + 1) * across + x]),
        ];
        let mut sharp = own;
        for other in around.into_iter().flatten() {
            for p in 0..3 {
                sharp[p] += CELL_SHARPNESS * other[3] * (own[p] - other[p]);
            }
        }
        [sharp[0] * own[3], sharp[1] * own[3], sharp[2] * own[3], own[3]]
    }
}

impl WithSimd for InterpolateColumns<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let (out, across) = (std::mem::take(&mut self.out), self.cells[0]);
        for (k, out) in out.chunks_exact_mut(4 * self.stride).enumerate() {
            let y = self.first + k;
            let mut between = ([usize::MAX; 2], [[0.0; 4]; 2]);
            for x in 0..across.length {
                let (cells, fraction) = across.around(x);
                if between.0 != cells {
                    between = (cells, cells.map(|cell| self.sharpen(cell, y)));
                }
                let [left, right] = between.1;
                for p in 0..4 {
                    out[p * self.stride + self.pad + x] = left[p] + fraction * (right[p] - left[p]);
                }
            }
            for plane in out.chunks_exact_mut(self.stride) {
                repeat_edges(plane, self.pad, across.length);
            }
        }
    }
}
