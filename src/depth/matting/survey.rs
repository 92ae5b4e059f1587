//! The pixels beside jumps of depth.

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::share::Labels;
use super::{EdgePixel, larger, smaller};
use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;
use crate::depth::bits::{Bits, WORD, places};
use crate::frame::DepthMap;

/// Finds them; owns the memory for it.
#[derive(Debug, Default)]
pub struct Survey(Vec<Band>);

/// What is found in a band, and what that needs.
#[derive(Debug, Default)]
struct Band {
    edges: Vec<EdgePixel>,
    /// Inverse depth of three rows, in 1/m, 0 where it is unknown; their highest and lowest, with a column more on either side.
    rows: [Vec<f32>; 3],
    ranges: [Vec<f32>; 2],
    /// Whether each pixel of a row is an edge: 1, or else 0, up to a whole word.
    found: Vec<u8>,
}

impl Survey {
    /// Replaces `edges` by the pixels of a map that differ by more than `jump` from one of their eight neighbours, row by row,
    /// and marks them.
    pub fn find(
        &mut self,
        (arch, workers): (Arch, &mut ThreadPool),
        map: &DepthMap,
        jump: f32,
        (at_edge, edges): (&mut Bits, &mut Vec<EdgePixel>),
    ) {
        let (width, height) = (map.width as usize, map.height as usize);
        at_edge.resize((width, height));
        let (words, across) = at_edge.words();
        let bands = Bands::new(height, 1, workers);
        let found = &mut self.0;
        found.resize_with(bands.rows().count(), Band::default);
        let parts = bands.rows().zip(bands.split(words, across)).zip(&mut *found);
        workers.run_each(parts, &|((of_band, words), band)| {
            arch.dispatch(FindEdges { map, jump, of_band, words, across, band });
        });
        edges.clear();
        found.iter().for_each(|band| edges.extend_from_slice(&band.edges));
    }
}

/// Finds the edges of a band of rows.
struct FindEdges<'a> {
    map: &'a DepthMap,
    jump: f32,
    of_band: Range<usize>,
    /// Marks for its pixels, so many words for a row.
    words: &'a mut [u64],
    across: usize,
    band: &'a mut Band,
}

impl WithSimd for FindEdges<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { map, jump, of_band, words, across, band } = self;
        let Band { edges, rows, ranges: [high, low], found } = band;
        let (width, height) = (map.width as usize, map.height as usize);
        edges.clear();
        rows.iter_mut().for_each(|row| row.resize(width, 0.0));
        for range in [&mut *high, &mut *low] {
            range.resize(width + 2, 0.0);
        }
        found.clear();
        found.resize(width.next_multiple_of(WORD), 0);
        let first = of_band.start;
        for y in of_band {
            // The row below is new; before the first one, that itself is, too, and the one above.
            for y in (if y == first { y.saturating_sub(1) } else { y + 1 })..(y + 2).min(height) {
                for (inverse, &metres) in rows[y % 3].iter_mut().zip(&map.metres[y * width..][..width]) {
                    *inverse = DepthMap::inverse_of(metres);
                }
            }
            let row = |y: usize| &rows[y % 3][..width];
            let (above, here, below) = (row(y.saturating_sub(1)), row(y), row((y + 1).min(height - 1)));
            let (most, least) = (&mut high[1..=width], &mut low[1..=width]);
            for x in 0..width {
                most[x] = larger(larger(above[x], here[x]), below[x]);
                least[x] = smaller(smaller(above[x], here[x]), below[x]);
            }
            for range in [&mut *high, &mut *low] {
                (range[0], range[width + 1]) = (range[1], range[width]);
            }
            let [left, middle, right] = [0, 1, 2].map(|by| (&high[by..][..width], &low[by..][..width]));
            let around = |x: usize| {
                let near = larger(larger(left.0[x], middle.0[x]), right.0[x]);
                [near, smaller(smaller(left.1[x], middle.1[x]), right.1[x])]
            };
            for (x, found) in found[..width].iter_mut().enumerate() {
                let [near, far] = around(x);
                *found = u8::from(near - far > jump);
            }
            let words = &mut words[(y - first) * across..][..across];
            for ((word, found), begin) in words.iter_mut().zip(found.as_chunks().0).zip((0..).step_by(WORD)) {
                *word = word_of(found);
                for x in places(*word).map(|place| begin + place) {
                    let [near, far] = around(x);
                    let mut edge = EdgePixel { x: x as u32, y: y as u32, near, far, labels: Labels::default() };
                    edge.labels = labels(&edge, rows, (width, height));
                    edges.push(edge);
                }
            }
        }
    }
}

/// The bits of bytes that are 1 or 0.
#[inline(always)]
fn word_of(bytes: &[u8; WORD]) -> u64 {
    // `|` instead of an early exit, so that it becomes vector code: mostly there are none.
    if bytes.iter().fold(0, |any, byte| any | byte) == 0 {
        return 0;
    }
    let mut word = 0;
    for (k, bytes) in bytes.as_chunks().0.iter().enumerate() {
        // The product has the sum of all bytes, each moved to a bit of its own, in its highest byte.
        word |= (u64::from_le_bytes(*bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * k);
    }
    word
}

/// What the map says of an edge pixel, by the inverse depth of its row and those beside it.
#[inline(always)]
fn labels(edge: &EdgePixel, rows: &[Vec<f32>; 3], (width, height): (usize, usize)) -> Labels {
    let (x, y) = (edge.x as usize, edge.y as usize);
    let middle = edge.middle();
    let is_near = rows[y % 3][x] > middle;
    // No branches; what is beyond the picture is left out of both.
    let columns = [(x.saturating_sub(1), x > 0), (x, true), ((x + 1).min(width - 1), x + 1 < width)];
    let ys = [(y.saturating_sub(1), y > 0), (y, true), ((y + 1).min(height - 1), y + 1 < height)];
    let (mut borders, mut alike) = (false, 0);
    for j in 0..3 {
        let row = &rows[ys[j].0 % 3];
        for i in 0..3 {
            let is_alike = (row[columns[i].0] > middle) == is_near;
            alike += u32::from(is_alike & columns[i].1 & ys[j].1);
            borders |= !is_alike & (i == 1 || j == 1);
        }
    }
    // Itself, and two neighbours in a row.
    Labels { is_near, borders, is_thin: is_near && alike <= 3 }
}
