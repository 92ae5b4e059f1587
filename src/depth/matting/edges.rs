//! Edge detection: pixels beside depth discontinuities.
//! twin: shaders/matte/find_edges.wgsl, matte/edges.wgsl

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use super::alpha::Labels;
use super::{EdgePixel, fast_max, fast_min};
use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;
use crate::depth::bitmap::{Bitmap, WORD, set_bits};
use crate::frame::DepthMap;

/// Finds edge pixels; owns the memory for it.
#[derive(Debug, Default)]
pub struct EdgeDetector(Vec<Band>);

/// Results and memory of one band of rows.
#[derive(Debug, Default)]
struct Band {
    edges: Vec<EdgePixel>,
    /// A ring buffer of three rows.
    rows: [Vec<Block>; 3],
}

/// [`WORD`] pixels of a row, with one more on either side.
#[derive(Clone, Copy, Debug)]
struct Block {
    /// Largest and smallest inverse depth in the block, in 1/m; 0 if unknown.
    near: f32,
    far: f32,
    /// Inverse depth of each pixel, computed on demand.
    inverse: Option<[f32; WIDE]>,
}

const WIDE: usize = WORD + 2;

impl EdgeDetector {
    /// Replaces `edges` by the pixels whose inverse depth varies by more than `depth_step` in their 3x3 neighbourhood,
    /// row by row, and marks them in `at_edge`.
    pub fn find_edges(
        &mut self,
        (arch, workers): (Arch, &mut ThreadPool),
        map: &DepthMap,
        depth_step: f32,
        at_edge: &mut Bitmap,
        edges: &mut Vec<EdgePixel>,
    ) {
        let (width, height) = (map.width as usize, map.height as usize);
        at_edge.resize((width, height));
        let (words, across) = at_edge.words();
        let bands = Bands::new(height, 1, workers);
        let found = &mut self.0;
        found.resize_with(bands.rows().count(), Band::default);
        let parts = bands.rows().zip(bands.split(words, across)).zip(&mut *found);
        workers.run_each(parts, &|((of_band, words), band)| {
            arch.dispatch(FindEdges { map, depth_step, of_band, words, across, band });
        });
        edges.clear();
        found.iter().for_each(|band| edges.extend_from_slice(&band.edges));
    }
}

/// Finds the edges of a band of rows.
struct FindEdges<'a> {
    map: &'a DepthMap,
    depth_step: f32,
    of_band: Range<usize>,
    /// Bitmap words of the band, `across` per row.
    words: &'a mut [u64],
    across: usize,
    band: &'a mut Band,
}

impl WithSimd for FindEdges<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { map, depth_step, of_band, words, across, band: Band { edges, rows } } = self;
        let (width, height) = (map.width as usize, map.height as usize);
        let metres = |y: usize| &map.metres[y * width..][..width];
        edges.clear();
        let first = of_band.start;
        for y in of_band {
            // Each row adds the one below; the first row of the band adds all three.
            for y in (if y == first { y.saturating_sub(1) } else { y + 1 })..(y + 2).min(height) {
                let row = &mut rows[y % 3];
                row.clear();
                for begin in (0..width).step_by(WORD) {
                    let [near, far] =
                        inverse_depth_range(simd, &metres(y)[begin.saturating_sub(1)..(begin + WORD + 1).min(width)]);
                    row.push(Block { near, far, inverse: None });
                }
            }
            let around = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
            let words = &mut words[(y - first) * across..][..across];
            words.fill(0);
            for (k, word) in words.iter_mut().enumerate().take(width.div_ceil(WORD)) {
                let (mut near, mut far) = (0.0, f32::INFINITY);
                for y in around {
                    let block = &rows[y % 3][k];
                    (near, far) = (fast_max(near, block.near), fast_min(far, block.far));
                }
                // Most blocks show one surface.
                if near - far <= depth_step {
                    continue;
                }
                let begin = k * WORD;
                let mut three = [[0.0; WIDE]; 3];
                for (own, y) in three.iter_mut().zip(around) {
                    *own = *rows[y % 3][k].inverse.get_or_insert_with(|| inverse_depths(metres(y), begin));
                }
                let (near, far) = neighbourhood_range(&three);
                let mut found = [0; WORD];
                for x in 0..WORD {
                    found[x] = u8::from(near[x] - far[x] > depth_step);
                }
                let there = !0 >> (WORD - (width - begin).min(WORD));
                *word = pack_bits(&found) & there;
                for place in set_bits(*word) {
                    let [x, y] = [(begin + place) as u32, y as u32];
                    let mut edge = EdgePixel { x, y, near: near[place], far: far[place], labels: Labels::default() };
                    let own = three[1][place + 1];
                    // If this pixel is the farther one, its own surface is the far one, even beside a third one behind
                    // it.
                    edge.far = if edge.near - own > depth_step { own } else { edge.far };
                    edge.labels = label_pixel(&edge, &three, place + 1, (width, height));
                    edges.push(edge);
                }
            }
        }
    }
}

