//! Presets: looks by name.

use egui::{Align2, CornerRadius, FontFamily, FontId, Rect, Role, Sense, TextEdit, Ui, Vec2, WidgetInfo, vec2};

use super::Sheet;
use crate::look::Effect;
use crate::look::presets::Preset;
use crate::preview::panel::theme::focus_ring;
use crate::preview::panel::theme::{Colors, medium};
use crate::preview::state::Action;

/// A preset that is being named.
#[derive(Debug, Default)]
pub struct Saving {
    /// The name as typed so far, while one is asked for.
    name: Option<String>,
    /// Whether the text field is new and still needs the focus.
    ask_focus: bool,
}

/// The presets, and a way to save one.
pub fn show(ui: &mut Ui, sheet: &mut Sheet, saving: &mut Saving) {
    let mut asked = false;
    ui.scope(|ui| {
        ui.spacing_mut().item_spacing = vec2(6.0, 6.0);
        ui.horizontal_wrapped(|ui| {
            let state = sheet.state;
            for (index, preset) in state.presets.iter().enumerate() {
                let needs_depth = preset.patch.effect.is_some_and(Effect::follows_depth);
                let possible = !needs_depth || sheet.has_depth();
                if chip(ui, index, preset, state.is_in_use(preset), possible) {
                    sheet.act(Action::Preset(preset.name.clone()));
                }
            }
            if saving.name.is_none() && ui.button("Save as…").on_hover_text("Save this look under a name").clicked() {
                *saving = Saving { name: Some(String::new()), ask_focus: true };
                // In the pass of the click it has the focus itself.
                ui.ctx().request_repaint();
                asked = true;
            }
        });
    });
    if let Some(name) = saving.name.as_mut().filter(|_| !asked) {
        let mut done = false;
        ui.horizontal(|ui| {
            let edit = TextEdit::singleline(name).hint_text("name").desired_width(150.0).char_limit(40);
            let edit = ui.add(edit);
            if std::mem::take(&mut saving.ask_focus) {
                edit.request_focus();
            }
            let entered = edit.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
            if (ui.button("Save").clicked() || entered) && !name.trim().is_empty() {
                sheet.actions.push(Action::SavePreset(name.trim().to_owned()));
                done = true;
            }
            let escaped = edit.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Escape));
            done |= ui.button("Cancel").clicked() || escaped;
        });
        if done {
            saving.name = None;
        }
    }
}

/// Draws a preset with the number of its key. Whether it was clicked.
fn chip(ui: &mut Ui, index: usize, preset: &Preset, chosen: bool, possible: bool) -> bool {
    let colors = Colors::here(ui);
    let family = if chosen { medium() } else { FontFamily::Proportional };
    let shown = capitalized(&preset.name);
    let (text, number_color) = match (chosen, possible) {
        (true, _) => (colors.on_accent, colors.on_accent),
        (false, true) => (colors.text, colors.weak),
        (false, false) => (colors.weak.gamma_multiply(0.6), colors.weak.gamma_multiply(0.6)),
    };
    let name = ui.painter().layout_no_wrap(shown, FontId::new(13.0, family), text);
    // The keys 1 to 9.
    let has_key = index < 9;
    let room = if has_key { 14.0 } else { 0.0 };
    let size = vec2((name.size().x + room + 20.0).min(ui.max_rect().width()), 28.0);
    let sense = if possible { Sense::click() } else { Sense::hover() };
    let (rect, response) = ui.allocate_exact_size(size, sense);
    response.widget_info(|| WidgetInfo::selected(Role::RadioButton, possible, chosen, &preset.name));
    let fill = match (chosen, possible && response.hovered()) {
        (true, _) => colors.accent,
        (false, true) => colors.hover,
        (false, false) => colors.field,
    };
    let painter = ui.painter();
    painter.rect_filled(rect, CornerRadius::same(14), fill);
    if has_key {
        let at = Rect::from_min_size(rect.min, Vec2::new(24.0, rect.height())).center();
        let font = FontId::new(11.0, FontFamily::Proportional);
        painter.text(at, Align2::CENTER_CENTER, index + 1, font, number_color);
    }
    painter.galley(rect.left_center() + vec2(10.0 + room, -name.size().y / 2.0), name, text);
    focus_ring(ui, &response, rect);
    let hint = match (possible, preset.own) {
        (false, _) => "needs depth, which this source has not",
        (true, true) => "your own look",
        (true, false) => "a ready-made look",
    };
    response.on_hover_text(hint).clicked()
}

fn capitalized(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
