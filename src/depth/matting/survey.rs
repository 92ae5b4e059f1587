//! The pixels beside jumps of depth.

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::{EdgePixel, larger, smaller};
use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;
use crate::frame::DepthMap;

/// Pixels of a row that are looked at at once.
const BLOCK: usize = 64;

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
}

impl Survey {
    /// Replaces `edges` by the pixels of a map that differ by more than `jump` from one of their eight neighbours, row by row,
    /// and marks them.
    pub fn find(
        &mut self,
        (arch, workers): (Arch, &mut ThreadPool),
        map: &DepthMap,
        jump: f32,
        (at_edge, edges): (&mut Vec<bool>, &mut Vec<EdgePixel>),
    ) {
        let (width, height) = (map.width as usize, map.height as usize);
        at_edge.resize(width * height, false);
        let bands = Bands::new(height, 1, workers);
        let found = &mut self.0;
        found.resize_with(bands.rows().count(), Band::default);
        let parts = bands.rows().zip(bands.split(at_edge, width)).zip(&mut *found);
        workers.run_each(parts, &|((of_band, at_edge), band)| {
            arch.dispatch(FindEdges { map, jump, of_band, at_edge, band });
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
    at_edge: &'a mut [bool],
    band: &'a mut Band,
}

impl WithSimd for FindEdges<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { map, jump, of_band, at_edge, band: Band { edges, rows, ranges: [high, low] } } = self;
        let (width, height) = (map.width as usize, map.height as usize);
        edges.clear();
        rows.iter_mut().for_each(|row| row.resize(width, 0.0));
        for range in [&mut *high, &mut *low] {
            range.resize(width + 2, 0.0);
        }
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
            let found = &mut at_edge[(y - first) * width..][..width];
            let [left, middle, right] = [0, 1, 2].map(|by| (&high[by..][..width], &low[by..][..width]));
            let around = |x: usize| {
                let near = larger(larger(left.0[x], middle.0[x]), right.0[x]);
                [near, smaller(smaller(left.1[x], middle.1[x]), right.1[x])]
            };
            for (x, found) in found.iter_mut().enumerate() {
                let [near, far] = around(x);
                *found = near - far > jump;
            }
            for (found, begin) in found.chunks(BLOCK).zip((0..).step_by(BLOCK)) {
                // `|` instead of an early exit, so that a block becomes vector code.
                if !found.iter().fold(false, |any, found| any | found) {
                    continue;
                }
                for x in (begin..).zip(found).filter(|(_, found)| **found).map(|(x, _)| x) {
                    let [near, far] = around(x);
                    edges.push(EdgePixel { x: x as u32, y: y as u32, near, far });
                }
            }
        }
    }
}
