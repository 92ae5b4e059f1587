use std::collections::HashSet;

use bokehcam::depth::focus::FocusRule;

use super::*;
use crate::state::sample::{running, state};
use crate::state::{Source, ViewMode, tweak};

const CONTEXT: Context = Context { size: (1280, 720), fit: 1.0, chord: 0 };

fn press(key: Key, modifiers: Modifiers) -> Event {
    Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers }
}

fn does(state: &State, key: Key, modifiers: Modifiers) -> Option<Action> {
    action_for_event(&press(key, modifiers), state, CONTEXT, false)
}

#[test]
fn no_two_keys_are_the_same_and_each_says_what_it_does() {
    let mut seen = HashSet::new();
    for binding in GROUPS.iter().flat_map(|group| group.bindings) {
        assert!(!binding.keys.is_empty() && !binding.help.is_empty());
        let own: HashSet<_> = binding.chords.iter().map(|chord| (chord.key, chord.ctrl, chord.shift)).collect();
        for chord in own {
            assert!(seen.insert(chord), "{chord:?} is bound twice");
        }
    }
}

#[test]
fn each_key_is_what_the_help_says() {
    // Each chord's displayed name must begin with its first key.
    for binding in GROUPS.iter().flat_map(|group| group.bindings) {
        let first = binding.chords[0];
        let sign = match first.key {
            Key::OpenBracket => "[",
            Key::Semicolon => ";",
            Key::Comma => ",",
            Key::ArrowLeft => "Left",
            Key::ArrowUp => "Up",
            Key::Escape => "Esc",
            Key::Minus if first.ctrl => "−",
            key => key.name(),
        };
        let name =
            format!("{}{}{sign}", if first.ctrl { "Ctrl+" } else { "" }, if first.shift { "Shift+" } else { "" });
        assert!(binding.keys.starts_with(&name), "{name} is not in '{}'", binding.keys);
    }
}

#[test]
fn switches_toggle() {
    let mut state = state();
    for (key, read) in [
        (Key::M, (|state| state.mirror) as fn(&State) -> bool),
        (Key::Z, |state| state.frozen),
        (Key::P, |state| state.panel),
        (Key::Space, |state| state.panel),
        (Key::H, |state| state.controls_hidden),
        (Key::F, |state| state.full_screen),
        (Key::F11, |state| state.full_screen),
        (Key::F1, |state| state.help),
        (Key::Questionmark, |state| state.help),
        (Key::B, |state| state.split.is_some()),
        (Key::D, |state| state.shown == ViewMode::Depth),
        (Key::V, |state| state.recording().is_some()),
        (Key::O, |state| state.virtual_camera().is_some()),
    ] {
        let before = read(&state);
        for turn in 1..=2 {
            let action = does(&state, key, Modifiers::NONE).unwrap();
            state.apply(action);
            assert_eq!(read(&state), before ^ (turn == 1), "{key:?}");
        }
    }
}

#[test]
fn keys_do_what_their_names_say() {
    let state = state();
    let ctrl = Modifiers::CTRL | Modifiers::COMMAND;
    for (key, modifiers, action) in [
        (Key::Z, ctrl, Action::Undo),
        (Key::Z, ctrl | Modifiers::SHIFT, Action::Redo),
        (Key::Y, ctrl, Action::Redo),
        (Key::R, Modifiers::NONE, Action::Reset),
        (Key::Num2, Modifiers::NONE, Action::Preset("cinematic".into())),
        (Key::Num6, Modifiers::NONE, Action::Preset("my desk".into())),
        (Key::S, Modifiers::NONE, Action::Snapshot),
        (Key::K, Modifiers::NONE, Action::CopyCommand),
        (Key::Q, Modifiers::NONE, Action::Close),
        (Key::Q, ctrl, Action::Close),
        (Key::W, ctrl, Action::Close),
        (Key::F5, Modifiers::NONE, Action::Refresh),
        (Key::Num0, ctrl, Action::TextScale(1.0)),
        (Key::Plus, ctrl | Modifiers::SHIFT, Action::TextScale(1.1)),
        (Key::Minus, ctrl, Action::TextScale(1.0 / 1.1)),
        // A character may need Shift on one keyboard layout and not on another.
        (Key::Questionmark, Modifiers::SHIFT, Action::Help(true)),
    ] {
        assert_eq!(does(&state, key, modifiers), Some(action), "{key:?} {modifiers:?}");
    }
    for (key, modifiers) in [
        (Key::S, ctrl),
        (Key::Q, Modifiers::SHIFT),
        (Key::Num9, Modifiers::NONE),
        (Key::A, Modifiers::NONE),
        (Key::Escape, ctrl),
        (Key::J, Modifiers::NONE),
    ] {
        assert_eq!(does(&state, key, modifiers), None, "{key:?} {modifiers:?}");
    }
}

