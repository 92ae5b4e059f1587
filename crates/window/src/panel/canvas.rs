//! Gestures on the picture: click, double-click, wheel, drag.

use egui::{Id, Rect, Response, Role, Sense, Ui, WidgetInfo};

use super::marks::{self, TiltHandle};
use super::state::{Action, State, ViewMode, tweak};
use super::viewport::{Viewport, fit_scale};
use crate::texts::tr;
use bokehcam::depth::focus::FocusRule;
use bokehcam::look::Effect;
use bokehcam::look::Look;

/// Duration of the ring at a click, in seconds.
const CLICK_RING_S: f64 = 0.9;
/// Scroll distance that doubles the blur, in points.
const WHEEL_TO_DOUBLE: f32 = 300.0;
/// Zoom gesture per zoom step, as a power of two: a pinch of this factor, or a notch of Ctrl+wheel.
const ZOOM_STEP_LOG2: f32 = 0.25;
/// Distance within which the split line can be grabbed, in points: with a pointer, and with a finger.
const GRAB_RADIUS: f32 = 12.0;
const FINGER_GRAB_RADIUS: f32 = 28.0;

/// State of the gestures between frames.
#[derive(Debug, Default)]
pub struct Gestures {
    /// Position of the last click that set the focus, as fractions of the unmirrored picture, and its time in seconds.
    ring: Option<([f32; 2], f64)>,
    /// The tilt-shift mark that is being dragged.
    grabbed: Option<TiltHandle>,
    /// Zoom gesture since the last zoom step, as a power of two.
    zoom_log2: f32,
}

impl Gestures {
    /// Handles the gestures on the picture and draws the marks on it. A touch that only reopens the panel (`is_wake_touch`) is
    /// not a click.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        state: &State,
        viewport: Viewport,
        is_wake_touch: bool,
        actions: &mut Vec<Action>,
    ) {
        // Not focusable with Tab: the arrow keys replace the click for keyboard users.
        let response = ui.interact(viewport.visible, Id::unique("picture"), Sense::CLICK | Sense::DRAG);
        response.widget_info(|| WidgetInfo::labeled(Role::Canvas, true, tr("Picture: a click focuses there")));
        let line = drag_split_line(ui, state, &viewport);
        let is_tilt =
            state.look.effect == Effect::TiltShift && state.shown == ViewMode::Picture && !state.controls_hidden;
        let on_line = line.as_ref().is_some_and(|line| line.hovered() || line.dragged());
        if !on_line && !is_wake_touch {
            self.handle_click(&response, state, &viewport, actions);
        }
        if is_tilt {
            self.drag_tilt(ui, &response, state, &viewport, actions);
        }
        if response.hovered() {
            change_blur_by_wheel(ui, state, &viewport, actions);
            self.zoom_by_gesture(ui, state, &viewport, actions);
        }
        if state.zoom.factor > 0 && !on_line && self.grabbed.is_none() {
            pan_by_drag(&response, &viewport, actions);
        }
        self.draw_marks(ui, state, &viewport, is_tilt, on_line);
        if let Some(at) = line.filter(Response::dragged).and_then(|line| line.interact_pointer_pos()) {
            let fraction = (at.x - viewport.rect.left()) / viewport.rect.width();
            actions.push(Action::Split(Some(fraction.clamp(0.0, 1.0))));
        }
    }

    /// Focuses at the click, or moves the tilt-shift band there; a double click tracks the object there.
    fn handle_click(&mut self, response: &Response, state: &State, viewport: &Viewport, actions: &mut Vec<Action>) {
        let Some(at) = response.interact_pointer_pos().filter(|_| response.clicked()) else { return };
        let mut look = state.look.clone();
        let [x, y] = viewport.to_fractions(at);
        if look.effect == Effect::TiltShift {
            look.tilt.center_y = marks::center_y_through(&look.tilt, viewport.size, [x, y]);
        // A double click shortly after another click is reported as a triple click.
        } else if response.double_clicked() || response.triple_clicked() {
            look.focus = tweak::focus_on_tracked(x, y);
            self.ring = Some(([x, y], response.ctx.input(|input| input.time)));
        } else {
            look.focus = tweak::focus_on_point(x, y);
            self.ring = Some(([x, y], response.ctx.input(|input| input.time)));
        }
        push_look(actions, state, look, "picture click");
    }

    /// Drags the tilt-shift mark that was pressed.
    fn drag_tilt(
        &mut self,
        ui: &Ui,
        response: &Response,
        state: &State,
        viewport: &Viewport,
        actions: &mut Vec<Action>,
    ) {
        if response.drag_started() {
            let origin = ui.input(|input| input.pointer.press_origin());
            self.grabbed = origin.and_then(|at| marks::handle_at(&state.look.tilt, viewport, at));
        }
        if !response.dragged() {
            self.grabbed = None;
        }
        if let (Some(grabbed), Some(at)) = (self.grabbed, response.interact_pointer_pos()) {
            let mut look = state.look.clone();
            marks::drag_handle(&mut look.tilt, grabbed, viewport, at);
            push_look(actions, state, look, grabbed.stroke());
        }
    }

    /// Zooms in steps by Ctrl+wheel or pinch. Zoom steps by key are also centred on the pointer.
    fn zoom_by_gesture(&mut self, ui: &Ui, state: &State, viewport: &Viewport, actions: &mut Vec<Action>) {
        let (factor, at) = ui.input(|input| (input.zoom_delta(), input.pointer.hover_pos()));
        let center = at.map(|at| viewport.to_fractions(at));
        for action in actions.iter_mut() {
            if let Action::Zoom(_, at @ None) = action {
                *at = center;
            }
        }
        self.zoom_log2 += factor.log2();
        if self.zoom_log2.abs() >= ZOOM_STEP_LOG2 {
            let step = self.zoom_log2.signum() as i32;
            self.zoom_log2 = 0.0;
            let size = (viewport.size.x as u32, viewport.size.y as u32);
            actions.push(Action::Zoom(state.zoom.next_factor(step, fit_scale(ui.ctx(), size)), center));
        }
    }

    /// Draws the marks on the picture: crop, split line, tilt-shift band, focus point, and click ring.
    fn draw_marks(&mut self, ui: &Ui, state: &State, viewport: &Viewport, is_tilt: bool, is_line_held: bool) {
        let painter = ui.painter().with_clip_rect(viewport.visible);
        let now = ui.input(|input| input.time);
        if state.controls_hidden {
            return;
        }
        // Auto-framing: outputs get this crop.
        if let Some(part) = state.crop.filter(|_| state.look.follow.zoom().is_some()) {
            marks::draw_crop(&painter, viewport, &part);
        }
        if let Some(at) = state.split {
            let after = match state.shown {
                ViewMode::Picture => "After",
                ViewMode::Depth => "Depth",
            };
            marks::draw_split(&painter, viewport, at, is_line_held, after);
        }
        if is_tilt {
            let pointer = ui.input(|input| input.pointer.hover_pos());
            let near = self.grabbed.or_else(|| pointer.and_then(|at| marks::handle_at(&state.look.tilt, viewport, at)));
            marks::draw_tilt(&painter, &state.look.tilt, viewport, near);
        }
        if let (FocusRule::Point { x, y }, Effect::Auto) = (state.look.focus, state.look.effect) {
            marks::draw_focus_point(&painter, viewport.to_screen([x, y]));
        }
        if let Some((at, clicked_s)) = self.ring {
            let age = (now - clicked_s) / CLICK_RING_S;
            if age < 1.0 {
                marks::draw_ring(&painter, viewport.to_screen(at), age.max(0.0) as f32);
                ui.ctx().request_repaint_after_secs(1.0 / 30.0);
            } else {
                self.ring = None;
            }
        }
    }
}

