//! Messages to the user.

use super::State;
use crate::texts::translate_sentence;

/// A message to the user, shown for a while.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Unique number, counting from 1.
    pub number: u64,
    pub text: String,
}

/// Maximum number of notes that are kept.
const MAX_NOTES: usize = 6;

impl State {
    /// Removes a message that no longer holds.
    pub(super) fn withdraw_note(&mut self, text: &str) {
        let text = translate_sentence(text);
        self.notes.retain(|note| note.text != text);
    }

    /// Adds a message, translated into the display language.
    pub fn note(&mut self, text: impl Into<String>) {
        let text = translate_sentence(&text.into());
        // A repeated message replaces the earlier one and is shown anew.
        self.notes.retain(|note| note.text != text);
        self.last_note_number += 1;
        self.notes.push(Note { number: self.last_note_number, text });
        if self.notes.len() > MAX_NOTES {
            self.notes.remove(0);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::state::apply::OUTPUTS_CONTINUE;
    use crate::state::sample::state;
    use crate::state::{Action, Output, Update};

    #[test]
    fn notes_are_few_and_numbered_and_none_is_there_twice() {
        let mut state = state();
        for k in 0..20 {
            state.apply_update(Update::Note(format!("note {k}")));
        }
        let numbers: Vec<u64> = state.notes.iter().map(|note| note.number).collect();
        assert_eq!(numbers, [15, 16, 17, 18, 19, 20]);
        assert_eq!(state.notes.last().unwrap().text, "note 19");
        // A repeated message is shown once.
        ["a", "b", "a"].iter().for_each(|line| state.note(*line));
        assert_eq!(state.notes[4..].iter().map(|note| note.text.as_str()).collect::<Vec<_>>(), ["b", "a"]);
    }

    #[test]
    fn a_message_goes_with_its_reason() {
        let mut state = state();
        let says = |state: &super::State, text: &str| state.notes.iter().any(|note| note.text == text);
        state.outputs = vec![Output { name: "take.mp4".into(), is_camera: false }];
        state.apply(Action::Freeze(true));
        assert!(says(&state, OUTPUTS_CONTINUE));
        state.apply(Action::Freeze(false));
        assert!(!says(&state, OUTPUTS_CONTINUE));
    }
}
