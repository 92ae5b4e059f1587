//! Pictures of 16-bit codes.

use super::{ToneCurves, round_to_8bit};

/// A picture of 16-bit codes: `height` x `width` x 3 (R, G, B), row-major, no padding.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture16 {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width * 3` codes.
    pub rgb: Vec<u16>,
    /// The tone curves of its codes.
    pub curves: ToneCurves,
}

impl Picture16 {
    /// Creates a black picture.
    pub fn new((width, height): (u32, u32), curves: ToneCurves) -> Self {
        Self { width, height, rgb: vec![0; width as usize * height as usize * 3], curves }
    }

    /// Stretches 8-bit codes, `height` x `width` x 3, to 16 bits, which [`Picture16::to_8bit`] reverses.
    pub fn from_8bit((width, height): (u32, u32), rgb: &[u8], curves: ToneCurves) -> Self {
        Self { width, height, rgb: rgb.iter().map(|&code| u16::from(code) * 257).collect(), curves }
    }

    /// Returns columns and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Returns the codes rounded to 8 bits.
    pub fn to_8bit(&self) -> Vec<u8> {
        self.rgb.iter().map(|&code| round_to_8bit(code)).collect()
    }

    /// Returns 8-bit codes of the same light in sRGB's curve.
    pub fn to_srgb(&self) -> Vec<u8> {
        let tables = self.curves.0.each_ref().map(|curve| curve.srgb_table());
        let codes = self.rgb.as_chunks::<3>().0;
        codes.iter().flat_map(|rgb| [0, 1, 2].map(|channel| tables[channel][usize::from(rgb[channel])])).collect()
    }

    /// Takes over the pixels that differ between two versions of this picture as 8-bit sRGB.
    pub fn take_changes(&mut self, before: &[u8], after: &[u8]) {
        let versions = before.as_chunks::<3>().0.iter().zip(after.as_chunks::<3>().0);
        for (codes, (before, after)) in self.rgb.as_chunks_mut::<3>().0.iter_mut().zip(versions) {
            if before != after {
                *codes = std::array::from_fn(|channel| self.curves.0[channel].encode_srgb(after[channel]));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::ToneCurve;
    use super::*;

    #[test]
    fn eight_bits_keep_the_light_and_changes_come_back() {
        let curves = ToneCurves([1.8, 2.2, 1.0].map(|gamma| Arc::new(ToneCurve::from_fn(move |c| c.powf(gamma)))));
        let srgb: Vec<u8> = (0..=255).flat_map(|code| [code; 3]).collect();
        let mut picture = Picture16::new((16, 16), curves);
        picture.take_changes(&vec![1; srgb.len()], &srgb);
        assert_eq!((picture.rgb[3], picture.to_srgb()[6..].to_vec()), (0, srgb[6..].to_vec()));
        let codes = picture.rgb.clone();
        picture.take_changes(&srgb, &srgb);
        assert_eq!(picture.rgb, codes);
    }

    #[test]
    fn stretching_to_16_bits_is_undone() {
        let rgb: Vec<u8> = (0..=255).flat_map(|code| [code, 255 - code, 7]).collect();
        assert_eq!(Picture16::from_8bit((16, 16), &rgb, ToneCurves::srgb().clone()).to_8bit(), rgb);
    }
}
