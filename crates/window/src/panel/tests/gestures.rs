//! Gestures on the picture.

use egui::{Event, Modifiers, Pos2, pos2};

use super::{Action, Window, close, last_look, on_panel, point, sample, scrolled};
use crate::present::Area;
use bokehcam::depth::focus::FocusRule;
use bokehcam::look::Effect;

#[test]
fn a_click_focuses_there() {
    let mut window = Window::new();
    assert!(close(point(&window.click(pos2(320.0, 180.0))), [0.25, 0.25]));
    // Mirrored, left is right.
    window.wait(1.0);
    window.state.mirror = true;
    assert!(close(point(&window.click(pos2(320.0, 540.0))), [0.75, 0.75]));
}

#[test]
fn a_click_is_where_the_picture_is() {
    // A letterboxed picture on a display with twice the pixel density, and larger text.
    let mut window = Window::new();
    window.native = 2.0;
    window.canvas.area = Area { x: 100, y: 60, width: 800, height: 450 };
    window.state.preferences.text_scale = 1.25;
    window.wait(0.2);
    let at = |x: f32, y: f32| pos2(x, y) / 2.5;
    assert!(close(point(&window.click(at(100.0 + 400.0, 60.0 + 90.0))), [0.5, 0.2]));
    window.wait(1.0);
    let beside = window.click(at(40.0, 300.0));
    assert_eq!(last_look(&beside), None, "beside the picture");
}

#[test]
fn a_double_click_follows_what_was_clicked_and_both_are_undone_together() {
    let mut window = Window::new();
    window.state.look.focus = FocusRule::Metres(3.0);
    let mut actions = window.click(pos2(500.0, 300.0));
    actions.extend(window.click(pos2(500.0, 300.0)));
    let focus = last_look(&actions).map(|look| look.focus);
    assert!(matches!(focus, Some(FocusRule::Track { .. })), "{actions:?}");
    window.wait(1.0);
    window.state.apply(Action::Undo);
    window.state.apply(Action::Undo);
    assert_eq!(window.state.look.focus, FocusRule::Metres(3.0));
}

#[test]
fn a_click_on_the_panel_does_not_reach_the_picture() {
    let mut window = Window::new();
    window.wait(0.5);
    let actions = window.click(on_panel());
    let focuses = actions.iter().any(|action| match action {
        Action::Look { look, .. } => matches!(look.focus, FocusRule::Point { .. }),
        _ => false,
    });
    assert!(!focuses, "{actions:?}");
}

#[test]
fn the_split_is_dragged() {
    let mut window = Window::new();
    window.state.split = Some(0.5);
    window.wait(0.1);
    let actions = window.drag(pos2(640.0, 300.0), pos2(320.0, 320.0));
    assert!((window.state.split.unwrap() - 0.25).abs() < 2e-3, "{:?}", window.state.split);
    assert_eq!(last_look(&actions), None, "a drag of the line is no click on the picture");
    // Not beyond the picture.
    window.drag(pos2(320.0, 300.0), pos2(-50.0, 300.0));
    assert_eq!(window.state.split, Some(0.0));
}

fn wheel(window: &mut Window, at: Pos2, delta: f32) -> Vec<Action> {
    let mut actions = window.pass(vec![Event::PointerMoved(at)]);
    actions.extend(window.pass(vec![scrolled(egui::MouseWheelUnit::Point, delta, Modifiers::NONE)]));
    actions.extend(window.wait(1.5));
    actions
}

#[test]
fn the_wheel_blurs_more_and_less_over_the_picture_only() {
    let mut window = Window::new();
    let amount = |window: &Window| crate::state::tweak::coc_fraction(&window.state.look, 720).unwrap();
    let first = amount(&window);
    let actions = wheel(&mut window, pos2(400.0, 300.0), 100.0);
    let more = amount(&window);
    assert!(more > 1.1 * first && more < 1.6 * first, "{first} to {more}");
    assert!(actions.contains(&Action::EndStroke), "the wheel came to rest");
    wheel(&mut window, pos2(400.0, 300.0), -200.0);
    assert!(amount(&window) < first);
    let before = window.state.look.clone();
    wheel(&mut window, on_panel(), 100.0);
    assert_eq!(window.state.look, before, "over the panel it scrolls the panel");
}

fn tilted() -> Window {
    let mut state = sample::state();
    state.look.effect = Effect::TiltShift;
    state.look.tilt.band = 0.2;
    Window::of(state, (1280, 720))
}

#[test]
fn the_band_of_tilt_shift_is_moved_widened_and_turned() {
    let mut window = tilted();
    window.drag(pos2(640.0, 360.0), pos2(640.0, 216.0));
    assert!((window.state.look.tilt.center_y - 0.3).abs() < 5e-3, "{:?}", window.state.look.tilt);
    let middle_y = 216.0;
    window.drag(pos2(640.0, middle_y + 72.0), pos2(640.0, middle_y + 144.0));
    assert!((window.state.look.tilt.band - 0.4).abs() < 5e-3, "{:?}", window.state.look.tilt);
    let reach = 0.32 * 720.0;
    window.drag(pos2(640.0 + reach, middle_y), pos2(640.0 + 200.0, middle_y + 200.0));
    assert!((window.state.look.tilt.angle_deg - 45.0).abs() < 1e-3, "{:?}", window.state.look.tilt);
}

#[test]
fn in_a_mirror_the_band_turns_as_it_is_seen() {
    let mut window = tilted();
    window.state.mirror = true;
    let reach = 0.32 * 720.0;
    window.drag(pos2(640.0 - reach, 360.0), pos2(640.0 - 200.0, 360.0 + 100.0));
    let angle = window.state.look.tilt.angle_deg;
    assert!((angle - 100f32.atan2(200.0).to_degrees()).abs() < 0.5, "{angle}");
}

#[test]
fn a_click_puts_the_band_there() {
    let mut window = tilted();
    window.click(pos2(200.0, 600.0));
    assert!((window.state.look.tilt.center_y - 600.0 / 720.0).abs() < 2e-3, "{:?}", window.state.look.tilt);
}

#[test]
fn a_drag_of_a_slider_is_undone_at_once_and_each_drag_on_its_own() {
    let mut window = tilted();
    let first = window.state.look.tilt;
    window.drag(pos2(640.0, 360.0), pos2(640.0, 300.0));
    window.wait(0.1);
    let between = window.state.look.tilt;
    window.drag(pos2(640.0, 300.0), pos2(640.0, 200.0));
    window.wait(0.1);
    window.state.apply(Action::Undo);
    assert_eq!(window.state.look.tilt, between);
    window.state.apply(Action::Undo);
    assert_eq!(window.state.look.tilt, first);
}
