//! Zooming: by keys, wheel and pinch; dragging and clicking the zoomed picture.

use egui::{Event, Key, Modifiers, pos2};

use super::super::super::state::{Action, Zoom};
use super::{Window, button, close, point, scrolled};
use crate::present::zoomed_area;

/// Lays the picture out as the window does.
fn place(window: &mut Window) {
    let Zoom { factor, center: [x, y] } = window.state.zoom;
    let center = [if window.state.mirror { 1.0 - x } else { x }, y];
    let (size, picture) = ((window.size.x as u32, window.size.y as u32), window.canvas.size);
    let (area, part) = zoomed_area(picture, size, factor, center);
    (window.canvas.area, window.canvas.visible_region) = (area, Some(part));
    window.pass(Vec::new());
}

/// Creates a window at 400 % around a point right of and above the middle.
fn enlarged_window(mirror: bool) -> Window {
    let mut window = Window::new();
    window.state.mirror = mirror;
    window.state.panel = false;
    window.state.zoom = Zoom { factor: 4, center: [0.6, 0.3] };
    place(&mut window);
    window.wait(1.0);
    window
}

#[test]
fn a_key_shows_the_pixels_under_the_pointer_and_all_of_the_picture_again() {
    let mut window = Window::new();
    window.pass(vec![Event::PointerMoved(pos2(320.0, 180.0))]);
    window.press(Key::X, Modifiers::NONE);
    assert!(window.state.zoom.factor == 1 && close(window.state.zoom.center, [0.25, 0.25]), "{:?}", window.state.zoom);
    window.press(Key::Plus, Modifiers::NONE);
    window.press(Key::Equals, Modifiers::NONE);
    assert_eq!(window.state.zoom.factor, 4);
    window.press(Key::Minus, Modifiers::NONE);
    assert_eq!(window.state.zoom.factor, 2);
    window.press(Key::X, Modifiers::NONE);
    assert_eq!(window.state.zoom.factor, 0);
}

#[test]
fn a_key_pressed_as_the_window_gets_smaller_counts_with_the_window_as_it_is_then() {
    let mut window = Window::new();
    window.press(Key::P, Modifiers::NONE);
    window.canvas.size = (640, 360);
    window.size = egui::vec2(600.0, 400.0);
    window.pass(vec![super::pressed(Key::X, Modifiers::NONE, true)]);
    assert_eq!(window.state.zoom.factor, 1);
}

#[test]
fn a_small_picture_is_never_made_smaller_by_a_key() {
    let mut window = Window::new();
    window.press(Key::P, Modifiers::NONE);
    // Fit to the window, it has 4.2 window pixels per picture pixel.
    window.canvas.size = (300, 170);
    window.pass(vec![Event::PointerMoved(pos2(320.0, 180.0))]);
    for key in [Key::X, Key::Plus] {
        window.press(key, Modifiers::NONE);
        assert_eq!(window.state.zoom.factor, 8, "{key:?}");
        window.press(if key == Key::X { key } else { Key::Minus }, Modifiers::NONE);
        assert_eq!(window.state.zoom.factor, 0, "all of it again");
    }
    // A factor chosen otherwise steps on from there.
    window.state.zoom.factor = 2;
    window.press(Key::Plus, Modifiers::NONE);
    assert_eq!(window.state.zoom.factor, 8);
}

#[test]
fn a_click_focuses_on_what_is_seen_there() {
    for mirror in [false, true] {
        let mut window = enlarged_window(mirror);
        // The middle of the window, and 100 window pixels to the right: 25 picture pixels.
        assert!(close(point(&window.click(pos2(640.0, 360.0))), [0.6, 0.3]));
        window.wait(1.0);
        let right = 25.0 / 1280.0 * if mirror { -1.0 } else { 1.0 };
        assert!(close(point(&window.click(pos2(740.0, 360.0))), [0.6 + right, 0.3]), "mirror {mirror}");
    }
}

#[test]
fn dragging_moves_it_and_no_further_than_its_edges() {
    for mirror in [false, true] {
        let mut window = enlarged_window(mirror);
        let actions = window.drag(pos2(640.0, 360.0), pos2(540.0, 320.0));
        assert!(!actions.iter().any(|action| matches!(action, Action::Look { .. })), "{actions:?}");
        let Some(Action::Pan(_)) = actions.iter().find(|action| matches!(action, Action::Pan(_))) else {
            panic!("{actions:?}")
        };
        // The panel gets the picture's position once per pass: here it stays unchanged.
        let step = window.state.zoom.center[0] - 0.6;
        assert!((step > 0.0) != mirror && step.abs() < 0.03, "{step}");
        window.state.zoom.center = [9.0, -9.0];
        place(&mut window);
        window.drag(pos2(640.0, 360.0), pos2(630.0, 368.0));
        let [x, y] = window.state.zoom.center;
        assert!((0.8..=0.9).contains(&x) && (0.1..=0.2).contains(&y), "{:?}", window.state.zoom);
    }
    let mut all = Window::new();
    let actions = all.drag(pos2(640.0, 360.0), pos2(540.0, 320.0));
    assert!(!actions.iter().any(|action| matches!(action, Action::Pan(_))), "where all is seen nothing moves");
}

#[test]
fn the_wheel_with_ctrl_and_two_fingers_enlarge_around_the_pointer() {
    let mut window = Window::new();
    window.state.panel = false;
    let at = pos2(960.0, 180.0);
    window.pass(vec![Event::PointerMoved(at)]);
    let look = window.state.look.clone();
    window.pass(vec![Event::Zoom(1.3)]);
    assert!(window.state.zoom.factor == 1 && close(window.state.zoom.center, [0.75, 0.25]), "{:?}", window.state.zoom);
    let ctrl = Modifiers::CTRL | Modifiers::COMMAND;
    window.pass(vec![scrolled(egui::MouseWheelUnit::Line, 2.0, ctrl)]);
    window.wait(0.5);
    assert!(window.state.zoom.factor > 1, "{:?}", window.state.zoom);
    assert_eq!(window.state.look, look, "the blur is the wheel's alone");
    for _ in 0..9 {
        window.pass(vec![Event::Zoom(0.7)]);
    }
    assert_eq!(window.state.zoom.factor, 0);
}

#[test]
fn the_split_line_is_where_the_picture_is_split() {
    let mut window = enlarged_window(false);
    window.state.split = Some(0.61);
    window.wait(0.1);
    // 0.01 of 1280 pixels right of the middle, each four wide.
    let line = 640.0 + 0.01 * 1280.0 * 4.0;
    let actions = window.drag(pos2(line, 300.0), pos2(line + 128.0, 300.0));
    assert!(!actions.iter().any(|action| matches!(action, Action::Pan(_))), "{actions:?}");
    assert!((window.state.split.unwrap() - 0.635).abs() < 2e-3, "{:?}", window.state.split);
    // Out of sight it cannot be grabbed.
    window.state.split = Some(0.1);
    window.wait(0.1);
    window.pass(vec![Event::PointerMoved(pos2(2.0, 300.0))]);
    window.pass(vec![button(pos2(2.0, 300.0), true)]);
    window.pass(vec![button(pos2(2.0, 300.0), false)]);
    assert_eq!(window.state.split, Some(0.1));
}
