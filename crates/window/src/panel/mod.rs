//! The controls, drawn with egui.

mod badges;
mod canvas;
mod cards;
mod closing;
mod dock;
mod fonts;
mod help;
mod icons;
mod marks;
mod notes;
mod plate;
mod sections;
mod sheet;
#[cfg(test)]
mod tests;
mod theme;
mod timer;
mod transport;
mod viewport;
mod widgets;

pub use dock::picture_area_px;
pub use fonts::SystemFonts;
pub use theme::install as install_theme;

use std::time::Duration;

use egui::{Context, Event, Id, Ui, Vec2};

use super::present::{Area, VisibleRegion};
use super::state::{Action, State};
use super::{keys, state};
use canvas::Gestures;
use dock::Dock;
use viewport::Viewport;

/// Seconds without pointer or keyboard input after which the panel hides in full screen.
const HIDE_DELAY_S: f64 = 4.0;
/// Minimum size of the window in points; the text scale is limited to preserve it.
const MIN_LAYOUT_SIZE: Vec2 = Vec2::new(320.0, 200.0);
/// Shown if the chosen text scale exceeds that limit.
const TEXT_TOO_LARGE: &str = "The window is too small for text of this size: the text is as large as fits.";
/// Seconds after which a key or the wheel without further events counts as released.
const RELEASE_DELAY_S: f64 = 0.8;

/// State of the controls between frames, besides egui's own memory.
#[derive(Default)]
pub struct Panel {
    /// Whether the panel never hides, because screen readers could not find it again.
    pub is_always_visible: bool,
    /// Whether fonts and styles are installed.
    has_theme: bool,
    /// Time of the last pointer or keyboard input, in egui's seconds.
    active_s: f64,
    /// Time of the last pointer movement or press, in egui's seconds.
    pointer_used_s: f64,
    /// Whether the current touch only reopened the panel, and has no other effect.
    is_wake_touch: bool,
    /// Time of the last look change by a control that is still held, in egui's seconds.
    stroke_s: Option<f64>,
    gestures: Gestures,
    sheet: sheet::PanelState,
    notes: notes::NoteTimes,
    badges: badges::Badges,
    /// The control that had the focus before a modal covered the window.
    last_focused: Option<Id>,
    /// Whether a modal covers the window.
    covered: bool,
    timer: timer::SelfTimer,
    transport: transport::TransportBar,
    /// Whether the window is too small for the chosen text scale.
    is_text_limited: bool,
    /// Whether a control had the focus or a popup was open at the end of the last pass.
    was_in_use: bool,
}

/// The picture's area in the window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Canvas {
    /// The picture's area, in pixels of the window.
    pub area: Area,
    /// The picture's width and height in pixels.
    pub size: (u32, u32),
    /// The visible part of the zoomed picture.
    pub visible_region: Option<VisibleRegion>,
}

impl Panel {
    /// Draws the controls, handles keys and gestures, and appends the resulting actions.
    pub fn show(&mut self, ui: &mut Ui, state: &State, canvas: Canvas, actions: &mut Vec<Action>) {
        let ctx = ui.ctx().clone();
        if !std::mem::replace(&mut self.has_theme, true) {
            theme::install(&ctx);
            self.active_s = ctx.input(|input| input.time);
        }
        ctx.accesskit_node_builder(egui::accesskit_root_id(), |node| node.set_label("bokehcam"));
        let first = actions.len();
        self.set_text_scale(&ctx, state.preferences.text_scale, actions);
        let size = if canvas.size.1 > 0 { canvas.size } else { (1280, 720) };
        let viewport = Viewport::new(canvas, ctx.pixels_per_point(), state.mirror);
        let window = ctx.content_rect();
        let awake = self.is_awake(ui, state.panel && !state.controls_hidden, viewport.is_none());
        let in_use = awake || self.is_always_visible || self.sheet.is_in_use(&ctx);
        let is_shown = !state.controls_hidden && state.panel && (in_use || !state.full_screen);
        let dock = is_shown.then(|| Dock::new(window, size, state.is_expanded()));
        // Must precede keys and gestures: their zoom steps depend on the current layout.
        dock::set_picture_area(&ctx, dock.map_or(window, |dock| dock.picture_area));
        self.read_keys(ui, state, size, actions);
        if let Some(viewport) = viewport {
            self.gestures.show(ui, state, viewport, self.is_wake_touch, actions);
        }
        if state.full_screen && self.is_pointer_idle(ui) {
            ctx.set_cursor_icon(egui::CursorIcon::None);
        }
        let mut bottom = 0.0;
        self.sheet.show(&ctx, state, dock, size, actions);
        if !state.controls_hidden {
            if awake && !state.panel {
                sheet::show_reopen_button(&ctx, actions);
            }
            if in_use || dock.is_some() {
                bottom = self.transport.show(&ctx, state, actions);
            }
        }
        self.badges.show(&ctx, state);
        self.notes.show(&ctx, state, (bottom, &mut self.timer), actions);
        closing::show(&ctx, state, actions);
        if state.help {
            help::show(&ctx, state, actions);
        }
        self.restore_focus(&ctx, state.help || state.closing);
        theme::draw_focus_ring(&ctx);
        actions.extend(widgets::take_message(&ctx).map(Action::Note));
        self.was_in_use = ctx.memory(|memory| memory.focused().is_some()) || egui::Popup::is_any_open(&ctx);
        self.end_stroke(ui, &actions[first..]).into_iter().for_each(|settle| actions.push(settle));
    }

