//! Draws squares of depth where the colour camera sees them, with a z-buffer.

use glam::DVec2;
use pulp::WithSimd;

use super::{Rays, Registration};
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
        let Self { registration: Registration { calibration, size, rays, depth_focal_px, view, .. }, from, into } =
            self;
        let offset = calibration.translation_m.as_vec3();
        let (focal_px, center_px) = (view.focal_px.as_vec2(), view.center_px.as_vec2());
        // Half of the footprint of a depth pixel at equal distance from both cameras.
        let half = f64::from(HALF_PIXEL) * view.focal_px / depth_focal_px;
        // That of a square which is turned about the optical axis is what encloses it.
        let [column, row] =
            [calibration.rotation.x_axis, calibration.rotation.y_axis].map(|axis| axis.truncate().abs());
        let half = (half * (column + row).max(DVec2::ONE)).as_vec2();
        let (width, height) = (view.drawn_size().0 as i32, view.drawn_size().1 as i32);
        let mut nearest_m = [0.0_f32; BLOCK];
        let [mut left, mut right, mut top, mut bottom] = [[0_i32; BLOCK]; 4];
        into.fill(f32::INFINITY);
        let along = calibration.rotation.x_axis.as_vec3();
        let [mut block_m, mut across, mut down, mut away] = [[0.0_f32; BLOCK]; 4];
        let mut spread = [1.0_f32; BLOCK];
        let width_in = (size.0 as usize).max(1);
        let starts = (0..width_in).step_by(BLOCK);
        for (y, x) in (0..size.1 as usize).flat_map(|y| starts.clone().map(move |x| (y, x))) {
            let (start, count) = (y * width_in + x, (width_in - x).min(BLOCK));
            // The rest of a row's last block is unknown.
            block_m[count..].fill(0.0);
            block_m[..count].copy_from_slice(&from[start..start + count]);
            match rays {
                Rays::Pinhole { columns, rows } => {
                    let row = rows[y];
                    for (k, column) in columns[x..x + count].iter().enumerate() {
                        across[k] = along.x * column + row.x;
                        down[k] = along.y * column + row.y;
                        away[k] = along.z * column + row.z;
                    }
                }
                Rays::Lens(tables) => {
                    for (block, table) in [&mut across, &mut down, &mut away, &mut spread].into_iter().zip(tables) {
                        block[..count].copy_from_slice(&table[start..start + count]);
                    }
                }
            }
            for k in 0..BLOCK {
                let z_m = block_m[k];
                let (x_m, y_m) = (across[k] * z_m + offset.x, down[k] * z_m + offset.y);
                let away_m = away[k] * z_m + offset.z;
                let per_m = 1.0 / away_m;
                let (u, v) = (focal_px.x * x_m * per_m + center_px.x, focal_px.y * y_m * per_m + center_px.y);
                let size = spread[k] * z_m * per_m;
                let (half_u, half_v) = ((half.x * size).min(MAX_HALF_PX), (half.y * size).min(MAX_HALF_PX));
                // From the first pixel centre inside to the first one beyond; the conversion to integers saturates.
                let first = |from_px: f32| from_px.ceil().max(0.0) as i32;
                // False for NaN, too.
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
        for z_m in into {
            *z_m = if *z_m < f32::INFINITY { *z_m } else { 0.0 };
        }
    }
}
