//! How noisy a depth map is, told from the map alone.

/// Distance in pixels between the three depths that tell noise from slope, above the length over which it correlates.
pub const LAG_PX: usize = 6;
/// Rows and columns sampled for the noise, at most.
pub const LOOKS: usize = 96;
/// Share of the differences that lie on smooth surfaces, whatever else the picture holds, and the quantile of `|x|`
/// there of a normal distribution in standard deviations.
pub const SMOOTH_SHARE: f32 = 0.35;
pub const SMOOTH_QUANTILE: f32 = 0.4538;
/// Noise below this is none: it is 1/20 px of CoC with a strong blur.
pub const NO_NOISE: f32 = 5e-4;

/// Measures the noise of maps of inverse depth; owns the memory for it.
#[derive(Debug, Default)]
pub struct NoiseMeter {
    differences: Vec<f32>,
}

impl NoiseMeter {
    /// The noise of a map of so many columns and rows, as a standard deviation: a low quantile of second differences, which
    /// slanted planes do not raise, and edges only where they are everywhere. `inverse` gives the inverse depth of a pixel;
    /// what `is_unknown` is left out.
    pub fn noise(
        &mut self,
        inverse: impl Fn(usize) -> f32,
        is_unknown: impl Fn(usize) -> bool,
        (width, height): (usize, usize),
    ) -> f32 {
        self.differences.clear();
        for y in (0..height).step_by(height.div_ceil(LOOKS).max(1)) {
            let row = y * width;
            for x in (LAG_PX..width.saturating_sub(LAG_PX)).step_by(width.div_ceil(LOOKS).max(1)) {
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
        let at = (self.differences.len() as f32 * SMOOTH_SHARE) as usize;
        let quantile = *self.differences.select_nth_unstable_by(at, f32::total_cmp).1;
        // The difference has 1 + 4 + 1 times the variance of a depth.
        quantile / SMOOTH_QUANTILE / 6.0_f32.sqrt()
    }
}
