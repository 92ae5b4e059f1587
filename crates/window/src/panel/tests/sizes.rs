//! Windows and texts of all sizes, with everything open: nothing panics, and nothing is out of sight.

use egui::Rect;

use super::{Window, sample};
use crate::state::{self, Output, Source, State};
use bokehcam::look::Effect;

fn states() -> Vec<State> {
    let base = sample::state();
    let mut all = vec![base.clone()];
    let mut full = base.clone();
    (full.help, full.split) = (true, Some(0.5));
    full.note("A long line for the person ".repeat(30));
    all.push(full);
    let mut tilt = base.clone();
    (tilt.look.effect, tilt.mirror, tilt.source) = (Effect::TiltShift, true, sample::running(false));
    all.push(tilt);
    let mut off = base.clone();
    (off.look.effect, off.shown, off.source) = (Effect::None, state::ViewMode::Depth, Source::Lost("why ".repeat(200)));
    off.focus_m = Some(f32::INFINITY);
    all.push(off);
    let mut empty = State::new(sample::look(), String::new());
    empty.source = Source::Ended;
    all.push(empty);
    all
}

#[test]
fn any_window_and_any_text() {
    for size in [(1, 1), (100, 80), (320, 1000), (1280, 720), (4096, 2304)] {
        for text_scale in [0.75, 1.0, 3.0] {
            for mut state in states() {
                state.preferences.text_scale = text_scale;
                let mut window = Window::of(state, size);
                window.wait(0.1);
            }
        }
    }
}

#[test]
fn the_panel_is_within_the_window() {
    for (size, text_scale) in [((1280, 720), 1.0), ((640, 480), 1.0), ((1280, 720), 3.0), ((4096, 2304), 2.0)] {
        let mut state = sample::state();
        state.preferences.text_scale = text_scale;
        let mut window = Window::of(state, size);
        window.wait(0.5);
        let rect = window.panel.sheet.rect().expect("the panel is shown");
        let whole = window.ctx.content_rect();
        assert!(whole.expand(1.0).contains_rect(rect), "{size:?} at {text_scale}: {rect} in {whole}");
    }
}

/// A change of the state, and the texts that must be visible then.
type Shown<'a> = (&'a dyn Fn(&mut State), &'a [&'a str]);

#[test]
fn the_largest_text_in_a_small_window_cuts_nothing_off() {
    let shown: [Shown; 3] = [
        (&|_| {}, &["Portrait", "Blur"]),
        (&|state| state.help = true, &["Keys and gestures", "Single keys", "Ask before closing", "1 – 9"]),
        (
            &|state| state.closing = true,
            &["Stop recording and close?", "Keep recording", "Stop and close", "Do not ask again"],
        ),
    ];
    for (change, texts) in shown {
        let mut state = sample::state();
        state.outputs = vec![Output { name: "clip.mp4".into(), is_camera: false }];
        state.preferences.text_scale = 3.0;
        change(&mut state);
        let mut window = Window::of(state, (500, 400));
        window.wait(0.5);
        let whole = window.ctx.content_rect();
        let panel = window.panel.sheet.rect().expect("the panel");
        assert!(whole.contains_rect(panel), "{panel} in {whole}");
        let boxes = window.boxes();
        for text in texts {
            let at = boxes.iter().find(|(shown, _)| shown == text).unwrap_or_else(|| panic!("{text}: {boxes:?}")).1;
            assert!(whole.contains_rect(at), "{text} at {at} in {whole}");
        }
        let said = window.state.notes.iter().filter(|note| note.text.contains("too small for text")).count();
        assert_eq!(said, 1, "that it is smaller than was chosen");
    }
    let mut state = sample::state();
    state.preferences.text_scale = 3.0;
    let mut window = Window::of(state, (1280, 720));
    window.wait(0.5);
    assert!(window.ctx.zoom_factor() == 3.0 && window.state.notes.is_empty());
}

