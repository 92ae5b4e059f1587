//! Sliding window over the last values of a measurement, with percentiles.

/// Ring buffer of the last `N` values.
#[derive(Clone, Copy, Debug)]
pub struct Window<const N: usize> {
    values: [f64; N],
    len: usize,
    /// Index of the next value to write; it holds the oldest value once the buffer is full.
    next: usize,
}

impl<const N: usize> Default for Window<N> {
    fn default() -> Self {
        Self { values: [0.0; N], len: 0, next: 0 }
    }
}

impl<const N: usize> Window<N> {
    /// Adds a value; beyond `N`, it replaces the oldest.
    pub fn push(&mut self, value: f64) {
        self.values[self.next] = value;
        self.next = (self.next + 1) % N;
        self.len = (self.len + 1).min(N);
    }

    /// Removes all values.
    pub fn clear(&mut self) {
        (self.len, self.next) = (0, 0);
    }

    /// Returns the number of values.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether the window is empty.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the smallest of the last `count` values that at least the fraction `p` (0 to 1) of them does not exceed
    /// (nearest rank); 0 without values.
    pub fn percentile(&self, count: usize, p: f64) -> f64 {
        let count = count.min(self.len);
        if count == 0 {
            return 0.0;
        }
        let mut sorted = [0.0; N];
        let sorted = &mut sorted[..count];
        for (back, value) in (1..).zip(sorted.iter_mut()) {
            *value = self.values[(self.next + N - back) % N];
        }
        sorted.sort_unstable_by(f64::total_cmp);
        let rank = ((p * count as f64).ceil() as usize).clamp(1, count);
        sorted[rank - 1]
    }

    /// Returns the median of the last `count` values, the lower one of two; 0 without values.
    pub fn median(&self, count: usize) -> f64 {
        self.percentile(count, 0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_those_of_the_newest_values() {
        let mut window = Window::<5>::default();
        assert_eq!((window.median(3), window.is_empty()), (0.0, true));
        for value in [9.0, 8.0, 1.0, 4.0, 2.0, 5.0, 3.0] {
            window.push(value);
        }
        // The window contains 1 4 2 5 3.
        assert_eq!((window.len(), window.median(5), window.median(3), window.median(1)), (5, 3.0, 3.0, 3.0));
        assert_eq!(
            (window.percentile(5, 0.95), window.percentile(5, 0.6), window.percentile(99, 0.0)),
            (5.0, 3.0, 1.0)
        );
        window.clear();
        window.push(7.0);
        assert_eq!((window.len(), window.percentile(5, 0.95)), (1, 7.0));
    }
}
