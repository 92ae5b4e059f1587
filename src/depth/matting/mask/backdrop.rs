//! A known background of the subject: a picture of the same place without it.

use std::ops::Range;

use super::cells::MaskView;
use crate::frame::{ColorImage, DepthMap, MixedPixel};

/// A background picture, and its exposure and shift relative to the current picture.
#[derive(Clone, Copy, Debug)]
pub struct BackgroundPlate<'a> {
    /// A picture of the size of the current one.
    pub color: &'a ColorImage,
    /// Linear light of each code, by channel, at the camera's current exposure.
    pub light: &'a [[f32; 256]; 3],
    /// Current position of its points minus their original one, in pixels: right, down.
    pub shift_px: [isize; 2],
}

impl BackgroundPlate<'_> {
    /// Returns a function from the column to the background light in a row; the border is replicated.
    #[inline(always)]
    pub fn light_in_row(&self, y: usize) -> impl Fn(usize) -> [f32; 3] {
        let place = |at: usize, shift: isize, count: usize| at.saturating_add_signed(-shift).min(count - 1);
        let (width, height) = (self.color.width as usize, self.color.height as usize);
        let row = &self.color.rgb[3 * width * place(y, self.shift_px[1], height)..][..3 * width];
        let (light, shift) = (self.light, self.shift_px[0]);
        move |x| {
            let at = 3 * place(x, shift, width);
            [0, 1, 2].map(|p| light[p][usize::from(row[at + p])])
        }
    }
}

impl MaskView<'_> {
    /// Adds the known background behind covered pixels.
    #[inline(always)]
    pub(super) fn add_background(
        &self,
        backdrop: &BackgroundPlate,
        (xs, y): (Range<usize>, usize),
        map: &mut DepthMap,
    ) {
        let (row, background_at) = (y * self.color.width as usize, backdrop.light_in_row(y));
        let metres = &map.metres[row..];
        map.matte.pixels.extend(xs.map(|x| {
            let (own, light) = (self.light_at(row + x), background_at(x));
            let difference = std::array::from_fn(|p| own[p] - light[p]);
            let (at, near_m, far_m) = ((row + x) as u32, DepthMap::SUBJECT_M, metres[x]);
            MixedPixel { at, near_m, far_m, alpha: 1.0, background_alpha: 1.0, difference }
        }));
    }
}
