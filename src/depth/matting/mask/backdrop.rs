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
    /// The light behind the pixels of a row; beyond the picture's edges, it is as there.
    #[inline(always)]
    pub fn row(&self, y: usize) -> impl Fn(usize) -> [f32; 3] {
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
