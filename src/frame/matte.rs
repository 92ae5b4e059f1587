//! The matte: pixels that show two surfaces at once (fractional alpha).

use std::ops::Range;

/// A mixed pixel on an outline: partly a nearer surface, the rest a farther one.
///
/// With alpha `alpha`, `D` the difference of the two colours in linear light, and `I` the pixel's own colour, the
/// nearer surface is `I + (1 - alpha) D` and the farther one `I - alpha D`, so that they composite exactly to the
/// pixel.
// The shaders read this memory layout.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "gpu", derive(bytemuck::Pod, bytemuck::Zeroable))]
pub struct MixedPixel {
    /// Pixel index: row times columns plus column.
    pub at: u32,
    /// Distance of the nearer surface, in metres.
    pub near_m: f32,
    /// Distance of the farther surface, in metres; unknown counts as infinite.
    pub far_m: f32,
    /// Alpha of the nearer surface, 0 to 1.
    pub alpha: f32,
    /// Known fraction of the farther surface, 0 to 1: its visible fraction, or 1 if it is known from elsewhere.
    pub background_alpha: f32,
    /// Colour of the nearer surface minus that of the farther one: linear light, red, green and blue.
    pub difference: [f32; 3],
}

/// Alpha mask of a nearer surface, from a network or a person: `height` x `width` alphas, 0 to 1, row-major. It covers
/// the same view as its picture, mostly at a much lower resolution.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mask {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width` alphas.
    pub alpha: Vec<f32>,
}

impl Mask {
    /// Resizes the mask, reusing its memory if possible. The content is unspecified afterwards.
    pub fn resize(&mut self, width: u32, height: u32) {
        (self.width, self.height) = (width, height);
        super::resize_buffer(&mut self.alpha, width as usize * height as usize);
    }
}

/// The mixed pixels of a picture, in row-major order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matte {
    /// By ascending [`MixedPixel::at`], each pixel at most once.
    pub pixels: Vec<MixedPixel>,
}

impl Matte {
    /// Returns the largest valid number of pixels on outlines, with an alpha below 1: with more, the depth is noise.
    pub fn max_pixels(width: usize, height: usize) -> usize {
        width * height / 2
    }

    /// Returns the largest number of pixels beside depth discontinuities that are matted; the rest of
    /// [`Self::max_pixels`] is for thin structures that continue from them.
    pub fn max_edges(width: usize, height: usize) -> usize {
        Self::max_pixels(width, height) / 4 * 3
    }

    /// Returns the largest valid number of other pixels, which hide a known surface entirely.
    pub fn max_hidden(width: usize, height: usize) -> usize {
        width * height / 4
    }

    /// Returns the largest valid number of all pixels; with more, the picture is blurred without the matte.
    pub fn capacity(width: usize, height: usize) -> usize {
        Self::max_pixels(width, height) + Self::max_hidden(width, height)
    }

    /// Returns the mixed pixels among the pixels `range`.
    pub fn pixels_in(&self, range: Range<usize>) -> &[MixedPixel] {
        let until = |pixels: &[MixedPixel], end: usize| pixels.partition_point(|pixel| (pixel.at as usize) < end);
        let from_start = &self.pixels[until(&self.pixels, range.start)..];
        // No more than the range has: so the second search is a short one, in memory that was just read.
        let most = &from_start[..from_start.len().min(range.len())];
        &most[..until(most, range.end)]
    }

    /// Returns column and row of some of the mixed pixels of a picture, none before row `y`.
    pub fn locate(
        pixels: &[MixedPixel],
        mut y: usize,
        width: usize,
    ) -> impl Iterator<Item = (usize, usize, &MixedPixel)> {
        let mut start = y * width;
        pixels.iter().map(move |pixel| {
            while pixel.at as usize >= start + width {
                (y, start) = (y + 1, start + width);
            }
            (pixel.at as usize - start, y, pixel)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pixels_of_a_range_are_all_within_it() {
        let pixel = |at| MixedPixel { at, ..MixedPixel::default() };
        for places in
            [vec![], vec![7], vec![0, 1, 2, 3, 9, 10, 11, 40], (0..50).collect(), (0..50).step_by(7).collect()]
        {
            let matte = Matte { pixels: places.iter().copied().map(pixel).collect() };
            assert!(Matte::locate(&matte.pixels, 0, 9).all(|(x, y, pixel)| x < 9 && y * 9 + x == pixel.at as usize));
            for (start, end) in (0..52).flat_map(|start| (start..54).map(move |end| (start, end))) {
                let found: Vec<u32> = matte.pixels_in(start..end).iter().map(|pixel| pixel.at).collect();
                let expected = places.iter().copied().filter(|&at| (start..end).contains(&(at as usize)));
                assert_eq!(found, expected.collect::<Vec<u32>>(), "{start}..{end} of {places:?}");
            }
        }
    }
}
