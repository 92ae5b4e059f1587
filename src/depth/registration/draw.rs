//! Draws squares of depth where the colour camera sees them, with a z-buffer.

use pulp::WithSimd;

use super::Registration;
use crate::frame::DepthMap;

/// Half of a pixel, plus a margin so that slanted surfaces, whose pixels spread, have no gaps.
const HALF_PIXEL: f32 = 0.5 * 1.15;

/// Depths nearer to the colour camera than this are ignored.
const MIN_DEPTH_M: f32 = 0.01;

/// Half of the largest square: surfaces much nearer to the colour camera than to the depth camera have gaps.
const MAX_HALF_PX: f32 = 4.0;

/// Pixels whose squares are computed as vectors before they are drawn one by one.
const BLOCK: usize = 32;

/// Draws the pixels of `from` into `into`.
pub(super) struct DrawSquares<'a> {
    pub registration: &'a Registration,
    pub from: &'a [f32],
    pub into: &'a mut [f32],
}

impl WithSimd for DrawSquares<'_> {
    type Output = ();
    // Plain loops over blocks, which the compiler vectorises for the instruction set that `pulp` selects.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { registration: Registration { calibration, depth, out, columns, rows, .. }, from, into } = self;
        let (along, offset) = (calibration.rotation.x_axis, calibration.translation_m);
        // Half of the footprint of a depth pixel at equal distance from both cameras.
        let (half_across, half_down) = (HALF_PIXEL * out.fx / depth.fx, HALF_PIXEL * out.fy / depth.fy);
        let (width, height) = (out.width as i32, out.height as i32);
        let mut nearest_m = [0.0_f32; BLOCK];
        let [mut left, mut right, mut top, mut bottom] = [[0_i32; BLOCK]; 4];
        into.fill(f32::INFINITY);
        for (row, measured) in rows.iter().zip(from.chunks_exact(columns.len().max(1))) {
            for (measured, columns) in measured.chunks(BLOCK).zip(columns.chunks(BLOCK)) {
                // The rest of a row's last block is unknown.
                let [mut block_m, mut across] = [[0.0_f32; BLOCK]; 2];
                block_m[..measured.len()].copy_from_slice(measured);
                across[..columns.len()].copy_from_slice(columns);
                for k in 0..BLOCK {
                    let z_m = block_m[k];
                    let direction = |axis: f32, row: f32| axis * across[k] + row;
                    let x_m = direction(along.x, row.x) * z_m + offset.x;
                    let y_m = direction(along.y, row.y) * z_m + offset.y;
                    let away_m = direction(along.z, row.z) * z_m + offset.z;
                    let per_m = 1.0 / away_m;
                    let (u, v) = (out.fx * x_m * per_m + out.cx, out.fy * y_m * per_m + out.cy);
                    let half_u = (half_across * z_m * per_m).min(MAX_HALF_PX);
                    let half_v = (half_down * z_m * per_m).min(MAX_HALF_PX);
                    // From the first pixel centre inside to the first one beyond; the conversion to integers saturates.
                    let first = |from_px: f32| from_px.ceil().max(0.0) as i32;
                    let is_seen = DepthMap::is_known(z_m) & (away_m > MIN_DEPTH_M);
                    nearest_m[k] = away_m;
                    left[k] = first(u - half_u);
                    right[k] = if is_seen { first(u + half_u).min(width) } else { 0 };
                    top[k] = first(v - half_v);
                    bottom[k] = first(v + half_v).min(height);
                }
                for k in 0..BLOCK {
                    if left[k] >= right[k] || top[k] >= bottom[k] {
                        continue;
                    }
                    let [first, last, upper, lower] = [left[k], right[k] - 1, top[k], bottom[k] - 1];
                    let mut draw = |x: i32, y: i32| {
                        let drawn = &mut into[(y * width + x) as usize];
                        *drawn = if nearest_m[k] < *drawn { nearest_m[k] } else { *drawn };
                    };
                    // Nearly all squares cover at most 2x2 pixels; some of these are then drawn twice.
                    if last - first < 2 && lower - upper < 2 {
                        draw(first, upper);
                        draw(last, upper);
                        draw(first, lower);
                        draw(last, lower);
                        continue;
                    }
                    for y in upper..=lower {
                        for x in first..=last {
                            draw(x, y);
                        }
                    }
                }
            }
        }
        for z_m in into {
            *z_m = if *z_m < f32::INFINITY { *z_m } else { 0.0 };
        }
    }
}
