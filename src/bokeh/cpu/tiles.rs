//! Tile classification: what is where, before any colour is read: the range of CoC of every tile, and the tiles that
//! stay as they are.

use std::ops::Range;

use super::pixels::Radii;
use super::unpack::{Source, coc_row};
use crate::bokeh::plan::Share;
use crate::optics::CocField;

/// Pixels of the picture across a tile.
pub const TILE_W: usize = 64;
/// Columns of the picture that are read at once.
pub const BLOCK: usize = 4 * TILE_W;
/// Columns beyond a block on both sides that averages of it reach.
pub const MARGIN: usize = 16;
/// Rows of a tile.
pub const TILE_H: usize = 8;
/// The picture around a tile that can change it, in tiles: the widest filter at full scale in a bin that is in focus,
/// and the cells that its radius is a mean of.
const AROUND: (usize, usize) = (1, 3);
/// Filters of a smaller radius have one tap.
const SHARP_PX: f32 = 0.4;

/// Which columns of a block and its margins a bin takes anything of: a bit for each tile from the one before the block on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pieces(u8);

impl Pieces {
    /// Tiles of a block, and one on both sides.
    pub const COUNT: usize = BLOCK / TILE_W + 2;
    pub const NONE: Self = Self(0);
    pub const ALL: Self = Self((1 << Self::COUNT) - 1);

    /// The tiles of which `takes` holds.
    pub fn of(takes: impl Fn(usize) -> bool) -> Self {
        Self((0..Self::COUNT).fold(0, |bits, k| bits | u8::from(takes(k)) << k))
    }

    /// The columns of tile `k`, none where it is not among them, up to column `end`.
    #[inline(always)]
    pub fn columns(self, k: usize, end: usize) -> Range<usize> {
        let first = |k: usize| (k * TILE_W + MARGIN).saturating_sub(TILE_W).min(end);
        if self.0 >> k & 1 == 1 { first(k)..first(k + 1) } else { 0..0 }
    }
}

/// The tiles of a picture.
pub struct Tiles {
    /// Lowest and highest CoC in pixels, row by row.
    pub ranges: Vec<(f32, f32)>,
    /// Per tile, whether nothing within its reach is blurred by anything behind: it stays as it is.
    pub still: Vec<bool>,
    /// Per tile, whether it and all around it is still, so that no bin needs it.
    pub idle: Vec<bool>,
    scratch: Vec<bool>,
    pub across: usize,
    pub down: usize,
}

impl Tiles {
    /// Tiles of a picture of `width` x `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        let (across, down) = (width.div_ceil(TILE_W), height.div_ceil(TILE_H));
        let flags = vec![false; across * down];
        Self {
            ranges: vec![(0.0, 0.0); across * down],
            still: flags.clone(),
            idle: flags.clone(),
            scratch: flags,
            across,
            down,
        }
    }

    /// Finds the tiles that stay as they are, once all ranges are known.
    pub fn settle(&mut self, enabled: bool) {
        let sharp = |&(low, high): &(f32, f32)| low >= -SHARP_PX && high <= SHARP_PX;
        self.idle.iter_mut().zip(&self.ranges).for_each(|(tile, range)| *tile = enabled && sharp(range));
        let size = (self.across, self.down);
        erode(&self.idle, &mut self.scratch, &mut self.still, size);
        erode(&self.still, &mut self.scratch, &mut self.idle, size);
    }

    /// Whether any CoC of some tiles does not have the whole share.
    pub fn any_outside(&self, share: &Share, columns: Range<usize>, rows: Range<usize>) -> bool {
        let columns = columns.start.min(self.across)..columns.end.min(self.across);
        (rows.start..rows.end.min(self.down)).any(|row| {
            let at = row * self.across;
            self.ranges[at + columns.start..at + columns.end].iter().any(|range| share.at(range.0) < 1.0)
        })
    }

    /// The tiles of a block, and beside it, of a row of tiles that a bin has a share of.
    pub fn pieces(&self, share: &Share, block: usize, row: usize) -> Pieces {
        Pieces::of(|k| {
            // Beyond the picture its outermost columns repeat.
            let column = (block * (BLOCK / TILE_W) + k).saturating_sub(1).min(self.across - 1);
            // Averages reach into the tiles beside one that a bin needs.
            let columns = column.saturating_sub(1)..(column + 2).min(self.across);
            let mut rows = row.saturating_sub(1)..(row + 2).min(self.down);
            let is_idle = |at: usize| self.idle[at * self.across..][columns.clone()].iter().all(|&idle| idle);
            share.meets(self.ranges[row * self.across + column]) && !rows.all(is_idle)
        })
    }

    /// Whether any CoC of some tiles has a share; columns and rows of tiles are cut at the picture's end.
    pub fn any_within(&self, share: &Share, columns: Range<usize>, rows: Range<usize>) -> bool {
        let columns = columns.start.min(self.across)..columns.end.min(self.across);
        (rows.start..rows.end.min(self.down)).any(|row| {
            let at = row * self.across;
            let tiles = &self.ranges[at + columns.start..at + columns.end];
            let idle = &self.idle[at + columns.start..at + columns.end];
            tiles.iter().zip(idle).any(|(&range, &idle)| !idle && share.meets(range))
        })
    }
}

/// A row of tiles.
pub struct Survey<'a> {
    pub source: &'a Source<'a>,
    pub row: usize,
    pub ranges: &'a mut [(f32, f32)],
    /// As many values as the picture has columns.
    pub coc: &'a mut [f32],
}

