//! The controls, drawn with egui.

mod badges;
mod canvas;
mod cards;
mod closing;
mod dock;
mod fonts;
mod help;
mod icons;
mod instruments;
mod legend;
mod marks;
mod notes;
mod parts;
mod place;
mod plate;
mod probe;
mod sections;
mod sheet;
#[cfg(test)]
mod tests;
mod theme;
mod timer;
mod transport;

pub use dock::room_px;
pub use fonts::SystemFonts;
pub use theme::install as dress;

use std::time::Duration;

use egui::{Context, Event, Id, Ui, Vec2};

use super::present::{Area, Part};
use super::state::{Action, State};
use super::{keys, meters, state, views};
use canvas::Gestures;
use dock::Dock;
use place::Place;

/// After this many seconds without pointer or keyboard the panel hides, in full screen.
const HIDES_AFTER_S: f64 = 4.0;
/// Points that the controls need: text is no larger than leaves them so many.
const LEAST_SIZE: Vec2 = Vec2::new(320.0, 200.0);
/// Shown when they have not.
const CRAMPED: &str = "The window is too small for text of this size: it is as large as there is room for.";
/// A key or the wheel that rests for this many seconds counts as let go.
const LET_GO_AFTER_S: f64 = 0.8;

/// What the controls remember from frame to frame besides egui's own memory.
#[derive(Default)]
pub struct Panel {
    /// Whether the panel never hides: a screen reader would not find it again.
    pub stays: bool,
    /// Whether fonts and styles are installed.
    ready: bool,
    /// When pointer or keyboard were used last, in egui's seconds.
    active_s: f64,
    /// When the pointer was.
    pointed_s: f64,
    /// Whether the touch that is going on brought the panel back, and does nothing else.
    waking: bool,
    /// When a control in hand changed the look last, until it is let go.
    stroke_s: Option<f64>,
    gestures: Gestures,
    sheet: sheet::Memory,
    instruments: instruments::Cache,
    notes: notes::Ages,
    badges: badges::Badges,
    /// What had the focus before something covered the window, and whether something does.
    focused: Option<Id>,
    covered: bool,
    timer: timer::Timer,
    transport: transport::Bar,
    /// The place of the picture, as fractions, of which somebody wants to know more.
    pub probed: Option<[f32; 2]>,
    /// Whether the window has no room for text of the size that was chosen.
    cramped: bool,
    /// Whether a control had the focus or a list was open at the end of the last pass.
    was_in_hand: bool,
}

/// The picture's area in the window, for the gestures on it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Canvas {
    /// The picture's area, in pixels of the window.
    pub area: Area,
    /// The picture's own columns and rows.
    pub size: (u32, u32),
    /// The part of the enlarged picture that is seen there.
    pub part: Option<Part>,
}

impl Panel {
    /// Draws the controls, reads keys and gestures, and adds what the person did to `actions`.
    pub fn show(&mut self, ui: &mut Ui, state: &State, canvas: Canvas, actions: &mut Vec<Action>) {
        let ctx = ui.ctx().clone();
        if !std::mem::replace(&mut self.ready, true) {
            theme::install(&ctx);
            self.active_s = ctx.input(|input| input.time);
        }
        ctx.accesskit_node_builder(egui::accesskit_root_id(), |node| node.set_label("bokehcam"));
        let first = actions.len();
        self.set_text_scale(&ctx, state.habits.text_scale, actions);
        let size = if canvas.size.1 > 0 { canvas.size } else { (1280, 720) };
        let place = Place::new(canvas, ctx.pixels_per_point(), state.mirror);
        let window = ctx.content_rect();
        let awake = self.is_awake(ui, state.panel && !state.bare, place.is_none());
        let in_use = awake || self.stays || self.sheet.is_in_use(&ctx);
        let is_shown = !state.bare && state.panel && (in_use || !state.full_screen);
        let dock = is_shown.then(|| Dock::of(window, size, state.shows_more()));
        // Before keys and gestures are read: what they zoom by is the window as it is now.
        dock::set_room(&ctx, dock.map_or(window, |dock| dock.room));
        self.read_keys(ui, state, size, actions);
        self.probed = None;
        if let Some(place) = place {
            self.gestures.show(ui, state, place, self.waking, actions);
            self.probed = probe::place(ui, state, &place);
        }
        if state.full_screen && self.pointer_rests(ui) {
            ctx.set_cursor_icon(egui::CursorIcon::None);
        }
        if self.probed.is_some() {
            probe::show(&ctx, state);
        }
        let mut bottom = 0.0;
        self.sheet.show(&ctx, state, dock, size, actions);
        if !state.bare {
            if awake && !state.panel {
                sheet::way_back(&ctx, actions);
            }
            if in_use || dock.is_some() {
                bottom = self.transport.show(&ctx, state, actions);
            }
            legend::show(ui, state, bottom);
            if state.instruments {
                self.instruments.show(&ctx, state);
            }
        }
        self.badges.show(&ctx, state);
        self.notes.show(&ctx, state, (bottom, &mut self.timer), actions);
        closing::show(&ctx, state, actions);
        if state.help {
            help::show(&ctx, state, actions);
        }
        self.give_back_focus(&ctx, state.help || state.closing);
        theme::focus_ring(&ctx);
        actions.extend(parts::take_said(&ctx).map(Action::Note));
        self.was_in_hand = ctx.memory(|memory| memory.focused().is_some()) || egui::Popup::is_any_open(&ctx);
        self.settle(ui, &actions[first..]).into_iter().for_each(|settle| actions.push(settle));
    }

