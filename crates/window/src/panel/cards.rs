//! Cards over the picture, with text and buttons.

use egui::{Align2, Area, Context, Id, Label, Margin, Order, Rect, RichText, Ui, pos2};

use super::dock::picture_area;
use super::state::Action;
use super::theme::{Colors, GAP, card_frame, medium_font};
use super::widgets::add_button;
use crate::texts::tr;

/// Draws a card in `area`, limited to `width` points and to the window's width. Returns its rectangle.
pub fn show(
    ctx: &Context,
    area: Area,
    width: f32,
    margin: impl Into<Margin>,
    content: impl FnOnce(&mut Ui, &Colors),
) -> Rect {
    let drawn = area.fade_in(false).show(ctx, |ui| {
        let colors = Colors::for_ui(ui);
        ui.set_max_width((picture_area(ctx).width() - 2.0 * GAP).min(width).max(60.0));
        card_frame(&colors).inner_margin(margin).show(ui, |ui| content(ui, &colors));
    });
    drawn.response.rect
}

pub fn add_title(ui: &mut Ui, text: &str) {
    ui.label(RichText::new(tr(text)).family(medium_font()).size(16.0));
}

/// Adds wrapped text; nothing if it is empty.
pub fn add_paragraph(ui: &mut Ui, colors: &Colors, text: &str) {
    if !text.is_empty() {
        ui.add(Label::new(RichText::new(tr(text)).color(colors.text)).wrap());
    }
}

/// Cards stacked upwards from the bottom of the picture, so that they do not cover faces.
pub struct CardStack<'a> {
    pub ctx: &'a Context,
    /// Distance from the bottom of the picture's area to the next card, in points.
    pub bottom: f32,
}

impl CardStack<'_> {
    /// Adds a card without controls. A click on it does not reach the picture below.
    pub fn add_text(&mut self, id: Id, width: f32, opacity: f32, text: &str) {
        let area = Area::new(id).order(Order::Foreground);
        self.add(area, width, Margin::symmetric(14, 9), |ui, colors| {
            ui.set_opacity(opacity);
            add_paragraph(ui, colors, text);
        });
    }

    /// Adds a card with buttons, given as text, hint and action.
    pub fn add_buttons(
        &mut self,
        id: &str,
        width: f32,
        [heading, why]: [&str; 2],
        buttons: impl IntoIterator<Item = (&'static str, &'static str, Action)>,
        actions: &mut Vec<Action>,
    ) {
        let area = Area::new(Id::unique(id)).order(Order::Middle);
        self.add(area, width, 14, |ui, colors| {
            add_title(ui, heading);
            add_paragraph(ui, colors, why);
            ui.add_space(2.0);
            ui.horizontal_wrapped(|ui| {
                for (text, hint, action) in buttons {
                    if add_button(ui, text, hint) {
                        actions.push(action);
                    }
                }
            });
        });
    }

    /// Adds a card with custom content.
    pub fn add_card(&mut self, id: &str, width: f32, content: impl FnOnce(&mut Ui, &Colors)) {
        self.add(Area::new(Id::unique(id)).order(Order::Foreground), width, Margin::symmetric(18, 10), content);
    }

    fn add(&mut self, area: Area, width: f32, margin: impl Into<Margin>, content: impl FnOnce(&mut Ui, &Colors)) {
        let free = picture_area(self.ctx);
        let at = pos2(free.center().x, free.bottom() - self.bottom);
        let area = area.pivot(Align2::CENTER_BOTTOM).fixed_pos(at);
        self.bottom += show(self.ctx, area, width, margin, content).height() + 6.0;
    }
}
