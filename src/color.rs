//! Colour: the curve of sRGB, luminance, and the weights of luma.

/// Linear light of an sRGB code value in [0, 1] (IEC 61966-2-1).
pub fn srgb_to_linear(code: f32) -> f32 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// The linear light of every 8-bit code.
pub fn light_of_codes() -> Box<[f32; 256]> {
    Box::new(std::array::from_fn(|code| srgb_to_linear(code as f32 / 255.0)))
}

/// sRGB code value in [0, 1] of linear light.
pub fn linear_to_srgb(light: f32) -> f32 {
    if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

/// 8-bit sRGB of linear light, 1 = white; cut to 0..1 first.
pub fn encode_srgb(light: f32) -> u8 {
    (linear_to_srgb(light.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8
}

/// Luminance of linear light (Rec. 709 weights).
#[inline(always)]
pub fn luminance(r: f32, g: f32, b: f32) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Which weights make luma of red, green and blue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Matrix {
    /// Standard definition, JPEG, and what cameras give that do not say.
    #[default]
    Bt601,
    /// High definition.
    Bt709,
    /// Ultra high definition, non-constant luminance.
    Bt2020,
}

impl Matrix {
    /// What players assume of a picture that does not say: BT.709 from 720 rows on.
    pub fn for_height(height: u32) -> Self {
        if height >= 720 { Self::Bt709 } else { Self::Bt601 }
    }

    /// Luma weights of red, green and blue.
    pub fn weights(self) -> [f64; 3] {
        let (red, blue) = match self {
            Self::Bt601 => (0.299, 0.114),
            Self::Bt709 => (0.2126, 0.0722),
            Self::Bt2020 => (0.2627, 0.0593),
        };
        [red, 1.0 - red - blue, blue]
    }
}