/// Returns the draggable area of the split line; `None` without a split.
fn drag_split_line(ui: &mut Ui, state: &State, viewport: &Viewport) -> Option<Response> {
    let at = state.split?;
    let x = viewport.rect.left() + at * viewport.rect.width();
    // egui hit-tests the next press against this pass: without a pointer, that press will come from a finger.
    let hold = if ui.input(|input| input.pointer.has_pointer()) { GRAB_RADIUS } else { FINGER_GRAB_RADIUS };
    let rect = Rect::from_x_y_ranges(x - hold..=x + hold, viewport.visible.y_range());
    if !viewport.visible.intersects(rect) {
        return None;
    }
    let line = ui.interact(rect, Id::unique("split line"), Sense::DRAG);
    Some(line.on_hover_and_drag_cursor(egui::CursorIcon::ResizeHorizontal))
}

/// Pans the zoomed picture by dragging.
fn pan_by_drag(response: &Response, viewport: &Viewport, actions: &mut Vec<Action>) {
    let by = response.drag_delta();
    if response.dragged() && by != egui::Vec2::ZERO {
        // Starts from the clamped position that is visible, not from the requested one: dragging past an edge has no
        // effect.
        actions.push(Action::Pan(viewport.to_fractions(viewport.visible.center() - by)));
    }
}

/// Changes the blur amount by the wheel.
fn change_blur_by_wheel(ui: &Ui, state: &State, viewport: &Viewport, actions: &mut Vec<Action>) {
    let turned = ui.input(|input| if input.modifiers.any() { 0.0 } else { input.smooth_scroll_delta().y });
    if turned != 0.0 {
        let mut look = state.look.clone();
        tweak::scale_blur(&mut look, (turned / WHEEL_TO_DOUBLE).exp2(), viewport.size.y as u32);
        push_look(actions, state, look, "wheel");
    }
}

/// Adds an action for `look` if it differs from the current look.
fn push_look(actions: &mut Vec<Action>, state: &State, look: Look, stroke: &'static str) {
    if look != state.look {
        actions.push(Action::Look { look: Box::new(look), stroke: Some(stroke) });
    }
}
