//! Tile classification before any colour is read: the CoC range of every tile, and the tiles that stay unchanged.

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::pixels::Radii;
use super::unpack::{InputFrame, compute_coc_row};
use crate::bokeh::ladder::Compositing;
use crate::bokeh::plan::{BinWeight, Plan};
use crate::bokeh::split::SHARP_PX;
use crate::frame::{Matte, MixedPixel};
use crate::optics::CocField;

/// Pixels of the picture across a tile.
pub const TILE_W: usize = 32;
/// Columns of the picture per block.
pub const BLOCK: usize = 8 * TILE_W;
/// Rows of a tile.
pub const TILE_H: usize = 8;
/// Neighbourhood that can change a tile, in tiles: the widest filter at full scale of the bin in focus, and the cells
/// over which its radius is averaged.
const NEIGHBOURHOOD: (usize, usize) = (1, 3);

/// No bin, or several.
const NO_BIN: u8 = u8::MAX;

/// Columns of the picture inside a block, made together.
#[derive(Clone, Copy)]
pub struct Run {
    pub block: usize,
    /// The first column: a whole piece of every bin ([`PIECE`](super::rows::PIECE)).
    pub x0: usize,
    /// Rounded up to whole pieces of every bin, also beyond the picture.
    pub columns: usize,
    /// Whether these are all columns of the block.
    pub is_whole: bool,
}

/// The tiles of a picture.
pub struct Tiles {
    /// Lowest and highest CoC in pixels, row by row.
    pub ranges: Vec<(f32, f32)>,
    /// Per tile, whether no background within its neighbourhood is blurred: it stays unchanged.
    pub still: Vec<bool>,
    /// Per tile, whether it and its neighbourhood are still, so that no bin needs it.
    pub idle: Vec<bool>,
    /// Per tile, the only bin that it belongs to, as a whole and without mixed pixels, or [`NO_BIN`].
    only: Vec<u8>,
    scratch: Vec<bool>,
    /// Per row of tiles, the index of its first mixed pixel, and at last their number.
    pub first_mixed: Vec<usize>,
    pub across: usize,
    pub down: usize,
}

