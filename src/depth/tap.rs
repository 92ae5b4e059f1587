//! Sample positions for resampling.

/// Two neighbouring samples and the weight of the second.
#[derive(Clone, Copy, Debug)]
pub struct Tap {
    /// Index of the first.
    pub first: usize,
    /// Index of the second.
    pub second: usize,
    /// Weight of the second, 0 to 1.
    pub weight: f32,
}

impl Tap {
    /// Returns the samples around the centre of pixel `at`, where `to` pixels and `from` samples cover the same length.
    pub fn new(at: usize, to: usize, from: usize) -> Self {
        Self::at((at as f32 + 0.5) * from as f32 / to as f32 - 0.5, from)
    }

    /// Returns the nearer sample.
    pub fn nearest(self) -> usize {
        if self.weight >= 0.5 { self.second } else { self.first }
    }

    /// Returns the samples around `place` among `count`; clamps at both ends.
    #[inline(always)]
    pub fn at(place: f32, count: usize) -> Self {
        let place = place.clamp(0.0, (count - 1) as f32);
        let first = place as usize;
        Self { first, second: (first + 1).min(count - 1), weight: place - first as f32 }
    }
}

/// Returns the index in a plane of `width` x `height` for pixel index `at` of a plane of `size`.
pub fn nearest_index(at: usize, size: (usize, usize), (width, height): (usize, usize)) -> usize {
    at / size.0 * height / size.1 * width + at % size.0 * width / size.0
}