#[test]
fn a_long_name_leaves_room_for_the_distance_of_focus() {
    for (label, shown) in [
        ("/home/somebody/recordings/of a day/in the garden", "in the garden, focused at 1.24 m"),
        ("Integrated Webcam, 640x480 YUYV at 30 fps", "Integrated Webcam, focused at 1.24 m"),
        ("A very long name of a camera on the desk", "A very long name of a camera on t…, focused at 1.24 m"),
    ] {
        let mut state = sample::state();
        let Source::Running(running) = &mut state.source else { unreachable!() };
        (running.label, state.source_name) = (label.into(), "not listed".into());
        let mut window = Window::of(state, (1280, 720));
        window.wait(0.3);
        assert!(window.texts().iter().any(|text| text == shown), "{shown}: {:?}", window.texts());
    }
}

#[test]
fn the_scroll_bar_covers_no_control() {
    let mut window = Window::new();
    window.wait(0.3);
    let panel = window.panel.sheet.rect().unwrap();
    // Hovering the bar makes it its widest.
    window.pass(vec![egui::Event::PointerMoved(panel.right_center() - egui::vec2(16.0, -40.0))]);
    window.wait(0.5);
    let (_, output) = window.pass_with_output(Vec::new());
    let bars = output.shapes.iter().filter_map(|clipped| match &clipped.shape {
        egui::Shape::Rect(shape) => Some(shape.rect),
        _ => None,
    });
    let is_bar = |rect: &Rect| panel.contains_rect(*rect) && rect.width() < 8.0 && rect.height() > 40.0;
    let left = bars.filter(is_bar).map(|bar| bar.left()).fold(f32::INFINITY, f32::min);
    output.drop_without_applying_deltas();
    assert!(left > panel.right() - 30.0, "no bar in {panel}");
    let mut seen = 0;
    for _ in 0..40 {
        window.press(egui::Key::Tab, egui::Modifiers::NONE);
        window.wait(0.1);
        let Some(id) = window.ctx.memory(|memory| memory.focused()) else { continue };
        let rect = window.ctx.read_response(id).unwrap().rect;
        // The buttons next to the title are above the bar.
        if rect.top() > panel.top() + 60.0 {
            assert!(rect.right() <= left, "{rect} under the bar at {left}");
            seen += 1;
        }
    }
    assert!(seen > 20, "only {seen}");
}

#[test]
fn where_a_control_is_scrolled_out_of_sight_it_gives_no_hint() {
    let mut window = Window::of(sample::state(), (1280, 500));
    window.pass(vec![egui::Event::PointerMoved(super::on_panel())]);
    window.wait(0.5);
    // The scroll area begins below the panel's margin.
    let top = window.panel.sheet.rect().unwrap().top() + crate::panel::theme::PAD;
    let scroll = |window: &mut Window, by: f32| {
        window.pass(vec![super::scrolled(egui::MouseWheelUnit::Point, by, egui::Modifiers::NONE)]);
        window.wait(0.8);
    };
    for _ in 0..100 {
        if window.place_of("Subject").is_some_and(|at| at.y < 300.0) {
            break;
        }
        scroll(&mut window, -60.0);
    }
    // Its upper third is out of sight.
    let at = window.place_of("Subject").expect("the option");
    scroll(&mut window, top + 4.0 - at.y);
    let at = window.place_of("Subject").expect("the option");
    assert!((at.y - top - 4.0).abs() < 2.0, "{at} under {top}");
    for (y, hints) in [(top + 8.0, true), (top - 5.0, false)] {
        window.pass(vec![egui::Event::PointerMoved(egui::pos2(at.x, y))]);
        window.wait(2.0);
        let is_seen = window.texts().iter().any(|text| text.starts_with("Follows a person"));
        assert_eq!(is_seen, hints, "at {y}, where it begins at {top}");
    }
}

#[test]
fn a_canvas_without_pixels_is_no_picture() {
    let mut window = Window::new();
    window.canvas = crate::panel::Canvas::default();
    assert!(window.click(egui::pos2(200.0, 200.0)).is_empty());
}
