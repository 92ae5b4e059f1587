//! What the pixels of a map hide, as far as that is remembered and may be seen.

use super::{Background, KNOWN, OTHER_PX};
use crate::compute::bands::Bands;
use crate::compute::thread_pool::ThreadPool;
use crate::frame::{ColorImage, DepthMap, Matte, MixedPixel};
use crate::optics::DepthCoc;

impl Background {
    /// Gives the pixels of a map that hide something remembered, as far as blur can show it, what that is.
    pub fn reveal(&mut self, workers: &mut ThreadPool, map: &mut DepthMap, color: &ColorImage, lens: &DepthCoc) {
        let size = self.size;
        if map.size() != color.size() || !self.knows(color) {
            return;
        }
        let other = lens.inverse_depth_of_px(OTHER_PX);
        let Self { cells, rounds, inverse, .. } = self;
        let nearest = cells.survey(workers, size, |at| {
            let own = DepthMap::inverse_of(map.metres[at]);
            (rounds[at] >= KNOWN).then(|| (own, own - inverse[at] > other))
        });
        cells.spread(lens.coc_px(0.0).max(-lens.coc_px(nearest.recip())));
        let bands = Bands::new(size.1, 1, workers);
        let mut pixels = std::mem::take(&mut self.pixels);
        pixels.resize_with(bands.rows().count(), Vec::new);
        workers.run_each(bands.rows().zip(&mut pixels), &|(rows, pixels)| {
            pixels.clear();
            for y in rows {
                self.reveal_row(y, map, color, other, pixels);
            }
        });
        map.matte.pixels.clear();
        pixels.iter().for_each(|pixels| map.matte.pixels.extend_from_slice(pixels));
        if map.matte.pixels.len() > Matte::most(size.0, size.1) {
            map.matte.pixels.retain(|pixel| pixel.share < 1.0);
        }
        self.pixels = pixels;
    }

    /// Adds the mixed pixels of a row, and what the others of it hide.
    fn reveal_row(&self, y: usize, map: &DepthMap, color: &ColorImage, other: f32, pixels: &mut Vec<MixedPixel>) {
        let row = y * self.size.0;
        let mut before = map.matte.within(row..row + self.size.0).iter().peekable();
        for (columns, is_wanted) in self.cells.row(y) {
            let (first, end) = (row + columns.start, row + columns.end);
            if !is_wanted {
                while let Some(pixel) = before.next_if(|pixel| (pixel.at as usize) < end) {
                    pixels.push(*pixel);
                }
                continue;
            }
            for at in first..end {
                let mixed = before.next_if(|pixel| pixel.at as usize == at);
                pixels.extend(mixed.copied().or_else(|| self.behind(at, map.metres[at], &color.rgb, other)));
            }
        }
    }

    /// A pixel at `metres` and what it hides, if that is remembered.
    fn behind(&self, at: usize, metres: f32, rgb: &[u8], other: f32) -> Option<MixedPixel> {
        let light = self.light_behind(at, DepthMap::inverse_of(metres), other)?;
        let difference = std::array::from_fn(|p| self.own_light[usize::from(rgb[3 * at + p])] - light[p]);
        let far_m = self.inverse[at].recip();
        Some(MixedPixel { at: at as u32, near_m: metres, far_m, share: 1.0, behind: 1.0, difference })
    }
}
