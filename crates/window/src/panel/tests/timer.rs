//! The self-timer, and the folder of saved files.

use egui::{Key, Modifiers};

use super::{Action, Window};

fn snapshots(actions: &[Action]) -> usize {
    actions.iter().filter(|action| **action == Action::Snapshot).count()
}

#[test]
fn the_self_timer_counts_to_one_snapshot_and_is_called_off_by_escape() {
    let mut window = Window::new();
    window.press(Key::S, Modifiers::SHIFT);
    for seconds in ["3", "2", "1"] {
        assert!(window.texts().iter().any(|text| text == seconds), "{seconds} in {:?}", window.texts());
        assert_eq!(snapshots(&window.wait(0.95)), 0);
    }
    assert_eq!(snapshots(&window.wait(1.0)), 1);
    assert!(!window.state.self_timer);
    assert_eq!(snapshots(&window.wait(5.0)), 0);

    window.press(Key::S, Modifiers::SHIFT);
    window.wait(1.0);
    window.press(Key::Escape, Modifiers::NONE);
    assert_eq!(snapshots(&window.wait(5.0)), 0);
    assert!(window.state.panel, "nothing else was closed");
}

#[test]
fn a_look_that_takes_a_while_is_said_to_be_worked_on() {
    let mut window = Window::new();
    let says = |window: &mut Window| window.texts().iter().any(|text| text == "Working…");
    window.state.is_transitional = true;
    assert!(!says(&mut window), "hardly anybody would see it");
    window.wait(0.1);
    assert!(says(&mut window));
    window.state.is_transitional = false;
    assert!(!says(&mut window));
}

#[test]
fn the_folder_is_offered_once_something_is_in_it() {
    let mut window = Window::of(super::sample::state(), (1280, 3000));
    window.pass(vec![egui::Event::PointerMoved(super::on_panel())]);
    assert!(window.texts().contains(&"Timer".to_owned()) && !window.texts().contains(&"Open folder".to_owned()));
    let folder = std::path::PathBuf::from("/home/me/Bilder");
    window.state.apply_update(crate::state::Update::SavedIn(folder.clone()));
    window.wait(0.2);
    assert!(window.texts().contains(&"Open folder".to_owned()), "{:?}", window.texts());
    let requests = window.state.apply(Action::OpenFolder);
    assert_eq!(requests, [crate::state::Request::OpenFolder(folder)]);
}
