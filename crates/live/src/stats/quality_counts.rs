use super::QualityStats;

/// Counts frames per quality level, by the levels' names.
#[derive(Clone, Debug, Default)]
pub struct QualityCounts {
    frames: Vec<(&'static str, u64)>,
    last: Option<&'static str>,
    switches: u64,
}

impl QualityCounts {
    /// Counts one frame at `level`. Allocates only when a level is seen for the first time.
    pub fn add(&mut self, level: &'static str) {
        match self.frames.iter_mut().find(|seen| seen.0 == level) {
            Some(seen) => seen.1 += 1,
            None => self.frames.push((level, 1)),
        }
        self.switches += u64::from(self.last.replace(level).is_some_and(|last| last != level));
    }

    pub(super) fn fractions(&self) -> QualityStats {
        let all: u64 = self.frames.iter().map(|level| level.1).sum();
        let fractions = self.frames.iter().map(|&(level, frames)| (level, frames as f64 / all as f64));
        QualityStats { fractions: fractions.collect(), switches: self.switches }
    }
}
