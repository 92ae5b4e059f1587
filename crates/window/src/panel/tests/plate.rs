//! Cards about the source: the background plate, and the demonstration notice.

use super::super::super::state::{DepthMethod, Source, State, sample};
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
    let unlike = texts(&|state| state.plate = Some(Step::Mismatched));
    assert!(unlike.contains("Take another plate"), "{unlike}");
    assert!(!texts(&|state| state.plate = Some(Step::Ready)).contains("Step out"));
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
    window.click_on("OK");
    assert!(!says(&mut window));
}
