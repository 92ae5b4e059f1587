//! The load of a simulated machine: the time of a frame at each quality level.

/// Pseudorandom numbers, reproducible on every machine.
pub struct Rng(u64);

impl Rng {
    /// Creates the sequence of a seed.
    pub fn new(seed: u64) -> Self {
        let mut rng = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x2545_f491_4f6c_dd1d);
        for _ in 0..8 {
            rng.uniform();
        }
        rng
    }

    /// Returns a uniformly distributed number from 0 to 1.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    /// Returns a standard normal number.
    pub fn normal(&mut self) -> f64 {
        let (a, b) = (self.uniform(), self.uniform());
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }
}

/// The load profile of a machine.
#[derive(Clone, Copy, Debug)]
pub struct LoadProfile {
    /// Lowest and highest load.
    pub loads: (f64, f64),
    /// Frames from one step of the load to the next.
    pub step_frames: usize,
    /// Standard deviation of the logarithm of the noise.
    pub noise: f64,
    /// The fraction of the frames that are outliers, and the factor by which they take longer.
    pub spikes: (f64, f64),
    /// Frames under way before a frame's time is known.
    pub delay_frames: usize,
}

/// The default profile: steps every 20 s at 30 frames a second.
pub const DEFAULT_PROFILE: LoadProfile =
    LoadProfile { loads: (0.6, 1.8), step_frames: 600, noise: 0.06, spikes: (0.01, 2.0), delay_frames: 3 };

/// Returns the time of every frame at the cheapest level, and the load without noise.
pub fn simulate_load(profile: &LoadProfile, frames: usize, seed: u64) -> Vec<(f64, f64)> {
    let mut rng = Rng::new(seed);
    let (low, high) = profile.loads;
    let mut load = low;
    (0..frames)
        .map(|frame| {
            if frame % profile.step_frames == 0 {
                load = low + (high - low) * rng.uniform();
            }
            let noise = (profile.noise * rng.normal()).exp();
            let spike = if rng.uniform() < profile.spikes.0 { profile.spikes.1 } else { 1.0 };
            (load * noise * spike, load)
        })
        .collect()
}
