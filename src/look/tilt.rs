//! The sharp band of tilt-shift.

use std::fmt;
use std::str::FromStr;

use crate::optics::Ramp;

/// The sharp band of `tilt-shift`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tilt {
    /// Middle of the band in the middle column, as a fraction of the height.
    pub center_y: f32,
    /// Width of the band across its direction, as a fraction of the height.
    pub band: f32,
    /// Rotation of the band, clockwise, in degrees; 0 is horizontal.
    pub angle_deg: f32,
}

impl FromStr for Tilt {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts = text.split(':');
        // Parses the next part: its default if the text ends, `None` if it is no number from `low` to `high`.
        let mut next = |low, high, default| match parts.next() {
            None => Some(default),
            Some(part) => part.trim().parse().ok().filter(|number| (low..=high).contains(number)),
        };
        let tilt = (|| {
            Some(Tilt {
                center_y: next(0.0, 1.0, 0.5)?,
                band: next(0.0, 1.0, 0.15)?,
                angle_deg: next(-360.0, 360.0, 0.0)?,
            })
        })();
        tilt.filter(|_| parts.next().is_none())
            .ok_or_else(|| "use CENTER_Y[:BAND[:ANGLE_DEG]], the first two from 0 to 1, such as 0.6:0.1:15".to_string())
    }
}

impl fmt::Display for Tilt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.center_y, self.band, self.angle_deg)
    }
}

impl Tilt {
    /// Returns the ramp for a picture of `size` pixels, which reaches `max_px` in the corner farthest from the band.
    pub fn ramp(&self, (width, height): (u32, u32), max_px: f32) -> Ramp {
        let (width, height) = (width as f32, height as f32);
        let (sin, cos) = self.angle_deg.to_radians().sin_cos();
        // The normal of the band, straight down at 0 degrees.
        let normal = glam::Vec2::new(-sin, cos);
        let offset_px = normal.dot(glam::Vec2::new(width / 2.0, height * self.center_y));
        let half_band_px = height * self.band / 2.0;
        let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
        let distance_px = corners
            .map(|corner| (normal.dot(corner.into()) - offset_px).abs() - half_band_px)
            .into_iter()
            .fold(0.0, f32::max);
        Ramp {
            normal,
            offset_px,
            half_band_px,
            slope: if distance_px > 0.0 { max_px / distance_px } else { 0.0 },
            max_px,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_all_is_sharp_the_ramp_is_level() {
        let ramp = |text: &str| text.parse::<Tilt>().unwrap().ramp((64, 48), 5.0);
        assert_eq!(ramp("0.5:1:0").slope, 0.0);
        // Half of the height on either side of a line is 5 px of blur.
        assert_eq!(ramp("0.5:0:0").slope, 5.0 / 24.0);
    }
}
