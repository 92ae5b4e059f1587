//! The smoothness penalty P2 of semi-global matching: the cost of a path for a change of disparity by more than one.

/// P2 across a strong edge of the picture, where a depth discontinuity is likely, and the addition where there is no
/// edge.
const P2: (f32, f32) = (20.0, 40.0);
/// Difference of grey values at which 1/e of the addition is left.
const EDGE_DECAY: f32 = 10.0;

/// P2 by the absolute difference of neighbouring grey values: `P2.0 + P2.1 exp(-difference / EDGE_DECAY)`.
pub struct Penalties([u8; 256]);

impl Penalties {
    pub fn new() -> Self {
        let mut table = [0; 256];
        for (step, p2) in table.iter_mut().enumerate() {
            *p2 = (P2.0 + P2.1 * (-(step as f32) / EDGE_DECAY).exp()) as u8;
        }
        Self(table)
    }

    /// Returns the table, indexed by the difference.
    pub fn table(&self) -> &[u8; 256] {
        &self.0
    }

    /// Returns P2 between two grey values.
    #[inline(always)]
    pub fn p2(&self, a: u8, b: u8) -> u8 {
        self.0[usize::from(a.abs_diff(b))]
    }
}
