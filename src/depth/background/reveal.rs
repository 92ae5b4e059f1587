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
        let surface_step = lens.inverse_depth_step(SURFACE_STEP_PX);
        if !std::mem::take(&mut self.is_classified) {
            self.classify_cells(workers, map, surface_step);
        }
        let nearest = self.cells.nearest_hiding;
        self.cells.select_near_visible(lens.coc_px(0.0).max(-lens.coc_px(nearest.recip())));
        let mut pixels = std::mem::take(&mut self.pixels);
        let known = self.view(map, surface_step);
        let bands = Bands::new(size.1, 1, workers);
        pixels.resize_with(bands.rows().count(), Default::default);
        workers.run_each(bands.rows().zip(&mut pixels), &|(rows, (pixels, hidden))| {
            Arch::new().dispatch(Reveal { background: self, map, color, known: &known, rows, pixels, hidden });
        });
        // The first band's vector is moved, not copied.
        if let Some(((first, _), others)) = pixels.split_first_mut() {
            std::mem::swap(&mut map.matte.pixels, first);
            others.iter().for_each(|(pixels, _)| map.matte.pixels.extend_from_slice(pixels));
        }
        if map.matte.pixels.len() > Matte::capacity(size.0, size.1) {
            map.matte.pixels.retain(|pixel| pixel.alpha < 1.0);
        }
        self.pixels = pixels;
    }

    /// Classifies the cells of a map.
    pub(super) fn classify_cells(&mut self, workers: &mut ThreadPool, map: &DepthMap, surface_step: f32) {
        let mut cells = std::mem::take(&mut self.cells);
        cells.classify(workers, self.size, &self.view(map, surface_step));
        self.cells = cells;
    }

    fn view<'a>(&'a self, map: &'a DepthMap, surface_step: f32) -> BackgroundView<'a> {
        BackgroundView { metres: &map.metres, rounds: &self.rounds, inverse: &self.inverse, surface_step }
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
    /// Of each selected cell, its first pixel in a row, and a bit for each pixel that hides a known background.
    hidden: &'a mut Vec<(usize, u32)>,
}

impl WithSimd for Reveal<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { background, map, color, known, rows, pixels, hidden } = self;
        let width = background.size.0;
        pixels.clear();
        let mut mixed = map.matte.pixels_in(rows.start * width..rows.end * width);
        for y in rows {
            hidden.clear();
            // All of a row first: these loads do not wait for one another.
            for columns in background.cells.selected_columns(y) {
                let (metres, rounds, inverse) = known.pixels(y * width + columns.start, columns.len());
                let mut is_hiding = [0; CELL];
                let hiding = &mut is_hiding[..columns.len()];
                for k in 0..hiding.len() {
                    hiding[k] = known.classify_pixel(metres[k], rounds[k], inverse[k]).1 << k;
                }
                hidden.push((y * width + columns.start, is_hiding.iter().fold(0, |all, bit| all | bit)));
            }
            for &(first, bits) in hidden.iter().filter(|(_, bits)| *bits != 0) {
                pixels.extend_from_slice(split_off_before(&mut mixed, first));
                let here = split_off_before(&mut mixed, first + CELL.min(width - (first - y * width)));
                let create = |at: usize| background.create_mixed_pixel(at, map.metres[at], &color.rgb);
                // Most cells have no mixed pixels, and hide all.
                if here.is_empty() && bits == (1 << CELL) - 1 {
                    pixels.extend((first..first + CELL).map(create));
                    continue;
                }
                let mut here = here.iter().peekable();
                for k in 0..CELL {
                    let at = first + k;
                    match here.next_if(|pixel| pixel.at as usize == at) {
                        Some(pixel) => pixels.push(*pixel),
                        None if bits >> k & 1 != 0 => pixels.push(create(at)),
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
