//! Detects that the picture has shown no person for so long that the user should know.

use bokehcam::frame::Mask;

/// Minimum mask value of a person.
const PERSON_ALPHA: f32 = 0.5;

/// Tracks how long no person was seen.
#[derive(Debug, Default)]
pub struct Absence {
    since_ns: Option<u64>,
    is_reported: bool,
}

impl Absence {
    /// Minimum duration of a reported absence: short breaks are normal.
    pub const MIN_REPORTED_NS: u64 = 5_000_000_000;

    /// Returns whether a long absence is to be reported, given the current mask of persons: true only once per source,
    /// since the same network in the same place would not do better.
    pub fn should_report(&mut self, mask: &Mask, now_ns: u64) -> bool {
        if mask.alpha.iter().any(|alpha| *alpha > PERSON_ALPHA) {
            self.since_ns = None;
            return false;
        }
        let since_ns = *self.since_ns.get_or_insert(now_ns);
        // Time goes back when a recording restarts.
        let is_long = now_ns.saturating_sub(since_ns) >= Self::MIN_REPORTED_NS;
        is_long && !std::mem::replace(&mut self.is_reported, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_absence_is_told_once() {
        let mask = |alpha: f32| Mask { width: 2, height: 1, alpha: vec![0.1, alpha] };
        let mut absence = Absence::default();
        // A person leaves after four seconds, and returns for a moment after eight.
        let is_there = |second: u64| second < 4 || second == 8;
        let told = (0..40).filter(|&second| {
            absence.should_report(&mask(if is_there(second) { 0.9 } else { 0.2 }), second * 1_000_000_000)
        });
        assert_eq!(told.collect::<Vec<_>>(), [14]);
    }
}
