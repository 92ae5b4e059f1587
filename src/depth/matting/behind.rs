//! What is known to lie behind pixels.

/// What was seen at each pixel of a picture, and may lie behind what is there now.
#[derive(Clone, Copy, Debug)]
pub struct Behind<'a> {
    /// 8-bit sRGB, 3 bytes a pixel.
    pub rgb: &'a [u8],
    /// Inverse depth of each pixel, in 1/m.
    pub inverse: &'a [f32],
    /// For how many rounds each was seen.
    pub rounds: &'a [u8],
    /// It is known from so many rounds on, at least one.
    pub known: u8,
    /// The linear light of each code of `rgb`, by channel, as the camera exposes now.
    pub light: &'a [[f32; 256]; 3],
    /// It lies behind what is nearer by more than this step of inverse depth, in 1/m.
    pub other: f32,
    /// A number that no other `rgb`, `inverse` and `rounds` have in this process.
    pub revision: u64,
}

impl Behind<'_> {
    /// The light behind pixel `at`, whose nearer surface has inverse depth `near`, in 1/m; `None` where that is not known.
    #[inline(always)]
    pub fn light(&self, at: usize, near: f32) -> Option<[f32; 3]> {
        let is_known = (self.rounds[at] >= self.known) & (near - self.inverse[at] > self.other);
        if is_known { Some(light_at(self.rgb, self.light, at)) } else { None }
    }
}

/// The light of a pixel of 8-bit sRGB whose codes have this light, by channel.
#[inline(always)]
pub fn light_at(rgb: &[u8], light: &[[f32; 256]; 3], at: usize) -> [f32; 3] {
    let (rgb, mut of_pixel) = (&rgb[3 * at..][..3], [0.0; 3]);
    for p in 0..3 {
        of_pixel[p] = light[p][usize::from(rgb[p])];
    }
    of_pixel
}