#[test]
fn looks_change_by_keys() {
    let state = state();
    let changed = |key: Key| match does(&state, key, Modifiers::NONE) {
        Some(Action::Look { look, stroke: Some(_) }) => *look,
        other => panic!("{key:?}: {other:?}"),
    };
    let amount = |key: Key| tweak::coc_fraction(&changed(key), 720).unwrap();
    let now = tweak::coc_fraction(&state.look, 720).unwrap();
    assert!(amount(Key::OpenBracket) < now && amount(Key::CloseBracket) > now);
    let mut lens = state.clone();
    lens.look.strength = bokehcam::look::Strength::Lens(tweak::DEFAULT_LENS);
    let with_lens = |key: Key| match does(&lens, key, Modifiers::NONE) {
        Some(Action::Look { look, .. }) => *look,
        other => panic!("{key:?}: {other:?}"),
    };
    let f_number = |key: Key| match with_lens(key).strength {
        bokehcam::look::Strength::Lens(lens) => lens.f_number,
        other => panic!("{other:?}"),
    };
    assert!(f_number(Key::Semicolon) < f_number(Key::Quote));
    assert!((changed(Key::Period).focus_range_m - 0.05).abs() < 1e-6);
    assert_eq!(does(&state, Key::Comma, Modifiers::NONE), None, "it is 0 already");
    for key in [Key::ArrowLeft, Key::ArrowRight, Key::ArrowUp, Key::ArrowDown] {
        assert!(matches!(changed(key).focus, FocusRule::Point { .. }));
    }
}

#[test]
fn only_some_keys_repeat_and_some_belong_to_a_control_in_focus() {
    let state = state();
    let repeated = |key: Key| {
        let event = Event::Key { key, physical_key: None, pressed: true, repeat: true, modifiers: Modifiers::NONE };
        action_for_event(&event, &state, CONTEXT, false)
    };
    assert!(repeated(Key::CloseBracket).is_some() && repeated(Key::ArrowUp).is_some());
    assert!(repeated(Key::M).is_none() && repeated(Key::V).is_none());
    let focused = |key: Key| action_for_event(&press(key, Modifiers::NONE), &state, CONTEXT, true);
    assert!(focused(Key::ArrowUp).is_none() && focused(Key::Space).is_none() && focused(Key::Escape).is_none());
    assert!(focused(Key::M).is_some());
    let released =
        Event::Key { key: Key::M, physical_key: None, pressed: false, repeat: false, modifiers: Modifiers::NONE };
    assert_eq!(action_for_event(&released, &state, CONTEXT, false), None);
}

#[test]
fn escape_closes_one_thing_after_the_other() {
    let mut state = state();
    (state.help, state.controls_hidden, state.full_screen, state.panel) = (true, true, true, true);
    let mut closed = Vec::new();
    while let Some(action) = does(&state, Key::Escape, Modifiers::NONE) {
        closed.push(action.clone());
        state.apply(action);
    }
    let all = [Action::Help(false), Action::HideControls(false), Action::FullScreen(false), Action::Panel(false)];
    assert_eq!(closed, all);
}

#[test]
fn f5_opens_again_what_was_lost() {
    let mut state = state();
    for source in [Source::Lost("gone".into()), Source::Ended] {
        state.source = source;
        assert_eq!(does(&state, Key::F5, Modifiers::NONE), Some(Action::Retry));
    }
    state.source = running(true);
    assert_eq!(does(&state, Key::F5, Modifiers::NONE), Some(Action::Refresh));
}
