//! Going back and forth in a recording.

use std::sync::Arc;

use super::App;
use crate::state::Transport;
use bokehcam::capture::Seeker;
use bokehcam::pipeline::View;

/// What the window knows of wishes for frames.
#[derive(Default)]
pub(super) struct Seeking {
    seeker: Option<Arc<Seeker>>,
    /// The numbers of the newest wish and of the last one that was answered.
    asked: u64,
    answered: u64,
}

impl Seeking {
    /// Of another source.
    pub fn of(seeker: Option<Arc<Seeker>>) -> Self {
        Self { seeker, asked: 0, answered: 0 }
    }

    /// Whether a frame answers a wish that no frame before it did: it is shown though the picture is frozen.
    pub fn is_answer(&self, view: &View) -> bool {
        view.seek > self.answered
    }
}

impl App {
    pub(super) fn seek(&mut self, place: usize) {
        if let Some(seeker) = &self.seeking.seeker {
            self.seeking.asked = seeker.go_to(place);
            self.tell_place(place);
        }
    }

    /// Takes note of where the frame is that is shown now.
    pub(super) fn note_place(&mut self, view: &View) {
        self.seeking.answered = view.seek;
        let is_behind = self.seeking.answered < self.seeking.asked;
        if let Some(seeker) = self.seeking.seeker.as_ref().filter(|_| !is_behind) {
            self.tell_place(seeker.place_of(view.stamp));
        }
    }

    fn tell_place(&mut self, place: usize) {
        let transport = |seeker: &Arc<Seeker>| Transport {
            place,
            frames: seeker.frames(),
            time_ns: seeker.time_ns(place),
            length_ns: seeker.length_ns(),
        };
        self.state.transport = self.seeking.seeker.as_ref().map(transport);
    }
}
