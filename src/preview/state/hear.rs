//! What others tell, and what it makes of the state.

use super::apply::NO_DEPTH;
use super::{Request, Shown, Source, State, Update};
use crate::look::{Effect, Look};

impl State {
    /// Takes note of what others tell; gives back another look where the source calls for one.
    pub fn hear(&mut self, told: Update) -> Option<Request> {
        match told {
            Update::Source(source) => return self.source_is(source),
            Update::Choices { sources, virtual_cameras } => {
                (self.sources, self.virtual_cameras) = (sources, virtual_cameras);
            }
            Update::Presets(presets) => self.presets = presets,
            Update::Controls(controls) => self.controls = controls,
            Update::Outputs(outputs) => self.outputs = outputs,
            Update::Note(text) => self.note(text),
            Update::Trouble(text) => self.trouble = Some(text),
        }
        None
    }

    fn source_is(&mut self, source: Source) -> Option<Request> {
        if let Source::Running(running) = &source {
            self.meters.restart();
            self.source_name.clone_from(&running.name);
        }
        self.source = source;
        if self.shown == Shown::Depth && !self.may_have_depth() {
            self.shown = Shown::Picture;
            self.note(NO_DEPTH);
        }
        let look = match &self.source {
            // What was changed for a source without depth is changed back for one that has it.
            Source::Running(running) if running.has_depth && self.fitted => {
                self.fitted = false;
                let follows = self.look.effect == Effect::TiltShift;
                Look { effect: if follows { Effect::Auto } else { self.look.effect }, ..self.look.clone() }
            }
            _ => self.fitting(self.look.clone()),
        };
        (look != self.look).then(|| {
            self.look = look;
            Request::Look(Box::new(self.look.clone()))
        })
    }

    /// A look as the source allows it.
    pub(super) fn fitting(&mut self, look: Look) -> Look {
        let fitted = look.for_source(self.may_have_depth());
        self.fitted |= fitted.effect != look.effect;
        fitted
    }
}
