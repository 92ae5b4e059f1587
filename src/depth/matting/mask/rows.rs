//! Alpha of the pixels in the unknown region, row by row.

#![allow(clippy::needless_range_loop)] // Lanes and planes index several arrays at once.

use std::ops::Range;

use super::cells::{Cell, MaskView, Run};
use super::connection::Connection;
use super::models::{INVERSE, LINE, MODEL, Models, SURFACES};
use super::outline::clarity;
use super::posterior::{LANES, Lanes, Posterior};
use super::{CONNECTED_FROM, NEAR_FROM};
use crate::compute::simd::prefetch;
use crate::depth::matting::contrast::MAX_PRECISION;
use crate::depth::matting::{fast_max, fast_min};
use crate::depth::tap::Tap;

/// The numbers of a row's pixels, by column, and scratch memory for the mask. Some columns more than the picture has,
/// so that all lanes can be read and written.
#[derive(Debug, Default)]
pub struct RowBuffers {
    mask_row: Vec<f32>,
    mask: Vec<f32>,
    light: [Vec<f32>; 3],
    /// Light of the known background.
    behind: [Vec<f32>; 3],
    precision: Vec<f32>,
    alpha: Vec<f32>,
}

impl RowBuffers {
    fn resize(&mut self, width: usize) {
        let Self { mask, light, behind, precision, alpha, .. } = self;
        let planes = light.iter_mut().chain(behind);
        planes.chain([mask, precision, alpha]).for_each(|plane| plane.resize(width + LANES, 0.0));
    }
}

/// Returns the lanes from column `x` on.
#[inline(always)]
fn lanes_at(row: &[f32], x: usize) -> Lanes {
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&row[x..][..LANES]);
    lanes
}

#[inline(always)]
fn lanes_of([red, green, blue]: &[Vec<f32>; 3], x: usize) -> [Lanes; 3] {
    [lanes_at(red, x), lanes_at(green, x), lanes_at(blue, x)]
}

/// Mask value from which a pixel is near whatever its colour, and the value up to which colours alone may make it far: an arm
/// looks like a wall behind it, and the outline of a coarse mask is off by some pixels.
const TRUSTED: f32 = 0.9;
const DOUBTED: f32 = 0.7;

/// Place of each lane's colour between both surfaces' (0: far, 1: near), and its reciprocal variance.
type Discriminants = (Lanes, Lanes);

