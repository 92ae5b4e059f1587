//! Temporal prior: where the picture has not changed since the last pair, its disparity is likely what it was.
//!
//! A blank wall costs much the same at any disparity, and noise decides anew for every frame. There a small bonus for
//! the last disparity decides instead. Where there is texture, the right disparity is better by more than the bonus, so
//! that nothing that moved keeps its old one.

use super::fixed::{ONE, UNKNOWN};

/// Sum of the changes of 3x3 pixels, in 8-bit codes, up to which they are taken for noise: 4 a pixel.
const NOISE: u16 = 36;

/// Remembers the last pair.
#[derive(Debug, Default)]
pub struct Prior {
    width: usize,
    /// The last left picture; empty before the first.
    luma: Vec<u8>,
    /// The last disparities that both eyes agreed on, in fixed point.
    map: Vec<u16>,
    /// Sums of changes of three neighbours in a row.
    changes: Vec<u16>,
    /// One more than the whole disparity that is likely, or 0.
    likely: Vec<u16>,
}

impl Prior {
    /// No memory yet of pictures of so many columns.
    pub fn new(width: usize) -> Self {
        Self { width, ..Self::default() }
    }

    /// One more than the whole disparity that is likely for each pixel of the left picture `luma`, or 0; nothing before
    /// the first pair.
    pub fn likely(&mut self, luma: &[u8]) -> Option<&[u16]> {
        if self.luma.len() != luma.len() {
            return None;
        }
        let Self { width, luma: last, map, changes, likely } = self;
        let width = *width;
        changes.resize(luma.len(), 0);
        for ((row, last), changes) in
            luma.chunks_exact(width).zip(last.chunks_exact(width)).zip(changes.chunks_exact_mut(width))
        {
            let change = |x: usize| u16::from(row[x].abs_diff(last[x]));
            for (x, out) in changes.iter_mut().enumerate() {
                *out = change(x.saturating_sub(1)) + change(x) + change((x + 1).min(width - 1));
            }
        }
        likely.clear();
        let height = luma.len() / width;
        for (y, map) in map.chunks_exact(width).enumerate() {
            let row = |y: usize| &changes[y * width..(y + 1) * width];
            let three = row(y.saturating_sub(1)).iter().zip(row(y)).zip(row((y + 1).min(height - 1)));
            likely.extend(map.iter().zip(three).map(|(&d, ((above, here), below))| {
                let is_still = above + here + below <= NOISE;
                if is_still && d != UNKNOWN { (d + ONE / 2) / ONE + 1 } else { 0 }
            }));
        }
        Some(likely)
    }

    /// Remembers a pair: its left picture, and its disparities in fixed point or [`UNKNOWN`].
    pub fn keep(&mut self, luma: &[u8], map: &[u16]) {
        self.luma.clear();
        self.luma.extend_from_slice(luma);
        self.map.clear();
        self.map.extend_from_slice(map);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_known_and_still_is_likely() {
        let (width, height) = (20, 10);
        let luma: Vec<u8> = (0..width * height).map(|i| (i * 7 % 200) as u8).collect();
        let mut map = vec![5 * ONE + ONE / 2; width * height];
        map[3] = UNKNOWN;
        let mut prior = Prior::new(width);
        assert!(prior.likely(&luma).is_none(), "before the first pair");
        prior.keep(&luma, &map);
        // Noise, and a change at (10, 5).
        let mut next: Vec<u8> = luma.iter().enumerate().map(|(i, &v)| v + (i % 3) as u8).collect();
        next[5 * width + 10] += 50;
        let likely = prior.likely(&next).unwrap();
        for (i, &d) in likely.iter().enumerate() {
            let moved = (i % width).abs_diff(10) <= 1 && (i / width).abs_diff(5) <= 1;
            assert_eq!(d, if i == 3 || moved { 0 } else { 7 }, "{i}");
        }
    }
}
