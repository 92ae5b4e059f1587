//! Properties of a camera besides its controls, and settings that depend on them.

use super::{Request, Source, State};
use bokehcam::look::Metres;
use bokehcam_live::source::modes::Mode;

/// Camera modes, and properties of the running source.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Camera {
    /// Frame sizes and rates, largest first.
    pub modes: Vec<Mode>,
    /// Whether the camera faces the user, who then expects a mirrored picture.
    pub faces_user: bool,
    /// What the distances of depth mean; applies to any kind of source.
    pub metres: Metres,
    /// Whether it is the demonstration, shown for want of a camera.
    pub is_fallback: bool,
}

impl State {
    /// Sets the camera's properties. Unless the user chose, mirrors the picture if the camera faces the user.
    pub(super) fn set_camera(&mut self, camera: Camera) {
        if !self.mirror_chosen {
            self.mirror = camera.faces_user;
        }
        self.camera = camera;
    }

    /// Whether depth is relative, without metres; while a source opens, as it was before.
    pub fn lacks_metres(&self) -> bool {
        self.camera.metres == Metres::Missing
    }

    /// Requests another frame size and rate of the camera.
    pub(super) fn set_camera_mode(&mut self, size: (u32, u32), fps: f64) -> Vec<Request> {
        self.source = Source::Opening;
        (self.frozen, self.focus_m) = (false, None);
        vec![Request::Mode(size, fps)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::{Action, Update, sample};

    fn mirror_of(state: &State) -> Option<String> {
        state.cli_options().into_iter().find(|(name, _)| name == "mirror").map(|(_, value)| value)
    }

    #[test]
    fn what_faces_the_person_is_a_mirror_unless_they_say_otherwise() {
        let camera = |faces_user| Update::Camera(Camera { faces_user, ..Camera::default() });
        let mut state = sample::state();
        for faces_user in [true, false, true] {
            state.apply_update(camera(faces_user));
            assert_eq!((state.mirror, mirror_of(&state)), (faces_user, None), "the command has the same default");
        }
        state.apply(Action::Mirror(false));
        assert_eq!(mirror_of(&state).as_deref(), Some("false"));
        for faces_user in [true, false] {
            state.apply_update(camera(faces_user));
            assert!(!state.mirror, "as was said");
        }
        state.apply(Action::Mirror(true));
        assert_eq!(mirror_of(&state).as_deref(), Some("true"));
    }

    #[test]
    fn what_can_be_a_source_is_opened_and_other_pictures_of_a_camera_are_asked_for() {
        let mut state = sample::state();
        assert_eq!(state.apply_update(Update::Offered("photo.jpg".into())), Some(Request::Open("photo.jpg".into())));
        assert_eq!((state.source_name.as_str(), &state.source), ("photo.jpg", &Source::Opening));
        assert_eq!(state.apply(Action::Mode((640, 480), 30.0)), [Request::Mode((640, 480), 30.0)]);
    }
}
