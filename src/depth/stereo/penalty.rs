//! The smoothness penalty P2 of semi-global matching: what it costs a path to change its disparity by more than one.

/// P2 across a strong edge of the picture, where a jump is likely, and what is added where there is no edge.
const JUMP: (f32, f32) = (20.0, 40.0);
/// Difference of grey values that takes away all but 1/e of the additional penalty.
const EDGE: f32 = 10.0;

/// P2 by the difference of grey values from pixel to pixel.
pub struct Penalties([u8; 256]);

impl Penalties {
    pub fn new() -> Self {
        let mut table = [0; 256];
        for (step, p2) in table.iter_mut().enumerate() {
            *p2 = (JUMP.0 + JUMP.1 * (-(step as f32) / EDGE).exp()) as u8;
        }
        Self(table)
    }

    /// All of them, by the difference.
    #[cfg(feature = "gpu")]
    pub fn table(&self) -> &[u8; 256] {
        &self.0
    }

    /// That between two grey values.
    #[inline(always)]
    pub fn between(&self, a: u8, b: u8) -> u8 {
        self.0[usize::from(a.abs_diff(b))]
    }
}
