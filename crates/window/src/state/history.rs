//! Undo and redo.

use bokehcam::look::Look;

/// The most looks that can be undone.
const MOST: usize = 100;

/// The looks before the present one, and those that were undone.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// The latest last.
    past: Vec<Look>,
    /// The latest undone last.
    future: Vec<Look>,
    /// The control in hand: its changes are undone together.
    stroke: Option<&'static str>,
}

impl History {
    /// Remembers `look`, which is about to be replaced. Changes of one stroke count as one until [`History::settle`].
    pub fn keep(&mut self, look: &Look, stroke: Option<&'static str>) {
        self.future.clear();
        if stroke.is_some() && stroke == self.stroke {
            return;
        }
        self.stroke = stroke;
        if self.past.len() == MOST {
            self.past.remove(0);
        }
        self.past.push(look.clone());
    }

    /// The stroke is over.
    pub fn settle(&mut self) {
        self.stroke = None;
    }

    /// The look before `look`, which itself is kept for [`History::redo`].
    pub fn undo(&mut self, look: &Look) -> Option<Look> {
        self.stroke = None;
        let before = self.past.pop()?;
        self.future.push(look.clone());
        Some(before)
    }

    /// The look that was undone last; `look` is kept for [`History::undo`].
    pub fn redo(&mut self, look: &Look) -> Option<Look> {
        self.stroke = None;
        let after = self.future.pop()?;
        self.past.push(look.clone());
        Some(after)
    }

    /// Whether there is anything to undo, and to redo.
    pub fn can(&self) -> (bool, bool) {
        (!self.past.is_empty(), !self.future.is_empty())
    }
}