/// Returns the largest and smallest inverse depth of some pixels, in 1/m.
#[inline(always)]
fn inverse_depth_range<S: Simd>(simd: S, metres: &[f32]) -> [f32; 2] {
    // Inverse depth decreases with depth, so one division per extreme is enough.
    let [least, most] = [DepthMap::MIN_M, DepthMap::MAX_M].map(|metres| simd.splat_f32s(metres));
    let [mut nearest, mut farthest] = [simd.splat_f32s(f32::INFINITY), simd.splat_f32s(0.0)];
    let (head, tail) = S::as_simd_f32s(metres);
    for &metres in head {
        let is_known =
            simd.and_m32s(simd.greater_than_or_equal_f32s(metres, least), simd.less_than_or_equal_f32s(metres, most));
        nearest = simd.min_f32s(nearest, simd.select_f32s(is_known, metres, nearest));
        // Unknown depth counts as infinite.
        farthest = simd.max_f32s(farthest, simd.select_f32s(is_known, metres, simd.splat_f32s(f32::INFINITY)));
    }
    let (mut nearest, mut farthest) = (simd.reduce_min_f32s(nearest), simd.reduce_max_f32s(farthest));
    for &metres in tail {
        let is_known = DepthMap::is_known(metres);
        nearest = fast_min(nearest, if is_known { metres } else { nearest });
        farthest = fast_max(farthest, if is_known { metres } else { f32::INFINITY });
    }
    [DepthMap::inverse_depth(nearest), DepthMap::inverse_depth(farthest)]
}

/// Returns the inverse depth of a block of a row and of one more pixel on either side, in 1/m; the border is
/// replicated.
#[inline(always)]
fn inverse_depths(metres: &[f32], begin: usize) -> [f32; WIDE] {
    let mut inverse = [0.0; WIDE];
    if begin > 0 && begin + WORD < metres.len() {
        inverse.copy_from_slice(&metres[begin - 1..][..WIDE]);
    } else {
        for (k, inverse) in inverse.iter_mut().enumerate() {
            *inverse = metres[(begin + k).saturating_sub(1).min(metres.len() - 1)];
        }
    }
    for inverse in &mut inverse {
        *inverse = DepthMap::inverse_depth(*inverse);
    }
    inverse
}

/// Returns the maximum and minimum inverse depth of each pixel's 3x3 neighbourhood, separably.
#[inline(always)]
fn neighbourhood_range([above, here, below]: &[[f32; WIDE]; 3]) -> ([f32; WORD], [f32; WORD]) {
    let (mut high, mut low) = ([0.0; WIDE], [0.0; WIDE]);
    for k in 0..WIDE {
        high[k] = fast_max(fast_max(above[k], here[k]), below[k]);
        low[k] = fast_min(fast_min(above[k], here[k]), below[k]);
    }
    let (mut near, mut far) = ([0.0; WORD], [0.0; WORD]);
    for k in 0..WORD {
        near[k] = fast_max(fast_max(high[k], high[k + 1]), high[k + 2]);
        far[k] = fast_min(fast_min(low[k], low[k + 1]), low[k + 2]);
    }
    (near, far)
}

/// Packs bytes, each 1 or 0, into bits.
#[inline(always)]
fn pack_bits(bytes: &[u8; WORD]) -> u64 {
    // `|` instead of an early exit, to vectorise: mostly there are none.
    if bytes.iter().fold(0, |any, byte| any | byte) == 0 {
        return 0;
    }
    let mut word = 0;
    for (k, bytes) in bytes.as_chunks().0.iter().enumerate() {
        // The highest byte of the product is the sum of all bytes, each shifted to its own bit.
        word |= (u64::from_le_bytes(*bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * k);
    }
    word
}

/// Computes the labels of the edge pixel at index `at` of its row, from the inverse depths of three rows.
#[inline(always)]
fn label_pixel(edge: &EdgePixel, rows: &[[f32; WIDE]; 3], at: usize, (width, height): (usize, usize)) -> Labels {
    let (x, y, middle) = (edge.x as usize, edge.y as usize, edge.mean_inverse());
    let is_near = rows[1][at] > middle;
    // Without branches; pixels beyond the picture are no neighbours.
    let (columns, lines) = ([x > 0, true, x + 1 < width], [y > 0, true, y + 1 < height]);
    let (mut borders, mut sides, mut alike) = (false, 0, 0);
    for (k, (row, is_line)) in rows.iter().zip(lines).enumerate() {
        for (j, (inverse, is_column)) in row[at - 1..][..3].iter().zip(columns).enumerate() {
            let (is_side, is_alike) = ((k + j) % 2 == 1, (*inverse > middle) == is_near);
            let counts = u32::from(is_alike & is_line & is_column);
            alike += counts;
            sides += if is_side { counts } else { 0 };
            borders |= is_side & !is_alike;
        }
    }
    // `alike` includes the pixel itself.
    Labels::new(is_near, borders, sides, alike - sides - 1)
}
