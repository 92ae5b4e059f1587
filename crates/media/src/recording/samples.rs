//! The sample format of picture files.

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

    pub fn bytes_per_pixel(self) -> usize {
        self.channels * (1 + usize::from(self.is_16bit))
    }
}
