//! Applies the session's updates to the state.

use super::apply::NO_METRES;
use super::{Request, Source, State, Update, ViewMode};
use bokehcam::look::Look;

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
            Update::Offered(name) => return self.open_source(name).pop(),
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
            self.meters.clear_recent();
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
        if self.source_depth().is_relative && self.may_have_depth() && chosen.metric_setting().is_some() {
            self.note(NO_METRES);
        }
        let look = self.adapt_look(chosen);
        (look != self.look).then(|| {
            self.look = look;
            Request::Look(Box::new(self.look.clone()))
        })
    }
}
