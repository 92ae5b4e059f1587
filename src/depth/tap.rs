//! Linear interpolation between the samples of planes of another size.

/// Two neighbouring samples and the share of the second.
#[derive(Clone, Copy, Debug)]
pub struct Tap {
    pub first: usize,
    pub second: usize,
    pub share: f32,
}

impl Tap {
    /// The samples around the centre of pixel `at`, where `to` pixels and `from` samples cover the same length.
    pub fn new(at: usize, to: usize, from: usize) -> Self {
        let place = ((at as f32 + 0.5) * from as f32 / to as f32 - 0.5).clamp(0.0, (from - 1) as f32);
        let first = place as usize;
        Self { first, second: (first + 1).min(from - 1), share: place - first as f32 }
    }
}
