//! Whether depth is registered to colours, told from some of the first frames.

use crate::depth::agreement::Agreement;
use crate::frame::{ColorImage, DepthMap};

/// One of so many frames is looked at, as neighbours are alike.
const EVERY: u32 = 10;
/// So many frames that agree decide.
const DECISION: u32 = 3;
/// After so many frames without a decision there will be none.
const LAST: u32 = 300;

/// Decides once.
#[derive(Debug, Default)]
pub struct RegistrationCheck {
    frames: u32,
    unrelated: u32,
}

impl RegistrationCheck {
    /// Takes the next frame, with its depth as it was measured; true, once, when it is clear that the two are not registered.
    pub fn fails(&mut self, map: &DepthMap, color: &ColorImage) -> bool {
        if self.frames >= LAST {
            return false;
        }
        self.frames += 1;
        if self.frames % EVERY != 1 {
            return false;
        }
        match Agreement::of(map, color) {
            Agreement::Unknown => {}
            Agreement::Unrelated => self.unrelated += 1,
            Agreement::Meets | Agreement::Beside { .. } | Agreement::Soft { .. } => self.frames = LAST,
        }
        let fails = self.unrelated == DECISION;
        if fails {
            self.frames = LAST;
        }
        fails
    }
}
