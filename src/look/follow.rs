//! Auto-framing: how far the crop may follow the subject.

use std::fmt;
use std::str::FromStr;

use super::number::parse_in_range;

/// The largest zoom to keep the subject centred: 1, which is off, to [`FramingZoom::MAX_ZOOM`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramingZoom(f32);

impl FramingZoom {
    /// No zoom.
    pub const OFF: Self = Self(1.0);
    /// Maximum zoom: beyond it too few of a camera's pixels remain.
    pub const MAX_ZOOM: f32 = 4.0;

    /// Creates it from a zoom, clamped from 1 (off) to [`FramingZoom::MAX_ZOOM`].
    pub fn from_zoom(zoom: f32) -> Self {
        Self(if zoom > 1.0 { zoom.min(Self::MAX_ZOOM) } else { 1.0 })
    }

    /// Returns the largest zoom; `None` if it is off.
    pub fn zoom(self) -> Option<f32> {
        (self != Self::OFF).then_some(self.0)
    }
}

impl FromStr for FramingZoom {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let zoom = if text == "off" { Some(1.0) } else { parse_in_range(text, 1.0, Self::MAX_ZOOM) };
        zoom.map(Self::from_zoom)
            .ok_or_else(|| format!("use off, or the largest zoom: a number from 1 to {}", Self::MAX_ZOOM))
    }
}

impl fmt::Display for FramingZoom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.zoom() {
            Some(zoom) => write!(f, "{zoom}"),
            None => f.write_str("off"),
        }
    }
}
