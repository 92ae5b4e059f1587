//! The plate: offered where it is the way to a portrait, and what to do while it is taken.

use super::super::super::state::{State, sample};
use super::Window;
use crate::depth::plate::Step;

#[test]
fn a_lone_camera_is_offered_a_plate_and_what_to_do_for_it_is_shown() {
    let mut window = Window::new();
    let mut texts = |change: &dyn Fn(&mut State)| {
        change(&mut window.state);
        window.pass(Vec::new());
        window.texts().join("\n")
    };
    assert!(!texts(&|_| {}).contains("Take a plate"));
    let offer = texts(&|state| state.source = sample::running(false));
    assert!(offer.contains("A portrait from this camera alone") && offer.contains("Not now"), "{offer}");
    assert!(!texts(&|state| state.declined_plate = true).contains("Not now"));
    let out = texts(&|state| state.plate = Some(Step::StepOut(2)));
    assert!(out.contains("Step out of the picture") && out.contains('2'), "{out}");
    let unlike = texts(&|state| state.plate = Some(Step::Unlike));
    assert!(unlike.contains("Take another plate"), "{unlike}");
    assert!(!texts(&|state| state.plate = Some(Step::Ready)).contains("Step out"));
}
