//! Tables between sRGB codes and linear light.

use crate::color::{encode_srgb, srgb_to_linear_table};

/// Entries of the table to sRGB: the darkest codes are four entries apart.
const TABLE_LEN: usize = 4096;

/// Both directions of the sRGB curve.
#[derive(Debug)]
pub(super) struct LightTables {
    linear: Box<[f32; 256]>,
    /// [`TABLE_LEN`] entries, uniform in the square root of linear light.
    srgb: Box<[u8; TABLE_LEN]>,
}

impl Default for LightTables {
    fn default() -> Self {
        let linear_of = |step: usize| (step as f32 / (TABLE_LEN - 1) as f32).powi(2);
        Self {
            linear: srgb_to_linear_table(),
            srgb: Box::new(std::array::from_fn(|step| encode_srgb(linear_of(step)))),
        }
    }
}

impl LightTables {
    /// Returns the light of an sRGB code, 0 to 1.
    pub fn decode(&self, code: u8) -> f32 {
        self.linear[usize::from(code)]
    }

    /// Returns the sRGB code of light; clamps it to 0 to 1.
    pub fn encode(&self, linear: f32) -> u8 {
        let linear = linear.clamp(0.0, 1.0);
        self.srgb[(linear.sqrt() * (TABLE_LEN - 1) as f32 + 0.5) as usize]
    }
}
