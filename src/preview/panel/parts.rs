//! The controls that the sections are made of.

use std::ops::RangeInclusive;

use egui::{
    Align, Align2, Context, CornerRadius, DragValue, FontId, Id, Layout, Rect, Response, RichText, Role, Sense, Slider,
    SliderClamping, Stroke, StrokeKind, TextStyle, Ui, Vec2, WidgetInfo, pos2,
};

use super::theme::{Colors, ROW, medium};
use crate::preview::texts::{tr, tr_with};

/// A control for a number.
pub struct Number<'a> {
    /// What it is called.
    pub label: &'a str,
    /// What it does, shown while the pointer rests on it.
    pub hint: &'a str,
    /// Least and largest value.
    pub range: RangeInclusive<f32>,
    /// Whether the slider is logarithmic.
    pub ratios: bool,
    /// Digits after the point.
    pub digits: usize,
    /// Prefix and suffix of the number.
    pub around: [&'a str; 2],
}

/// Draws a name, a number to drag or type, and a slider under them. Whether the number was changed.
pub fn number(ui: &mut Ui, how: Number, value: &mut f32) -> bool {
    let Number { label, hint, range, ratios, digits, around: [before, after] } = how;
    let (label, hint) = (tr(label), tr(hint));
    let mut changed = false;
    ui.scope(|ui| {
        ui.spacing_mut().item_spacing.y = 0.0;
        let name = ui.horizontal(|ui| {
            let name = ui.label(label).on_hover_text(hint);
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                ui.spacing_mut().button_padding = Vec2::new(5.0, 1.0);
                ui.spacing_mut().interact_size = Vec2::new(24.0, 20.0);
                // Dragging over 300 points, the panel's width, covers the range.
                let per_point = (range.end() - range.start()) / 300.0;
                // What was chosen elsewhere may lie outside; it stays until somebody moves it.
                let mut typed = *value;
                let drag = DragValue::new(&mut typed).range(range.clone()).clamp_existing_to_range(false);
                let drag = drag
                    .speed(per_point)
                    .update_while_editing(false)
                    .max_decimals(digits)
                    .min_decimals(digits)
                    .prefix(before)
                    .suffix(after);
                // Many write 1,5.
                let (ctx, shown) = (ui.ctx().clone(), f64::from(*value));
                let drag = drag.custom_parser(|text| {
                    let number: f64 = text.trim().replace(',', ".").parse().ok()?;
                    // On its way through the panel, Tab leaves behind what was there.
                    if (number - shown).abs() > 0.1f64.powi(digits as i32) {
                        say_range(&ctx, (label, before, after), digits, &range, number);
                    }
                    Some(number)
                });
                let is_other = ui.add(drag).labelled_by(name.id).on_hover_text(hint).changed();
                // The keyboard's way through the panel leaves behind the number as it is shown, rounded.
                if is_other && (typed - *value).abs() > 0.501 * 0.1f32.powi(digits as i32) {
                    (*value, changed) = (typed, true);
                }
            });
            name
        });
        ui.spacing_mut().slider_width = ui.available_width();
        ui.spacing_mut().interact_size.y = 20.0;
        // A logarithmic slider that begins at 0 has to begin its decades somewhere.
        let least = if ratios { f64::from(*range.start()).max(1e-3) } else { 0.0 };
        let mut slid = *value;
        let slider = Slider::new(&mut slid, range).clamping(SliderClamping::Edits).show_value(false);
        let slider =
            ui.add(slider.logarithmic(ratios).smallest_positive(least)).labelled_by(name.inner.id).on_hover_text(hint);
        if slider.changed() {
            // A digit more than is shown.
            let steps = 10f32.powi(digits as i32 + 1);
            (*value, changed) = ((slid * steps).round() / steps, true);
        }
    });
    changed
}

/// Where a line for the person waits for the end of the pass.
fn said() -> Id {
    Id::unique("said by a control")
}

/// Says what becomes of a number that was typed, if it cannot be.
fn say_range(
    ctx: &Context,
    (label, before, after): (&str, &str, &str),
    digits: usize,
    range: &RangeInclusive<f32>,
    number: f64,
) {
    // As it is shown: half a step beyond is the end itself.
    let half = 0.5 * 0.1f64.powi(digits as i32);
    let (least, most) = (f64::from(*range.start()), f64::from(*range.end()));
    if number < least - half || number > most + half {
        let taken = if number < least { least } else { most };
        let [least, most, taken] = [least, most, taken].map(|number| format!("{before}{number:.digits$}{after}"));
        let line = tr_with("{} goes from {} to {}: {} was taken.", &[&label, &least, &most, &taken]);
        ctx.data_mut(|data| data.insert_temp(said(), line));
    }
}

/// The line that a control had for the person in this pass.
pub fn take_said(ctx: &Context) -> Option<String> {
    ctx.data_mut(|data| data.remove_temp(said()))
}

