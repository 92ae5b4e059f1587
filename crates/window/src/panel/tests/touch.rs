//! Touch input, as the window system reports it, and hiding the idle pointer.

use egui::{CursorIcon, Event, Pos2, TouchDeviceId, TouchId, TouchPhase, pos2};

use super::{Action, Window, button};
use bokehcam::depth::focus::FocusRule;

/// Returns egui's events for a finger: the touch itself, and the emulated pointer.
fn finger(at: Pos2, phase: TouchPhase) -> Vec<Event> {
    let touch = Event::Touch { device_id: TouchDeviceId(1), id: TouchId(7), phase, pos: at, force: None };
    match phase {
        TouchPhase::Start => vec![touch, Event::PointerMoved(at), button(at, true)],
        TouchPhase::Move => vec![touch, Event::PointerMoved(at)],
        _ => vec![touch, button(at, false), Event::PointerGone],
    }
}

fn tap(window: &mut Window, at: Pos2) -> Vec<Action> {
    let mut actions = window.pass(finger(at, TouchPhase::Start));
    actions.extend(window.wait(0.05));
    actions.extend(window.pass(finger(at, TouchPhase::End)));
    actions.extend(window.wait(0.1));
    actions
}

fn focused(actions: &[Action]) -> Vec<FocusRule> {
    let looks = actions.iter().filter_map(|action| match action {
        Action::Look { look, .. } => Some(look.focus),
        _ => None,
    });
    looks.collect()
}

#[test]
fn a_tap_focuses_unless_it_wakes_the_panel() {
    let mut window = Window::new();
    window.state.full_screen = true;
    let at = pos2(320.0, 180.0);
    assert_eq!(focused(&tap(&mut window, at)), [FocusRule::Point { x: 0.25, y: 0.25 }]);
    // The panel has hidden: the first tap reopens it, and only the next one focuses.
    window.wait(5.0);
    assert!(window.panel.sheet.rect().is_none());
    assert_eq!(focused(&tap(&mut window, pos2(640.0, 360.0))), []);
    window.wait(0.5);
    assert!(window.panel.sheet.rect().is_some());
    assert_eq!(focused(&tap(&mut window, pos2(640.0, 360.0))), [FocusRule::Point { x: 0.5, y: 0.5 }]);
    // Without a panel to reopen, every tap focuses.
    window.state.panel = false;
    window.wait(6.0);
    assert_eq!(focused(&tap(&mut window, at)).len(), 1);
}

#[test]
fn a_finger_takes_the_split_line_from_further_off_than_a_pointer() {
    for (by_finger, taken) in [(true, true), (false, false)] {
        let mut window = Window::new();
        window.state.split = Some(0.5);
        window.wait(0.1);
        let (from, to) = (pos2(640.0 + 24.0, 300.0), pos2(320.0, 320.0));
        if by_finger {
            window.pass(finger(from, TouchPhase::Start));
            for step in 1..=8 {
                window.pass(finger(from + (to - from) * (step as f32 / 8.0), TouchPhase::Move));
            }
            window.pass(finger(to, TouchPhase::End));
        } else {
            window.drag(from, to);
        }
        assert_eq!((window.state.split.unwrap() - 0.25).abs() < 2e-3, taken, "{:?}", window.state.split);
        assert_eq!(window.state.look, super::sample::state().look, "a drag of the line is no click");
    }
}

#[test]
fn no_hint_stays_where_a_finger_was() {
    let mut window = Window::new();
    let at = window.place_of("Snapshot").unwrap_or(pos2(1150.0, 300.0));
    tap(&mut window, at);
    window.wait(2.0);
    assert!(!window.texts().iter().any(|text| text.contains("(S)")), "{:?}", window.texts());
}

#[test]
fn a_pointer_that_rests_is_hidden_in_full_screen_until_it_moves() {
    let mut window = Window::new();
    let icon = |window: &mut Window, events: Vec<Event>| {
        let (_, output) = window.pass_with_output(events);
        let icon = output.platform_output.cursor_icon;
        output.drop_without_applying_deltas();
        icon
    };
    window.pass(vec![Event::PointerMoved(pos2(300.0, 300.0))]);
    window.wait(6.0);
    assert_ne!(icon(&mut window, Vec::new()), CursorIcon::None, "in a window it stays");
    window.state.full_screen = true;
    assert_eq!(icon(&mut window, Vec::new()), CursorIcon::None);
    assert_ne!(icon(&mut window, vec![Event::PointerMoved(pos2(320.0, 300.0))]), CursorIcon::None);
    window.wait(3.0);
    assert_ne!(icon(&mut window, Vec::new()), CursorIcon::None);
    window.wait(1.5);
    assert_eq!(icon(&mut window, Vec::new()), CursorIcon::None);
    // Over the panel, the pointer stays visible.
    window.pass(vec![Event::PointerMoved(super::on_panel())]);
    window.wait(10.0);
    assert_ne!(icon(&mut window, Vec::new()), CursorIcon::None);
}
