//! Gestures on the picture itself: click, double-click, wheel, drag.

use egui::{Id, Rect, Response, Role, Sense, Ui, WidgetInfo};

use super::marks::{self, Tilting};
use super::place::{Place, fit};
use super::state::{Action, Shown, State, tweak};
use crate::texts::tr;
use bokehcam::depth::focus::FocusRule;
use bokehcam::look::Effect;
use bokehcam::look::Look;

/// How long the ring at a click is shown, in seconds.
pub const RING_S: f64 = 0.9;
/// Scrolling by this many points doubles the blur.
const WHEEL_TO_DOUBLE: f32 = 300.0;
/// Two fingers that part by this power of two make a step of the size; so does a notch of the wheel with Ctrl.
const PINCH: f32 = 0.25;
/// The split line can be grabbed this near to it, in points, by a pointer and by a finger.
const HOLD: f32 = 12.0;
const FINGER_HOLD: f32 = 28.0;

/// What the gestures remember.
#[derive(Debug, Default)]
pub struct Gestures {
    /// Where a click focused last, as fractions of the picture as it is, and when.
    ring: Option<([f32; 2], f64)>,
    /// Which of the marks of tilt-shift is being dragged.
    tilting: Option<Tilting>,
    /// How far the wheel or two fingers have enlarged the picture since the last step, as a power of two.
    pinched: f32,
}

impl Gestures {
    /// Reads the gestures on the picture, and draws the marks on it. A touch that wakes the panel is no click.
    pub fn show(&mut self, ui: &mut Ui, state: &State, place: Place, waking: bool, actions: &mut Vec<Action>) {
        // No stop for the Tab key: the arrow keys do what a click does.
        let response = ui.interact(place.seen, Id::unique("picture"), Sense::CLICK | Sense::DRAG);
        response.widget_info(|| WidgetInfo::labeled(Role::Canvas, true, tr("Picture: a click focuses there")));
        let line = split_line(ui, state, &place);
        let is_tilt = state.look.effect == Effect::TiltShift && state.shown == Shown::Picture && !state.bare;
        let on_line = line.as_ref().is_some_and(|line| line.hovered() || line.dragged());
        if !on_line && !waking {
            self.click(&response, state, &place, actions);
        }
        if is_tilt {
            self.tilt(ui, &response, state, &place, actions);
        }
        if response.hovered() {
            wheel(ui, state, &place, actions);
            self.zoom(ui, state, &place, actions);
        }
        if state.zoom.factor > 0 && !on_line && self.tilting.is_none() {
            pan(&response, &place, actions);
        }
        self.draw(ui, state, &place, is_tilt, on_line);
        if let Some(at) = line.filter(Response::dragged).and_then(|line| line.interact_pointer_pos()) {
            let fraction = (at.x - place.rect.left()) / place.rect.width();
            actions.push(Action::Split(Some(fraction.clamp(0.0, 1.0))));
        }
    }

    /// Focuses where one clicked, or moves the band of tilt-shift there; a double click follows what is there.
    fn click(&mut self, response: &Response, state: &State, place: &Place, actions: &mut Vec<Action>) {
        let Some(at) = response.interact_pointer_pos().filter(|_| response.clicked()) else { return };
        let mut look = state.look.clone();
        let [x, y] = place.fractions(at);
        if look.effect == Effect::TiltShift {
            look.tilt.center_y = marks::center_through(&look.tilt, place.size, [x, y]);
        // A double click soon after another click counts as a third.
        } else if response.double_clicked() || response.triple_clicked() {
            look.focus = tweak::track(x, y);
            self.ring = Some(([x, y], response.ctx.input(|input| input.time)));
        } else {
            look.focus = tweak::point(x, y);
            self.ring = Some(([x, y], response.ctx.input(|input| input.time)));
        }
        push_look(actions, state, look, "picture click");
    }

    /// Drags the mark of tilt-shift that was pressed.
    fn tilt(&mut self, ui: &Ui, response: &Response, state: &State, place: &Place, actions: &mut Vec<Action>) {
        if response.drag_started() {
            let origin = ui.input(|input| input.pointer.press_origin());
            self.tilting = origin.and_then(|at| marks::grip(&state.look.tilt, place, at));
        }
        if !response.dragged() {
            self.tilting = None;
        }
        if let (Some(tilting), Some(at)) = (self.tilting, response.interact_pointer_pos()) {
            let mut look = state.look.clone();
            marks::drag(&mut look.tilt, tilting, place, at);
            push_look(actions, state, look, tilting.stroke());
        }
    }