impl Tiles {
    /// Allocates for a picture of `width` x `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        let (across, down) = (width.div_ceil(TILE_W), height.div_ceil(TILE_H));
        let flags = vec![false; across * down];
        Self {
            ranges: vec![(0.0, 0.0); across * down],
            still: flags.clone(),
            idle: flags.clone(),
            only: vec![NO_BIN; across * down],
            scratch: flags,
            first_mixed: vec![0; down + 1],
            across,
            down,
        }
    }

    /// Finds the tiles that stay unchanged, after all ranges are known.
    pub fn classify(&mut self, enabled: bool) {
        let sharp = |&(low, high): &(f32, f32)| low >= -SHARP_PX && high <= SHARP_PX;
        self.idle.iter_mut().zip(&self.ranges).for_each(|(tile, range)| *tile = enabled && sharp(range));
        let size = (self.across, self.down);
        erode(&self.idle, &mut self.scratch, &mut self.still, size);
        erode(&self.still, &mut self.scratch, &mut self.idle, size);
    }

    /// Finds the mixed pixels of each row of tiles. One by one, as memory is read fastest, unlike in a search.
    pub fn find_mixed(&mut self, matte: Option<&Matte>, (width, height): (usize, usize)) {
        let pixels = matte.map_or(&[][..], |matte| &matte.pixels);
        let mut next = 0;
        for (row, first) in self.first_mixed.iter_mut().enumerate() {
            let end = (row * TILE_H).min(height) * width;
            next += pixels[next..].iter().take_while(|pixel| (pixel.at as usize) < end).count();
            *first = next;
        }
    }

    /// Sets the range of all tiles, where no layer needs those of each: one radius, or any.
    pub fn set_ranges(&mut self, coc: Radii<'_>) {
        let range = match coc {
            Radii::Field(CocField::Uniform { radius_px }, _) => (*radius_px, *radius_px),
            _ => (f32::NEG_INFINITY, f32::INFINITY),
        };
        self.ranges.fill(range);
    }

    /// Finds the tiles that belong to one bin, after the bins are known.
    pub fn find_only_bins(&mut self, plan: &Plan, matte: Option<&Matte>) {
        self.only.fill(NO_BIN);
        if plan.compositing == Compositing::Gather || plan.compositing == Compositing::Select && plan.bins.len() > 1 {
            return;
        }
        for k in 0..plan.bins.len() {
            let weight = plan.bin_weight(k);
            for (only, range) in self.only.iter_mut().zip(&self.ranges) {
                if plan.bins.len() == 1 || weight.at(range.0) == 1.0 && weight.at(range.1) == 1.0 {
                    *only = k as u8;
                }
            }
        }
        for (x, y, _) in matte.iter().flat_map(|matte| Matte::locate(&matte.pixels, 0, plan.width)) {
            if let Some(only) = self.only.get_mut(y / TILE_H * self.across + x / TILE_W) {
                *only = NO_BIN;
            }
        }
    }

    /// Returns the only bin that these tiles belong to, if there is one.
    #[inline(always)]
    pub fn only_bin(&self, columns: Range<usize>, rows: Range<usize>) -> Option<usize> {
        let mut all = self.spans(columns, rows).flat_map(|span| &self.only[span]);
        let first = *all.next()?;
        (first != NO_BIN && all.all(|&only| only == first)).then_some(usize::from(first))
    }

    /// Returns the only bin that a tile belongs to, if there is one.
    #[inline(always)]
    pub fn only_bin_of(&self, tile: usize) -> Option<usize> {
        Some(usize::from(self.only[tile])).filter(|&only| only != usize::from(NO_BIN))
    }

    /// Returns the CoC of these tiles, in pixels, if it is the same everywhere.
    #[inline(always)]
    pub fn only_coc(&self, columns: Range<usize>, rows: Range<usize>) -> Option<f32> {
        let mut all = self.spans(columns, rows).flat_map(|span| &self.ranges[span]);
        let first = *all.next()?;
        (first.0 == first.1 && all.all(|&range| range == first)).then_some(first.0)
    }

    /// Whether the weight is below 1 at the lowest CoC of any of these tiles.
    pub fn any_partly_outside(&self, weight: &BinWeight, columns: Range<usize>, rows: Range<usize>) -> bool {
        self.spans(columns, rows).any(|span| self.ranges[span].iter().any(|range| weight.at(range.0) < 1.0))
    }

    /// Whether the weight is above 0 for any CoC of these tiles.
    pub fn any_overlapping(&self, weight: &BinWeight, columns: Range<usize>, rows: Range<usize>) -> bool {
        self.spans(columns, rows).any(|span| {
            let mut tiles = self.ranges[span.clone()].iter().zip(&self.idle[span]);
            tiles.any(|(&range, &idle)| !idle && weight.overlaps(range))
        })
    }

    /// Returns where these tiles are, row by row; columns and rows are clamped to the picture.
    fn spans(&self, columns: Range<usize>, rows: Range<usize>) -> impl Iterator<Item = Range<usize>> {
        let (across, [first, last]) = (self.across, [columns.start, columns.end].map(|column| column.min(self.across)));
        (rows.start..rows.end.min(self.down)).map(move |row| row * across + first..row * across + last)
    }
}

/// Computes the CoC ranges of a row of tiles.
pub struct ComputeTileRanges<'a> {
    pub source: &'a InputFrame<'a>,
    pub row: usize,
    /// Mixed pixels in this row.
    pub mixed: &'a [MixedPixel],
    pub ranges: &'a mut [(f32, f32)],
    /// Scratch for one row of the picture.
    pub coc: &'a mut [f32],
    /// Scratch for the lowest and the highest value of each tile, in each lane of a vector.
    pub lanes: &'a mut [f32],
}