impl MaskView<'_> {
    /// Computes alpha of the pixels of all `runs` in the unknown region, and adds those that may be connected to the
    /// near surface.
    #[inline(always)]
    pub fn compute_alphas(
        &self,
        (runs, models, posterior): (&[Run], &Models, &Posterior),
        buffers: &mut RowBuffers,
        alphas: &mut Vec<f32>,
        connection: &mut Connection,
    ) {
        buffers.resize(self.color.width as usize);
        for runs in runs.chunk_by(|a, b| a.row == b.row) {
            let in_band = runs.iter().filter(|run| run.cell == Cell::Band);
            for y in self.pixel_rows(runs[0].row) {
                let down = self.enclosing_cells(y, self.down);
                self.interpolate_mask_row(y, &mut buffers.mask_row);
                for xs in in_band.clone().map(|run| run.xs.clone()) {
                    self.read_pixels((xs.clone(), y), buffers);
                    let mut start = xs.start;
                    while start < xs.end {
                        let (columns, end) = self.columns_around(start);
                        self.compute_part(models, posterior, (start..end.min(xs.end), &down, columns), buffers);
                        start = end;
                    }
                    if let Some(given) = self.given {
                        let given = &given.alpha[y * self.color.width as usize..];
                        for x in xs.clone() {
                            let alpha = &mut buffers.alpha[x];
                            *alpha = given[x] + (*alpha - given[x]) * clarity(buffers.precision[x]);
                        }
                    }
                    alphas.extend_from_slice(&buffers.alpha[xs.clone()]);
                    add_connected((xs, y), buffers, connection);
                }
            }
        }
    }

    /// Reads the mask and the light of some pixels.
    #[inline(always)]
    fn read_pixels(&self, (xs, y): (Range<usize>, usize), buffers: &mut RowBuffers) {
        let RowBuffers { mask_row, mask, light, behind, .. } = buffers;
        let [red, green, blue] = light;
        let width = self.color.width as usize;
        let first = y * width;
        // The rows of a run lie too far apart for the processor to foresee them.
        if let Some(next) = self.color.rgb.get(3 * (first + width + xs.start)..3 * (first + width + xs.end)) {
            prefetch(next);
        }
        let light = red[xs.clone()].iter_mut().zip(&mut green[xs.clone()]).zip(&mut blue[xs.clone()]);
        let codes = &self.color.rgb.as_chunks::<3>().0[first..][xs.clone()];
        for (((red, green), blue), codes) in light.zip(codes) {
            [*red, *green, *blue] = codes.map(|code| self.light[usize::from(code)]);
        }
        for (x, mask) in xs.clone().zip(&mut mask[xs.clone()]) {
            *mask = self.mask_at(mask_row, x);
        }
        if let Some(backdrop) = self.backdrop {
            let background_at = backdrop.light_in_row(y);
            let [red, green, blue] = behind;
            for x in xs {
                [red[x], green[x], blue[x]] = background_at(x);
            }
        }
    }

    /// Computes alpha of pixels between the same four cell centres.
    #[inline(always)]
    fn compute_part(
        &self,
        models: &Models,
        posterior: &Posterior,
        (xs, down, columns): (Range<usize>, &Tap, [usize; 2]),
        buffers: &mut RowBuffers,
    ) {
        let (across, step) = (self.across, 1.0 / self.cell_px as f32);
        // With a known background, each pixel has its own discriminant.
        let (mut line, mut front) = (None, None);
        match self.backdrop {
            None => line = models.beside::<{ SURFACES - LINE }>(LINE, across, down, columns),
            Some(_) => front = models.beside::<{ MODEL - SURFACES }>(SURFACES, across, down, columns),
        }
        for x in xs.step_by(LANES) {
            let first = self.place_of(x) - columns[0] as f32;
            let mut along = [0.0; LANES];
            for k in 0..LANES {
                along[k] = first + step * k as f32;
            }
            let light = lanes_of(&buffers.light, x);
            let mask = lanes_at(&buffers.mask, x);
            let discriminants = match (&line, &front) {
                (Some(line), _) => Some(discriminate(line, &along, &light)),
                (None, Some(front)) => {
                    let behind = lanes_of(&buffers.behind, x);
                    Some(discriminate_against(front, &along, &light, &behind))
                }
                (None, None) => None,
            };
            let (alpha, precision) = match discriminants {
                Some((places, precision)) => {
                    let mut alpha = posterior.alphas(&mask, &places, &precision);
                    // A loosened mask is of an outline that may be wrong.
                    if self.given.is_none() {
                        for k in 0..LANES {
                            alpha[k] = fast_max(alpha[k], fast_min((mask[k] - DOUBTED) / (TRUSTED - DOUBTED), 1.0));
                        }
                    }
                    (alpha, precision)
                }
                None => (mask, [0.0; LANES]),
            };
            buffers.alpha[x..][..LANES].copy_from_slice(&alpha);
            buffers.precision[x..][..LANES].copy_from_slice(&precision);
        }
    }
}

/// Returns the discriminants of a line interpolated between `left` and `right`.
#[inline(always)]
fn discriminate<const N: usize>([left, right]: &[[f32; N]; 2], along: &Lanes, light: &[Lanes; 3]) -> Discriminants {
    let (mut places, mut precision) = ([0.0; LANES], [0.0; LANES]);
    for k in 0..LANES {
        let between = |n: usize| left[n] + (right[n] - left[n]) * along[k];
        places[k] = between(0) * light[0][k] + between(1) * light[1][k] + between(2) * light[2][k] - between(3);
        precision[k] = between(4);
    }
    (places, precision)
}

