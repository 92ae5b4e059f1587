//! Temporal hysteresis of the subject: the lens stays with one subject while others come and go.

/// Maximum distance between two measurements of one subject at rest, in dioptres, and its maximum speed, in dioptres a
/// second.
const SAME_SUBJECT: f32 = 0.12;
const MAX_SPEED: f32 = 2.0;
/// Upper bound of the time for which motion is assumed: after a longer gap, two subjects could not be told apart.
const MAX_GAP_S: f32 = 0.1;
/// Another subject is chosen after this time and this number of consecutive maps, so that neither a passer-by nor a
/// single bad map moves the focus.
const MIN_DURATION_NS: u64 = 400_000_000;
const MIN_MAPS: u32 = 3;

/// Returns how far a subject may have moved between two times, in dioptres.
pub fn motion_tolerance(from_ns: u64, to_ns: u64) -> f32 {
    let elapsed_s = to_ns.saturating_sub(from_ns) as f32 / 1e9;
    SAME_SUBJECT + MAX_SPEED * elapsed_s.min(MAX_GAP_S)
}

/// The hysteresis' state: the current subject and its rival.
#[derive(Debug, Default)]
pub struct Hysteresis {
    subject: Option<Candidate>,
    /// Another subject, found since the current one was last found.
    rival: Option<Candidate>,
}

#[derive(Clone, Copy, Debug)]
struct Candidate {
    dioptres: f32,
    time_ns: u64,
    /// The last time it was not found, and the number of maps in which it was.
    since_ns: u64,
    maps: u32,
}

impl Candidate {
    fn is_same(&self, dioptres: f32, time_ns: u64) -> bool {
        (dioptres - self.dioptres).abs() <= motion_tolerance(self.time_ns, time_ns)
    }

    fn update(self, dioptres: f32, time_ns: u64) -> Self {
        Self { dioptres, time_ns, maps: self.maps.saturating_add(1), ..self }
    }
}

impl Hysteresis {
    /// Returns the distance to focus on, in dioptres, given the subject `found` in a map without memory. `find_near`
    /// returns the distance of a remaining subject near a given one, if there is any.
    pub fn choose_subject(&mut self, found: f32, find_near: impl Fn(f32) -> Option<f32>, time_ns: u64) -> f32 {
        let new = |since_ns| Candidate { dioptres: found, time_ns, since_ns, maps: 1 };
        let Some(subject) = self.subject else {
            self.subject = Some(new(time_ns));
            return found;
        };
        if subject.is_same(found, time_ns) {
            (self.subject, self.rival) = (Some(subject.update(found, time_ns)), None);
            return found;
        }
        let rival = self.rival.filter(|rival| rival.is_same(found, time_ns));
        let rival = rival.map_or_else(|| new(subject.time_ns), |rival| rival.update(found, time_ns));
        let has_stayed = rival.maps >= MIN_MAPS && time_ns.saturating_sub(rival.since_ns) >= MIN_DURATION_NS;
        // A subject from the first maps may itself be an error.
        let outvotes = subject.maps < MIN_MAPS && rival.maps > subject.maps;
        if has_stayed || outvotes {
            (self.subject, self.rival) = (Some(rival), None);
            return found;
        }
        self.rival = Some(rival);
        let dioptres = find_near(subject.dioptres).filter(|&dioptres| subject.is_same(dioptres, time_ns));
        // The time while it was not found does not widen the tolerance.
        let now = Candidate { dioptres: dioptres.unwrap_or(subject.dioptres), time_ns, ..subject };
        self.subject = Some(now);
        now.dioptres
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// Returns the distances chosen for these found ones, one map every `step_ms`; all of them remain present.
    fn chosen(found: &[f32], step_ms: u64) -> Vec<f32> {
        let mut hysteresis = Hysteresis::default();
        let mut choose = |(map, &found): (u64, &f32)| hysteresis.choose_subject(found, Some, map * step_ms * MS);
        (0..).zip(found).map(&mut choose).collect()
    }

    #[test]
    fn one_bad_map_moves_nothing_however_rare_maps_are() {
        for step_ms in [10, 33, 83, 500, 2000] {
            let mut found = [0.8; 12];
            for bad in 3..11 {
                found[bad] = 1.9;
                assert_eq!(chosen(&found, step_ms), [0.8; 12], "{step_ms} ms, map {bad}");
                found[bad] = 0.8;
            }
        }
    }

    #[test]
    fn a_bad_first_map_is_outvoted_by_those_after_it() {
        assert_eq!(chosen(&[1.9, 0.8, 0.8, 0.8], 500), [1.9, 1.9, 0.8, 0.8]);
    }

    #[test]
    fn who_stays_is_turned_to_after_some_time_and_some_maps() {
        let found: Vec<f32> = [0.8; 5].into_iter().chain([1.9; 40]).collect();
        let turned = |step_ms| chosen(&found, step_ms).iter().position(|&dioptres| dioptres == 1.9).unwrap() as u64;
        assert_eq!((turned(10) - 4) * 10, 400);
        assert_eq!((turned(40) - 4) * 40, 400);
        assert_eq!(turned(1000) - 4, 3, "three maps");
    }

    #[test]
    fn one_who_moves_is_followed() {
        let found: Vec<f32> = (0..60).map(|map| 0.5 + 0.03 * map as f32).collect();
        assert_eq!(chosen(&found, 33), found);
    }
}
