//! Names of units.

use std::fmt::{self, Display};
use std::str::FromStr;

/// The meaning of the numbers in a depth map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DepthUnit {
    /// Distances in metres, or in units of which the scale is given.
    Metres,
    /// Distances, in this many units per metre.
    PerMetre(f32),
    /// Relative inverse depth: larger numbers are nearer.
    Inverse,
    /// Disparities in pixels; 1/256 px in whole numbers of 16 bits.
    Disparity,
}

/// Units per metre of millimetres.
const MILLIMETRES: f32 = 1000.0;

impl DepthUnit {
    /// Returns the units per metre of distances, if they are stated.
    pub fn units_per_m(self) -> Option<f32> {
        if let Self::PerMetre(scale) = self { Some(scale) } else { None }
    }
}

impl FromStr for DepthUnit {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let scale = |number: &str| number.parse().ok().filter(|scale: &f32| *scale > 0.0 && scale.is_finite());
        match text {
            "metres" | "meters" | "m" => Ok(Self::Metres),
            "millimetres" | "millimeters" | "mm" => Ok(Self::PerMetre(MILLIMETRES)),
            "inverse" => Ok(Self::Inverse),
            "disparity" => Ok(Self::Disparity),
            _ => {
                text.strip_prefix("scale:").and_then(scale).map(Self::PerMetre).ok_or_else(|| {
                    "use metres, millimetres, scale:N (N units per metre), inverse or disparity".to_owned()
                })
            }
        }
    }
}

impl Display for DepthUnit {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Metres => out.write_str("metres"),
            Self::PerMetre(MILLIMETRES) => out.write_str("millimetres"),
            Self::PerMetre(scale) => write!(out, "scale:{scale}"),
            Self::Inverse => out.write_str("inverse"),
            Self::Disparity => out.write_str("disparity"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_shown_is_read() {
        for text in ["metres", "millimetres", "scale:256", "scale:6553.5", "inverse", "disparity"] {
            assert_eq!(text.parse::<DepthUnit>().unwrap().to_string(), text);
        }
        for text in ["", "scale:", "scale:0", "scale:-1", "scale:inf", "cm"] {
            assert!(text.parse::<DepthUnit>().unwrap_err().contains("scale:N"), "{text}");
        }
    }
}
