//! User presets: save, replace, rename, delete; and typed numbers.

use egui::{Event, Key, Modifiers};

use super::{Action, Window, pressed};

fn done(actions: Vec<Action>) -> Vec<Action> {
    actions.into_iter().filter(|action| !matches!(action, Action::EndStroke)).collect()
}

impl Window {
    /// Clicks on the control with this text.
    #[track_caller]
    pub fn click_on(&mut self, text: &str) -> Vec<Action> {
        let at = self.place_of(text).unwrap_or_else(|| panic!("{text} is not in {:?}", self.texts()));
        let actions = self.click(at);
        self.wait(0.1);
        done(actions)
    }

    /// Replaces the text in the focused field.
    pub fn type_over(&mut self, text: &str) {
        self.pass(vec![pressed(Key::A, Modifiers::CTRL | Modifiers::COMMAND, true)]);
        self.pass(vec![Event::Text(text.into())]);
    }

    fn enter(&mut self) -> Vec<Action> {
        let mut actions = self.press(Key::Enter, Modifiers::NONE);
        actions.extend(self.wait(0.1));
        done(actions)
    }
}

#[test]
fn a_preset_of_the_same_name_is_replaced_only_by_the_button_that_says_so() {
    let mut window = Window::new();
    window.click_on("Save as…");
    window.type_over("my desk");
    window.wait(0.1);
    assert!(window.texts().iter().any(|text| text.contains("already a look of this name")));
    assert_eq!(window.enter(), []);
    assert_eq!(window.click_on("Replace"), [Action::SavePreset("my desk".into())]);
    assert!(window.place_of("Replace").is_none());
    // A built-in preset's name is rejected when saving.
    window.click_on("Save as…");
    window.type_over("mine");
    assert_eq!(window.enter(), [Action::SavePreset("mine".into())]);
}

#[test]
fn ones_own_are_renamed_and_deleted() {
    let mut window = Window::new();
    window.click_on("Edit…");
    assert_eq!(window.texts().iter().filter(|text| *text == "Delete").count(), 1, "built-in ones stay");
    window.click_on("Rename");
    window.type_over("my table");
    assert_eq!(window.enter(), [Action::RenamePreset("my desk".into(), "my table".into())]);
    window.click_on("Rename");
    assert_eq!(window.enter(), [], "the same name");
    assert_eq!(window.click_on("Delete"), []);
    assert_eq!(window.click_on("Keep it"), []);
    window.click_on("Delete");
    assert_eq!(window.click_on("Delete it"), [Action::DeletePreset("my desk".into())]);
    window.click_on("Edit…");
    assert!(window.place_of("Rename").is_none());
}

#[test]
fn escape_gives_up_what_is_asked_and_closes_nothing_else() {
    let mut window = Window::new();
    let escape = |window: &mut Window| {
        window.press(Key::Escape, Modifiers::NONE);
        window.wait(0.1);
        assert!(window.state.panel, "the panel stays");
    };
    window.click_on("Edit…");
    window.click_on("Delete");
    assert!(window.place_of("Delete it").is_some());
    escape(&mut window);
    assert!(window.place_of("Delete it").is_none() && window.place_of("Delete").is_some());
    escape(&mut window);
    assert!(window.place_of("Delete").is_none());
    window.click_on("Save as…");
    // The help is above it, and closes first.
    window.state.help = true;
    window.wait(0.2);
    escape(&mut window);
    assert!(!window.state.help && window.place_of("Cancel").is_some());
    escape(&mut window);
    assert!(window.place_of("Cancel").is_none());
    window.press(Key::Escape, Modifiers::NONE);
    assert!(!window.state.panel, "nothing is asked any more");
}

#[test]
fn a_number_that_cannot_be_is_told() {
    let mut window = Window::new();
    let said = |window: &Window| window.state.notes.iter().map(|note| note.text.clone()).collect::<Vec<_>>();
    window.click_on("0.00");
    window.type_over("70");
    window.enter();
    assert_eq!(window.state.look.focus_range_m, 2.0 * 0.5 * *crate::state::tweak::FOCUS_RANGE_LIMITS_M.end());
    assert!(
        said(&window).iter().any(|line| line.starts_with("Depth of the sharp range is limited to ±0.00 m to ±")),
        "{:?}",
        said(&window)
    );
    let before = said(&window).len();
    let shown = window.texts().into_iter().find(|text| text.starts_with('±')).expect("the number");
    window.click_on(&shown);
    window.type_over("0,4");
    window.enter();
    assert_eq!((window.state.look.focus_range_m, said(&window).len()), (0.8, before));
}
