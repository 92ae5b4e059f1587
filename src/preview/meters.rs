//! What the instruments show: the last frames, and how long they took.

use crate::pipeline::View;

/// The last frames.
#[derive(Clone, Debug, Default)]
pub struct Meters {}

impl Meters {
    /// A frame was presented at `now_ns` of the run's clock.
    pub fn presented(&mut self, view: &View, now_ns: u64) {
        let _ = (view, now_ns);
    }
}
