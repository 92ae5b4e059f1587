//! What all executors compute with: small whole numbers, so that every one finds the same.

/// One pixel of disparity.
pub const ONE: u16 = 64;

/// A pixel whose disparity is not known.
pub const UNKNOWN: u16 = u16::MAX;

/// As many disparities as the executors are made for.
const RANGES: [usize; 7] = [16, 32, 64, 96, 128, 192, 256];

/// So many disparities that executors try when at least `disparities` are asked for, at most 256.
pub fn range(disparities: usize) -> usize {
    RANGES.into_iter().find(|&range| range >= disparities).unwrap_or(RANGES[RANGES.len() - 1])
}

/// The cost of a partner beyond the border of the right picture: that of a poor one, so that the outermost columns may
/// take the disparity of their neighbours.
pub const OUTSIDE: u8 = 8;

/// The penalty (P1) for a disparity that differs by one from that of the pixel before.
pub const SLOPE: u8 = 8;

/// What a likely disparity costs less, and those beside it.
pub const BONUS: u8 = 2;

/// The disparities that left and right take may differ by this much.
pub const AGREE: u8 = 1;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_disparities_are_tried_as_are_asked_for_and_no_needless_ones() {
        assert!(RANGES.is_sorted() && RANGES.into_iter().all(|exact| range(exact) == exact));
        assert_eq!([1, 17, 193, 256, 1000].map(range), [16, 32, 256, 256, 256]);
    }
}
