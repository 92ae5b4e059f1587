//! Playback position of a recording, and seeking.

use super::{Action, Request, State};

/// Playback position of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Transport {
    /// Index of the displayed frame, or of the one requested last.
    pub frame: usize,
    /// Number of frames, at least 1.
    pub frames: usize,
    /// Time of that frame, from the first one.
    pub time_ns: u64,
    /// Time of the end of the last frame, from the first one.
    pub length_ns: u64,
}

impl State {
    /// Whether freezing pauses playback: the source is a recording, and no output needs its frames.
    pub fn can_pause(&self) -> bool {
        self.transport.is_some() && self.outputs.is_empty()
    }

    /// Seeks to a frame of the recording.
    pub(super) fn seek(&mut self, frame: usize) -> Vec<Request> {
        let Some(transport) = &mut self.transport else { return Vec::new() };
        transport.frame = frame.min(transport.frames.saturating_sub(1));
        vec![Request::Seek(transport.frame)]
    }

    /// Pauses and moves by this number of frames, wrapping around at either end.
    pub(super) fn step_frames(&mut self, by: i32) -> Vec<Request> {
        let Some(Transport { frame, frames, .. }) = self.transport else { return Vec::new() };
        let mut requests = self.apply(Action::Freeze(true));
        requests.extend(self.seek((frame as i64 + i64::from(by)).rem_euclid(frames.max(1) as i64) as usize));
        requests
    }
}

#[cfg(test)]
mod tests {
    use crate::state::Action;
    use crate::state::sample::state;
    use bokehcam::depth::plate::Step;

    #[test]
    fn a_frozen_picture_needs_no_other() {
        let mut state = state();
        assert!(!state.can_pause_pipeline());
        state.apply(Action::Freeze(true));
        assert!(state.can_pause_pipeline(), "of a camera as well");
        state.plate = Some(Step::StepOut(2));
        assert!(!state.can_pause_pipeline(), "a plate is being taken");
        state.plate = Some(Step::Ready);
        assert!(state.can_pause_pipeline());
        state.apply(Action::Freeze(false));
        assert!(!state.can_pause_pipeline());
    }
}
