//! Panel tests without a display: input events in, actions and shapes out.

mod access;
mod covers;
mod first;
mod fonts;
mod gestures;
mod keyboard;
mod looks;
mod plate;
mod presets;
mod sections;
mod sizes;
mod texts;
mod timer;
mod touch;
mod transport;
mod zoom;

use egui::pos2;
use egui::{Event, FullOutput, Key, Modifiers, MouseWheelUnit, PointerButton, Pos2, RawInput, Rect, TouchPhase, Vec2};

use super::super::state::{Action, State, sample};
use super::{Canvas, Panel};
use crate::present::Area;
use bokehcam::depth::focus::FocusRule;
use bokehcam::look::Look;

/// A headless window that runs the controls alone.
struct Window {
    ctx: egui::Context,
    panel: Panel,
    state: State,
    canvas: Canvas,
    size: Vec2,
    native: f32,
    time_s: f64,
}

impl Window {
    /// Creates a window of 1280 x 720 pixels that the picture fills.
    fn new() -> Self {
        Self::of(sample::state(), (1280, 720))
    }

    fn of(state: State, size: (u32, u32)) -> Self {
        let mut window = Self::unseen(state, size);
        // Fonts and layout are stable from the second pass on.
        for _ in 0..4 {
            window.pass(Vec::new());
        }
        window
    }

    /// Creates a window before its first pass.
    fn unseen(state: State, (width, height): (u32, u32)) -> Self {
        let area = Area { x: 0, y: 0, width, height };
        Self {
            ctx: egui::Context::default(),
            panel: Panel::default(),
            state,
            canvas: Canvas { area, size: (1280, 720), visible_region: None },
            size: Vec2::new(width as f32, height as f32),
            native: 1.0,
            time_s: 0.0,
        }
    }

    /// Runs one pass of egui and applies the resulting actions, like the window.
    fn pass_with_output(&mut self, events: Vec<Event>) -> (Vec<Action>, FullOutput) {
        self.time_s += 1.0 / 60.0;
        let mut input = RawInput {
            time: Some(self.time_s),
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, self.size / (self.native * self.ctx.zoom_factor()))),
            events,
            focused: true,
            ..RawInput::default()
        };
        input.viewports.entry(egui::ViewportId::ROOT).or_default().native_pixels_per_point = Some(self.native);
        let mut actions = Vec::new();
        let Self { ctx, panel, state, canvas, .. } = self;
        let output = ctx.run_ui(input, |ui| panel.show(ui, state, *canvas, &mut actions));
        for action in actions.clone() {
            self.state.apply(action);
        }
        (actions, output)
    }

    fn pass(&mut self, events: Vec<Event>) -> Vec<Action> {
        let (actions, output) = self.pass_with_output(events);
        output.drop_without_applying_deltas();
        actions
    }

    /// Runs passes for `seconds` without any input.
    fn wait(&mut self, seconds: f64) -> Vec<Action> {
        let end_s = self.time_s + seconds;
        let mut actions = Vec::new();
        while self.time_s < end_s {
            actions.extend(self.pass(Vec::new()));
        }
        actions
    }

    /// Returns all texts drawn, with their rectangles.
    fn boxes(&mut self) -> Vec<(String, Rect)> {
        fn add(shape: &egui::Shape, to: &mut Vec<(String, Rect)>) {
            match shape {
                egui::Shape::Text(text) => to.push((text.galley.text().to_owned(), text.visual_bounding_rect())),
                egui::Shape::Vec(shapes) => shapes.iter().for_each(|shape| add(shape, to)),
                _ => {}
            }
        }
        let (_, output) = self.pass_with_output(Vec::new());
        let mut texts = Vec::new();
        output.shapes.iter().for_each(|clipped| add(&clipped.shape, &mut texts));
        output.drop_without_applying_deltas();
        texts
    }

    /// Returns all texts drawn, with their centres.
    fn places(&mut self) -> Vec<(String, Pos2)> {
        self.boxes().into_iter().map(|(text, at)| (text, at.center())).collect()
    }

    fn texts(&mut self) -> Vec<String> {
        self.places().into_iter().map(|(text, _)| text).collect()
    }

    fn place_of(&mut self, text: &str) -> Option<Pos2> {
        self.places().into_iter().find_map(|(shown, at)| (shown == text).then_some(at))
    }

    fn press(&mut self, key: Key, modifiers: Modifiers) -> Vec<Action> {
        let mut actions = self.pass(vec![pressed(key, modifiers, true)]);
        actions.extend(self.pass(vec![pressed(key, modifiers, false)]));
        actions
    }

    fn click(&mut self, at: Pos2) -> Vec<Action> {
        let mut actions = self.pass(vec![Event::PointerMoved(at)]);
        actions.extend(self.pass(vec![button(at, true)]));
        actions.extend(self.pass(vec![button(at, false)]));
        actions.extend(self.pass(Vec::new()));
        actions
    }

    fn drag(&mut self, from: Pos2, to: Pos2) -> Vec<Action> {
        let mut actions = self.pass(vec![Event::PointerMoved(from)]);
        actions.extend(self.pass(vec![button(from, true)]));
        for step in 1..=8 {
            let at = from + (to - from) * (step as f32 / 8.0);
            actions.extend(self.pass(vec![Event::PointerMoved(at)]));
        }
        actions.extend(self.pass(vec![button(to, false)]));
        actions
    }
}

fn pressed(key: Key, modifiers: Modifiers, pressed: bool) -> Event {
    Event::Key { key, physical_key: Some(key), pressed, repeat: false, modifiers }
}

fn button(pos: Pos2, pressed: bool) -> Event {
    Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers: Modifiers::NONE }
}

/// Creates a wheel event.
fn scrolled(unit: MouseWheelUnit, by: f32, modifiers: Modifiers) -> Event {
    let source = egui::MouseWheelSource::Unknown;
    Event::MouseWheel { unit, delta: Vec2::new(0.0, by), phase: TouchPhase::Move, source, modifiers }
}

/// Returns the last look among the actions.
fn last_look(actions: &[Action]) -> Option<Look> {
    actions.iter().rev().find_map(|action| match action {
        Action::Look { look, .. } => Some((**look).clone()),
        _ => None,
    })
}

/// Returns the focus point of the last look.
fn point(actions: &[Action]) -> [f32; 2] {
    match last_look(actions).map(|look| look.focus) {
        Some(FocusRule::Point { x, y }) => [x, y],
        other => panic!("{other:?} of {actions:?}"),
    }
}

fn close(a: [f32; 2], b: [f32; 2]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-3)
}

/// A position on the panel, clear of the picture.
fn on_panel() -> Pos2 {
    pos2(1280.0 - 40.0, 400.0)
}
