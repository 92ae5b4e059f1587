//! The panel itself: what everybody needs, and more on a wish.

use egui::{Area, Context, Id, Order, Rect, ScrollArea, Ui, Vec2, vec2};

use super::cards;
use super::dock::{Dock, LINE};
use super::icons::{self, Icon};
use super::parts::end_of;
use super::sections::{self, Editing, Sheet, Thumbs, first};
use super::state::{Action, Source, State};
use super::theme::{self, Colors, GAP, PAD};
use crate::texts::{tr, tr_with};

/// What the panel remembers.
#[derive(Default)]
pub struct Memory {
    editing: Editing,
    thumbs: Thumbs,
    /// Where the panel was drawn last; `None` while it is closed.
    rect: Option<Rect>,
    /// The control that had the focus in the pass before.
    focused: Option<Id>,
}

fn id() -> Id {
    Id::unique("panel")
}

impl Memory {
    /// Whether the pointer is over the panel, or a control has the focus or a list open: then it must not hide.
    pub fn is_in_use(&self, ctx: &Context) -> bool {
        let pointer = ctx.input(|input| input.pointer.latest_pos());
        let under_pointer = self.rect.zip(pointer).is_some_and(|(rect, at)| rect.contains(at));
        under_pointer || ctx.memory(|memory| memory.focused().is_some()) || ctx.any_popup_open()
    }

    /// Whether it asks something that Esc gives up.
    pub fn is_asking(&self) -> bool {
        self.rect.is_some() && self.editing.is_asking()
    }

    /// Where it was drawn last, if it is open.
    pub fn rect(&self) -> Option<Rect> {
        self.rect
    }

    /// Draws the panel where it stands; what does not fit is scrolled.
    pub fn show(
        &mut self,
        ctx: &Context,
        state: &State,
        dock: Option<Dock>,
        size: (u32, u32),
        actions: &mut Vec<Action>,
    ) {
        self.rect = dock.map(|dock| dock.panel);
        let Some(Dock { panel, columns, .. }) = dock else { return };
        let area = Area::new(id()).fixed_pos(panel.min).order(Order::Middle).constrain(false).fade_in(false);
        let drawn = area.show(ctx, |ui| {
            let colors = Colors::here(ui);
            ui.set_max_size(panel.size().max(Vec2::splat(1.0)));
            theme::card(&colors).show(ui, |ui| {
                let inner = (panel.size() - Vec2::splat(2.0 * (PAD + LINE))).max(Vec2::splat(1.0));
                ui.set_width(inner.x);
                let more = state.shows_more();
                let scroll = ScrollArea::vertical().max_height(inner.y.max(20.0)).auto_shrink([false, true]);
                scroll.show(ui, |ui| {
                    let mut sheet = Sheet { state, look: state.look.clone(), stroke: None, size, actions };
                    first::show(ui, &mut sheet, columns);
                    if more {
                        header(ui, state, sheet.actions);
                        status(ui, state);
                        ui.spacing_mut().combo_width = ui.available_width();
                        sections::show(ui, &mut sheet, &mut self.editing, &mut self.thumbs);
                    }
                    self.follow_focus(ui);
                    let Sheet { look, stroke, .. } = sheet;
                    if stroke.is_some() && look != state.look {
                        actions.push(Action::Look { look: Box::new(look), stroke });
                    }
                });
            });
        });
        if matches!(state.source, Source::Running(_)) && state.shows_more() && !state.stands_still() {
            ctx.request_repaint_after_secs(STATUS_PERIOD_S);
        }
        self.rect = Some(drawn.response.rect);
    }

    /// Scrolls to the control that the focus moved to, if that is out of sight.
    fn follow_focus(&mut self, ui: &Ui) {
        let focused = ui.ctx().memory(|memory| memory.focused());
        if let Some(id) = focused.filter(|_| focused != self.focused)
            && let Some(response) = ui.ctx().read_response(id)
            && response.layer_id == ui.layer_id()
            && !ui.clip_rect().contains_rect(response.rect)
        {
            ui.scroll_to_rect(response.rect.expand(8.0), None);
        }
        self.focused = focused;
    }
}

/// Draws a button that brings the panel back, where it was.
pub fn way_back(ctx: &Context, actions: &mut Vec<Action>) {
    let corner = ctx.content_rect().right_top() + vec2(-GAP - icons::SIDE - 6.0, GAP);
    let area = Area::new(id().with("way back")).fixed_pos(corner).order(Order::Middle);
    cards::show(ctx, area, 60.0, 3, |ui, _| {
        if icons::button(ui, Icon::Panel, "Show the panel (P)", true) {
            actions.push(Action::Panel(true));
        }
    });
}

/// Seconds between updates of the focus distance, which changes without any input.
const STATUS_PERIOD_S: f32 = 0.5;

/// The state of the source and the distance of focus, in one line.
fn status(ui: &mut Ui, state: &State) {
    let colors = Colors::here(ui);
    let mut parts: Vec<String> = Vec::new();
    if let Source::Running(running) = &state.source {
        // What comes after it has to be seen, too.
        parts.push(end_of(&running.label, 34));
    }
    let focused = state.look.effect.follows_depth() && !state.known().is_relative;
    if let Some(metres) = state.focus_m.filter(|metres| focused && metres.is_finite()) {
        parts.push(tr_with("focused at {} m", &[&format!("{metres:.2}")]));
    }
    let text = match &state.source {
        Source::Running(_) => parts.join(", "),
        Source::Opening => tr("Opening…").to_owned(),
        Source::Lost(_) => tr("No picture").to_owned(),
        Source::Ended => tr("The recording is over").to_owned(),
    };
    let text = egui::RichText::new(text).text_style(egui::TextStyle::Small).color(colors.weak);
    ui.add(egui::Label::new(text).truncate());
}

/// Buttons for undo, redo, reset, help and hiding the panel.
fn header(ui: &mut Ui, state: &State, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        let (undo, redo) = state.history.can();
        let buttons = [
            (Icon::Undo, "Undo (Ctrl+Z)", undo, Action::Undo),
            (Icon::Redo, "Redo (Ctrl+Shift+Z)", redo, Action::Redo),
            (Icon::Reset, "Back to the usual look (R)", state.look != state.first_look, Action::Reset),
            (Icon::Help, "Keys (F1)", true, Action::Help(!state.help)),
            (Icon::Close, "Hide the panel (P)", true, Action::Panel(false)),
        ];
        for (icon, hint, enabled, action) in buttons {
            if icons::button(ui, icon, hint, enabled) {
                actions.push(action);
            }
        }
    });
}
