//! Separation of mixed pixels into both surfaces' colours.

#![allow(clippy::needless_range_loop)] // Lanes and planes index several arrays at once.

use std::ops::Range;

use super::cells::MaskView;
use super::connection::Connection;
use super::models::{INVERSE, Models, SURFACES};
use super::posterior::{LANES, Lanes};
use crate::depth::bitmap::{WORD, set_bits};
use crate::depth::matting::contrast::{QUANTISATION, SHRINKAGE};
use crate::depth::matting::{NEARLY_PURE, fast_max, fast_min};
use crate::frame::{DepthMap, MixedPixel};

/// Numbers of both surfaces, and where means and variances begin.
const PARAMS: usize = INVERSE - SURFACES;
const NEAR: usize = 0;
const FAR: usize = 3;
const NEAR_VARIANCE: usize = 6;
const FAR_VARIANCE: usize = 7;

/// The last mixed pixels, which are separated together.
#[derive(Default)]
struct Batch {
    count: usize,
    alpha: Lanes,
    own: [Lanes; 3],
    surfaces: [Lanes; PARAMS],
}

impl MaskView<'_> {
    /// Writes the depth of pixels of a row in the unknown region, and adds the mixed ones, given alpha of each and which
    /// are unconnected: surely far. With a known background, pixels that the near surface covers are mixed ones, too.
    #[inline(always)]
    pub fn separate_pixels(
        &self,
        models: &Models,
        (xs, y): (Range<usize>, usize),
        (alphas, connection): (&[f32], &Connection),
        map: &mut DepthMap,
    ) {
        let (first, down) = (y * self.color.width as usize, self.enclosing_cells(y, self.down));
        let background_at = self.backdrop.map(|backdrop| backdrop.light_in_row(y));
        let max_alpha = if background_at.is_some() { f32::INFINITY } else { NEARLY_PURE };
        let metres = &mut map.metres[first..];
        let mut batch = Batch::default();
        let (mut columns, mut end, mut has_surfaces, mut sides) = ([0; 2], 0, false, [[0.0; PARAMS]; 2]);
        for (start, alphas) in xs.clone().step_by(WORD).zip(alphas.chunks(WORD)) {
            let unconnected = connection.unconnected_at((start, y));
            let (mut mixed, mut near) = (0, 0);
            for (place, alpha) in alphas.iter().enumerate() {
                mixed |= u64::from((*alpha >= 1.0 - NEARLY_PURE) & (*alpha <= max_alpha)) << place;
                near |= u64::from(*alpha > 0.5) << place;
            }
            for place in set_bits(mixed & !unconnected) {
                let (x, alpha) = (start + place, alphas[place]);
                if x >= end {
                    (columns, end) = self.columns_around(x);
                    let found = models.beside(SURFACES, self.across, &down, columns);
                    (has_surfaces, sides) = (found.is_some(), found.unwrap_or_default());
                }
                let along = self.place_of(x) - columns[0] as f32;
                let mut params = [0.0; PARAMS];
                for n in 0..PARAMS {
                    params[n] = sides[0][n] + (sides[1][n] - sides[0][n]) * along;
                }
                let mut background_alpha = 1.0 - alpha;
                if let Some(background_at) = &background_at {
                    background_alpha = 1.0;
                    if has_surfaces || alpha > NEARLY_PURE {
                        params[FAR..][..3].copy_from_slice(&background_at(x));
                    }
                }
                let (at, near_m, far_m) = ((first + x) as u32, DepthMap::SUBJECT_M, metres[x]);
                let pixel = MixedPixel { at, near_m, far_m, alpha, background_alpha, difference: [0.0; 3] };
                map.matte.pixels.push(pixel);
                batch.add(alpha, self.light_at(first + x), &params);
                if batch.count == LANES {
                    batch.separate(&mut map.matte.pixels);
                }
            }
            near &= !unconnected;
            for (place, metres) in metres[start..][..alphas.len()].iter_mut().enumerate() {
                *metres = if near >> place & 1 != 0 { DepthMap::SUBJECT_M } else { *metres };
            }
        }
        batch.separate(&mut map.matte.pixels);
    }
}

impl Batch {
    #[inline(always)]
    fn add(&mut self, alpha: f32, own: [f32; 3], params: &[f32; PARAMS]) {
        let lane = self.count;
        self.alpha[lane] = alpha;
        for p in 0..3 {
            self.own[p][lane] = own[p];
        }
        for n in 0..PARAMS {
            self.surfaces[n][lane] = params[n];
        }
        self.count += 1;
    }

    /// Computes the near colour minus the far colour of the batch, which are the last ones of `pixels`, and empties it:
    /// the most likely pair that adds up to the pixel's own colour (Chuang et al. 2001, equation 9, without the noise
    /// term, and with each surface's mean variance). Clamped so that neither is darker than black or brighter than
    /// white.
    #[inline(always)]
    fn separate(&mut self, pixels: &mut [MixedPixel]) {
        let Self { count, alpha, own, surfaces } = self;
        let mut differences = [[0.0; LANES]; 3];
        for p in 0..3 {
            for k in 0..LANES {
                let (alpha, rest, own) = (alpha[k], 1.0 - alpha[k], own[p][k]);
                let (near, far) = (surfaces[NEAR + p][k], surfaces[FAR + p][k]);
                let (of_near, of_far) = (alpha * surfaces[NEAR_VARIANCE][k], rest * surfaces[FAR_VARIANCE][k]);
                let spread = (1.0 + SHRINKAGE) * (alpha * of_near + rest * of_far) + QUANTISATION;
                let residual = own - alpha * near - rest * far;
                let difference = near - far + residual * (of_near - of_far) / spread;
                let (up, down) = (fast_max(rest, 1e-3), fast_max(alpha, 1e-3));
                let most = fast_min((1.0 - own) / up, own / down);
                let least = -fast_min(own / up, (1.0 - own) / down);
                let clamped = fast_min(fast_max(difference, fast_min(least, 0.0)), fast_max(most, 0.0));
                // The known background behind a covered pixel.
                differences[p][k] = if alpha > NEARLY_PURE { (own - far) / alpha } else { clamped };
            }
        }
        let first = pixels.len() - *count;
        for (k, pixel) in pixels[first..].iter_mut().enumerate() {
            pixel.difference = [differences[0][k], differences[1][k], differences[2][k]];
        }
        *count = 0;
    }
}
