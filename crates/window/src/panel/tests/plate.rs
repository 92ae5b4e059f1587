//! Cards about the source: the background plate, and the demonstration notice.

use egui::{Key, Modifiers};

use super::super::super::state::{Action, DepthMethod, DroppedFile, Request, Source, State, sample};
use super::Window;
use bokehcam::depth::plate::Step;

#[test]
fn a_lone_camera_is_offered_a_plate_and_what_to_do_for_it_is_shown() {
    let mut window = Window::new();
    let mut texts = |change: &dyn Fn(&mut State)| {
        change(&mut window.state);
        window.pass(Vec::new());
        window.texts().join("\n")
    };
    assert!(!texts(&|_| {}).contains("Show me the empty room"));
    let offer = texts(&|state| state.source = sample::running(false));
    for button in ["Find me with a small network", "Show me the empty room", "Not now"] {
        assert!(offer.contains(button), "{button}: {offer}");
    }
    let declined = |state: &mut State| {
        let Source::Running(running) = &mut state.source else { panic!("it runs") };
        running.depth_methods.push(DepthMethod::Measured);
    };
    assert!(!texts(&declined).contains("Not now"), "it has depth, which was declined");
    texts(&|state| state.source = sample::running(false));
    assert!(!texts(&|state| state.depth_offer_declined = true).contains("Not now"));
    let out = texts(&|state| state.plate = Some(Step::StepOut(2)));
    assert!(out.contains("Step out of the picture") && out.contains('2'), "{out}");
    let there = texts(&|state| state.plate = Some(Step::PersonThere));
    assert!(there.contains("Somebody seems to be there") && !there.contains("Something moves"), "{there}");
    let unlike = texts(&|state| state.plate = Some(Step::Mismatched));
    assert!(unlike.contains("Take another plate"), "{unlike}");
    assert!(!texts(&|state| state.plate = Some(Step::Ready)).contains("Step out"));
}

#[test]
fn a_plate_is_taken_though_somebody_seems_to_be_there() {
    let mut state = sample::state();
    (state.source, state.plate) = (sample::running(false), Some(Step::PersonThere));
    let mut window = Window::of(state, (1280, 720));
    assert_eq!(window.click_on("Take it anyway"), [Action::CapturePlateAnyway]);
    assert_eq!(window.state.apply(Action::CapturePlateAnyway), [Request::CapturePlateAnyway]);
}

#[test]
fn what_installs_the_network_stays_to_be_read() {
    let mut state = sample::state();
    state.source = sample::running(false);
    let mut window = Window::of(state, (1280, 720));
    window.wait(60.0);
    let says = |window: &mut Window| window.texts().iter().any(|text| text.contains("bokehcam models get"));
    assert!(says(&mut window));
    let Source::Running(running) = &mut window.state.source else { panic!("it runs") };
    running.depth_methods.push(DepthMethod::Person);
    assert!(!says(&mut window), "it is there");
}

#[test]
fn a_dropped_file_is_asked_about_and_esc_forgets_it() {
    let mut window = Window::new();
    let drop = |window: &mut Window| {
        window.state.dropped = Some(DroppedFile { name: "/tmp/pictures/wall.png".into(), is_asked: true });
        window.wait(0.1);
    };
    drop(&mut window);
    assert!(window.place_of("What is wall.png for?").is_some());
    assert_eq!(window.click_on("Cancel"), [Action::DismissDropped]);
    assert!(window.place_of("What is wall.png for?").is_none());
    drop(&mut window);
    window.press(Key::Escape, Modifiers::NONE);
    assert!(window.state.dropped.is_none() && window.state.panel);
    drop(&mut window);
    assert_eq!(window.click_on("Open instead"), [Action::OpenDropped]);
    assert_eq!(window.state.chosen_source.as_deref(), Some("/tmp/pictures/wall.png"));
}

#[test]
fn that_it_is_a_demonstration_is_said_until_it_is_known() {
    let mut window = Window::new();
    let says = |window: &mut Window| window.texts().iter().any(|text| text.contains("bokehcam doctor"));
    assert!(!says(&mut window));
    let Source::Running(running) = &mut window.state.source else { panic!("it runs") };
    running.name = "demo".into();
    window.wait(60.0);
    assert!(says(&mut window));
    window.state.controls_hidden = true;
    window.pass(Vec::new());
    assert!(!says(&mut window), "only the picture");
    window.state.controls_hidden = false;
    window.wait(0.1);
    let look = window.state.look.clone();
    window.click_on("This is a demonstration");
    assert!(window.state.look == look, "a click on the card is none on the picture");
    assert!(window.texts().iter().any(|text| text.contains("“Camera”")), "the list that has this label");
    window.state.camera.is_fallback = true;
    assert!(window.texts().iter().any(|text| text.contains("is used at once")));
    window.click_on("OK");
    assert!(!says(&mut window));
}
