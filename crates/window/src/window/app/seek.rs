//! Seeking in a recording.

use std::sync::Arc;

use super::App;
use crate::state::Transport;
use bokehcam_live::capture::Seeker;
use bokehcam_live::pipeline::View;

/// State of seek requests.
#[derive(Default)]
pub(super) struct SeekState {
    seeker: Option<Arc<Seeker>>,
    /// Numbers of the newest request and of the last one whose frame was displayed.
    requested: u64,
    displayed: u64,
}

impl SeekState {
    /// Creates the state for a new source.
    pub fn new(seeker: Option<Arc<Seeker>>) -> Self {
        Self { seeker, requested: 0, displayed: 0 }
    }

    /// Whether a frame is the first one for a newer request: it is displayed even while the picture is frozen.
    pub fn is_requested_frame(&self, view: &View) -> bool {
        view.seek > self.displayed
    }
}

impl App {
    pub(super) fn seek_to_frame(&mut self, frame: usize) {
        if let Some(seeker) = &self.seek_state.seeker {
            self.seek_state.requested = seeker.request_frame(frame);
            self.set_position(frame);
        }
    }

    /// Updates the playback position with that of the displayed frame.
    pub(super) fn update_position(&mut self, view: &View) {
        self.seek_state.displayed = view.seek;
        let is_seek_pending = self.seek_state.displayed < self.seek_state.requested;
        if let Some(seeker) = self.seek_state.seeker.as_ref().filter(|_| !is_seek_pending) {
            self.set_position(seeker.position_of(view.stamp));
        }
    }

    fn set_position(&mut self, frame: usize) {
        let transport = |seeker: &Arc<Seeker>| Transport {
            frame,
            frames: seeker.frames(),
            time_ns: seeker.time_ns(frame),
            length_ns: seeker.length_ns(),
        };
        self.state.transport = self.seek_state.seeker.as_ref().map(transport);
    }
}
