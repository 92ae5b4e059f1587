//! The sample format of picture files.

/// Difference of channels, 0 to 1, up to which a pixel is grey: compression makes such.
pub(super) const GREY_TOLERANCE: f32 = 8.0 / 255.0;

/// Share of pixels with colours up to which a picture is grey.
pub(super) const MAX_COLORED: f32 = 0.005;

/// Channels and bit depth of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleFormat {
    /// 1 is grey, 3 is colour; one more is alpha.
    pub channels: usize,
    /// Whether samples have 16 bits, big-endian, instead of 8.
    pub is_16bit: bool,
}

impl SampleFormat {
    pub fn has_color(self) -> bool {
        self.channels >= 3
    }

    pub fn has_alpha(self) -> bool {
        self.channels.is_multiple_of(2)
    }

    pub fn is_depth(self) -> bool {
        self.is_16bit && self.channels == 1
    }

    /// Returns the code of a channel of a pixel, 0 to [`Self::white`].
    #[inline]
    pub fn code(self, pixel: &[u8], channel: usize) -> u16 {
        match self.is_16bit {
            true => u16::from_be_bytes([pixel[2 * channel], pixel[2 * channel + 1]]),
            false => pixel[channel].into(),
        }
    }

    /// Returns the same, 0 to 65535.
    #[inline]
    pub fn code_16bit(self, pixel: &[u8], channel: usize) -> u16 {
        self.code(pixel, channel) * if self.is_16bit { 1 } else { 257 }
    }

    /// Returns the largest code.
    pub fn white(self) -> f32 {
        if self.is_16bit { 65535.0 } else { 255.0 }
    }

    pub fn bytes_per_pixel(self) -> usize {
        self.channels * (1 + usize::from(self.is_16bit))
    }
}
