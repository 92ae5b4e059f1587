//! Modals over the window: the help, and the dialog that confirms closing.

use egui::{Event, Key, Modifiers, pos2};

use super::{Action, Window, pressed, sample};
use crate::keys::GROUPS;
use crate::state::{DepthMethod, Output, Source, State};
use bokehcam::depth::plate::Step;

fn recording() -> State {
    let mut state = sample::state();
    state.outputs = vec![Output { name: "clip.mp4".into(), is_camera: false }];
    state
}

#[test]
fn closing_asks_once_while_something_is_recorded() {
    let mut window = Window::new();
    assert!(window.press(Key::Q, Modifiers::NONE).contains(&Action::Close));
    assert!(!window.state.closing, "nothing would be broken off");

    let mut window = Window::of(recording(), (1280, 720));
    window.press(Key::Q, Modifiers::NONE);
    window.wait(0.2);
    assert!(window.place_of("Stop recording and close?").is_some());
    // It captures keys and clicks, and a nervous second press is no answer.
    let look = window.state.look.clone();
    for key in [Key::M, Key::Num2, Key::OpenBracket, Key::V, Key::Q] {
        assert_eq!(window.press(key, Modifiers::NONE), [], "{key:?}");
    }
    let ctrl = Modifiers::CTRL | Modifiers::COMMAND;
    for key in [Key::Q, Key::W] {
        assert_eq!(window.press(key, ctrl), [], "Ctrl+{key:?}");
    }
    assert!(window.state.closing);
    window.click(pos2(200.0, 650.0));
    assert_eq!((&window.state.look, window.state.mirror, window.state.outputs.len()), (&look, false, 1));
    window.state.closing = true;
    window.press(Key::Escape, Modifiers::NONE);
    assert!(!window.state.closing && window.state.panel);
    window.state.closing = true;
    window.wait(0.5);
    window.press(Key::Tab, Modifiers::NONE);
    window.press(Key::Escape, Modifiers::NONE);
    assert!(!window.state.closing, "once is enough, whatever has the focus");
    window.press(Key::Q, Modifiers::NONE);
    window.wait(0.2);
    assert_eq!(window.state.apply(Action::Close), [crate::state::Request::Close], "asked once");
}

#[test]
fn closing_asks_where_calls_may_have_the_picture() {
    let mut state = sample::state();
    state.outputs = vec![Output { name: "pipewire".into(), is_camera: true }];
    let mut window = Window::of(state, (1280, 720));
    window.press(Key::Q, Modifiers::NONE);
    window.wait(0.2);
    assert!(window.state.closing && window.place_of("Take the picture out of calls and close?").is_some());
    window.click_on("Stay");
    assert!(!window.state.closing && window.state.outputs.len() == 1);
    window.press(Key::Q, Modifiers::NONE);
    window.wait(0.2);
    assert!(window.click_on("Close").contains(&Action::Close));
}

#[test]
fn esc_leaves_a_plate_that_is_not_there_yet() {
    let mut state = sample::state();
    state.source = sample::running(false);
    let Source::Running(running) = &mut state.source else { unreachable!("it runs") };
    running.depth_methods = vec![DepthMethod::Person, DepthMethod::Plate];
    state.plate = Some(Step::KeepsMoving);
    let mut window = Window::of(state, (1280, 720));
    assert!(window.place_of("Find me without it").is_some());
    assert!(window.press(Key::Escape, Modifiers::NONE).contains(&Action::SetDepthMethod(DepthMethod::Person)));
    assert!(window.state.panel, "the panel stays");
    window.state.plate = Some(Step::Ready);
    assert!(window.press(Key::Escape, Modifiers::NONE).contains(&Action::Panel(false)));
}

#[test]
fn it_does_not_ask_who_said_so_nor_when_nothing_would_be_lost() {
    let mut window = Window::of(recording(), (1280, 720));
    window.state.apply(Action::Close);
    window.wait(0.2);
    window.click_on("Do not ask again");
    window.click_on("Keep recording");
    assert!(
        !window.state.closing && window.state.preferences.ask_before_closing,
        "who does not close has decided nothing"
    );
    window.state.apply(Action::Close);
    window.wait(0.2);
    // Enter activates the safe choice.
    window.press(Key::Enter, Modifiers::NONE);
    assert!(!window.state.closing);
    window.state.apply(Action::Close);
    window.wait(0.2);
    window.click_on("Do not ask again");
    assert!(window.click_on("Stop and close").contains(&Action::Close));
    assert!(!window.state.preferences.ask_before_closing);
    let mut state = recording();
    state.apply(Action::Close);
    assert!(state.closing);
    state.apply_update(crate::state::Update::Outputs(Vec::new()));
    assert!(!state.closing, "the recording has ended by itself");
}

#[test]
fn the_help_scrolls_by_keys_and_lets_nothing_through() {
    let mut window = Window::of(sample::state(), (600, 400));
    window.press(Key::F1, Modifiers::NONE);
    window.wait(0.3);
    let first = "the preset of that number";
    let top = window.place_of(first).expect("the first row");
    window.press(Key::PageDown, Modifiers::NONE);
    window.wait(0.5);
    assert!(window.place_of(first).is_none_or(|now| now.y < top.y - 50.0));
    window.press(Key::Home, Modifiers::NONE);
    window.wait(0.5);
    assert_eq!(window.place_of(first), Some(top));
    let before = window.state.look.clone();
    window.press(Key::Num2, Modifiers::NONE);
    window.pass(vec![Event::PointerMoved(pos2(300.0, 200.0))]);
    window.click(pos2(4.0, 4.0));
    assert!(!window.state.help, "a click beside it closes it");
    assert_eq!(window.state.look, before, "and does nothing else");
}

#[test]
fn single_keys_can_be_switched_off() {
    let mut window = Window::new();
    window.state.preferences.single_keys = false;
    for (chord, keys) in
        GROUPS.iter().flat_map(|group| group.bindings).flat_map(|b| b.chords.iter().map(|c| (c, b.keys)))
    {
        let modifiers = if chord.ctrl { Modifiers::CTRL | Modifiers::COMMAND } else { Modifiers::NONE };
        window.state.help = false;
        window.state.look.focus_range_m = 0.5;
        let done = window.pass(vec![pressed(chord.key, modifiers, true)]);
        window.pass(vec![pressed(chord.key, modifiers, false)]);
        let is_sign = !chord.ctrl && chord.key.symbol_or_name().len() == 1;
        assert!(!is_sign || done.iter().all(|action| *action == Action::EndStroke), "{keys}: {done:?}");
    }
    assert!(window.press(Key::F1, Modifiers::NONE).contains(&Action::Help(true)));
}