/// Returns the discriminants between a surface interpolated between `left` and `right` and the light `behind` it.
#[inline(always)]
fn discriminate_against<const N: usize>(
    [left, right]: &[[f32; N]; 2],
    along: &Lanes,
    light: &[Lanes; 3],
    behind: &[Lanes; 3],
) -> Discriminants {
    const FIRST: usize = INVERSE - SURFACES;
    let (mut places, mut precision) = ([0.0; LANES], [0.0; LANES]);
    for k in 0..LANES {
        let between = |n: usize| left[n] + (right[n] - left[n]) * along[k];
        let [x, y, z] = [between(0) - behind[0][k], between(1) - behind[1][k], between(2) - behind[2][k]];
        let [xx, xy, xz] = [between(FIRST), between(FIRST + 1), between(FIRST + 2)];
        let [yy, yz, zz] = [between(FIRST + 3), between(FIRST + 4), between(FIRST + 5)];
        let direction = [xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z];
        let contrast = fast_max(direction[0] * x + direction[1] * y + direction[2] * z, 1e-9);
        let mut place = 0.0;
        for p in 0..3 {
            place += direction[p] * (light[p][k] - behind[p][k]);
        }
        places[k] = place / contrast;
        precision[k] = fast_min(2.0 * contrast, MAX_PRECISION);
    }
    (places, precision)
}

/// Adds the pixels of a run that may be connected to the near surface, and its seeds.
#[inline(always)]
fn add_connected((xs, y): (Range<usize>, usize), buffers: &RowBuffers, connection: &mut Connection) {
    for x in xs.clone().step_by(LANES) {
        let (mask, alpha) = (lanes_at(&buffers.mask, x), lanes_at(&buffers.alpha, x));
        // Candidates in the lower bits, seeds in the higher ones.
        let mut bits = [0u32; LANES];
        for k in 0..LANES {
            let is_seed = (alpha[k] > NEAR_FROM) & (mask[k] > NEAR_FROM);
            bits[k] = u32::from(alpha[k] >= CONNECTED_FROM) << k | u32::from(is_seed) << (LANES + k);
        }
        let bits = u64::from(bits.into_iter().fold(0, |all, bits| all | bits));
        let own = u64::MAX >> (u64::BITS as usize - LANES.min(xs.end - x));
        connection.add((x, y), bits & own, bits >> LANES & own);
    }
}

#[cfg(test)]
mod tests {
    use super::super::MaskMatting;
    use super::{DOUBTED, TRUSTED};
    use crate::frame::{ColorImage, DepthMap, Mask};

    /// Side of a mask pixel, and size of the mask.
    const SCALE: usize = 5;
    const SIZE: (usize, usize) = (40, 30);

    /// Returns alpha in the middle of an arm that has this value in the mask and the wall's colour, beside a body of another
    /// one.
    fn alpha_in_middle(value: f32) -> f32 {
        let is_arm = |x: usize, y: usize| (20..24).contains(&x) && (10..20).contains(&y);
        let mut mask = Mask::default();
        mask.resize(SIZE.0 as u32, SIZE.1 as u32);
        for (at, alpha) in mask.alpha.iter_mut().enumerate() {
            let (x, y) = (at % SIZE.0, at / SIZE.0);
            *alpha = if is_arm(x, y) { value } else { f32::from(x < 20) };
        }
        let mut color = ColorImage::new((SCALE * SIZE.0) as u32, (SCALE * SIZE.1) as u32);
        for (at, pixel) in color.rgb.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            let grain = (at * 7 % 5) as u8;
            *pixel = if at % (SCALE * SIZE.0) < SCALE * 20 { [40 + grain; 3] } else { [200 + grain, 160, 140] };
        }
        let mut map = DepthMap::new(color.width, color.height);
        map.metres.fill(DepthMap::FAR_M);
        MaskMatting::default().compute_matte(&mask, &color, None, &mut map);
        let at = SCALE * 15 * SCALE * SIZE.0 + SCALE * 22;
        let mixed = map.matte.pixels.iter().find(|pixel| pixel.at as usize == at);
        mixed.map_or(f32::from(u8::from(map.metres[at] <= DepthMap::SUBJECT_M)), |pixel| pixel.alpha)
    }

    #[test]
    fn what_a_mask_is_sure_of_stays_and_of_what_it_doubts_colours_decide() {
        assert_eq!([1.0, 0.9, TRUSTED].map(alpha_in_middle), [1.0; 3]);
        let between = alpha_in_middle((TRUSTED + DOUBTED) / 2.0);
        assert!((0.3..0.8).contains(&between), "{between}");
        assert!([DOUBTED, 0.5, 0.2].into_iter().all(|value| alpha_in_middle(value) < 0.1));
    }
}
