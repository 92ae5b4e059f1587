//! The panel's sections: their order and folding, reopening the panel, and a single focus ring.

use std::sync::Arc;

use egui::{Key, Modifiers, pos2};

use super::{Action, Window, sample};
use crate::services::PathKind;
use crate::state::{Request, Source, State, Update, ViewMode};
use bokehcam::depth::backdrop::{Background, BackgroundPicture};
use bokehcam::frame::ColorImage;

#[test]
fn what_is_needed_first_is_on_top_and_experts_parts_are_folded() {
    let mut window = Window::of(sample::state(), (1280, 2000));
    window.pass(vec![egui::Event::PointerMoved(super::on_panel())]);
    let y = |window: &mut Window, text: &str| window.place_of(text).map(|at| at.y);
    let [blur, save, focus, source, record] = ["Use in calls", "Save as…", "Focus", "Source", "Record and call"]
        .map(|text| y(&mut window, text).expect(text));
    assert!(blur < save && save < focus && focus < source && source < record);
    for inner in ["Quality", "cpu, 2 threads, AVX2"] {
        assert!(window.place_of(inner).is_none(), "{inner}");
    }
    window.state.apply(Action::Section("For experts", true));
    for folded in ["Source", "Record and call", "Focus", "Blur", "Aperture", "View"] {
        window.state.apply(Action::Section(folded, false));
    }
    window.wait(0.5);
    for inner in ["Quality", "cpu, 2 threads, AVX2"] {
        assert!(window.place_of(inner).is_some(), "{inner}");
    }
    assert_eq!(window.click_on("View"), [Action::Section("View", true)]);
    window.wait(0.5);
    assert_eq!(window.click_on("Depth"), [Action::Show(ViewMode::Depth)]);
    assert_eq!(window.click_on("Depth"), [Action::Show(ViewMode::Picture)]);
    assert!(window.place_of("Mirror").is_some());
}

#[test]
fn what_is_behind_is_a_colour_or_a_picture_that_is_asked_for() {
    let mut window = Window::of(sample::state(), (1280, 2000));
    window.state.apply(Action::Section("Background", true));
    window.wait(0.5);
    let choose = |window: &mut Window, kind: &str| {
        let list = window.places().into_iter().find(|(text, _)| text.starts_with("Background: ")).unwrap().1;
        window.click(list);
        window.wait(0.2);
        // The popup is above everything else, and is drawn last.
        let at = window.places().into_iter().rev().find(|(text, _)| text == kind).unwrap().1;
        let done = window.click(at);
        window.wait(0.2);
        done
    };
    assert_eq!(choose(&mut window, "Picture or video"), [Action::Browse(PathKind::Background)]);
    assert_eq!(window.state.look, sample::look(), "nothing changes until there is one");
    choose(&mut window, "Colour");
    assert!(matches!(window.state.look.background, Background::Color(_)));
    let wall = Background::Picture(Arc::new(BackgroundPicture {
        file: Some("wall.jpg".into()),
        image: ColorImage::new(2, 2),
    }));
    let request = window.state.apply_update(Update::Background(wall.clone()));
    assert!(matches!(request, Some(Request::Look(look)) if look.background == wall));
    window.wait(0.1);
    assert!(window.place_of("wall.jpg").is_some());
    assert_eq!(window.click_on("Choose file…"), [Action::Browse(PathKind::Background)]);
    window.state.apply(Action::Undo);
    assert!(matches!(window.state.look.background, Background::Color(_)), "as every other change");
}

#[test]
fn auto_framing_is_with_the_view() {
    let mut window = Window::of(sample::state(), (1280, 2000));
    window.state.apply(Action::Section("Background", true));
    window.wait(0.5);
    let [background, view, follow] =
        ["Background", "View", "Follow the subject"].map(|text| window.place_of(text).expect(text).y);
    assert!(background < view && view < follow);
    window.click_on("Follow the subject");
    assert!(window.state.look.follow.zoom().is_some());
}

#[test]
fn a_button_brings_the_panel_back() {
    let mut window = Window::new();
    window.press(Key::P, Modifiers::NONE);
    window.pass(vec![egui::Event::PointerMoved(pos2(300.0, 300.0))]);
    window.wait(0.5);
    assert!(!window.state.panel);
    window.click(pos2(1280.0 - 29.0, 29.0));
    assert!(window.state.panel);
}

#[test]
fn its_first_seconds_count_from_the_first_picture() {
    let mut state = State::new(sample::look(), "slow".into());
    state.source = Source::Opening;
    state.full_screen = true;
    let mut window = Window::of(state, (1280, 720));
    let canvas = std::mem::take(&mut window.canvas.area);
    window.wait(20.0);
    assert!(window.place_of("Use in calls").is_some());
    window.canvas.area = canvas;
    window.state.source = sample::running(true);
    window.wait(3.5);
    assert!(window.place_of("Use in calls").is_some());
    window.wait(1.5);
    assert!(window.place_of("Use in calls").is_none());
}

/// Counts the rectangles drawn with the ring's stroke.
fn rings(window: &mut Window) -> usize {
    let (_, output) = window.pass_with_output(Vec::new());
    let color = super::super::theme::Colors::for_theme(window.ctx.theme()).text;
    let is_ring =
        |shape: &egui::Shape| matches!(shape, egui::Shape::Rect(rect) if rect.stroke == egui::Stroke::new(2.0, color));
    let count = output.shapes.iter().filter(|clipped| is_ring(&clipped.shape)).count();
    output.drop_without_applying_deltas();
    count
}

#[test]
fn whatever_has_the_focus_has_one_and_the_same_ring() {
    let mut window = Window::new();
    window.state.apply(Action::Section("For experts", true));
    assert_eq!(rings(&mut window), 0);
    for stop in 0..60 {
        window.press(Key::Tab, Modifiers::NONE);
        window.wait(0.3);
        assert_eq!(rings(&mut window), 1, "stop {stop}");
    }
}
