//! The remembered background behind pixels.

/// A remembered background picture, which may be hidden now.
/// twin: shaders/matte/background.wgsl
#[derive(Clone, Copy, Debug)]
pub struct KnownBackground<'a> {
    /// 8-bit sRGB, 3 bytes a pixel.
    pub rgb: &'a [u8],
    /// Inverse depth of each pixel, in 1/m.
    pub inverse: &'a [f32],
    /// Number of rounds in which each pixel was seen.
    pub rounds: &'a [u8],
    /// Minimum number of rounds, at least 1, from which a pixel counts as known.
    pub min_rounds: u8,
    /// Linear light of each code of `rgb`, by channel, at the camera's current exposure.
    pub light: &'a [[f32; 256]; 3],
    /// Minimum step of inverse depth, in 1/m, from a surface to the background behind it.
    pub surface_step: f32,
    /// The revision of this content.
    pub revision: Revision,
}

/// Numbers unique in this process for the content of a remembered background. Forgetting a part changes only `rounds`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Revision {
    /// Of `rgb` and `inverse`.
    pub picture: u64,
    /// Of `rounds`.
    pub rounds: u64,
}

impl KnownBackground<'_> {
    /// Returns the linear light behind pixel `at`, whose nearer surface is at inverse depth `near`, in 1/m; `None` if
    /// unknown.
    #[inline(always)]
    pub fn light_at(&self, at: usize, near: f32) -> Option<[f32; 3]> {
        let is_known = (self.rounds[at] >= self.min_rounds) & (near - self.inverse[at] > self.surface_step);
        if is_known { Some(light_at(self.rgb, self.light, at)) } else { None }
    }
}

/// Returns the linear light of pixel `at` of an 8-bit sRGB picture, by a table for each channel.
#[inline(always)]
pub fn light_at(rgb: &[u8], light: &[[f32; 256]; 3], at: usize) -> [f32; 3] {
    let (rgb, mut of_pixel) = (&rgb[3 * at..][..3], [0.0; 3]);
    for p in 0..3 {
        of_pixel[p] = light[p][usize::from(rgb[p])];
    }
    of_pixel
}
