//! The matte: pixels that show two surfaces at once.

use std::ops::Range;

/// A pixel on an outline: a share of a nearer surface, and the rest of a farther one.
///
/// With `D` the difference of the two colours, in linear light, and `I` the pixel's own, the nearer surface is
/// `I + (1 - share) D` and the farther one `I - share D`: so that both together are the pixel, exactly.
// As it lies in memory it is what the shaders read.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "gpu", derive(bytemuck::Pod, bytemuck::Zeroable))]
pub struct MixedPixel {
    /// Which pixel: row times columns plus column.
    pub at: u32,
    /// Distance of the nearer surface, in metres.
    pub near_m: f32,
    /// Distance of the farther surface, in metres, or unknown: infinitely far.
    pub far_m: f32,
    /// How much of the pixel the nearer surface covers, 0 to 1.
    pub share: f32,
    /// How much of the pixel is known of the farther surface, 0 to 1: what is seen of it, or 1 where what is behind is known
    /// from elsewhere.
    pub behind: f32,
    /// Colour of the nearer surface less that of the farther one: linear light, red, green and blue.
    pub difference: [f32; 3],
}

/// How much of each pixel a nearer surface covers, as far as a network or a person knows: `height` x `width` shares, 0 to 1,
/// row-major. It covers the same view as its picture, and mostly has far fewer pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mask {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width` shares.
    pub share: Vec<f32>,
}

impl Mask {
    /// Gives the mask another size, keeping its memory where that suffices. The content is unspecified after.
    pub fn resize(&mut self, width: u32, height: u32) {
        (self.width, self.height) = (width, height);
        super::make_room(&mut self.share, width as usize * height as usize);
    }
}

/// The mixed pixels of a picture, row by row and from left to right.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matte {
    /// By ascending [`MixedPixel::at`], each pixel at most once.
    pub pixels: Vec<MixedPixel>,
}

impl Matte {
    /// Most mixed pixels of a picture: where there are more, its depth is noise, and it is blurred as if it had none.
    pub fn most(width: usize, height: usize) -> usize {
        width * height / 4
    }

    /// Those among the pixels `range`.
    pub fn within(&self, range: Range<usize>) -> &[MixedPixel] {
        let until = |end: usize| self.pixels.partition_point(|pixel| (pixel.at as usize) < end);
        &self.pixels[until(range.start)..until(range.end)]
    }
}
