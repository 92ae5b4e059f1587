//! The first screen: few controls, all fully visible, beside the picture or below it.

use std::collections::HashMap;

use egui::accesskit::{Action as Told, Node, NodeId};
use egui::{Key, Modifiers, Rect, Role, pos2};

use super::{Action, Window, sample};
use crate::panel::dock::{Dock, picture_area};
use crate::state::{DepthMethod, Output, Source, State};
use crate::texts;
use bokehcam::look::Effect;

/// Sizes of windows.
const WINDOWS: [(u32, u32); 7] =
    [(1280, 720), (1920, 1200), (800, 600), (640, 480), (500, 700), (480, 320), (360, 640)];

fn first() -> State {
    let mut state = sample::state();
    state.apply(Action::Section("More", false));
    state
}

/// Returns the accessible controls: roles, names, and rectangles in points.
fn controls(window: &mut Window) -> Vec<(Role, String, Rect)> {
    window.ctx.enable_accesskit();
    window.pass(Vec::new());
    let (_, output) = window.pass_with_output(Vec::new());
    let update = output.platform_output.accesskit_update.clone().expect("a tree");
    output.drop_without_applying_deltas();
    let names: HashMap<NodeId, Node> = update.nodes.iter().cloned().collect();
    let mut found = Vec::new();
    for (_, node) in &update.nodes {
        let is_control = node.supports_action(Told::Click) || node.supports_action(Told::SetValue);
        let works = [Role::Button, Role::ComboBox, Role::RadioButton, Role::Slider, Role::SpinButton, Role::Switch];
        if works.contains(&node.role()) && (is_control || node.is_disabled()) {
            let beside = node.labelled_by().iter().find_map(|id| names.get(id)?.value());
            let name = node.label().or(beside).unwrap_or_default().to_owned();
            let scale = window.ctx.pixels_per_point();
            let at = node.bounds().map_or(Rect::NOTHING, |at| {
                Rect::from_min_max(pos2(at.x0 as f32, at.y0 as f32), pos2(at.x1 as f32, at.y1 as f32)) / scale
            });
            found.push((node.role(), name, at));
        }
    }
    found
}

#[test]
fn it_has_eight_controls_at_most_with_the_blur_among_them() {
    for size in WINDOWS {
        let mut window = Window::of(first(), size);
        let found = controls(&mut window);
        assert!(found.len() <= 8, "{size:?}: {found:?}");
        for name in ["Camera", "Portrait", "Blur", "Background", "Record", "Snapshot", "Use in calls", "More"] {
            let is_it = |called: &String| called.split(": ").next() == Some(name);
            assert!(found.iter().any(|(_, called, _)| is_it(called)), "{size:?}: {name} is not in {found:?}");
        }
    }
}

#[test]
fn they_do_what_they_say() {
    let mut window = Window::of(first(), (1280, 720));
    window.click_on("Portrait");
    assert_eq!(window.state.look.effect, Effect::None);
    window.click_on("Portrait");
    assert_eq!(window.state.look.effect, Effect::Auto);
    assert_eq!(window.click_on("Record"), [Action::Record(true)]);
    assert_eq!(window.click_on("Use in calls"), [Action::VirtualCamera(Some("/dev/video9".into()))]);
    assert_eq!(window.click_on("Use in calls"), [Action::VirtualCamera(None)]);
    window.click_on("+ More");
    assert!(window.state.is_expanded() && window.place_of("Save as…").is_some());
    window.click_on("− Less");
    assert!(window.place_of("Save as…").is_none());
    let before = window.state.look.clone();
    let slider = controls(&mut window).into_iter().find(|(role, ..)| *role == Role::Slider).unwrap().2;
    window.drag(slider.center(), slider.right_center());
    let amount = |look| crate::state::tweak::coc_fraction(look, 720).unwrap();
    assert!(amount(&window.state.look) > 1.5 * amount(&before));
}

#[test]
fn without_depth_the_switch_asks_how_it_may_be_known() {
    let mut state = first();
    state.apply_update(crate::state::Update::Source(sample::running(false)));
    assert_eq!(state.look.effect, Effect::Blur, "nobody knows whom to keep sharp");
    state.depth_offer_declined = true;
    let mut window = Window::of(state, (1280, 720));
    window.click_on("Portrait");
    assert_eq!((window.state.look.effect, window.state.offers_depth_methods()), (Effect::Blur, true));
    window.wait(0.1);
    assert_eq!(window.click_on("Find me with a small network"), [Action::SetDepthMethod(DepthMethod::Person)]);
    assert_eq!(window.click_on("Show me the empty room"), [Action::CapturePlate]);
    window.press(Key::Escape, Modifiers::NONE);
    assert!(window.state.depth_offer_declined && window.state.panel, "Esc closes the question alone");
}

