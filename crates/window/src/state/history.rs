//! Undo and redo.

use bokehcam::look::Look;

/// Maximum number of undo steps.
const MAX_STEPS: usize = 100;

/// Undo and redo stacks of looks.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// Previous looks, most recent last.
    past: Vec<Look>,
    /// Undone looks, most recently undone last.
    future: Vec<Look>,
    /// The control in use: its changes share one undo step.
    stroke: Option<&'static str>,
}

impl History {
    /// Pushes `look`, which is about to be replaced. Changes with the same stroke share one step until
    /// [`History::end_stroke`].
    pub fn push(&mut self, look: &Look, stroke: Option<&'static str>) {
        self.future.clear();
        if stroke.is_some() && stroke == self.stroke {
            return;
        }
        self.stroke = stroke;
        if self.past.len() == MAX_STEPS {
            self.past.remove(0);
        }
        self.past.push(look.clone());
    }

    /// Ends the stroke: the next change starts a new undo step.
    pub fn end_stroke(&mut self) {
        self.stroke = None;
    }

    /// Returns the previous look; moves `look` to the redo stack.
    pub fn undo(&mut self, look: &Look) -> Option<Look> {
        self.stroke = None;
        let before = self.past.pop()?;
        self.future.push(look.clone());
        Some(before)
    }

    /// Returns the look that was undone last; moves `look` to the undo stack.
    pub fn redo(&mut self, look: &Look) -> Option<Look> {
        self.stroke = None;
        let after = self.future.pop()?;
        self.past.push(look.clone());
        Some(after)
    }

    /// Returns whether there is anything to undo, and to redo.
    pub fn can_undo_redo(&self) -> (bool, bool) {
        (!self.past.is_empty(), !self.future.is_empty())
    }
}