impl WithSimd for ComputeTileRanges<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (width, height) = self.source.size;
        // CoC grows with depth: if the two pictures have the same size, the CoC range follows from the depth range.
        let direct = match self.source.coc {
            Radii::Field(CocField::Depth(lens), Some(map)) if map.size() == (width as u32, height as u32) => {
                Some((lens, map))
            }
            _ => None,
        };
        // Unknown depth counts as infinite.
        let unknown = simd.splat_f32s(if direct.is_some() { 0.0 } else { f32::NEG_INFINITY });
        let (lowest, highest) = self.lanes.split_at_mut(self.lanes.len() / 2);
        let (lowest, highest) = (S::as_mut_simd_f32s(lowest).0, S::as_mut_simd_f32s(highest).0);
        lowest.fill(simd.splat_f32s(f32::INFINITY));
        highest.fill(simd.splat_f32s(f32::NEG_INFINITY));
        // Row by row, as memory is read fastest.
        for y in self.row * TILE_H..((self.row + 1) * TILE_H).min(height) {
            let row = match direct {
                Some((_, map)) => &map.metres[y * width..][..width],
                None => {
                    compute_coc_row(self.source, y, 0, self.coc);
                    &*self.coc
                }
            };
            for ((low, high), tile) in lowest.iter_mut().zip(&mut *highest).zip(row.chunks(TILE_W)) {
                (*low, *high) = extend_lanes(simd, (*low, *high), tile, |value| {
                    let is_known = simd.greater_than_f32s(value, unknown);
                    simd.select_f32s(is_known, value, simd.splat_f32s(f32::INFINITY))
                });
            }
        }
        for (range, (low, high)) in self.ranges.iter_mut().zip(lowest.iter().zip(&*highest)) {
            *range = (simd.reduce_min_f32s(*low), simd.reduce_max_f32s(*high));
        }
        for (x, _, pixel) in Matte::locate(self.mixed, self.row * TILE_H, width) {
            let (low, high) = &mut self.ranges[x / TILE_W];
            (*low, *high) = (low.min(pixel.near_m), high.max(pixel.far_m));
        }
        if let Some((lens, _)) = direct {
            self.ranges.iter_mut().for_each(|(low, high)| (*low, *high) = (lens.coc_px(*low), lens.coc_px(*high)));
        }
    }
}

/// Widens a range by some values.
#[inline(always)]
pub fn extend_range<S: Simd>(simd: S, range: &mut (f32, f32), values: &[f32]) {
    let range_lanes = (simd.splat_f32s(range.0), simd.splat_f32s(range.1));
    let (low, high) = extend_lanes(simd, range_lanes, values, |value| value);
    *range = (simd.reduce_min_f32s(low), simd.reduce_max_f32s(high));
}

/// Returns the ranges in the lanes of vectors, widened by some values, each mapped by `of`.
#[inline(always)]
fn extend_lanes<S: Simd>(
    simd: S,
    range: (S::f32s, S::f32s),
    values: &[f32],
    of: impl Fn(S::f32s) -> S::f32s,
) -> (S::f32s, S::f32s) {
    let extend = |(low, high), value| (simd.min_f32s(low, value), simd.max_f32s(high, value));
    let (vectors, rest) = S::as_simd_f32s(values);
    let range = vectors.iter().fold(range, |range, value| extend(range, of(*value)));
    rest.iter().fold(range, |range, value| extend(range, of(simd.splat_f32s(*value))))
}

/// Erosion: a tile stays set if its whole neighbourhood is set.
fn erode(from: &[bool], scratch: &mut [bool], to: &mut [bool], (across, down): (usize, usize)) {
    for (row, out) in from.chunks_exact(across).zip(scratch.chunks_exact_mut(across)) {
        out.copy_from_slice(row);
        for distance in 1..(NEIGHBOURHOOD.0 + 1).min(across) {
            out.iter_mut().zip(&row[distance..]).for_each(|(out, set)| *out &= set);
            out[distance..].iter_mut().zip(row).for_each(|(out, set)| *out &= set);
        }
    }
    for (y, out) in to.chunks_exact_mut(across).enumerate() {
        out.fill(true);
        let rows = y.saturating_sub(NEIGHBOURHOOD.1)..(y + NEIGHBOURHOOD.1 + 1).min(down);
        for row in scratch[rows.start * across..rows.end * across].chunks_exact(across) {
            out.iter_mut().zip(row).for_each(|(out, set)| *out &= set);
        }
    }
}