    /// Makes text and controls as large as was chosen, as far as there is room for them, and tells where there is not; a new
    /// scale holds from the next pass on.
    fn set_text_scale(&mut self, ctx: &Context, chosen: f32, actions: &mut Vec<Action>) {
        let window = ctx.content_rect().size() * ctx.zoom_factor();
        let most = (window.x / LEAST_SIZE.x).min(window.y / LEAST_SIZE.y).max(1.0);
        if !std::mem::replace(&mut self.cramped, chosen > most) && self.cramped {
            actions.push(Action::Note(CRAMPED.to_owned()));
        }
        if (ctx.zoom_factor() - chosen.min(most)).abs() > 1e-3 {
            ctx.set_zoom_factor(chosen.min(most));
        }
    }

    /// Gives the focus back to what had it, once nothing covers the window any more.
    fn give_back_focus(&mut self, ctx: &Context, covered: bool) {
        match (std::mem::replace(&mut self.covered, covered), covered) {
            (true, false) => self.focused.into_iter().for_each(|id| ctx.memory_mut(|memory| memory.request_focus(id))),
            (false, false) => self.focused = ctx.memory(|memory| memory.focused()),
            (_, true) => {}
        }
    }

    /// Adds the actions of the keys that were pressed, unless text is being typed.
    fn read_keys(&mut self, ui: &Ui, state: &State, size: (u32, u32), actions: &mut Vec<Action>) {
        let ctx = ui.ctx();
        if ctx.text_edit_focused() {
            return;
        }
        // egui has already used Esc to drop the focus or to close a list, or a question does: it must not close anything else.
        let is_used = self.was_in_hand || self.sheet.is_asking() && !state.help && !state.closing;
        let escaped = ui.input(|input| input.key_pressed(egui::Key::Escape)) && is_used;
        let focused = ctx.memory(|memory| memory.focused().is_some()) || escaped;
        let context = keys::Context { size, fit: place::fit(ctx, size), chord: 0 };
        ui.input(|input| {
            actions.extend(input.events.iter().filter_map(|event| keys::action(event, state, context, focused)));
        });
    }

    /// Whether pointer or keyboard were used a short while ago, or the person `waits` for the first picture. A touch that
    /// brings the panel back is remembered.
    fn is_awake(&mut self, ui: &Ui, has_panel: bool, waits: bool) -> bool {
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
            self.waking = has_panel && now_s - self.active_s > HIDES_AFTER_S && !self.sheet.is_in_use(ui.ctx());
        }
        // Its first seconds count from the first picture.
        if active || waits {
            self.active_s = now_s;
        }
        is_before(ui, self.active_s + HIDES_AFTER_S)
    }

    /// Whether the pointer has not been moved for so long that nobody looks for it; where it keeps the panel, it stays.
    fn pointer_rests(&mut self, ui: &Ui) -> bool {
        let at = ui.input(|input| {
            if input.pointer.is_moving() || input.pointer.any_down() || input.pointer.any_released() {
                self.pointed_s = input.time;
            }
            input.pointer.latest_pos()
        });
        !is_before(ui, self.pointed_s + HIDES_AFTER_S)
            && !self.sheet.rect().zip(at).is_some_and(|(panel, at)| panel.contains(at))
    }

    /// The action that ends a stroke, once the control is let go: its changes are undone together, later ones apart.
    fn settle(&mut self, ui: &Ui, done: &[Action]) -> Option<Action> {
        let (now_s, down, released) =
            ui.input(|input| (input.time, input.pointer.any_down(), input.pointer.any_released()));
        if done.iter().any(|action| matches!(action, Action::Look { stroke: Some(_), .. })) {
            self.stroke_s = Some(now_s);
        }
        let changed_s = self.stroke_s?;
        if released || !down && now_s - changed_s > LET_GO_AFTER_S {
            self.stroke_s = None;
            return Some(Action::Settle);
        }
        None
    }
}

/// Whether it is not yet this time, in egui's seconds; when it is, there is another pass.
fn is_before(ui: &Ui, end_s: f64) -> bool {
    let left_s = end_s - ui.input(|input| input.time);
    if left_s > 0.0 {
        ui.ctx().request_repaint_after(Duration::from_secs_f64(left_s + 0.01));
    }
    left_s > 0.0
}
