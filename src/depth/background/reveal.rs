//! Adds the remembered background to the pixels that hide it, where blur may reveal it.

use std::ops::Range;

use pulp::{Arch, WithSimd};

use super::cells::{BackgroundView, CELL};
use super::{BackgroundMemory, SURFACE_STEP_PX};
use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;
use crate::depth::matting::light_at;
use crate::frame::{ColorImage, DepthMap, Matte, MixedPixel};
use crate::optics::DepthCoc;

impl BackgroundMemory {
    /// Adds the hidden background to the matte of a map, for pixels within the blur radius of a visible background.
    pub fn reveal_background(
        &mut self,
        workers: &mut ThreadPool,
        map: &mut DepthMap,
        color: &ColorImage,
        lens: &DepthCoc,
    ) {
        let size = self.size;
        if map.size() != color.size() || !self.is_usable_for(color) {
            return;
        }
        let mut cells = std::mem::take(&mut self.cells);
        let mut pixels = std::mem::take(&mut self.pixels);
        let surface_step = lens.inverse_depth_step(SURFACE_STEP_PX);
        let known = BackgroundView { metres: &map.metres, rounds: &self.rounds, inverse: &self.inverse, surface_step };
        let nearest = cells.classify(workers, size, &known);
        cells.select_near_visible(lens.coc_px(0.0).max(-lens.coc_px(nearest.recip())));
        self.cells = cells;
        let bands = Bands::new(size.1, 1, workers);
        pixels.resize_with(bands.rows().count(), Vec::new);
        workers.run_each(bands.rows().zip(&mut pixels), &|(rows, pixels)| {
            Arch::new().dispatch(Reveal { background: self, map, color, known: &known, rows, pixels });
        });
        // The first band's vector is moved, not copied.
        if let Some((first, others)) = pixels.split_first_mut() {
            std::mem::swap(&mut map.matte.pixels, first);
            others.iter().for_each(|pixels| map.matte.pixels.extend_from_slice(pixels));
        }
        if map.matte.pixels.len() > Matte::max_pixels(size.0, size.1) {
            map.matte.pixels.retain(|pixel| pixel.alpha < 1.0);
        }
        self.pixels = pixels;
    }

    /// Creates the matte entry of a pixel at `metres` that hides a known background.
    #[inline(always)]
    fn create_mixed_pixel(&self, at: usize, metres: f32, rgb: &[u8]) -> MixedPixel {
        let (light, own) = (light_at(&self.rgb, &self.light, at), &rgb[3 * at..][..3]);
        let mut difference = [0.0; 3];
        for p in 0..3 {
            difference[p] = self.own_light[usize::from(own[p])] - light[p];
        }
        let far_m = self.inverse[at].recip();
        MixedPixel { at: at as u32, near_m: metres, far_m, alpha: 1.0, background_alpha: 1.0, difference }
    }
}

/// Merges the mixed pixels of some rows with the pixels that hide a background.
struct Reveal<'a> {
    background: &'a BackgroundMemory,
    map: &'a DepthMap,
    color: &'a ColorImage,
    known: &'a BackgroundView<'a>,
    rows: Range<usize>,
    pixels: &'a mut Vec<MixedPixel>,
}

impl WithSimd for Reveal<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { background, map, color, known, rows, pixels } = self;
        let width = background.size.0;
        pixels.clear();
        let mut mixed = map.matte.pixels_in(rows.start * width..rows.end * width);
        for y in rows {
            for columns in background.cells.selected_columns(y) {
                let (first, end) = (y * width + columns.start, y * width + columns.end);
                pixels.extend_from_slice(split_off_before(&mut mixed, first));
                let (metres, rounds, inverse) = known.pixels(first, columns.len());
                let mut is_hiding = [0; CELL];
                let hiding = &mut is_hiding[..columns.len()];
                for k in 0..hiding.len() {
                    hiding[k] = known.classify_pixel(metres[k], rounds[k], inverse[k]).1;
                }
                let mut here = split_off_before(&mut mixed, end).iter().peekable();
                for (k, hides) in hiding.iter().enumerate() {
                    let at = first + k;
                    match here.next_if(|pixel| pixel.at as usize == at) {
                        Some(pixel) => pixels.push(*pixel),
                        None if *hides != 0 => pixels.push(background.create_mixed_pixel(at, metres[k], &color.rgb)),
                        None => {}
                    }
                }
            }
        }
        pixels.extend_from_slice(mixed);
    }
}

/// Splits off the pixels before index `at`.
#[inline(always)]
fn split_off_before<'a>(pixels: &mut &'a [MixedPixel], at: usize) -> &'a [MixedPixel] {
    let mut count = 0;
    while pixels.get(count).is_some_and(|pixel| (pixel.at as usize) < at) {
        count += 1;
    }
    let (taken, left) = pixels.split_at(count);
    *pixels = left;
    taken
}
