//! How large the picture is shown, and which part of it.

use super::State;

/// The picture in the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zoom {
    /// Pixels of the window along a side of one of the picture; 0 fits all of it into the window.
    pub factor: u32,
    /// What is in the window's middle, as fractions of the picture as it is.
    pub center: [f32; 2],
}

/// The factors that can be chosen.
const FACTORS: [u32; 5] = [0, 1, 2, 4, 8];

impl Default for Zoom {
    fn default() -> Self {
        Self { factor: 0, center: [0.5; 2] }
    }
}

impl Zoom {
    /// The next larger factor (`by` > 0), or the next smaller one. Where all of the picture is seen at `fit` pixels of the window
    /// for one of its own, those that would show it smaller are left out.
    pub fn stepped(self, by: i32, fit: f32) -> u32 {
        let mut factors = FACTORS.into_iter().filter(|&factor| factor == 0 || factor as f32 > 0.99 * fit);
        match by > 0 {
            true => factors.find(|factor| *factor > self.factor).unwrap_or(self.factor),
            false => factors.take_while(|factor| *factor < self.factor).last().unwrap_or(0),
        }
    }
}

impl State {
    /// Shows the picture in another size; the point `at`, as fractions of the picture, stays where it is, or comes to the
    /// middle where all was seen.
    pub(super) fn set_zoom(&mut self, factor: u32, at: Option<[f32; 2]>) {
        let Zoom { factor: before, center } = self.zoom;
        let at = at.unwrap_or(center);
        let share = if factor == 0 || before == 0 { 0.0 } else { before as f32 / factor as f32 };
        self.zoom = Zoom { factor, center: [0, 1].map(|axis| at[axis] + (center[axis] - at[axis]) * share) };
    }
}
