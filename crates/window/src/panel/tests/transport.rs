//! The playback bar of a recording.

use egui::{Key, Modifiers, pos2};

use super::super::super::state::{Action, Output, Transport};
use super::Window;

const TRANSPORT: Transport = Transport { frame: 3, frames: 101, time_ns: 1_230_000_000, length_ns: 61_000_000_000 };

fn of_a_recording() -> Window {
    let mut window = Window::new();
    window.state.transport = Some(TRANSPORT);
    // Awake: the pointer is over the picture.
    window.pass(vec![egui::Event::PointerMoved(pos2(300.0, 300.0))]);
    window.wait(0.3);
    window
}

#[test]
fn a_recording_has_a_bar_that_goes_with_the_panel_and_a_camera_has_none() {
    let mut window = of_a_recording();
    let time = "0:01.23 / 1:01.00";
    assert!(window.place_of(time).is_some_and(|at| at.y > 680.0), "{:?}", window.texts());
    window.state.controls_hidden = true;
    assert!(window.place_of(time).is_none());
    window.state.controls_hidden = false;
    window.wait(5.0);
    assert!(window.place_of(time).is_some(), "beside the panel it stays");
    window.state.full_screen = true;
    window.wait(5.0);
    assert!(window.place_of(time).is_none(), "it hides");
    let mut camera = of_a_recording();
    camera.state.transport = None;
    assert!(camera.place_of(time).is_none());
}

#[test]
fn in_a_small_window_the_bar_makes_room_for_the_panel() {
    for width in [150, 400, 500, 640, 800] {
        let mut state = super::sample::state();
        state.transport = Some(TRANSPORT);
        let mut window = Window::of(state, (width, 420));
        window.wait(0.5);
        let panel = window.panel.sheet.rect().unwrap();
        let bar = window.ctx.memory(|memory| memory.area_rect(egui::Id::unique("transport")));
        assert!(bar.is_none_or(|bar| !bar.intersects(panel)), "{width}: {bar:?} over {panel}");
        assert_eq!(bar.is_some(), width >= 400, "{width}: {bar:?} and {panel}");
    }
}

#[test]
fn keys_step_pause_and_go_to_the_start() {
    let mut window = of_a_recording();
    assert_eq!(window.press(Key::PageDown, Modifiers::NONE), [Action::Step(1)]);
    assert!(window.state.frozen && window.state.transport.unwrap().frame == 4);
    window.press(Key::PageUp, Modifiers::NONE);
    window.press(Key::PageUp, Modifiers::NONE);
    assert_eq!(window.state.transport.unwrap().frame, 2);
    assert_eq!(window.press(Key::Home, Modifiers::NONE), [Action::Seek(0)]);
    // The step before the first frame wraps around to the last.
    window.press(Key::PageUp, Modifiers::NONE);
    assert_eq!(window.state.transport.unwrap().frame, 100);
    window.press(Key::Z, Modifiers::NONE);
    assert!(!window.state.frozen);
    window.state.transport = None;
    assert!(window.press(Key::PageDown, Modifiers::NONE).is_empty() && !window.state.frozen);
}

#[test]
fn the_line_is_dragged_while_the_recording_stands_still_and_plays_on_after() {
    let mut window = of_a_recording();
    // Right of the time, left of the panel.
    let actions = window.drag(pos2(400.0, 688.0), pos2(700.0, 688.0));
    let sought: Vec<usize> = actions
        .iter()
        .filter_map(|action| match action {
            Action::Seek(place) => Some(*place),
            _ => None,
        })
        .collect();
    assert!(sought.len() > 4 && sought.is_sorted() && sought.last() < Some(&101), "{actions:?}");
    let freezes: Vec<&Action> = actions.iter().filter(|action| matches!(action, Action::Freeze(_))).collect();
    assert_eq!(freezes, [&Action::Freeze(true), &Action::Freeze(false)]);
    assert!(!actions.iter().any(|action| matches!(action, Action::Look { .. })), "no click on the picture");
    // A paused recording stays paused.
    window.state.frozen = true;
    let actions = window.drag(pos2(700.0, 688.0), pos2(500.0, 688.0));
    assert!(!actions.iter().any(|action| matches!(action, Action::Freeze(_))), "{actions:?}");
}

#[test]
fn the_hint_of_the_line_is_at_the_pointer() {
    let mut window = of_a_recording();
    for x in [400.0, 800.0] {
        window.pass(vec![egui::Event::PointerMoved(pos2(x, 688.0))]);
        window.wait(2.0);
        let at = window.place_of("Frame 4 of 101").expect("a hint");
        assert!((at.x - x).abs() < 90.0, "{at} for {x}");
        window.pass(vec![egui::Event::PointerMoved(pos2(x, 300.0))]);
        window.wait(0.5);
    }
}

#[test]
fn it_is_a_pause_unless_something_is_written() {
    let mut window = of_a_recording();
    window.state.frozen = true;
    assert!(window.texts().iter().any(|text| text == "Paused"));
    window.state.outputs = vec![Output { name: "film.mp4".into(), is_camera: false }];
    assert!(window.texts().iter().any(|text| text == "Frozen here, live elsewhere"));
}
