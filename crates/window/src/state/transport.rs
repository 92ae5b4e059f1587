//! Where a recording is, and going back and forth in it.

use super::{Action, Request, State};

/// Where a recording is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Transport {
    /// The place of the frame that is shown, or of the one that was asked for last.
    pub place: usize,
    /// How many frames there are, 1 at least.
    pub frames: usize,
    /// When that frame is, after the first one.
    pub time_ns: u64,
    /// To the end of the last frame.
    pub length_ns: u64,
}

impl State {
    /// Whether a frozen picture is a pause: it is a recording's, which stands still as nobody else needs it.
    pub fn can_pause(&self) -> bool {
        self.transport.is_some() && self.outputs.is_empty()
    }

    /// Goes to the frame at a place of the recording.
    pub(super) fn seek(&mut self, place: usize) -> Vec<Request> {
        let Some(transport) = &mut self.transport else { return Vec::new() };
        transport.place = place.min(transport.frames.saturating_sub(1));
        vec![Request::Seek(transport.place)]
    }

    /// Stops at the frame so many after the one that is shown; the first one follows the last.
    pub(super) fn step(&mut self, by: i32) -> Vec<Request> {
        let Some(Transport { place, frames, .. }) = self.transport else { return Vec::new() };
        let mut requests = self.apply(Action::Freeze(true));
        requests.extend(self.seek((place as i64 + i64::from(by)).rem_euclid(frames.max(1) as i64) as usize));
        requests
    }
}
