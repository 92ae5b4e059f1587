//! Lens models by the names and coefficients that files give them.

use super::Distortion;

/// Maximum tilt of a sensor.
const MAX_TILT_RAD: f64 = 0.5;

/// What is wrong with the coefficients of a lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LensFault {
    /// The model needs another number of them.
    Count(&'static str),
    /// The sensor would be tilted too far.
    Tilt,
    /// The model is unknown.
    Model,
}

impl Distortion {
    /// Returns the distortion of the lens model that calibrations call `model`, with these coefficients.
    pub fn from_model(model: &str, coefficients: &[f64]) -> Result<Self, LensFault> {
        match model.to_ascii_lowercase().replace('_', "-").as_str() {
            // ROS writes no coefficients, and at times no model, for pictures without distortion.
            "none" | "" | "plumb-bob" if coefficients.is_empty() => Ok(Self::RadialTangential([0.0; 8])),
            "radial-tangential" | "radtan" | "plumb-bob" | "rational-polynomial" | "opencv" | "pinhole" => {
                if ![4, 5, 8, 12, 14].contains(&coefficients.len()) {
                    return Err(LensFault::Count("a vector of 4, 5, 8, 12 or 14 (k1 k2 p1 p2 k3 ...)"));
                }
                let mut all = [0.0; 14];
                all[..coefficients.len()].copy_from_slice(coefficients);
                if all[12..].iter().any(|tilt_rad: &f64| tilt_rad.abs() > MAX_TILT_RAD) {
                    return Err(LensFault::Tilt);
                }
                // The first 8 are k1 to k6, p1 and p2; the others belong to a thin prism and a tilted sensor.
                let [k1, k2, p1, p2, k3, k4, k5, k6, rest @ ..] = all;
                Ok(match rest == [0.0; 6] {
                    true => Self::RadialTangential([k1, k2, p1, p2, k3, k4, k5, k6]),
                    false => Self::PrismTilted(all),
                })
            }
            "equidistant" | "fisheye" | "kannala-brandt" | "opencv-fisheye" => {
                let all = coefficients.try_into().map(Self::Equidistant);
                all.map_err(|_| LensFault::Count("a vector of 4 (k1 k2 k3 k4)"))
            }
            "none" => Ok(Self::RadialTangential([0.0; 8])),
            _ => Err(LensFault::Model),
        }
    }
}
