//! What holds of a look where nothing is said, beside what depends on the picture.

use super::Tilt;

/// Soft rim of the aperture, as a fraction of its radius: rank 3 is then as good as rank 7 of a hard disc.
pub const RIM: f32 = 0.2;
/// Highlight recovery; off, because it invents light.
pub const HIGHLIGHTS: f32 = 0.0;
/// Radial intensity of the aperture: flat.
pub const INTENSITY: f32 = 0.0;
/// Sharp range of distances around the focal plane, in metres.
pub const FOCUS_RANGE_M: f32 = 0.0;
/// The sharp band of tilt-shift.
pub const TILT: Tilt = Tilt { center_y: 0.55, band: 0.15, angle_deg: 0.0 };
