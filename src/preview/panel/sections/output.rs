//! Where pictures go besides the window.

use egui::{Align, Align2, Button, CornerRadius, Layout, Role, Sense, Stroke, TextStyle, Ui, Vec2, WidgetInfo, vec2};

use super::Sheet;
use crate::preview::panel::parts::{Hinted, list, path, remark};
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
        // What is neither on nor off is no switch to a screen reader.
        let mut button = |text: &str, hint: &str, is_on: Option<bool>, size: Vec2, action: Action| {
            let button = is_on.into_iter().fold(Button::new(tr(text)).min_size(size), Button::selected);
            if ui.add(button).hint(hint).clicked() {
                sheet.act(action);
            }
        };
        let hint = "Save this picture, with all that is needed to make it again (S)";
        button("Snapshot", hint, None, half - vec2(40.0, 0.0), Action::Snapshot);
        let timer = Action::SelfTimer(!state.self_timer);
        button("3 s", "A snapshot in three seconds (Shift+S)", Some(state.self_timer), vec2(34.0, 28.0), timer);
        let hint = "The command line that does the same, to the clipboard (K)";
        button("Copy command", hint, None, half, Action::CopyCommand);
    });
    if let Some(folder) = &state.kept_in {
        let open = Button::new(tr("Open folder")).min_size(vec2(ui.available_width(), 28.0));
        if ui.add(open).on_hover_text(folder.display().to_string()).clicked() {
            sheet.act(Action::OpenFolder);
        }
    }
    ui.scope(|ui| {
        // The button takes no more room than the name beside it.
        ui.spacing_mut().interact_size.y = 0.0;
        name_and_off(ui, sheet);
    });
    if state.virtual_cameras.is_empty() {
        remark(ui, NO_VIRTUAL_CAMERA);
        return;
    }
    let current = state.virtual_camera().map(|output| output.name.as_str());
    let off = (tr("Off").to_owned(), "", None);
    let cameras =
        state.virtual_cameras.iter().map(|camera| (camera.label.clone(), &camera.name[..], Some(&camera.name[..])));
    let all: Vec<_> = [off].into_iter().chain(cameras).collect();
    let shown = all
        .iter()
        .find(|camera| camera.2 == current)
        .map_or_else(|| current.unwrap_or_default().to_owned(), |camera| camera.0.clone());
    if let Some(camera) = list(ui, "Virtual camera", &shown, all, &current) {
        sheet.act(Action::VirtualCamera(camera.map(str::to_owned)));
    }
}

/// What the virtual camera is called, and the button that keeps pictures from all outputs.
fn name_and_off(ui: &mut Ui, sheet: &mut Sheet) {
    let is_off = sheet.state.off;
    ui.horizontal(|ui| {
        ui.label(tr("Virtual camera")).hint("For calls: other programs see the picture as a camera's (O)");
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let off = ui.add(Button::new(tr("Still card")).small().selected(is_off));
            if off.hint("No picture leaves this program, and the camera rests, until it is on again").clicked() {
                sheet.act(Action::Off(!is_off));
            }
        });
    });
}

/// Draws the button that starts and stops a recording. Whether it was clicked.
fn record_button(ui: &mut Ui, on: bool) -> bool {
    let colors = Colors::here(ui);
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), 32.0), Sense::click());
    let text = tr(if on { "Stop recording" } else { "Record" });
    response.widget_info(|| WidgetInfo::selected(Role::Button, true, on, text));
    let painter = ui.painter();
    painter.rect_filled(rect, CornerRadius::same(8), colors.fill(false, response.hovered()));
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
    response.hint("A video beside the window, until you stop it (V)").clicked()
}
