//! Where pictures go besides the window.

use egui::{Align2, ComboBox, CornerRadius, Role, Sense, Stroke, TextStyle, Ui, Vec2, WidgetInfo, vec2};

use super::Sheet;
use crate::preview::panel::parts::{called, path, remark};
use crate::preview::panel::{icons, theme::Colors};
use crate::preview::state::{Action, NO_VIRTUAL_CAMERA};
use crate::preview::texts::tr;

/// Snapshot, recording, virtual camera and the command.
pub fn show(ui: &mut Ui, sheet: &mut Sheet) {
    let state = sheet.state;
    let recording = state.recording();
    if record_button(ui, recording.is_some()) {
        sheet.act(Action::Record(recording.is_none()));
    }
    if let Some(output) = recording.filter(|output| !output.name.is_empty()) {
        path(ui, &output.name);
    }
    let half = vec2((ui.available_width() - 6.0) / 2.0, 28.0);
    ui.horizontal(|ui| {
        let timer = egui::Button::new(tr("3 s")).selected(state.self_timer).min_size(vec2(34.0, 28.0));
        let snapshot = egui::Button::new(tr("Snapshot")).min_size(half - vec2(40.0, 0.0));
        if ui
            .add(snapshot)
            .on_hover_text(tr("Save this picture, with all that is needed to make it again (S)"))
            .clicked()
        {
            sheet.act(Action::Snapshot);
        }
        if ui.add(timer).on_hover_text(tr("A snapshot in three seconds (Shift+S)")).clicked() {
            sheet.act(Action::SelfTimer(!state.self_timer));
        }
        let copy = egui::Button::new(tr("Copy command")).min_size(half);
        if ui.add(copy).on_hover_text(tr("The command line that does the same, to the clipboard (K)")).clicked() {
            sheet.act(Action::CopyCommand);
        }
    });
    if let Some(folder) = &state.kept_in {
        let open = egui::Button::new(tr("Open folder")).min_size(vec2(ui.available_width(), 28.0));
        if ui.add(open).on_hover_text(folder.display().to_string()).clicked() {
            sheet.act(Action::OpenFolder);
        }
    }
    ui.label(tr("Virtual camera")).on_hover_text(tr("For calls: other programs see the picture as a camera's (O)"));
    if state.virtual_cameras.is_empty() {
        remark(ui, NO_VIRTUAL_CAMERA);
        return;
    }
    let current = state.virtual_camera();
    let label = |name: &str| {
        let choice = state.virtual_cameras.iter().find(|choice| choice.name == name);
        choice.map_or_else(|| name.to_owned(), |choice| choice.label.clone())
    };
    let text = current.map_or_else(|| tr("Off").to_owned(), |output| label(&output.name));
    let cameras = ComboBox::from_id_salt("virtual camera").selected_text(text).truncate().show_ui(ui, |ui| {
        if ui.selectable_label(current.is_none(), tr("Off")).clicked() && current.is_some() {
            sheet.act(Action::VirtualCamera(None));
        }
        for choice in &state.virtual_cameras {
            let chosen = current.is_some_and(|output| output.name == choice.name);
            if ui.selectable_label(chosen, &choice.label).on_hover_text(&choice.name).clicked() && !chosen {
                sheet.act(Action::VirtualCamera(Some(choice.name.clone())));
            }
        }
    });
    called(&cameras.response, "Virtual camera", Role::ComboBox);
}

/// Draws the button that starts and stops a recording. Whether it was clicked.
fn record_button(ui: &mut Ui, on: bool) -> bool {
    let colors = Colors::here(ui);
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), 32.0), Sense::click());
    let text = tr(if on { "Stop recording" } else { "Record" });
    response.widget_info(|| WidgetInfo::selected(Role::Button, true, on, text));
    let painter = ui.painter();
    painter.rect_filled(rect, CornerRadius::same(8), if response.hovered() { colors.hover } else { colors.field });
    if on {
        let border = Stroke::new(1.5, colors.alarm);
        painter.rect_stroke(rect, CornerRadius::same(8), border, egui::StrokeKind::Inside);
    }
    let font = TextStyle::Button.resolve(ui.style());
    let name = painter.layout_no_wrap(text.to_owned(), font, colors.text);
    let left = rect.center().x - (name.size().x + 22.0) / 2.0;
    icons::record(painter, egui::pos2(left + 7.0, rect.center().y), on, colors.alarm);
    let at = egui::pos2(left + 22.0, rect.center().y);
    painter.galley(Align2::LEFT_CENTER.anchor_size(at, name.size()).min, name, colors.text);
    response.on_hover_text(tr("A video beside the window, until you stop it (V)")).clicked()
}
