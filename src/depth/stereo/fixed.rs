//! Fixed-point constants of all executors: small integers, so that all compute the same result.

/// A disparity of one pixel.
pub const ONE: u16 = 64;

/// An unknown disparity.
pub const UNKNOWN: u16 = u16::MAX;

/// The bit of a disparity that was not matched, but filled in from its neighbours; also set in [`UNKNOWN`].
pub const FILLED: u16 = 1 << 15;

/// Whether a disparity was matched: neither unknown nor filled in.
#[inline(always)]
pub fn is_known(disparity: u16) -> bool {
    disparity < FILLED
}

/// The numbers of candidate disparities that the executors are compiled for.
const COUNTS: [usize; 7] = [16, 32, 64, 96, 128, 192, 256];

/// Returns the number of candidates that executors try for at least `disparities`, at most 256.
pub fn candidate_count(disparities: usize) -> usize {
    COUNTS.into_iter().find(|&candidate_count| candidate_count >= disparities).unwrap_or(COUNTS[COUNTS.len() - 1])
}

/// Cost of a partner beyond the border of the right picture: that of a poor match, so that the outermost columns may
/// take the disparity of their neighbours.
pub const OUTSIDE_COST: u8 = 8;

/// The penalty P1 for a disparity that differs by one from that of the previous pixel.
pub const P1: u8 = 8;

/// Reduction of the cost of the likely disparity and of those one above and below it.
pub const PRIOR_BONUS: u8 = 2;

/// Left-right consistency: the largest difference between the left and the right disparity, in whole pixels.
pub const MAX_LR_DIFFERENCE: u8 = 1;

/// Neighbours whose disparities differ by more, in fixed point, belong to different components.
pub const MAX_SPECKLE_STEP: u16 = 2 * ONE;

/// Temporal change summed over 3x3 pixels, in 8-bit codes, up to which it counts as noise: 4 per pixel.
pub const MAX_NOISE: u16 = 36;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_disparities_are_tried_as_are_asked_for_and_no_needless_ones() {
        assert!(COUNTS.is_sorted() && COUNTS.into_iter().all(|exact| candidate_count(exact) == exact));
        assert_eq!([1, 17, 193, 256, 1000].map(candidate_count), [16, 32, 256, 256, 256]);
    }
}
