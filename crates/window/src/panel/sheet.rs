//! The panel: the first screen with the essential controls, and an expanded part.

use egui::{Area, Context, Id, Order, Rect, ScrollArea, Ui, Vec2, vec2};

use super::cards;
use super::dock::{Dock, LINE};
use super::icons::{self, Icon};
use super::sections::{self, PanelForm, PresetEditor, Thumbnails, first};
use super::state::{Action, Source, State};
use super::theme::{self, Colors, GAP, PAD};
use super::widgets::truncate_end;
use crate::texts::{format_number, tr, tr_with};

/// State of the panel between frames.
#[derive(Default)]
pub struct PanelState {
    editing: PresetEditor,
    thumbnails: Thumbnails,
    /// Rectangle at the last drawing; `None` while it is closed.
    rect: Option<Rect>,
    /// The control that had the focus in the previous pass.
    last_focused: Option<Id>,
}

fn panel_id() -> Id {
    Id::unique("panel")
}

impl PanelState {
    /// Whether the panel must not hide: the pointer is over it, a control has the focus, or a popup is open.
    pub fn is_in_use(&self, ctx: &Context) -> bool {
        let pointer = ctx.input(|input| input.pointer.latest_pos());
        let under_pointer = self.rect.zip(pointer).is_some_and(|(rect, at)| rect.contains(at));
        under_pointer || ctx.memory(|memory| memory.focused().is_some()) || ctx.any_popup_open()
    }

    /// Whether a dialog is open that Esc cancels.
    pub fn has_open_dialog(&self) -> bool {
        self.rect.is_some() && self.editing.has_open_dialog()
    }

    /// Returns its rectangle at the last drawing, if it is open.
    pub fn rect(&self) -> Option<Rect> {
        self.rect
    }

    /// Draws the panel in its dock, scrolling if it does not fit.
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
        let area = Area::new(panel_id()).fixed_pos(panel.min).order(Order::Middle).constrain(false).fade_in(false);
        let drawn = area.show(ctx, |ui| {
            let colors = Colors::for_ui(ui);
            ui.set_max_size(panel.size().max(Vec2::splat(1.0)));
            theme::card_frame(&colors).show(ui, |ui| {
                let inner = (panel.size() - Vec2::splat(2.0 * (PAD + LINE))).max(Vec2::splat(1.0));
                ui.set_width(inner.x);
                let more = state.is_expanded();
                let scroll = ScrollArea::vertical().max_height(inner.y.max(20.0)).auto_shrink([false, true]);
                scroll.show(ui, |ui| {
                    let mut form = PanelForm { state, look: state.look.clone(), stroke: None, size, actions };
                    first::show(ui, &mut form, columns);
                    if more {
                        add_header(ui, state, form.actions);
                        add_status(ui, state);
                        ui.spacing_mut().combo_width = ui.available_width();
                        sections::show(ui, &mut form, &mut self.editing, &mut self.thumbnails);
                    }
                    self.scroll_to_focus(ui);
                    let PanelForm { look, stroke, .. } = form;
                    if stroke.is_some() && look != state.look {
                        actions.push(Action::Look { look: Box::new(look), stroke });
                    }
                });
            });
        });
        // The status line changes without any input.
        if matches!(state.source, Source::Running(_)) && state.is_expanded() && !state.can_pause_pipeline() {
            ctx.request_repaint_after_secs(STATUS_PERIOD_S);
        }
        self.rect = Some(drawn.response.rect);
    }

    /// Scrolls to a newly focused control that is out of sight.
    fn scroll_to_focus(&mut self, ui: &Ui) {
        let focused = ui.ctx().memory(|memory| memory.focused());
        if let Some(id) = focused.filter(|_| focused != self.last_focused)
            && let Some(response) = ui.ctx().read_response(id)
            && response.layer_id == ui.layer_id()
            && !ui.clip_rect().contains_rect(response.rect)
        {
            ui.scroll_to_rect(response.rect.expand(8.0), None);
        }
        self.last_focused = focused;
    }
}

/// Draws a button that reopens the panel, at the panel's corner.
pub fn show_reopen_button(ctx: &Context, actions: &mut Vec<Action>) {
    let corner = ctx.content_rect().right_top() + vec2(-GAP - icons::ICON_SIZE - 6.0, GAP);
    let area = Area::new(panel_id().with("way back")).fixed_pos(corner).order(Order::Middle);
    cards::show(ctx, area, 60.0, 3, |ui, _| {
        if icons::add_button(ui, Icon::Panel, "Show the panel (P)", true) {
            actions.push(Action::Panel(true));
        }
    });
}

/// Seconds between updates of the focus distance, which changes without any input.
const STATUS_PERIOD_S: f32 = 0.5;

/// Adds a line with the source's status and the focus distance.
fn add_status(ui: &mut Ui, state: &State) {
    let colors = Colors::for_ui(ui);
    let mut parts: Vec<String> = Vec::new();
    if matches!(state.source, Source::Running(_)) {
        // Shortened, to leave room for the focus distance.
        parts.push(truncate_end(state.title(), 34));
    }
    let focused = state.look.effect.follows_depth() && !state.lacks_metres();
    if let Some(metres) = state.focus_m.filter(|metres| focused && metres.is_finite()) {
        parts.push(tr_with("focused at {} m", &[&format_number(metres, 2)]));
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

/// Adds the buttons for undo, redo, reset, help and hiding the panel.
fn add_header(ui: &mut Ui, state: &State, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        let (undo, redo) = state.history.can_undo_redo();
        let buttons = [
            (Icon::Undo, "Undo (Ctrl+Z)", undo, Action::Undo),
            (Icon::Redo, "Redo (Ctrl+Shift+Z)", redo, Action::Redo),
            (Icon::Reset, "Back to the usual look (R)", state.is_look_changed(), Action::Reset),
            (Icon::Help, "Keys (F1)", true, Action::Help(!state.help)),
            (Icon::Close, "Hide the panel (P)", true, Action::Panel(false)),
        ];
        for (icon, hint, enabled, action) in buttons {
            if icons::add_button(ui, icon, hint, enabled) {
                actions.push(action);
            }
        }
    });
}
