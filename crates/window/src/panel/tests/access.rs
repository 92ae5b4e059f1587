//! Accessibility: the names and states that a screen reader gets.

use egui::Role;
use egui::accesskit::{Node, NodeId, Toggled};

use super::super::super::state::State;
use super::{Window, sample};
use bokehcam::look::{Effect, Strength};

/// The accessibility tree of a window.
struct Tree(Vec<(NodeId, Node)>);

impl Tree {
    fn of(state: State) -> Self {
        let mut window = Window::of(state, (1280, 4000));
        for folded in ["For experts", "Controls of the camera", "Save as…"] {
            if let Some(at) = window.place_of(folded) {
                window.click(at);
                window.wait(0.4);
            }
        }
        window.ctx.enable_accesskit();
        window.pass(Vec::new());
        let (_, output) = window.pass_with_output(Vec::new());
        let update = output.platform_output.accesskit_update.clone().expect("a tree");
        output.drop_without_applying_deltas();
        Self(update.nodes)
    }

    /// Returns a control's accessible name, from its own label or a label widget.
    fn name(&self, node: &Node) -> Option<String> {
        let own = node.label().map(str::to_owned);
        let beside = node.labelled_by().iter().find_map(|id| {
            let (_, label) = self.0.iter().find(|(other, _)| other == id)?;
            label.label().or(label.value()).map(str::to_owned)
        });
        own.or(beside).filter(|name| !name.trim().is_empty())
    }

    fn find(&self, role: Role, name: &str) -> &Node {
        let is = |node: &&Node| node.role() == role && self.name(node).as_deref() == Some(name);
        self.0.iter().map(|(_, node)| node).find(is).unwrap_or_else(|| panic!("no {role:?} {name:?}"))
    }
}

#[test]
fn every_control_has_a_name() {
    let mut lens = sample::state();
    lens.look.strength = Strength::Lens(crate::state::tweak::DEFAULT_LENS);
    let mut tilt = sample::state();
    (tilt.look.effect, tilt.source) = (Effect::TiltShift, sample::running(false));
    for state in [sample::state(), lens, tilt] {
        let tree = Tree::of(state);
        let controls = [
            Role::Button,
            Role::CheckBox,
            Role::ComboBox,
            Role::RadioButton,
            Role::Slider,
            Role::SpinButton,
            Role::Switch,
            Role::TextInput,
        ];
        let mut counted = 0;
        for (_, node) in tree.0.iter().filter(|(_, node)| controls.contains(&node.role())) {
            assert!(tree.name(node).is_some(), "without a name: {node:?}");
            counted += 1;
        }
        tree.find(Role::TextInput, "Name of the preset");
        let quality = tree.find(Role::ComboBox, "Quality: Auto: as the time allows");
        assert_eq!(quality.value(), Some("Auto: as the time allows"));
        for list in ["Camera: Recording: portrait", "Auto exposure: Aperture Priority Mode", "Camera for calls: Off"] {
            tree.find(Role::ComboBox, list);
        }
        assert!(counted > 40, "only {counted}");
    }
}

#[test]
fn values_and_states_are_told() {
    let mut state = sample::state();
    (state.look.rim, state.mirror) = (0.25, true);
    let tree = Tree::of(state);
    let rim = tree.find(Role::Slider, "Soft edge");
    assert!((rim.numeric_value().unwrap() - 0.25).abs() < 1e-6);
    assert_eq!((rim.min_numeric_value(), rim.max_numeric_value()), (Some(0.0), Some(1.0)));
    assert_eq!(tree.find(Role::Switch, "Mirror").toggled(), Some(Toggled::True));
    assert_eq!(tree.find(Role::Switch, "Freeze").toggled(), Some(Toggled::False));
    assert_eq!(tree.find(Role::RadioButton, "Disc").toggled(), Some(Toggled::True));
    assert_eq!(tree.find(Role::RadioButton, "Heart").toggled(), Some(Toggled::False));
    assert!(tree.find(Role::Button, "Redo (Ctrl+Shift+Z)").is_disabled(), "nothing to redo");
    assert!(!tree.find(Role::Button, "Record").is_disabled());
    let (open, folded) =
        (tree.find(Role::DisclosureTriangle, "Focus"), tree.find(Role::DisclosureTriangle, "Background"));
    assert_eq!((open.is_expanded(), open.toggled()), (Some(true), Some(Toggled::True)));
    assert_eq!((folded.is_expanded(), folded.toggled()), (Some(false), Some(Toggled::False)));
    assert!(tree.0.iter().any(|(_, node)| node.role() == Role::Window && node.label() == Some("bokehcam")), "a name");
}
