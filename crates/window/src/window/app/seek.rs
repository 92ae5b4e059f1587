//! Seeking in a recording.

use std::sync::Arc;

use super::App;
use crate::state::Transport;
use bokehcam::capture::Seeker;
use bokehcam::pipeline::View;

/// State of seek requests.
#[derive(Default)]
pub(super) struct Seeking {
    seeker: Option<Arc<Seeker>>,
    /// Numbers of the newest request and of the last one whose frame was displayed.
    requested: u64,
    displayed: u64,
}

impl Seeking {
    /// Creates the state for a new source.
    pub fn of(seeker: Option<Arc<Seeker>>) -> Self {
        Self { seeker, requested: 0, displayed: 0 }
    }

    /// Whether a frame is the first one for a newer request: it is displayed even while the picture is frozen.
    pub fn is_answer(&self, view: &View) -> bool {
        view.seek > self.displayed
    }
}

impl App {
    pub(super) fn seek(&mut self, place: usize) {
        if let Some(seeker) = &self.seeking.seeker {
            self.seeking.requested = seeker.request_frame(place);
            self.set_position(place);
        }
    }

    /// Updates the playback position with that of the displayed frame.
    pub(super) fn update_position(&mut self, view: &View) {
        self.seeking.displayed = view.seek;
        let is_behind = self.seeking.displayed < self.seeking.requested;
        if let Some(seeker) = self.seeking.seeker.as_ref().filter(|_| !is_behind) {
            self.set_position(seeker.position_of(view.stamp));
        }
    }

    fn set_position(&mut self, place: usize) {
        let transport = |seeker: &Arc<Seeker>| Transport {
            place,
            frames: seeker.frames(),
            time_ns: seeker.time_ns(place),
            length_ns: seeker.length_ns(),
        };
        self.state.transport = self.seeking.seeker.as_ref().map(transport);
    }
}
