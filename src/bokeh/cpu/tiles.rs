//! Tile classification: what is where, before any colour is read: the range of CoC of every tile, and the tiles that
//! stay as they are.

use super::pixels::Radii;
use super::unpack::{Source, coc_row};
use crate::bokeh::plan::Share;
use crate::optics::CocField;

/// Pixels of the picture across a tile.
pub const TILE_W: usize = 64;
/// Columns of the picture that are read at once.
pub const BLOCK: usize = 4 * TILE_W;
/// Rows of a tile.
pub const TILE_H: usize = 8;
/// The picture around a tile that can change it, in tiles: the widest filter at full scale in a bin that is in focus,
/// and the cells that its radius is a mean of.
const AROUND: (usize, usize) = (1, 3);
/// Filters of a smaller radius have one tap.
const SHARP_PX: f32 = 0.4;

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
    pub fn any_outside(&self, share: &Share, columns: std::ops::Range<usize>, rows: std::ops::Range<usize>) -> bool {
        let columns = columns.start.min(self.across)..columns.end.min(self.across);
        (rows.start..rows.end.min(self.down)).any(|row| {
            let at = row * self.across;
            self.ranges[at + columns.start..at + columns.end].iter().any(|range| share.at(range.0) < 1.0)
        })
    }

    /// Whether any CoC of some tiles has a share; columns and rows of tiles are cut at the picture's end.
    pub fn any_within(&self, share: &Share, columns: std::ops::Range<usize>, rows: std::ops::Range<usize>) -> bool {
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
    // Halves against halves, as one value after the other waits for each.
    for half in [8, 4, 2, 1] {
        for k in 0..half {
            low[k] = if low[k + half] < low[k] { low[k + half] } else { low[k] };
            high[k] = if high[k + half] > high[k] { high[k + half] } else { high[k] };
        }
    }
    (range.0, range.1) = (range.0.min(low[0]), range.1.max(high[0]));
    for value in rest {
        let value = of(*value);
        (range.0, range.1) = (range.0.min(value), range.1.max(value));
    }
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
