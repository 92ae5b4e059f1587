//! The panel by keyboard alone, and automatic hiding.

use std::collections::HashSet;

use egui::{Event, Key, Modifiers, pos2};

use super::{Action, Window, on_panel, pressed};
use crate::keys::GROUPS;
use crate::state::{Output, Source, Transport};
use bokehcam::depth::backdrop::Background;
use bokehcam::depth::focus::FocusRule;
use bokehcam::look::Strength;
use bokehcam::optics::Lens;

#[test]
fn every_key_reaches_the_window() {
    for (group, binding) in GROUPS.iter().flat_map(|group| group.bindings.iter().map(move |b| (group.name, b))) {
        let mut window = Window::new();
        // Something to undo, to redo and to reset.
        window.state.look.focus_range_m = 0.5;
        window.state.look.focus = FocusRule::Metres(2.0);
        // A recording, to seek in.
        window.state.transport = Some(Transport { frames: 9, ..Transport::default() });
        for chord in binding.chords.iter().take(6) {
            let mut modifiers = if chord.ctrl { Modifiers::CTRL | Modifiers::COMMAND } else { Modifiers::NONE };
            modifiers.shift = chord.shift;
            let actions = window.press(chord.key, modifiers);
            let done = actions.iter().any(|action| *action != Action::EndStroke);
            // The panel's own key is pressed twice, so Esc then has nothing to close.
            assert!(done || chord.key == Key::Escape, "{group}: {} gave {actions:?}", binding.keys);
        }
    }
}

/// Returns the number of Tab stops, by pressing Tab until the focus repeats.
fn stops(window: &mut Window) -> usize {
    let mut seen = HashSet::new();
    for _ in 0..400 {
        window.press(Key::Tab, Modifiers::NONE);
        let focused = window.ctx.memory(|memory| memory.focused());
        if let Some(id) = focused
            && !seen.insert(id)
        {
            break;
        }
    }
    seen.len()
}

#[test]
fn tab_reaches_the_controls() {
    let mut window = Window::new();
    let all = stops(&mut window);
    assert!(all > 40, "only {all}");
    // Without frames there is one more button, and more presets are Tab stops.
    window.state.source = Source::Lost("gone".into());
    assert!(stops(&mut window) > all);
}

#[test]
fn a_control_in_focus_is_worked_by_the_keyboard() {
    let mut window = Window::new();
    let mut done: Vec<Action> = Vec::new();
    for _ in 0..90 {
        window.press(Key::Tab, Modifiers::NONE);
        let focused = window.ctx.memory(|memory| memory.focused());
        done.extend(window.press(Key::ArrowRight, Modifiers::NONE));
        // Controls without use for an arrow key move the focus: restore it.
        focused.into_iter().for_each(|id| window.ctx.memory_mut(|memory| memory.request_focus(id)));
        // Cancelling a dialog would remove the focused field.
        if window.place_of("Cancel").is_some() {
            continue;
        }
        let before = window.state.clone();
        done.extend(window.press(Key::Space, Modifiers::NONE));
        // Restores whatever closes or folds the panel, or can be undone.
        let state = &mut window.state;
        (state.panel, state.help, state.preferences) = (before.panel, before.help, before.preferences);
        (state.history, state.look) = (before.history, before.look);
        window.pass(Vec::new());
        // Closing the panel removed the focus: restore it.
        if window.ctx.memory(|memory| memory.focused().is_none()) {
            focused.into_iter().for_each(|id| window.ctx.memory_mut(|memory| memory.request_focus(id)));
        }
    }
    assert!(done.iter().any(|action| matches!(action, Action::Preset(_))), "{done:?}");
    assert!(done.iter().any(|action| matches!(action, Action::Look { .. })), "{done:?}");
}

impl Window {
    /// Presses Tab until the focus is on the control with this text.
    fn tab_to(&mut self, text: &str) {
        let has_it = |_: &usize| {
            self.press(Key::Tab, Modifiers::NONE);
            self.wait(0.3);
            let focused = self.ctx.memory(|memory| memory.focused()).and_then(|id| self.ctx.read_response(id));
            focused.zip(self.place_of(text)).is_some_and(|(response, at)| response.rect.contains(at))
        };
        (0..90).find(has_it).unwrap_or_else(|| panic!("no way to {text}"));
    }
}

#[test]
fn relative_depth_is_focused_at_a_place_from_0_to_1() {
    let mut state = crate::state::sample::state();
    (state.camera.metres, state.focus_m) = (bokehcam::look::Metres::Missing, Some(4.0));
    let mut window = Window::of(state, (1280, 720));
    window.tab_to("Subject");
    for _ in 0..2 {
        window.press(Key::ArrowRight, Modifiers::NONE);
        window.wait(0.2);
    }
    assert_eq!(window.state.look.focus, FocusRule::Relative(0.75), "where it was, at four times the nearest distance");
    // Over the number to its slider.
    for key in [Key::Tab, Key::Tab, Key::ArrowLeft] {
        window.press(key, Modifiers::NONE);
        window.wait(0.2);
    }
    let FocusRule::Relative(place) = window.state.look.focus else { panic!("{:?}", window.state.look.focus) };
    assert!((0.5..0.75).contains(&place), "the slider moves it nearer: {place}");
}

