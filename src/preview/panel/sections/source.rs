//! The source, and the camera's controls.

use egui::{ComboBox, Role, Ui};

use super::Sheet;
use crate::knob::Knob;
use crate::preview::panel::parts::{Number, called, number, remark, switch};
use crate::preview::services::Browse;
use crate::preview::state::{Action, Source};
use crate::preview::texts::{tr, tr_with};

/// The source, and others to choose.
pub fn show(ui: &mut Ui, sheet: &mut Sheet) {
    let state = sheet.state;
    let current = state.sources.iter().find(|choice| choice.name == state.source_name);
    let label = match (current, &state.source) {
        (Some(choice), _) => choice.label.as_str(),
        (None, Source::Running(running)) => running.label.as_str(),
        (None, _) if state.source_name.is_empty() => tr("the first camera"),
        (None, _) => state.source_name.as_str(),
    };
    let sources = ComboBox::from_id_salt("source").selected_text(label).truncate().show_ui(ui, |ui| {
        for choice in &state.sources {
            let chosen = choice.name == state.source_name;
            if ui.selectable_label(chosen, &choice.label).on_hover_text(&choice.name).clicked() && !chosen {
                sheet.act(Action::Open(choice.name.clone()));
            }
        }
        if state.sources.is_empty() {
            remark(ui, "Nothing else was found.");
        }
    });
    called(&sources.response, "Source", Role::ComboBox);
    match &state.source {
        Source::Opening => remark(ui, "Opening…"),
        Source::Running(running) => {
            let (width, height) = running.size;
            let rate = 1e9 / running.period_ns.max(1) as f64;
            let depth = tr(if running.has_depth { "with depth" } else { "without depth" });
            remark(ui, &format!("{width} × {height}, {rate:.0} fps, {depth}"));
            remark(ui, &running.executor);
        }
        Source::Lost(why) => remark(ui, &tr_with("Lost: {}", &[why])),
        Source::Ended => remark(ui, "It came to its end."),
    }
    modes(ui, sheet);
    ui.horizontal(|ui| {
        for (text, what) in [("Open folder…", Browse::Folder), ("Open photo…", Browse::Photo)] {
            if ui.button(tr(text)).on_hover_text(tr("It can also be dropped on the window")).clicked() {
                sheet.act(Action::Browse(what));
            }
        }
    });
    ui.horizontal(|ui| {
        if ui.button(tr("Look for others")).on_hover_text(tr("Look again which cameras there are (F5)")).clicked() {
            sheet.act(Action::Refresh);
        }
        if ui.button(tr("Open again")).on_hover_text(tr("Close the source and open it anew")).clicked() {
            sheet.act(Action::Retry);
        }
    });
    if state.takes_plates()[0] {
        let text = if state.plate.is_some() { "Take another plate" } else { "Take a plate" };
        let hint =
            "A picture of what is behind you gives a portrait without any network; the camera has to stand still (T)";
        if ui.button(tr(text)).on_hover_text(tr(hint)).clicked() {
            sheet.act(Action::TakePlate);
        }
    }
}

/// The camera's sizes and rates.
fn modes(ui: &mut Ui, sheet: &mut Sheet) {
    let (state, Source::Running(running)) = (sheet.state, &sheet.state.source) else { return };
    let Some(mode) = state.camera.modes.iter().find(|mode| mode.size == running.size) else { return };
    let now_fps = 1e9 / running.period_ns.max(1) as f64;
    let size_text = |(width, height): (u32, u32)| format!("{width} × {height}");
    let fps_text = |fps: f64| format!("{} fps", (fps * 100.0).round() / 100.0);
    let nearest = |all: &[f64]| all.iter().copied().min_by(|a, b| (a - now_fps).abs().total_cmp(&(b - now_fps).abs()));
    let half = (ui.available_width() - 6.0) / 2.0;
    ui.horizontal(|ui| {
        ui.spacing_mut().combo_width = half;
        ComboBox::from_id_salt("size").width(half).selected_text(size_text(mode.size)).show_ui(ui, |ui| {
            for other in &state.camera.modes {
                let chosen = other.size == mode.size;
                if ui.selectable_label(chosen, size_text(other.size)).clicked() && !chosen {
                    sheet.act(Action::Mode(other.size, nearest(&other.fps).unwrap_or(now_fps)));
                }
            }
        });
        ComboBox::from_id_salt("rate").width(half).selected_text(fps_text(now_fps)).show_ui(ui, |ui| {
            for &fps in &mode.fps {
                let chosen = (fps - now_fps).abs() < 0.1;
                if ui.selectable_label(chosen, fps_text(fps)).clicked() && !chosen {
                    sheet.act(Action::Mode(mode.size, fps));
                }
            }
        });
    });
}

/// The camera's own controls.
pub fn controls(ui: &mut Ui, sheet: &mut Sheet) {
    let state = sheet.state;
    for control in &state.controls {
        let value = ui.add_enabled_ui(control.active, |ui| knob(ui, control)).inner;
        if let Some(value) = value {
            sheet.act(Action::Control(control.name.clone(), value));
        }
    }
}

/// Draws a control of the camera: a switch, a menu or a number. Its new value, if it was changed.
fn knob(ui: &mut Ui, control: &Knob) -> Option<i64> {
    let label = title(&control.name);
    let hint = format!("--control {}={}", control.name, control.value);
    if control.switch {
        return switch(ui, &label, &hint, control.value != 0).then_some(i64::from(control.value == 0));
    }
    if !control.menu.is_empty() {
        let chosen = control.menu.iter().find(|(value, _)| *value == control.value);
        let text = chosen.map_or("?", |(_, name)| name.as_str());
        let mut picked = None;
        ui.label(&label);
        let menu = ComboBox::from_id_salt(&control.name).selected_text(text).truncate().show_ui(ui, |ui| {
            for (value, name) in &control.menu {
                if ui.selectable_label(*value == control.value, name).clicked() {
                    picked = Some(*value);
                }
            }
        });
        called(&menu.response, &label, Role::ComboBox);
        return picked.filter(|&value| value != control.value);
    }
    let (least, most, step) = control.range;
    let mut value = control.value as f32;
    let range = least as f32..=(most.max(least)) as f32;
    let how = Number { label: &label, hint: &hint, range, ratios: false, digits: 0, around: ["", ""] };
    if !number(ui, how, &mut value) {
        return None;
    }
    // The driver takes only whole steps from the least value.
    let steps = ((f64::from(value) - least as f64) / step.max(1) as f64).round() as i64;
    let value = least.saturating_add(steps.saturating_mul(step.max(1)));
    (value != control.value).then_some(value)
}

/// `exposure_auto_priority` as a person would write it.
fn title(name: &str) -> String {
    let mut letters = name.chars().map(|c| if c == '_' { ' ' } else { c });
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
