//! The samples of planes of another size.

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
        Self::at((at as f32 + 0.5) * from as f32 / to as f32 - 0.5, from)
    }

    /// The sample that is nearer.
    #[cfg(feature = "gpu")]
    pub fn nearest(self) -> usize {
        if self.share >= 0.5 { self.second } else { self.first }
    }

    /// The samples around a place among `count`; beyond the outermost it is as there.
    #[inline(always)]
    pub fn at(place: f32, count: usize) -> Self {
        let place = place.clamp(0.0, (count - 1) as f32);
        let first = place as usize;
        Self { first, second: (first + 1).min(count - 1), share: place - first as f32 }
    }
}

/// The pixel of a plane of other sizes that pixel `at` of one of `size` falls on.
pub fn nearest(at: usize, size: (usize, usize), (width, height): (usize, usize)) -> usize {
    at / size.0 * height / size.1 * width + at % size.0 * width / size.0
}