#[test]
fn arrows_choose_among_options_as_in_any_group() {
    let mut window = Window::new();
    window.tab_to("Subject");
    let right = |window: &mut Window| {
        window.press(Key::ArrowRight, Modifiers::NONE);
        window.wait(0.2);
        window.state.look.focus
    };
    assert!(matches!(right(&mut window), FocusRule::Point { .. }));
    assert!(matches!(right(&mut window), FocusRule::Metres(_)));
    let last = window.ctx.memory(|memory| memory.focused());
    assert!(matches!(right(&mut window), FocusRule::Metres(_)));
    assert_eq!(window.ctx.memory(|memory| memory.focused()), last, "at the end it stays");
    window.press(Key::ArrowLeft, Modifiers::NONE);
    assert!(matches!(window.state.look.focus, FocusRule::Point { .. }));
    // Presets and apertures are radio groups as well.
    window.tab_to("Cinematic");
    assert_eq!(window.press(Key::ArrowRight, Modifiers::NONE), [Action::Preset("dreamy".into())]);
    assert_eq!(window.press(Key::ArrowRight, Modifiers::NONE), [Action::Preset("product".into())]);
}

#[test]
fn arrows_in_a_list_that_a_click_opened_belong_to_the_list() {
    let mut window = Window::new();
    let list = window.places().into_iter().find(|(text, _)| text.starts_with("Background: ")).unwrap().1;
    window.click(list);
    window.wait(0.2);
    assert!(egui::Popup::is_any_open(&window.ctx));
    let is_on_colour = |window: &mut Window| {
        let focused = window.ctx.memory(|memory| memory.focused()).and_then(|id| window.ctx.read_response(id));
        focused.zip(window.place_of("Colour")).is_some_and(|(response, at)| response.rect.contains(at))
    };
    for _ in 0..4 {
        if !is_on_colour(&mut window) {
            window.press(Key::ArrowDown, Modifiers::NONE);
            window.wait(0.1);
        }
    }
    assert!(is_on_colour(&mut window));
    assert_eq!(window.state.look.focus, FocusRule::Auto, "the point of focus stays");
    window.press(Key::Enter, Modifiers::NONE);
    window.wait(0.2);
    assert!(!matches!(window.state.look.background, Background::Blur) && window.state.look.focus == FocusRule::Auto);
    assert!(!egui::Popup::is_any_open(&window.ctx), "it is closed by its choice");
    window.ctx.memory_mut(|memory| memory.stop_text_input());
    window.press(Key::ArrowDown, Modifiers::NONE);
    assert!(matches!(window.state.look.focus, FocusRule::Point { .. }), "then they are the picture's again");
}

#[test]
fn tab_alone_changes_nothing() {
    let mut window = Window::new();
    window.state.focus_m = Some(1.2345);
    // Values that are displayed rounded.
    let look = &mut window.state.look;
    (look.strength, look.focus_range_m) = (Strength::Percent(2.2468), 0.1234);
    (look.aperture.intensity, look.rim, look.highlights) = (0.1234, 0.1234, 3.4567);
    look.max_coc_px = Some(33.33);
    let before = look.clone();
    let mut focused = HashSet::new();
    for _ in 0..2 * stops(&mut window) {
        window.press(Key::Tab, Modifiers::NONE);
        window.wait(0.1);
        focused.extend(window.ctx.memory(|memory| memory.focused()));
        assert_eq!(window.state.look, before);
    }
    assert!(focused.len() > 40);
    window.state.look.strength =
        Strength::Lens(Lens { f_number: 2.3456, focal_length_mm: 35.6, sensor_width_mm: 23.456 });
    let before = window.state.look.clone();
    for _ in 0..60 {
        window.press(Key::Tab, Modifiers::NONE);
        assert_eq!(window.state.look, before);
    }
}

#[test]
fn a_name_is_typed_whatever_way_it_is_asked_for_and_presses_no_keys() {
    for by_keyboard in [false, true] {
        let mut window = Window::new();
        if by_keyboard {
            let is_asked = |_: &usize| {
                window.press(Key::Tab, Modifiers::NONE);
                let focused = window.ctx.memory(|memory| memory.focused());
                window.press(Key::Enter, Modifiers::NONE);
                (window.state.panel, window.state.help) = (true, false);
                window.state.apply(Action::Section("More", true));
                window.wait(0.1);
                // Closing the panel removed the focus: restore it.
                if window.ctx.memory(|memory| memory.focused().is_none()) {
                    focused.into_iter().for_each(|id| window.ctx.memory_mut(|memory| memory.request_focus(id)));
                }
                window.ctx.text_edit_focused()
            };
            (0..60).find(is_asked).expect("a field to type a name in");
        } else {
            window.click_on("Save as…");
        }
        let mut actions = Vec::new();
        for (key, letter) in [(Key::Q, "q"), (Key::U, "u"), (Key::I, "i"), (Key::E, "e"), (Key::T, "t")] {
            actions.extend(window.pass(vec![pressed(key, Modifiers::NONE, true), Event::Text(letter.into())]));
        }
        actions.extend(window.press(Key::Enter, Modifiers::NONE));
        actions.extend(window.wait(0.2));
        let done: Vec<&Action> = actions.iter().filter(|action| **action != Action::EndStroke).collect();
        assert_eq!(done, [&Action::SavePreset("quiet".into())]);
    }
}

