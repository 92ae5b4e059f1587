//! What is behind a subject, known from a picture of the same place without it.

use crate::frame::ColorImage;

/// A picture of what is behind, and how it differs from that of now.
#[derive(Clone, Copy, Debug)]
pub struct Backdrop<'a> {
    /// As large as the picture of now.
    pub color: &'a ColorImage,
    /// The light of each code, by channel, as the camera exposes now.
    pub light: &'a [[f32; 256]; 3],
    /// Where its points are now, less where they were: to the right, and down.
    pub shift_px: [isize; 2],
}

impl Backdrop<'_> {
    /// The light behind a pixel; beyond its edges, it is as there.
    #[inline(always)]
    pub fn light_at(&self, x: usize, y: usize) -> [f32; 3] {
        let place = |at: usize, shift: isize, count: u32| at.saturating_add_signed(-shift).min(count as usize - 1);
        let (x, y) = (place(x, self.shift_px[0], self.color.width), place(y, self.shift_px[1], self.color.height));
        let at = 3 * (y * self.color.width as usize + x);
        [0, 1, 2].map(|p| self.light[p][usize::from(self.color.rgb[at + p])])
    }
}
