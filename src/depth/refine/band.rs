//! The band of pixels beside depth edges: dilates a mask of edge pixels, first along rows, then down columns.
//! twin: shaders/refine/band.wgsl

use std::ops::Range;

use pulp::WithSimd;

use super::tiles::Tiles;

/// Width of the band beside a discontinuity in which a depth may be wrong, in pixels, with the edge pixel.
pub const BAND_PX: usize = 4;
/// Distance that the band reaches from its edge pixel.
const SIDE_PX: usize = BAND_PX - 1;

/// Marks the pixels within [`BAND_PX`] of an edge along the rows of a band.
pub struct DilateRows<'a> {
    pub tiles: &'a Tiles,
    pub width: usize,
    pub edge: &'a [bool],
    pub rows: Range<usize>,
    pub out: &'a mut [bool],
}

impl WithSimd for DilateRows<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { tiles, width, edge, rows, out } = self;
        for (line, y) in rows.enumerate() {
            for columns in tiles.near_columns(y) {
                let row = &edge[y * width..][..width];
                let out = &mut out[line * width..][..width];
                out[columns.clone()].copy_from_slice(&row[columns.clone()]);
                for px in 1..=SIDE_PX {
                    let Range { start, end } = columns;
                    // Pixels without a neighbour this far to the left or right are skipped.
                    let (after, before) = (start.max(px), end.min(width.saturating_sub(px)));
                    if after < end {
                        or_assign(&mut out[after..end], &row[after - px..end - px]);
                    }
                    if start < before {
                        or_assign(&mut out[start..before], &row[start + px..before + px]);
                    }
                }
            }
        }
    }
}

/// Dilates the mask `along` down the columns.
pub struct DilateColumns<'a> {
    pub tiles: &'a Tiles,
    pub width: usize,
    pub along: &'a [bool],
    pub rows: Range<usize>,
    pub out: &'a mut [bool],
}

impl WithSimd for DilateColumns<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { tiles, width, along, rows, out } = self;
        let height = along.len() / width;
        for (line, y) in rows.enumerate() {
            for columns in tiles.near_columns(y) {
                let out = &mut out[line * width..][columns.clone()];
                out.fill(false);
                for other in y.saturating_sub(SIDE_PX)..(y + BAND_PX).min(height) {
                    or_assign(out, &along[other * width..][columns.clone()]);
                }
            }
        }
    }
}

#[inline(always)]
fn or_assign(to: &mut [bool], from: &[bool]) {
    for (to, &from) in to.iter_mut().zip(from) {
        *to |= from;
    }
}
