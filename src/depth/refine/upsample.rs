//! Edge-preserving upsampling: resamples a depth map to the size of its picture.
//!
//! Smooth surfaces are interpolated bilinearly in inverse depth, in which planes are linear. Across a discontinuity or
//! beside a hole the nearest neighbour is taken, so that no depth is invented; the colour-guided alignment places the edge
//! exactly later.
//!
//! twin: shaders/refine/prepare.wgsl

use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;
use crate::depth::tap::Tap;
use crate::frame::DepthMap;

/// Inverse depths that differ by less than this fraction of the larger belong to one surface.
pub const SAME_SURFACE: f32 = 0.05;

/// Resamples depth maps; owns its buffers.
#[derive(Debug, Default)]
pub struct Upsampler {
    metres: Vec<f32>,
    columns: Vec<Tap>,
}

impl Upsampler {
    /// Resamples `map` to the size of its picture, in pixels; an empty map becomes unknown (0) everywhere.
    pub fn resize(&mut self, workers: &mut ThreadPool, map: &mut DepthMap, (width, height): (u32, u32)) {
        let (from_width, from_height) = (map.width as usize, map.height as usize);
        if map.metres.is_empty() || map.size() == (width, height) {
            return map.resize(width, height);
        }
        self.metres.clear();
        self.metres.extend_from_slice(&map.metres);
        self.columns.clear();
        self.columns.extend((0..width as usize).map(|x| Tap::new(x, width as usize, from_width)));
        map.resize(width, height);
        let (Self { metres, columns }, width, height) = (&*self, width as usize, height as usize);
        let bands = Bands::new(height, 1, workers);
        workers.run_each(bands.rows().zip(bands.split(&mut map.metres, width)), &|(rows, out)| {
            for (y, row) in rows.zip(out.chunks_exact_mut(width)) {
                let Tap { first, second, weight: down_weight } = Tap::new(y, height, from_height);
                let above = &metres[first * from_width..][..from_width];
                let below = &metres[second * from_width..][..from_width];
                for (z_m, tap) in row.iter_mut().zip(columns) {
                    *z_m = interpolate(
                        [above[tap.first], above[tap.second], below[tap.first], below[tap.second]],
                        tap.weight,
                        down_weight,
                    );
                }
            }
        });
    }
}

/// Interpolates four neighbours (upper two, then lower two) at the fractions `right` and `down` (0 to 1); returns the
/// nearest one if they are not one surface.
fn interpolate(four_m: [f32; 4], right: f32, down: f32) -> f32 {
    let nearest_m = four_m[usize::from(right >= 0.5) + 2 * usize::from(down >= 0.5)];
    if !four_m.into_iter().all(DepthMap::is_known) {
        return nearest_m;
    }
    let inverse = four_m.map(|z_m| 1.0 / z_m);
    let (low, high) = inverse.into_iter().fold((f32::MAX, 0.0_f32), |(low, high), v| (low.min(v), high.max(v)));
    if high - low > SAME_SURFACE * high {
        return nearest_m;
    }
    let [a, b, c, d] = inverse;
    let (upper, lower) = (a + (b - a) * right, c + (d - c) * right);
    1.0 / (upper + (lower - upper) * down)
}
