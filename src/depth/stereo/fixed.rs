//! What all executors compute with: small whole numbers, so that every one finds the same.

/// One pixel of disparity.
pub const ONE: u16 = 64;

/// A pixel whose disparity is not known.
pub const UNKNOWN: u16 = u16::MAX;

/// The bit of a disparity that was not matched, but filled in from beside it; unknown ones have it, too.
pub const FILLED: u16 = 1 << 15;

/// Whether both eyes agree on this disparity of a map: it is neither unknown nor filled in.
#[inline(always)]
pub fn is_known(disparity: u16) -> bool {
    disparity < FILLED
}

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

/// Neighbours whose disparities differ by more, in fixed point, are not of one island.
pub const STEP: u16 = 2 * ONE;

/// Sum of the changes of 3x3 pixels from picture to picture, in 8-bit codes, up to which they are taken for noise: 4 a
/// pixel.
pub const NOISE: u16 = 36;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_disparities_are_tried_as_are_asked_for_and_no_needless_ones() {
        assert!(RANGES.is_sorted() && RANGES.into_iter().all(|exact| range(exact) == exact));
        assert_eq!([1, 17, 193, 256, 1000].map(range), [16, 32, 256, 256, 256]);
    }
}
