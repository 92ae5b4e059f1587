//! Bilinear interpolation of a row of pixels between four cells.

/// Parameters left and right of some pixels.
pub struct Sides<const N: usize>([[f32; N]; 2]);

impl<const N: usize> Sides<N> {
    /// Interpolates vertically, from the four corners to both sides.
    #[inline(always)]
    pub fn new([left, below_left, right, below_right]: [[f32; N]; 4], down: f32) -> Self {
        Self([lerp(&left, &below_left, down), lerp(&right, &below_right, down)])
    }

    #[inline(always)]
    pub fn interpolate(&self, along: f32) -> [f32; N] {
        lerp(&self.0[0], &self.0[1], along)
    }
}

#[inline(always)]
fn lerp<const N: usize>(a: &[f32; N], b: &[f32; N], fraction: f32) -> [f32; N] {
    std::array::from_fn(|k| a[k] + (b[k] - a[k]) * fraction)
}
