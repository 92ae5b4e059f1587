//! Which frame of the right camera belongs to which of the left one, by the times they were taken.

/// The frames in hand, one of each eye at most, by their times.
#[derive(Debug)]
pub(super) struct Pairing {
    /// Frames that are less than this apart are a pair: half a period.
    half_ns: u64,
    left_ns: Option<u64>,
    right_ns: Option<u64>,
}

/// What to do about the frames in hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// They are a pair: the right one was taken so much later, in nanoseconds. Neither is in hand any more.
    Pair { skew_ns: i64 },
    /// The left one waits for one of the right camera.
    NeedsRight,
    /// There is none of the left camera.
    NeedsLeft,
    /// The right one was too early for every left one to come; it is not in hand any more.
    RightAlone,
    /// The right one was taken too late for the left one, which is not in hand any more. The right one stays for the
    /// next.
    LeftAlone,
}

impl Pairing {
    /// Pairs frames that come every `period_ns`.
    pub(super) fn new(period_ns: u64) -> Self {
        Self { half_ns: (period_ns / 2).max(1), left_ns: None, right_ns: None }
    }

    /// How far apart frames of a pair may be, and how long one waits for the other.
    pub(super) fn half_ns(&self) -> u64 {
        self.half_ns
    }

    /// A frame of the left camera came; the one in hand, if any, is given up.
    pub(super) fn left(&mut self, taken_ns: u64) {
        self.left_ns = Some(taken_ns);
    }

    /// A frame of the right camera came; the one in hand, if any, is given up.
    pub(super) fn right(&mut self, taken_ns: u64) {
        self.right_ns = Some(taken_ns);
    }

    pub(super) fn clear(&mut self) {
        (self.left_ns, self.right_ns) = (None, None);
    }

    /// What to do now.
    pub(super) fn judge(&mut self) -> Verdict {
        let Some(left_ns) = self.left_ns else { return Verdict::NeedsLeft };
        let Some(right_ns) = self.right_ns else { return Verdict::NeedsRight };
        // Nanoseconds since the system started: far below the sign.
        let skew_ns = right_ns as i64 - left_ns as i64;
        if skew_ns.unsigned_abs() < self.half_ns {
            self.clear();
            Verdict::Pair { skew_ns }
        } else if skew_ns < 0 {
            self.right_ns = None;
            Verdict::RightAlone
        } else {
            self.left_ns = None;
            Verdict::LeftAlone
        }
    }

    /// The left frame in hand has waited long enough; it is not in hand any more.
    pub(super) fn give_up_left(&mut self) {
        self.left_ns = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const PERIOD_NS: u64 = 33 * MS;

    /// What becomes of frames taken at these times: pairs, and those that stay alone. As the camera does it: a left
    /// frame is taken, and then right ones until it is judged.
    fn play(left: &[u64], right: &[u64]) -> (Vec<(u64, u64)>, usize, usize) {
        let mut pairing = Pairing::new(PERIOD_NS);
        let mut rights = right.iter().copied();
        let (mut pairs, mut lefts_alone, mut rights_alone) = (Vec::new(), 0, 0);
        for &left_ns in left {
            pairing.left(left_ns);
            loop {
                match pairing.judge() {
                    Verdict::Pair { skew_ns } => pairs.push((left_ns, left_ns.wrapping_add_signed(skew_ns))),
                    Verdict::LeftAlone => lefts_alone += 1,
                    Verdict::RightAlone => rights_alone += 1,
                    Verdict::NeedsLeft => break,
                    Verdict::NeedsRight => match rights.next() {
                        Some(right_ns) => pairing.right(right_ns),
                        None => {
                            pairing.give_up_left();
                            lefts_alone += 1;
                        }
                    },
                }
            }
        }
        (pairs, lefts_alone, rights_alone)
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
        let (pairs, lefts_alone, _) = play(&left, &right);
        assert!(pairs.iter().all(|(left_ns, right_ns)| left_ns.abs_diff(*right_ns) < PERIOD_NS / 2));
        assert!(pairs.is_sorted_by(|a, b| a.0 < b.0 && a.1 < b.1), "no frame is taken twice");
        assert_eq!(pairs.len() + lefts_alone, 300);
    }

    #[test]
    fn a_lost_frame_costs_its_partner_and_nothing_more() {
        let whole = times(100, 0, 2 * MS);
        let without = |lost: &[usize]| -> Vec<u64> {
            whole.iter().enumerate().filter(|(k, _)| !lost.contains(k)).map(|(_, &ns)| ns).collect()
        };
        let later: Vec<u64> = whole.iter().map(|ns| ns + 5 * MS).collect();
        let (pairs, lefts_alone, rights_alone) = play(&without(&[10, 11, 40]), &later);
        assert_eq!((pairs.len(), lefts_alone, rights_alone), (97, 0, 3));
        let (pairs, lefts_alone, rights_alone) = play(&later, &without(&[10, 11, 40]));
        assert_eq!((pairs.len(), lefts_alone, rights_alone), (97, 3, 0));
        assert!(pairs.iter().all(|(left_ns, right_ns)| left_ns - right_ns == 5 * MS));
    }

    #[test]
    fn one_eye_alone_gives_no_pairs() {
        assert_eq!(play(&times(10, 0, 0), &[]), (vec![], 10, 0));
        // Old ones from before it went away.
        assert_eq!(play(&times(10, 400 * MS, 0), &times(3, 0, 0)), (vec![], 10, 3));
    }
}
