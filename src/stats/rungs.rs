use super::QualityUse;

/// Counts frames per quality level, by the levels' names.
#[derive(Clone, Debug, Default)]
pub struct QualityCounts {
    frames: Vec<(&'static str, u64)>,
    last: Option<&'static str>,
    switches: u64,
}

impl QualityCounts {
    /// Counts one frame at `rung`. Allocates only when a level is seen for the first time.
    pub fn add(&mut self, rung: &'static str) {
        match self.frames.iter_mut().find(|seen| seen.0 == rung) {
            Some(seen) => seen.1 += 1,
            None => self.frames.push((rung, 1)),
        }
        self.switches += u64::from(self.last.replace(rung).is_some_and(|last| last != rung));
    }

    pub(super) fn shares(&self) -> QualityUse {
        let all: u64 = self.frames.iter().map(|rung| rung.1).sum();
        let share = self.frames.iter().map(|&(rung, frames)| (rung, frames as f64 / all as f64));
        QualityUse { share: share.collect(), switches: self.switches }
    }
}
