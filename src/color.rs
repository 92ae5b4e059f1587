//! Colour: tone curves, above all sRGB's transfer function; luminance, and luma weights.

mod picture16;
mod tone_curve;

pub use picture16::Picture16;
pub use tone_curve::{ToneCurve, ToneCurves};

/// Converts an sRGB code value in [0, 1] to linear light (IEC 61966-2-1).
pub fn srgb_to_linear(code: f32) -> f32 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// Returns a table of the linear light of every 8-bit code.
pub fn srgb_to_linear_table() -> Box<[f32; 256]> {
    Box::new(std::array::from_fn(|code| srgb_to_linear(code as f32 / 255.0)))
}

/// Converts linear light to an sRGB code value in [0, 1].
pub fn linear_to_srgb(light: f32) -> f32 {
    if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

/// Converts linear light, 1 = white, to 8-bit sRGB; clamps to 0..1 first.
pub fn encode_srgb(light: f32) -> u8 {
    (linear_to_srgb(light.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8
}

/// Rounds a 16-bit code to 8 bits.
#[inline(always)]
pub fn round_to_8bit(code: u16) -> u8 {
    ((u32::from(code) * 255 + 32767) / 65535) as u8
}

/// Returns the luminance of linear light (Rec. 709 weights).
#[inline(always)]
pub fn luminance(r: f32, g: f32, b: f32) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Standard that defines the luma weights of red, green and blue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum YcbcrMatrix {
    /// Standard definition, JPEG, and cameras that do not declare a matrix.
    #[default]
    Bt601,
    /// High definition.
    Bt709,
    /// Ultra high definition, non-constant luminance.
    Bt2020,
}

impl YcbcrMatrix {
    /// Returns the matrix that players assume if none is declared: BT.709 from 720 rows on.
    pub fn for_height(height: u32) -> Self {
        if height >= 720 { Self::Bt709 } else { Self::Bt601 }
    }

    /// Returns the luma weights of red, green and blue.
    pub fn luma_weights(self) -> [f64; 3] {
        let (red, blue) = match self {
            Self::Bt601 => (0.299, 0.114),
            Self::Bt709 => (0.2126, 0.0722),
            Self::Bt2020 => (0.2627, 0.0593),
        };
        [red, 1.0 - red - blue, blue]
    }
}