    /// Sets the text scale, limited to the window's size, and adds a note when the limit takes effect. egui applies a
    /// new scale in the next pass.
    fn set_text_scale(&mut self, ctx: &Context, chosen: f32, actions: &mut Vec<Action>) {
        let window = ctx.content_rect().size() * ctx.zoom_factor();
        let max_scale = (window.x / MIN_LAYOUT_SIZE.x).min(window.y / MIN_LAYOUT_SIZE.y).max(1.0);
        if !std::mem::replace(&mut self.is_text_limited, chosen > max_scale) && self.is_text_limited {
            actions.push(Action::Note(TEXT_TOO_LARGE.to_owned()));
        }
        if (ctx.zoom_factor() - chosen.min(max_scale)).abs() > 1e-3 {
            ctx.set_zoom_factor(chosen.min(max_scale));
        }
    }

    /// Restores the focus once no modal covers the window any more.
    fn restore_focus(&mut self, ctx: &Context, covered: bool) {
        match (std::mem::replace(&mut self.covered, covered), covered) {
            (true, false) => {
                self.last_focused.into_iter().for_each(|id| ctx.memory_mut(|memory| memory.request_focus(id)))
            }
            (false, false) => self.last_focused = ctx.memory(|memory| memory.focused()),
            (_, true) => {}
        }
    }

    /// Adds the actions of the pressed keys, unless text is being typed.
    fn read_keys(&mut self, ui: &Ui, state: &State, size: (u32, u32), actions: &mut Vec<Action>) {
        let ctx = ui.ctx();
        if ctx.text_edit_focused() {
            return;
        }
        // egui or a question has already handled Esc (dropped the focus, closed a popup): it must not close anything
        // else.
        let is_used = self.was_in_use || self.sheet.has_open_dialog() && !state.help && !state.closing;
        let escaped = ui.input(|input| input.key_pressed(egui::Key::Escape)) && is_used;
        // A list that a click opened has no focus, and still takes the arrow keys.
        let focused = ctx.memory(|memory| memory.focused().is_some()) || escaped || egui::Popup::is_any_open(ctx);
        let context = keys::Context { size, fit: viewport::fit_scale(ctx, size), chord: 0 };
        ui.input(|input| {
            actions
                .extend(input.events.iter().filter_map(|event| keys::action_for_event(event, state, context, focused)));
        });
    }

    /// Whether pointer or keyboard were used recently, or no picture has arrived yet (`is_waiting`). Also records a
    /// touch that reopens the panel.
    fn is_awake(&mut self, ui: &Ui, has_panel: bool, is_waiting: bool) -> bool {
        let began = |event: &Event| matches!(event, Event::Touch { phase: egui::TouchPhase::Start, .. });
        let (now_s, active, touched) = ui.input(|input| {
            let is_use = |event: &Event| {
                let is_other = matches!(event, Event::PointerGone | Event::WindowFocused(_) | Event::MouseMoved(_));
                !is_other && !matches!(event, Event::Key { pressed: false, .. })
            };
            let active = input.events.iter().any(is_use) || input.pointer.any_down();
            (input.time, active, input.events.iter().any(began))
        });
        if touched {
            self.is_wake_touch = has_panel && now_s - self.active_s > HIDE_DELAY_S && !self.sheet.is_in_use(ui.ctx());
        }
        // The first countdown starts with the first picture.
        if active || is_waiting {
            self.active_s = now_s;
        }
        is_in_future(ui, self.active_s + HIDE_DELAY_S)
    }

    /// Whether the pointer has not moved for [`HIDE_DELAY_S`] and can be hidden; false over the panel.
    fn is_pointer_idle(&mut self, ui: &Ui) -> bool {
        let at = ui.input(|input| {
            if input.pointer.is_moving() || input.pointer.any_down() || input.pointer.any_released() {
                self.pointer_used_s = input.time;
            }
            input.pointer.latest_pos()
        });
        !is_in_future(ui, self.pointer_used_s + HIDE_DELAY_S)
            && !self.sheet.rect().zip(at).is_some_and(|(panel, at)| panel.contains(at))
    }

    /// Returns the action that ends an undo stroke once the control is released; later changes start a new undo step.
    fn end_stroke(&mut self, ui: &Ui, done: &[Action]) -> Option<Action> {
        let (now_s, down, released) =
            ui.input(|input| (input.time, input.pointer.any_down(), input.pointer.any_released()));
        if done.iter().any(|action| matches!(action, Action::Look { stroke: Some(_), .. })) {
            self.stroke_s = Some(now_s);
        }
        let changed_s = self.stroke_s?;
        if released || !down && now_s - changed_s > RELEASE_DELAY_S {
            self.stroke_s = None;
            return Some(Action::EndStroke);
        }
        None
    }
}

/// Whether `end_s` (egui's seconds) is in the future; if so, requests a repaint for that time.
fn is_in_future(ui: &Ui, end_s: f64) -> bool {
    let left_s = end_s - ui.input(|input| input.time);
    if left_s > 0.0 {
        ui.ctx().request_repaint_after(Duration::from_secs_f64(left_s + 0.01));
    }
    left_s > 0.0
}