    /// Enlarges the picture step by step, by the wheel with Ctrl or by two fingers; a key's step goes to the pointer, too.
    fn zoom(&mut self, ui: &Ui, state: &State, place: &Place, actions: &mut Vec<Action>) {
        let (factor, at) = ui.input(|input| (input.zoom_delta(), input.pointer.hover_pos()));
        let here = at.map(|at| place.fractions(at));
        for action in actions.iter_mut() {
            if let Action::Zoom(_, at @ None) = action {
                *at = here;
            }
        }
        self.pinched += factor.log2();
        if self.pinched.abs() >= PINCH {
            let step = self.pinched.signum() as i32;
            self.pinched = 0.0;
            let size = (place.size.x as u32, place.size.y as u32);
            actions.push(Action::Zoom(state.zoom.stepped(step, fit(ui.ctx(), size)), here));
        }
    }

    /// Draws the marks on the picture: split line, band of tilt-shift, point of focus and the ring of a click.
    fn draw(&mut self, ui: &Ui, state: &State, place: &Place, is_tilt: bool, line_held: bool) {
        let painter = ui.painter().with_clip_rect(place.seen);
        let now = ui.input(|input| input.time);
        if state.bare {
            return;
        }
        if let Some(part) = state.part.filter(|_| state.look.follow.zoom().is_some()) {
            marks::part(&painter, place, &part);
        }
        if let Some(at) = state.split {
            let after = match state.shown {
                Shown::Picture => "After",
                Shown::Depth => "Depth",
                Shown::Coc => "Blur radius",
                Shown::Bins => "Layers",
            };
            marks::split(&painter, place, at, line_held, after);
        }
        if is_tilt {
            let pointer = ui.input(|input| input.pointer.hover_pos());
            let near = self.tilting.or_else(|| pointer.and_then(|at| marks::grip(&state.look.tilt, place, at)));
            marks::tilt(&painter, &state.look.tilt, place, near);
        }
        if let (FocusRule::Point { x, y }, Effect::Auto) = (state.look.focus, state.look.effect) {
            marks::point(&painter, place.point([x, y]));
        }
        if let Some((at, clicked_s)) = self.ring {
            let age = (now - clicked_s) / RING_S;
            if age < 1.0 {
                marks::ring(&painter, place.point(at), age.max(0.0) as f32);
                ui.ctx().request_repaint_after_secs(1.0 / 30.0);
            } else {
                self.ring = None;
            }
        }
    }
}

/// The area around the split line in which it can be dragged; `None` without a split.
fn split_line(ui: &mut Ui, state: &State, place: &Place) -> Option<Response> {
    let at = state.split?;
    let x = place.rect.left() + at * place.rect.width();
    // What is pressed next is taken from this pass: where there is no pointer, it will be a finger.
    let hold = if ui.input(|input| input.pointer.has_pointer()) { HOLD } else { FINGER_HOLD };
    let rect = Rect::from_x_y_ranges(x - hold..=x + hold, place.seen.y_range());
    if !place.seen.intersects(rect) {
        return None;
    }
    let line = ui.interact(rect, Id::unique("split line"), Sense::DRAG);
    Some(line.on_hover_and_drag_cursor(egui::CursorIcon::ResizeHorizontal))
}

/// Moves an enlarged picture by dragging it.
fn pan(response: &Response, place: &Place, actions: &mut Vec<Action>) {
    let by = response.drag_delta();
    if response.dragged() && by != egui::Vec2::ZERO {
        // From where it is, and not from where it was once asked to be: at its edges it goes no further.
        actions.push(Action::Pan(place.fractions(place.seen.center() - by)));
    }
}

/// Changes the amount of blur by the wheel.
fn wheel(ui: &Ui, state: &State, place: &Place, actions: &mut Vec<Action>) {
    let turned = ui.input(|input| if input.modifiers.any() { 0.0 } else { input.smooth_scroll_delta().y });
    if turned != 0.0 {
        let mut look = state.look.clone();
        tweak::blur_by(&mut look, (turned / WHEEL_TO_DOUBLE).exp2(), place.size.y as u32);
        push_look(actions, state, look, "wheel");
    }
}

/// Adds the action for another look, if it is another one.
fn push_look(actions: &mut Vec<Action>, state: &State, look: Look, stroke: &'static str) {
    if look != state.look {
        actions.push(Action::Look { look: Box::new(look), stroke: Some(stroke) });
    }
}
