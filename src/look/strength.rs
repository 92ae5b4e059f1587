//! The strength of the blur, for pictures of any size.

use std::fmt;
use std::str::FromStr;

use super::MAX_RADIUS_PX;
use super::number::parse_in_range;
use crate::optics::Lens;

/// The strength of the blur.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Strength {
    /// A CoC radius at infinity of [`COC_AT_INFINITY_PER_HEIGHT`](super::COC_AT_INFINITY_PER_HEIGHT).
    Default,
    /// CoC radius at infinity, in pixels.
    AtInfinity(f32),
    /// CoC radius at infinity, in percent of the picture's height.
    Percent(f32),
    /// Given by this lens at the focus distance.
    Lens(Lens),
}

impl FromStr for Strength {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let strength = match text.strip_suffix('%') {
            None if text == "auto" => Some(Self::Default),
            None => parse_in_range(text, 0.0, MAX_RADIUS_PX).map(Self::AtInfinity),
            Some(percent) => parse_in_range(percent, 0.0, 100.0).map(Self::Percent),
        };
        strength
            .ok_or_else(|| format!("use pixels from 0 to {MAX_RADIUS_PX}, a share of the height such as 3%, or auto"))
    }
}

impl fmt::Display for Strength {
    /// Writes the value of the setting `blur`; a lens has settings of its own.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Default => f.write_str("auto"),
            Self::AtInfinity(radius_px) => write!(f, "{radius_px}"),
            Self::Percent(percent) => write!(f, "{percent}%"),
            Self::Lens(lens) => write!(f, "{} mm f/{}", lens.focal_length_mm, lens.f_number),
        }
    }
}
