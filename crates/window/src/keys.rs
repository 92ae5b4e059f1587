//! Key bindings: one table that the help displays and that maps key events to actions.

mod bindings;

use egui::{Event, Key, Modifiers};

use super::state::{Action, State};
pub use bindings::GROUPS;

/// A key with its modifiers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chord {
    pub key: Key,
    /// Whether Ctrl must be held.
    pub ctrl: bool,
    /// Whether Shift must be held. Checked only for letters: on some keyboard layouts other characters need Shift
    /// anyway.
    pub shift: bool,
}

/// A set of chords and the action they trigger.
pub struct Binding {
    /// Alternative chords; each one triggers the action.
    pub chords: &'static [Chord],
    /// The chords as the help displays them.
    pub keys: &'static str,
    pub help: &'static str,
    /// Whether it repeats while the key is held.
    pub repeats: bool,
    make: fn(&State, Context) -> Option<Action>,
}

/// A titled group of bindings in the help.
pub struct Group {
    /// The title.
    pub name: &'static str,
    pub bindings: &'static [Binding],
}

/// Values that an action depends on besides the state.
#[derive(Clone, Copy, Debug)]
pub struct Context {
    /// Width and height of the picture in pixels; relative blur amounts depend on it.
    pub size: (u32, u32),
    /// Scale of the picture when it fits the window: window pixels per picture pixel.
    pub fit: f32,
    /// Index of the pressed chord in [`Binding::chords`].
    pub chord: usize,
}

/// Whether a focused control handles this key itself.
fn is_handled_by_controls(chord: Chord) -> bool {
    let keys = [Key::ArrowLeft, Key::ArrowRight, Key::ArrowUp, Key::ArrowDown, Key::Space, Key::Escape];
    !chord.ctrl && keys.contains(&chord.key)
}

/// Whether a key may trigger this action now: nothing may change unseen beneath the help or the closing dialog.
fn is_allowed(action: &Action, state: &State) -> bool {
    match action {
        Action::CancelClose => true,
        // A second press, out of nervousness, does not answer the question whether to close.
        Action::Close | Action::Help(_) | Action::FullScreen(_) | Action::TextScale(_) => !state.closing,
        _ => !state.help && !state.closing,
    }
}

/// Whether the chord is a single printable character without Ctrl, which speech-input software may press by accident.
fn is_single_key(chord: Chord) -> bool {
    !chord.ctrl && chord.key.symbol_or_name().len() == 1
}

/// Whether the key is a letter. Shift and Alt are checked for letters only: some layouts need them for other
/// characters.
fn is_letter(key: Key) -> bool {
    key.name().len() == 1 && key.name().chars().all(|c| c.is_ascii_alphabetic())
}

impl Chord {
    /// Whether the pressed key and modifiers match this chord.
    fn matches(self, pressed: Key, modifiers: Modifiers) -> bool {
        let shift = !is_letter(self.key) || self.shift == modifiers.shift;
        self.key == pressed && self.ctrl == modifiers.ctrl && shift && (!modifiers.alt || !is_letter(self.key))
    }
}

/// Returns the action bound to a key event. While a control is `focused`, the keys it handles itself are ignored.
pub fn action_for_event(event: &Event, state: &State, context: Context, focused: bool) -> Option<Action> {
    let Event::Key { key, pressed: true, repeat, modifiers, .. } = event else { return None };
    let bindings = GROUPS.iter().flat_map(|group| group.bindings);
    let found = bindings.filter(|binding| binding.repeats || !repeat).find_map(|binding| {
        let chord = binding.chords.iter().position(|chord| chord.matches(*key, *modifiers))?;
        Some((binding, chord))
    });
    let (binding, chord) = found?;
    if !state.preferences.single_keys && is_single_key(binding.chords[chord]) {
        return None;
    }
    // Esc closes the closing dialog even while one of its buttons has the focus.
    let closes = state.closing && *key == Key::Escape;
    if focused && is_handled_by_controls(binding.chords[chord]) && !closes {
        return None;
    }
    (binding.make)(state, Context { chord, ..context }).filter(|action| is_allowed(action, state))
}

#[cfg(test)]
mod tests;
