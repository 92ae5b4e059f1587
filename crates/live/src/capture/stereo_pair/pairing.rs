//! Matches frames of the left and the right camera by their capture times.

/// Capture times of the frames to be matched, at most one per camera.
#[derive(Debug)]
pub(super) struct Pairing {
    /// Largest time difference of a pair, exclusive: half a period.
    max_skew_ns: u64,
    left_ns: Option<u64>,
    right_ns: Option<u64>,
}

/// The next step with the current frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// They are a pair; the right one was captured `skew_ns` nanoseconds later. Both are removed.
    Pair { skew_ns: i64 },
    /// The left frame waits for a right one.
    NeedsRight,
    /// There is no left frame.
    NeedsLeft,
    /// The right frame is too early for this and every later left frame, and is removed.
    UnpairedRight,
    /// The right frame is too late for the left one, which is removed. The right one stays for the next.
    UnpairedLeft,
}

impl Pairing {
    /// Creates a matcher for frames that arrive every `period_ns`.
    pub(super) fn new(period_ns: u64) -> Self {
        Self { max_skew_ns: (period_ns / 2).max(1), left_ns: None, right_ns: None }
    }

    /// Largest time difference of a pair, and the longest wait for a partner.
    pub(super) fn max_skew_ns(&self) -> u64 {
        self.max_skew_ns
    }

    /// Sets the left frame; replaces the current one, if any.
    pub(super) fn set_left(&mut self, captured_ns: u64) {
        self.left_ns = Some(captured_ns);
    }

    /// Sets the right frame; replaces the current one, if any.
    pub(super) fn set_right(&mut self, captured_ns: u64) {
        self.right_ns = Some(captured_ns);
    }

    pub(super) fn clear(&mut self) {
        (self.left_ns, self.right_ns) = (None, None);
    }

    /// Compares the current frames, and removes those that are done.
    pub(super) fn match_frames(&mut self) -> Verdict {
        let Some(left_ns) = self.left_ns else { return Verdict::NeedsLeft };
        let Some(right_ns) = self.right_ns else { return Verdict::NeedsRight };
        // Nanoseconds since boot fit into an `i64`.
        let skew_ns = right_ns as i64 - left_ns as i64;
        if skew_ns.unsigned_abs() < self.max_skew_ns {
            self.clear();
            Verdict::Pair { skew_ns }
        } else if skew_ns < 0 {
            self.right_ns = None;
            Verdict::UnpairedRight
        } else {
            self.left_ns = None;
            Verdict::UnpairedLeft
        }
    }

    /// Removes the left frame, which has waited long enough.
    pub(super) fn drop_left(&mut self) {
        self.left_ns = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const PERIOD_NS: u64 = 33 * MS;

    /// Returns the pairs of frames with these capture times, and the numbers of unpaired left and right ones. Like the
    /// camera, it takes a left frame, and then right ones until it is matched.
    fn play(left: &[u64], right: &[u64]) -> (Vec<(u64, u64)>, usize, usize) {
        let mut pairing = Pairing::new(PERIOD_NS);
        let mut rights = right.iter().copied();
        let (mut pairs, mut unpaired_lefts, mut unpaired_rights) = (Vec::new(), 0, 0);
        for &left_ns in left {
            pairing.set_left(left_ns);
            loop {
                match pairing.match_frames() {
                    Verdict::Pair { skew_ns } => pairs.push((left_ns, left_ns.wrapping_add_signed(skew_ns))),
                    Verdict::UnpairedLeft => unpaired_lefts += 1,
                    Verdict::UnpairedRight => unpaired_rights += 1,
                    Verdict::NeedsLeft => break,
                    Verdict::NeedsRight => match rights.next() {
                        Some(right_ns) => pairing.set_right(right_ns),
                        None => {
                            pairing.drop_left();
                            unpaired_lefts += 1;
                        }
                    },
                }
            }
        }
        (pairs, unpaired_lefts, unpaired_rights)
    }

    fn times(count: u64, skew_ns: u64, jitter_ns: u64) -> Vec<u64> {
        let mut state = 7u64;
        let mut jitter = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            if jitter_ns == 0 { 0 } else { (state >> 33) % jitter_ns }
        };
        (1..=count).map(|k| k * PERIOD_NS + skew_ns + jitter()).collect()
    }

    #[test]
    fn frames_less_than_half_a_period_apart_are_pairs_whichever_eye_leads() {
        for (left_skew, right_skew) in [(0, 0), (0, 12), (12, 0), (3, 3)] {
            let (left, right) = (times(100, left_skew * MS, 4 * MS), times(100, right_skew * MS, 4 * MS));
            let (pairs, ..) = play(&left, &right);
            assert_eq!(pairs, left.into_iter().zip(right).collect::<Vec<_>>(), "{left_skew} {right_skew}");
        }
    }

    #[test]
    fn no_pair_is_further_apart_and_every_left_frame_is_accounted_for() {
        // The worst skew: the partner changes with the jitter.
        let (left, right) = (times(300, 0, 6 * MS), times(300, 16 * MS, 6 * MS));
        let (pairs, unpaired_lefts, _) = play(&left, &right);
        assert!(pairs.iter().all(|(left_ns, right_ns)| left_ns.abs_diff(*right_ns) < PERIOD_NS / 2));
        assert!(pairs.is_sorted_by(|a, b| a.0 < b.0 && a.1 < b.1), "no frame is taken twice");
        assert_eq!(pairs.len() + unpaired_lefts, 300);
    }

    #[test]
    fn a_lost_frame_costs_its_partner_and_nothing_more() {
        let whole = times(100, 0, 2 * MS);
        let without = |lost: &[usize]| -> Vec<u64> {
            whole.iter().enumerate().filter(|(k, _)| !lost.contains(k)).map(|(_, &ns)| ns).collect()
        };
        let later: Vec<u64> = whole.iter().map(|ns| ns + 5 * MS).collect();
        let (pairs, unpaired_lefts, unpaired_rights) = play(&without(&[10, 11, 40]), &later);
        assert_eq!((pairs.len(), unpaired_lefts, unpaired_rights), (97, 0, 3));
        let (pairs, unpaired_lefts, unpaired_rights) = play(&later, &without(&[10, 11, 40]));
        assert_eq!((pairs.len(), unpaired_lefts, unpaired_rights), (97, 3, 0));
        assert!(pairs.iter().all(|(left_ns, right_ns)| left_ns - right_ns == 5 * MS));
    }

    #[test]
    fn one_eye_alone_gives_no_pairs() {
        assert_eq!(play(&times(10, 0, 0), &[]), (vec![], 10, 0));
        // Right frames from before the camera disappeared.
        assert_eq!(play(&times(10, 400 * MS, 0), &times(3, 0, 0)), (vec![], 10, 3));
    }
}