#[test]
fn the_panel_is_never_on_the_picture() {
    for size in WINDOWS {
        for picture in [(1280, 720), (640, 480), (720, 1280)] {
            for more in [false, true] {
                let window = Rect::from_min_size(pos2(0.0, 0.0), egui::vec2(size.0 as f32, size.1 as f32));
                let dock = Dock::new(window, picture, more);
                assert!(
                    window.contains_rect(dock.panel) && window.contains_rect(dock.picture_area),
                    "{size:?}: {dock:?}"
                );
                assert!(!dock.panel.intersects(dock.picture_area), "{size:?}: {dock:?}");
                assert!(dock.picture_area.area() > 0.3 * window.area(), "{size:?}: {dock:?}");
            }
        }
    }
    // Below in a tall window, beside in a wide one, without cost where the picture leaves room.
    let dock = |width: f32, height: f32, picture| {
        Dock::new(Rect::from_min_size(pos2(0.0, 0.0), egui::vec2(width, height)), picture, false)
    };
    assert!(dock(500.0, 700.0, (1280, 720)).picture_area.height() >= 500.0 * 9.0 / 16.0);
    assert!(dock(1280.0, 720.0, (640, 480)).picture_area.width() >= 960.0);
    assert_eq!((dock(1280.0, 720.0, (1280, 720)).columns, dock(500.0, 700.0, (1280, 720)).columns), (1, 2));
}

#[test]
fn messages_and_badges_are_in_the_pictures_room() {
    for size in WINDOWS {
        let mut state = first();
        state.outputs = vec![Output { name: "clip.mp4".into(), is_camera: false }];
        state.note("Saved ~/Pictures/bokehcam 2026-11-23 21-14-05.png");
        let mut window = Window::of(state, size);
        let area = picture_area(&window.ctx).expand(1.0);
        for (text, at) in window.boxes() {
            if text.starts_with("Saved") || text.starts_with("Recording ") {
                assert!(area.contains_rect(at), "{size:?}: {text} at {at} is not in {area}");
            }
        }
    }
}

/// Returns the built-in German translation.
fn german() -> texts::Table {
    texts::load_built_in("de").expect("German")
}

#[test]
fn german_is_whole() {
    let (english, german) = (texts::tests::english_table(), german());
    let missing: Vec<&String> = english.keys().filter(|text| german.get(*text).is_none_or(String::is_empty)).collect();
    assert!(missing.is_empty(), "not in German: {missing:#?}");
    let gone: Vec<&String> = german.keys().filter(|text| !english.contains_key(*text)).collect();
    assert!(gone.is_empty(), "German has what is nowhere: {gone:#?}");
    for (text, translated) in &german {
        assert_eq!(text.matches("{}").count(), translated.matches("{}").count(), "{text}");
    }
}

#[test]
fn in_german_nothing_is_cut_off_at_any_size() {
    texts::set_translation(german());
    for size in WINDOWS {
        for more in [false, true] {
            let mut state = first();
            state.apply(Action::Section("More", more));
            for section in ["Controls of the camera", "For experts", "Background"] {
                state.apply(Action::Section(section, true));
            }
            let Source::Running(running) = &mut state.source else { panic!("it runs") };
            running.depth_methods = vec![
                DepthMethod::Measured,
                DepthMethod::Stereo,
                DepthMethod::Person,
                DepthMethod::PersonAndMonoDepth,
                DepthMethod::Plate,
            ];
            state.look.strength = bokehcam::look::Strength::Lens(crate::state::tweak::DEFAULT_LENS);
            (state.mirror, state.split) = (true, Some(0.5));
            // As much as fits the panel's height.
            let mut window = Window::of(state, size);
            window.wait(0.5);
            let panel = window.panel.sheet.rect().expect("the panel");
            let found = controls(&mut window);
            assert!(found.len() > if more { 20 } else { 6 }, "{size:?}: {found:?}");
            for (role, name, at) in found {
                assert!(
                    panel.left() <= at.left() && at.right() <= panel.right(),
                    "{size:?}: {role:?} {name} at {at} in {panel}"
                );
            }
            let inside = |at: &Rect| panel.intersects(*at);
            for (text, at) in window.boxes().into_iter().filter(|(_, at)| inside(at)) {
                assert!(
                    at.left() >= panel.left() && at.right() <= panel.right() + 0.5,
                    "{size:?}: {text} at {at} in {panel}"
                );
            }
        }
    }
}
