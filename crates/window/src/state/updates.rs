//! Applies the session's updates to the state.

use super::apply::NO_METRES;
use super::{Request, Source, State, Update, ViewMode};
use bokehcam::look::{Look, Metres};

/// Shown when a camera replaces the demonstration.
const CAMERA_FOUND: &str = "A camera was connected: here it is.";

impl State {
    /// Applies an update of the session. Returns a request if a new source requires a different look or was offered.
    pub fn apply_update(&mut self, update: Update) -> Option<Request> {
        match update {
            Update::Source(source) => return self.set_source(source),
            Update::Choices { sources, virtual_cameras } => {
                (self.sources, self.virtual_cameras) = (sources, virtual_cameras);
            }
            Update::Presets(presets) => self.presets = presets,
            Update::Controls(controls) => self.controls = controls,
            Update::Camera(camera) => self.set_camera(camera),
            Update::Offered(name) => return self.accept_offer(name),
            Update::CameraFound(name) => {
                self.note(CAMERA_FOUND);
                return self.open_source(name).pop();
            }
            Update::Background(behind) => {
                return self.set_look(Look { background: behind, ..self.look.clone() }, None).pop();
            }
            Update::Outputs(outputs) => {
                self.outputs = outputs;
                self.recorded_bytes = self.recorded_bytes.filter(|_| self.recording().is_some());
                // Without outputs there is nothing to confirm any more.
                self.closing &= !self.outputs.is_empty();
            }
            Update::Watched(is_watched) => self.is_watched = is_watched,
            Update::RecordedBytes(bytes) => self.recorded_bytes = Some(bytes),
            Update::SavedIn(folder) => self.saved_in = Some(folder),
            Update::Note(text) => self.note(text),
            Update::OutputFailure(text) => self.output_failure = Some(text),
        }
        None
    }

    /// Sets the source, and adapts the view and the look to it.
    fn set_source(&mut self, source: Source) -> Option<Request> {
        if let Source::Running(running) = &source {
            self.source_name.clone_from(&running.name);
        }
        self.source = source;
        if self.shown == ViewMode::Depth && !self.may_have_depth() {
            self.shown = ViewMode::Picture;
            self.note(self.no_depth_advice());
        }
        let chosen = match &self.source {
            // Restores a portrait effect that a source without depth replaced, unless the user chose another effect
            // since.
            Source::Running(running) if running.has_depth => {
                let chosen = self.chosen_look();
                self.effect_replaced = false;
                chosen
            }
            _ => self.look.clone(),
        };
        if self.look_facts().metres == Metres::Missing && self.may_have_depth() && chosen.needs_metres() {
            self.note(NO_METRES);
        }
        let look = self.adapt_look(chosen);
        (look != self.look).then(|| {
            self.look = look;
            Request::Look(Box::new(self.look.clone()))
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::state::sample::{running, state};
    use crate::state::{Action, Camera, Request, Running, Source, Update};

    #[test]
    fn what_is_chosen_in_the_window_is_a_choice_and_nothing_else_is() {
        let mut state = state();
        let running_as = |name: &str| match running(true) {
            Source::Running(running) => Source::Running(Running { name: name.into(), ..running }),
            _ => unreachable!("it runs"),
        };
        // From the command line, or for want of a camera.
        state.apply_update(Update::Camera(Camera { is_fallback: true, ..Camera::default() }));
        state.apply_update(Update::Source(running_as("demo")));
        state.apply(Action::Retry);
        assert_eq!(state.chosen_source, None);
        let camera = "pipewire:laptop_cam".to_owned();
        assert_eq!(state.apply_update(Update::CameraFound(camera.clone())), Some(Request::Open(camera.clone())));
        state.apply_update(Update::Source(running_as(&camera)));
        assert_eq!((state.chosen_source.as_ref(), &state.source_name), (None, &camera), "it came by itself");
        for name in ["demo", "/dev/video0"] {
            state.apply(Action::Open(name.into()));
            assert_eq!(state.chosen_source.as_deref(), Some(name));
        }
        state.apply_update(Update::Offered("photo.jpg".into()));
        assert_eq!(state.chosen_source.as_deref(), Some("photo.jpg"));
    }
}
