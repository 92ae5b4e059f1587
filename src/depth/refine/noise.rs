//! Estimates the noise of a depth map.

/// Spacing in pixels of the three samples of a second difference, above the correlation length of the noise.
pub const LAG_PX: usize = 6;
/// Maximum number of sampled rows and of sampled columns.
pub const GRID: usize = 96;
/// Fraction of the differences that lie on smooth surfaces in any picture, and the corresponding quantile of `|x|` of a
/// normal distribution, in standard deviations.
pub const SMOOTH_FRACTION: f32 = 0.35;
pub const SMOOTH_QUANTILE: f32 = 0.4538;
/// Noise below this is ignored: it is 1/20 px of CoC with a strong blur.
pub const NO_NOISE: f32 = 5e-4;

/// Measures the noise of maps of inverse depth; owns its buffers.
#[derive(Debug, Default)]
pub struct NoiseEstimator {
    differences: Vec<f32>,
}

impl NoiseEstimator {
    /// Returns the standard deviation of the noise of a map of this size, from a low quantile of second differences:
    /// slanted planes do not raise it, and edges only if they are everywhere. `inverse` returns the inverse depth of a
    /// pixel; pixels that are `is_unknown` are skipped.
    ///
    /// twin: shaders/refine/noise.wgsl
    pub fn estimate(
        &mut self,
        inverse: impl Fn(usize) -> f32,
        is_unknown: impl Fn(usize) -> bool,
        (width, height): (usize, usize),
    ) -> f32 {
        self.differences.clear();
        for y in (0..height).step_by(height.div_ceil(GRID).max(1)) {
            let row = y * width;
            for x in (LAG_PX..width.saturating_sub(LAG_PX)).step_by(width.div_ceil(GRID).max(1)) {
                let three = [x - LAG_PX, x, x + LAG_PX].map(|x| row + x);
                if three.iter().all(|&at| !is_unknown(at)) {
                    let [before, here, after] = three.map(&inverse);
                    self.differences.push((before - 2.0 * here + after).abs());
                }
            }
        }
        if self.differences.is_empty() {
            return 0.0;
        }
        let at = (self.differences.len() as f32 * SMOOTH_FRACTION) as usize;
        let quantile = *self.differences.select_nth_unstable_by(at, f32::total_cmp).1;
        // The second difference has 1 + 4 + 1 times the variance of a depth.
        quantile / SMOOTH_QUANTILE / 6.0_f32.sqrt()
    }
}