/// Draws options side by side, each with a name and a hint; `can` says which may be chosen. The one that was clicked.
pub fn choose(
    ui: &mut Ui,
    what: &str,
    options: &[(&str, &str)],
    chosen: usize,
    can: impl Fn(usize) -> bool,
) -> Option<usize> {
    let colors = Colors::here(ui);
    let what = tr(what);
    let (rect, _) = ui.allocate_exact_size(Vec2::new(ui.available_width(), ROW), Sense::hover());
    ui.painter().rect_filled(rect, CornerRadius::same(7), colors.field);
    let cell_width = rect.width() / options.len().max(1) as f32;
    let mut clicked = None;
    for (index, (name, hint)) in options.iter().map(|(name, hint)| (tr(name), tr(hint))).enumerate() {
        let left = rect.left() + cell_width * index as f32;
        let cell = Rect::from_min_size(pos2(left, rect.top()), Vec2::new(cell_width, ROW));
        let (is_chosen, is_possible) = (index == chosen, can(index));
        let sense = if is_possible { Sense::click() } else { Sense::hover() };
        let response = ui.interact(cell, ui.scope_id().with((what, index)), sense);
        response
            .widget_info(|| WidgetInfo::selected(Role::RadioButton, is_possible, is_chosen, format!("{what}: {name}")));
        let inner = cell.shrink(2.0);
        let text = if is_chosen {
            ui.painter().rect_filled(inner, CornerRadius::same(6), colors.accent);
            colors.on_accent
        } else if !is_possible {
            colors.weak.gamma_multiply(0.6)
        } else {
            if response.hovered() {
                ui.painter().rect_filled(inner, CornerRadius::same(6), colors.hover);
            }
            colors.text
        };
        let family = if is_chosen { medium() } else { egui::FontFamily::Proportional };
        let font = FontId::new(12.5, family);
        ui.painter().with_clip_rect(cell).text(inner.center(), Align2::CENTER_CENTER, name, font, text);
        if response.on_hover_text(hint).clicked() {
            clicked = Some(index);
        }
    }
    clicked
}

/// Draws a name and a switch. Whether it was clicked.
pub fn switch(ui: &mut Ui, label: &str, hint: &str, on: bool) -> bool {
    let colors = Colors::here(ui);
    let (label, hint) = (tr(label), tr(hint));
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), 24.0), Sense::click());
    response.widget_info(|| WidgetInfo::selected(Role::Switch, ui.is_enabled(), on, label));
    let track = Rect::from_center_size(pos2(rect.right() - 17.0, rect.center().y), Vec2::new(32.0, 18.0));
    let fill = match (on, response.hovered()) {
        (true, _) => colors.accent,
        (false, true) => colors.hover,
        (false, false) => colors.field,
    };
    let painter = ui.painter();
    painter.rect_filled(track, CornerRadius::same(9), fill);
    painter.rect_stroke(track, CornerRadius::same(9), Stroke::new(1.0, colors.line), StrokeKind::Inside);
    let x = if on { track.right() - 9.0 } else { track.left() + 9.0 };
    painter.circle_filled(pos2(x, track.center().y), 6.5, if on { colors.on_accent } else { colors.weak });
    let font = TextStyle::Body.resolve(ui.style());
    painter.text(rect.left_center(), Align2::LEFT_CENTER, label, font, ui.visuals().text_color());
    response.on_hover_text(hint).clicked()
}

/// Tells a screen reader what a list or a field is called.
pub fn called(control: &Response, name: &str, role: Role) {
    control.widget_info(|| WidgetInfo::labeled(role, control.enabled(), tr(name)));
}

/// A line of explanation.
pub fn remark(ui: &mut Ui, text: &str) {
    let colors = Colors::here(ui);
    ui.label(RichText::new(tr(text)).text_style(TextStyle::Small).color(colors.weak));
}

/// A path, of which the end says which file it is: a long one is cut at its beginning.
pub fn path(ui: &mut Ui, path: &str) {
    const MOST: usize = 38;
    let over = path.chars().count().saturating_sub(MOST);
    let cut = path.chars().skip(over + 1).collect::<String>();
    ui.scope(|ui| remark(ui, &if over == 0 { path.to_owned() } else { format!("…{cut}") }))
        .response
        .on_hover_text(path);
}

/// Draws a part of the panel, unless it is folded. Whether its title was clicked.
pub fn section(ui: &mut Ui, name: &str, open: bool, body: impl FnOnce(&mut Ui)) -> bool {
    let colors = Colors::here(ui);
    ui.add_space(4.0);
    let title = RichText::new(tr(name)).family(medium()).size(13.5).color(colors.text);
    let header = egui::CollapsingHeader::new(title).id_salt(name).open(Some(open)).icon(super::icons::chevron);
    let folded = header.show_unindented(ui, |ui| {
        ui.add_space(2.0);
        body(ui);
    });
    folded.header_response.clicked()
}
