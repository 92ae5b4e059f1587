//! Post-processing of an executor's result: fills mismatches, the left border and empty rows, corrects foreground
//! fattening, and removes the remaining outliers with a 3x3 median.

use std::sync::atomic::AtomicBool;

use pulp::{Arch, WithSimd};

use super::color_similarity::{ColorSimilarity, Colors};
use super::fattening::FatteningCorrection;
use super::fixed::{FILLED, ONE};
use super::gaps;
use super::mismatches::MismatchFiller;
use crate::compute::thread_pool::{DisjointParts, ThreadPool};

/// Post-processes maps of one size; owns its buffers.
pub struct PostProcessor {
    width: usize,
    mismatches: MismatchFiller,
    similarity: ColorSimilarity,
    fattening: FatteningCorrection,
    /// The median of the filled map.
    smooth: Vec<u16>,
    /// A flag per row, with which [`DisjointParts`] ensures that only one thread writes it.
    taken: Vec<AtomicBool>,
    arch: Arch,
}

impl PostProcessor {
    /// Allocates for maps of this size.
    pub fn new((width, height): (usize, usize)) -> Self {
        Self {
            width,
            mismatches: MismatchFiller::new((width, height)),
            similarity: ColorSimilarity::default(),
            fattening: FatteningCorrection::new((width, height)),
            smooth: vec![0; width * height],
            taken: std::iter::repeat_with(AtomicBool::default).take(height).collect(),
            arch: Arch::new(),
        }
    }

    /// Fills unknown pixels of `map`, whose left picture is `luma`, and writes its 3x3 median to `px`, in pixels, above
    /// 0.
    pub fn postprocess(
        &mut self,
        map: &mut [u16],
        luma: &[u8],
        colors: Option<Colors>,
        workers: &mut ThreadPool,
        px: &mut [f32],
    ) {
        let Self { width, mismatches, similarity, fattening, smooth, taken, arch } = self;
        let (width, arch) = (*width, *arch);
        mismatches.fill(map, luma);
        if let Some(colors) = colors {
            similarity.correct(map, width, mismatches.first_known_columns(), colors);
        }
        // Paths with too large changes of brightness have reached no pixel.
        for (row, &first) in map.chunks_exact_mut(width).zip(mismatches.first_known_columns()) {
            gaps::fill_row(&mut row[..=first], 0);
        }
        gaps::fill_empty_rows(map, width);
        // The first median removes outliers, which have no colour edge; the second smooths the per-pixel decisions.
        median_filter(map, width, (workers, arch), taken, smooth, |fixed| fixed);
        fattening.correct(smooth, map, luma, colors, workers);
        median_filter(map, width, (workers, arch), taken, px, fixed_to_px);
    }
}

/// Writes the 3x3 median of each pixel of `map` to `out`, converted by `to`.
fn median_filter<T: Send>(
    map: &[u16],
    width: usize,
    (workers, arch): (&mut ThreadPool, Arch),
    taken: &mut [AtomicBool],
    out: &mut [T],
    to: impl Fn(u16) -> T + Copy + Sync,
) {
    let height = map.len() / width;
    let out = DisjointParts::new(out, width, taken);
    workers.run(height, &|y| {
        let row = |y: usize| &map[y * width..(y + 1) * width];
        let rows = [row(y.saturating_sub(1)), row(y), row((y + 1).min(height - 1))];
        arch.dispatch(Median { rows, out: out.part(y), to });
    });
}

/// Computes the median of three rows and columns; beyond the border the outermost pixels repeat.
struct Median<'a, T, F> {
    rows: [&'a [u16]; 3],
    out: &'a mut [T],
    to: F,
}

impl<T, F: Fn(u16) -> T> WithSimd for Median<'_, T, F> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { rows: [above, here, below], out, to } = self;
        let width = out.len();
        let at = |x: usize| {
            let (before, after) = (x.saturating_sub(1), (x + 1).min(width - 1));
            let mut nine = [0; 9];
            for (k, row) in [above, here, below].into_iter().enumerate() {
                (nine[3 * k], nine[3 * k + 1], nine[3 * k + 2]) = (row[before], row[x], row[after]);
            }
            to(median_of_disparities(nine))
        };
        (out[0], out[width - 1]) = (at(0), at(width - 1));
        if width < 3 {
            return;
        }
        // Slices of equal length need no bounds checks, so that this loop becomes vector code.
        let inner = width - 2;
        let (above, here, below) =
            (shifted_columns(above, inner), shifted_columns(here, inner), shifted_columns(below, inner));
        for (x, out) in out[1..=inner].iter_mut().enumerate() {
            *out = to(median_of_disparities([
                above[0][x],
                above[1][x],
                above[2][x],
                here[0][x],
                here[1][x],
                here[2][x],
                below[0][x],
                below[1][x],
                below[2][x],
            ]));
        }
    }
}

/// Returns `row` from its first, second and third column on: the left neighbours, pixels and right neighbours of
/// `length` inner pixels.
#[inline(always)]
fn shifted_columns(row: &[u16], length: usize) -> [&[u16]; 3] {
    [&row[..length], &row[1..=length], &row[2..length + 2]]
}

/// Returns the median of nine disparities, ignoring the mark of filled ones.
#[inline(always)]
fn median_of_disparities(nine: [u16; 9]) -> u16 {
    median_of_nine(nine.map(|d| d & !FILLED))
}

/// Converts fixed point to pixels, above 0: 0 would mean unknown, and a disparity of 0 is known.
#[inline(always)]
fn fixed_to_px(fixed: u16) -> f32 {
    f32::from(if fixed > 1 { fixed } else { 1 }) / f32::from(ONE)
}

/// Returns the median of nine with 19 exchanges (Paeth, *Median finding on a 3x3 grid*, Graphics Gems, 1990).
#[inline(always)]
fn median_of_nine(nine: [u16; 9]) -> u16 {
    let [mut a, mut b, mut c, mut d, mut e, mut f, mut g, mut h, mut i] = nine;
    // Unrolled: a loop over indices would not become vector code.
    macro_rules! exchange {
        ($($low:ident $high:ident),*) => {
            $(($low, $high) = ($low.min($high), $low.max($high));)*
        };
    }
    exchange!(b c, e f, h i, a b, d e, g h, b c, e f, h i, a d, f i, e h, d g, b e, c f, e h, e c, g e, e c);
    let _ = (a, b, c, d, f, g, h, i);
    e
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_the_fifth() {
        let mut state = 1u32;
        for _ in 0..2000 {
            let nine: [u16; 9] = std::array::from_fn(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 24) as u16 % 12
            });
            let mut sorted = nine;
            sorted.sort_unstable();
            assert_eq!(median_of_nine(nine), sorted[4], "{nine:?}");
        }
    }
}
