//! Whether nobody is in the picture for so long that it should be said.

use crate::frame::Mask;

/// From this share on a pixel is a person's.
const PERSON: f32 = 0.5;

/// Since when nobody is there.
#[derive(Debug, Default)]
pub struct Absence {
    since_ns: Option<u64>,
    is_told: bool,
}

impl Absence {
    /// Who goes for a cup of tea need not be told that they are away.
    pub const LONG_NS: u64 = 5_000_000_000;

    /// Whether by now, with this mask of persons, nobody was seen for long: true once, as the same network before the same
    /// place goes on as it began.
    pub fn is_news(&mut self, mask: &Mask, now_ns: u64) -> bool {
        if mask.share.iter().any(|share| *share > PERSON) {
            self.since_ns = None;
            return false;
        }
        let since_ns = *self.since_ns.get_or_insert(now_ns);
        // Time goes back where a recording begins anew.
        let is_long = now_ns.saturating_sub(since_ns) >= Self::LONG_NS;
        is_long && !std::mem::replace(&mut self.is_told, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_absence_is_told_once() {
        let mask = |share: f32| Mask { width: 2, height: 1, share: vec![0.1, share] };
        let mut absence = Absence::default();
        // A person leaves after four seconds, and comes for a moment after eight.
        let is_there = |second: u64| second < 4 || second == 8;
        let told = (0..40)
            .filter(|&second| absence.is_news(&mask(if is_there(second) { 0.9 } else { 0.2 }), second * 1_000_000_000));
        assert_eq!(told.collect::<Vec<_>>(), [14]);
    }
}
