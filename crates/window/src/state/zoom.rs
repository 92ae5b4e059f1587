//! Zoom factor and position of the picture.

use super::State;

/// Zoom of the picture in the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zoom {
    /// Window pixels per picture pixel; 0 fits the picture to the window.
    pub factor: u32,
    /// The point in the window's middle, as fractions of the unmirrored picture.
    pub center: [f32; 2],
}

/// Available factors.
const FACTORS: [u32; 5] = [0, 1, 2, 4, 8];

impl Default for Zoom {
    fn default() -> Self {
        Self { factor: 0, center: [0.5; 2] }
    }
}

impl Zoom {
    /// Returns the next larger factor (`by` > 0) or the next smaller one. Skips factors below `fit`, the scale that
    /// fits the picture to the window.
    pub fn next_factor(self, by: i32, fit: f32) -> u32 {
        let mut factors = FACTORS.into_iter().filter(|&factor| factor == 0 || factor as f32 > 0.99 * fit);
        match by > 0 {
            true => factors.find(|factor| *factor > self.factor).unwrap_or(self.factor),
            false => factors.take_while(|factor| *factor < self.factor).last().unwrap_or(0),
        }
    }
}

impl State {
    /// Zooms; the point `at` (fractions of the picture) stays where it is, or moves to the middle if the picture was
    /// fitted.
    pub(super) fn set_zoom(&mut self, factor: u32, at: Option<[f32; 2]>) {
        let Zoom { factor: before, center } = self.zoom;
        let at = at.unwrap_or(center);
        let ratio = if factor == 0 || before == 0 { 0.0 } else { before as f32 / factor as f32 };
        self.zoom = Zoom { factor, center: [0, 1].map(|axis| at[axis] + (center[axis] - at[axis]) * ratio) };
    }
}