#[test]
fn what_is_written_is_always_seen_with_its_time() {
    let mut window = Window::new();
    window.state.outputs = vec![Output { name: "clip.mp4".into(), is_camera: false }];
    window.pass(Vec::new());
    for bare in [false, true] {
        window.state.controls_hidden = bare;
        for _ in 0..2 {
            window.wait(30.5);
            assert!(window.texts().iter().any(|text| text.starts_with("Recording ")), "{:?}", window.texts());
            window.pass(vec![Event::PointerMoved(pos2(300.0, 300.0))]);
        }
    }
    assert!(window.texts().contains(&"Recording 2:02".to_owned()), "{:?}", window.texts());
    (window.state.controls_hidden, window.state.panel) = (false, true);
    window.pass(vec![Event::PointerMoved(pos2(310.0, 300.0))]);
    window.wait(0.5);
    let (panel, badge) = (window.panel.sheet.rect().unwrap(), window.place_of("Recording 2:02").unwrap());
    assert!(badge.x < panel.left() && badge.y > 0.0, "{badge} is under {panel}");
    window.state.outputs.clear();
    window.wait(0.1);
    assert!(!window.texts().iter().any(|text| text.starts_with("Recording ")));
}

#[test]
fn the_panel_scrolls_to_what_has_the_focus() {
    let mut window = Window::new();
    let mut scrolled = 0;
    for _ in 0..60 {
        window.press(Key::Tab, Modifiers::NONE);
        window.wait(1.0);
        let Some(id) = window.ctx.memory(|memory| memory.focused()) else { continue };
        let response = window.ctx.read_response(id).unwrap();
        let panel = window.panel.sheet.rect().unwrap();
        assert!(panel.contains_rect(response.rect), "{} is not in {panel}", response.rect);
        scrolled += usize::from(response.rect.bottom() > panel.bottom() - 60.0);
    }
    assert!(scrolled > 0, "nothing was ever at the end of the panel");
}

/// Whether the panel is visible: whether a click in its place hits a layer above the picture.
fn is_seen(window: &Window) -> bool {
    window.ctx.layer_id_at(on_panel()).is_some_and(|layer| layer.order != egui::Order::Background)
}

#[test]
fn in_full_screen_the_panel_hides_itself_and_comes_back() {
    let mut window = Window::new();
    window.wait(20.0);
    assert!(is_seen(&window), "in a window it stands beside the picture");
    window.state.full_screen = true;
    window.pass(vec![Event::PointerMoved(pos2(300.0, 300.0))]);
    assert!(is_seen(&window));
    window.wait(5.0);
    assert!(!is_seen(&window), "nobody is there");
    window.pass(vec![Event::PointerMoved(pos2(310.0, 300.0))]);
    window.wait(0.5);
    assert!(is_seen(&window), "the pointer moved");
    window.wait(5.0);
    window.press(Key::I, Modifiers::NONE);
    window.wait(0.5);
    assert!(is_seen(&window), "a key was pressed");
    // While the pointer is over it, it stays.
    window.pass(vec![Event::PointerMoved(on_panel())]);
    window.wait(20.0);
    assert!(is_seen(&window));
    window.pass(vec![Event::PointerMoved(pos2(300.0, 300.0))]);
    window.wait(5.0);
    assert!(!is_seen(&window));
    // While one of its controls has the focus, it stays as well.
    window.press(Key::Tab, Modifiers::NONE);
    window.wait(20.0);
    assert!(is_seen(&window));
    let mut window = Window::new();
    (window.panel.is_always_visible, window.state.full_screen) = (true, true);
    window.wait(20.0);
    assert!(is_seen(&window), "a screen reader looks for it");
}

#[test]
fn the_panel_is_closed_and_everything_hidden_by_keys() {
    let mut window = Window::new();
    window.press(Key::P, Modifiers::NONE);
    window.wait(0.5);
    assert!(!window.state.panel && !is_seen(&window));
    window.press(Key::P, Modifiers::NONE);
    window.wait(0.5);
    assert!(is_seen(&window));
    window.press(Key::H, Modifiers::NONE);
    window.wait(0.5);
    assert!(!is_seen(&window));
}
