//! What others tell, and what it makes of the state.

use super::apply::NO_DEPTH;
use super::{Shown, Source, State, Told};

impl State {
    /// Takes note of what others tell.
    pub fn hear(&mut self, told: Told) {
        match told {
            Told::Source(source) => self.source_is(source),
            Told::Choices { sources, virtual_cameras } => {
                (self.sources, self.virtual_cameras) = (sources, virtual_cameras);
            }
            Told::Presets(presets) => self.presets = presets,
            Told::Controls(controls) => self.controls = controls,
            Told::Outputs(outputs) => self.outputs = outputs,
            Told::Note(text) => self.note(text),
        }
    }

    fn source_is(&mut self, source: Source) {
        if matches!(source, Source::Running(_)) {
            self.meters.restart();
        }
        self.source = source;
        if self.shown == Shown::Depth && !self.may_have_depth() {
            self.shown = Shown::Picture;
            self.note(NO_DEPTH);
        }
    }
}
