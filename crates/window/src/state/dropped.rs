//! Files dropped on the window.

use std::str::FromStr;

use super::{Request, Source, State};
use bokehcam_live::source::{Kind, SourceName};

/// A file or folder that was dropped on the window.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DroppedFile {
    pub name: String,
    /// Whether the user must be asked what it is for: it is a source, and a camera or an output is active.
    pub is_asked: bool,
}

impl State {
    /// Has a dropped file checked as a source.
    pub(super) fn drop_file(&mut self, name: String) -> Vec<Request> {
        self.dropped = Some(DroppedFile { name: name.clone(), is_asked: false });
        vec![Request::Offer(name)]
    }

    /// Opens an offered source. A dropped one waits for an answer if it would replace a camera or what others see.
    pub(super) fn accept_offer(&mut self, name: String) -> Option<Request> {
        let is_busy = !self.outputs.is_empty()
            || matches!(&self.source, Source::Running(running) if running.kind == Kind::Camera);
        match &mut self.dropped {
            Some(dropped) if dropped.name == name && is_busy => {
                dropped.is_asked = true;
                None
            }
            _ => self.choose_source(name).pop(),
        }
    }

    /// Opens a source that the user chose in the window: the next preview starts with it.
    pub(super) fn choose_source(&mut self, name: String) -> Vec<Request> {
        self.chosen_source = Some(name.clone());
        self.open_source(name)
    }

    /// Returns the dropped file that the user must be asked about.
    pub fn asked_file(&self) -> Option<&str> {
        self.dropped.as_ref().filter(|dropped| dropped.is_asked).map(|dropped| dropped.name.as_str())
    }

    /// Returns that file if it can be the background of the current look.
    pub fn asked_background(&self) -> Option<&str> {
        let is_picture =
            |name: &&str| SourceName::from_str(name).is_ok_and(|name| matches!(name.kind(), Kind::Photo | Kind::Video));
        self.asked_file().filter(|_| self.look.effect.follows_depth()).filter(is_picture)
    }

    /// Takes the name of the dropped file.
    pub(super) fn take_dropped(&mut self) -> Option<String> {
        self.dropped.take().map(|dropped| dropped.name)
    }
}

#[cfg(test)]
mod tests {
    use crate::state::{Action, Output, Request, Source, Update, sample};

    #[test]
    fn what_is_dropped_replaces_no_camera_and_nothing_in_a_call_unasked() {
        let folder = tempfile::tempdir().unwrap();
        let photo = folder.path().join("wall.png");
        let name = photo.display().to_string();
        bokehcam_media::recording::still::write_color(&photo, &bokehcam::frame::ColorImage::new(4, 4), false).unwrap();
        let dropped = |is_camera: bool, is_in_call: bool| {
            let mut state = sample::state();
            let Source::Running(running) = &mut state.source else { unreachable!("it runs") };
            running.kind = if is_camera { Default::default() } else { bokehcam_live::source::Kind::Recording };
            state.outputs.extend(is_in_call.then(|| Output { name: "pipewire".into(), is_camera: true }));
            assert_eq!(state.apply(Action::Drop(name.clone())), [Request::Offer(name.clone())]);
            assert_eq!(state.asked_file(), None, "it may be no source");
            let request = state.apply_update(Update::Offered(name.clone()));
            (state, request)
        };
        let open = Request::Open(name.clone());
        assert_eq!(dropped(false, false).1, Some(open.clone()), "nothing is lost");
        for (is_camera, is_in_call) in [(true, false), (false, true), (true, true)] {
            let (state, request) = dropped(is_camera, is_in_call);
            assert_eq!((request, state.asked_background()), (None, Some(name.as_str())));
            assert!(matches!(state.source, Source::Running(_)));
            let mut answered = state.clone();
            assert_eq!(answered.apply(Action::OpenDropped), std::slice::from_ref(&open));
            assert_eq!((answered.asked_file(), answered.chosen_source.as_ref()), (None, Some(&name)));
            let mut answered = state.clone();
            assert_eq!(answered.apply(Action::UseDroppedAsBackground), [Request::LoadBackground(name.clone())]);
            assert_eq!((answered.asked_file(), answered.chosen_source.as_ref()), (None, None));
            let mut answered = state;
            assert_eq!(answered.apply(Action::DismissDropped), []);
            assert_eq!(answered.asked_file(), None);
        }
        // A dialog was opened for this very purpose.
        let mut state = sample::state();
        assert_eq!(state.apply_update(Update::Offered(name.clone())), Some(open));
    }
}