impl pulp::WithSimd for Survey<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let (width, height) = self.source.size;
        // CoC grows with depth: where the two pictures have the same size, the range of depth tells that of CoC.
        let direct = match self.source.coc {
            Radii::Field(CocField::Depth(lens), Some(map)) if map.size() == (width as u32, height as u32) => {
                Some((lens, map))
            }
            _ => None,
        };
        self.ranges.fill((f32::INFINITY, f32::NEG_INFINITY));
        for y in self.row * TILE_H..((self.row + 1) * TILE_H).min(height) {
            let values = match direct {
                Some((_, map)) => &map.metres[y * width..][..width],
                None => {
                    coc_row(self.source, y, 0, self.coc);
                    &*self.coc
                }
            };
            for (range, values) in self.ranges.iter_mut().zip(values.chunks(TILE_W)) {
                // What is unknown is infinitely far.
                let unknown = |value: f32| direct.is_some() && (value <= 0.0 || value.is_nan());
                widen(range, values, |value| if unknown(value) { f32::INFINITY } else { value });
            }
        }
        if let Some(matte) = self.source.matte {
            let rows = self.row * TILE_H * width..((self.row + 1) * TILE_H).min(height) * width;
            for pixel in matte.within(rows) {
                let (low, high) = &mut self.ranges[pixel.at as usize % width / TILE_W];
                (*low, *high) = (low.min(pixel.near_m), high.max(pixel.far_m));
            }
        }
        if let Some((lens, _)) = direct {
            self.ranges.iter_mut().for_each(|(low, high)| (*low, *high) = (lens.coc_px(*low), lens.coc_px(*high)));
        }
    }
}

/// Widens a range by some values, each as `of` has it.
#[inline(always)]
pub fn widen(range: &mut (f32, f32), values: &[f32], of: impl Fn(f32) -> f32) {
    let (mut low, mut high) = ([f32::INFINITY; 16], [f32::NEG_INFINITY; 16]);
    let (vectors, rest) = values.as_chunks::<16>();
    for values in vectors {
        for k in 0..16 {
            let value = of(values[k]);
            low[k] = if value < low[k] { value } else { low[k] };
            high[k] = if value > high[k] { value } else { high[k] };
        }
    }
    let rest = || rest.iter().map(|&value| of(value));
    range.0 = low.into_iter().chain(rest()).fold(range.0, f32::min);
    range.1 = high.into_iter().chain(rest()).fold(range.1, f32::max);
}

/// A tile stays set when all around it are set.
fn erode(from: &[bool], scratch: &mut [bool], to: &mut [bool], (across, down): (usize, usize)) {
    for (row, out) in from.chunks_exact(across).zip(scratch.chunks_exact_mut(across)) {
        for (x, out) in out.iter_mut().enumerate() {
            *out = row[x.saturating_sub(AROUND.0)..(x + AROUND.0 + 1).min(across)].iter().all(|&set| set);
        }
    }
    for y in 0..down {
        for x in 0..across {
            to[y * across + x] =
                (y.saturating_sub(AROUND.1)..(y + AROUND.1 + 1).min(down)).all(|y| scratch[y * across + x]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDE: usize = BLOCK + 2 * MARGIN;

    #[test]
    fn the_pieces_of_a_block_are_all_its_columns_and_margins() {
        for end in [BLOCK / 2 + 2 * MARGIN, WIDE] {
            let columns: Vec<usize> = (0..Pieces::COUNT).flat_map(|k| Pieces::ALL.columns(k, end)).collect();
            assert_eq!(columns, (0..end).collect::<Vec<_>>());
        }
        let second = Pieces::of(|k| k == 2);
        let columns: Vec<usize> = (0..Pieces::COUNT).flat_map(|k| second.columns(k, WIDE)).collect();
        assert_eq!(columns, (MARGIN + TILE_W..MARGIN + 2 * TILE_W).collect::<Vec<_>>(), "the second tile of the block");
        assert_eq!(Pieces::of(|_| false), Pieces::NONE);
    }

    /// Wherever a pixel has a share, its tile is among the pieces of the block.
    #[test]
    fn a_share_is_missed_nowhere() {
        let (width, height) = (3 * TILE_W + 5, 2 * TILE_H);
        let mut tiles = Tiles::new(width, height);
        let coc = |x: usize, y: usize| ((x * 7 + y * 13) % 61) as f32 * 0.2 - 4.0;
        for (at, range) in tiles.ranges.iter_mut().enumerate() {
            let (column, row) = (at % tiles.across * TILE_W, at / tiles.across * TILE_H);
            let values = (0..TILE_H * TILE_W).map(|k| coc(column + k % TILE_W, row + k / TILE_W));
            *range = values.fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), value| (a.min(value), b.max(value)));
        }
        for low_px in [-3.0, 0.5, 5.0] {
            let share = Share::new(Some((low_px, 4.0)), Some((low_px + 1.0, 4.0)));
            for row in 0..tiles.down {
                let pieces = tiles.pieces(&share, 0, row);
                for k in 1..Pieces::COUNT - 1 {
                    let taken = pieces.columns(k, WIDE).any(|x| {
                        let x = (x - MARGIN).min(width - 1);
                        (0..TILE_H).any(|y| share.at(coc(x, row * TILE_H + y)) > 0.0)
                    });
                    let has = (0..TILE_W * TILE_H).any(|at| {
                        let x = ((k - 1) * TILE_W + at % TILE_W).min(width - 1);
                        share.at(coc(x, row * TILE_H + at / TILE_W)) > 0.0
                    });
                    assert_eq!(taken, has, "{low_px} {row} {k}");
                }
            }
        }
    }
}
