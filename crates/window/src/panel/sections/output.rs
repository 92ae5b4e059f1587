//! Outputs besides the window.

use egui::Ui;

use super::PanelForm;
use crate::panel::widgets::{Tooltip, add_dropdown, add_path, add_remark};
use crate::state::{Action, NO_VIRTUAL_CAMERA};
use crate::texts::tr;

/// Adds the self-timer, camera off, snapshot options, the command line, and the virtual camera.
pub fn show(ui: &mut Ui, form: &mut PanelForm) {
    let state = form.state;
    if let Some(output) = state.recording().filter(|output| !output.name.is_empty()) {
        add_path(ui, &output.name);
    }
    form.add_switch(ui, "Timer", "A snapshot in three seconds (Shift+S)", state.self_timer, Action::SelfTimer);
    let hint = "No picture leaves this program, and the camera is off: others see a still card";
    form.add_switch(ui, "Camera off", hint, state.off, Action::Off);
    let hint = "Also saves the picture before the blur and its depth: `render --like` makes the snapshot again";
    form.add_switch(ui, "Reproducible snapshots", hint, state.preferences.keep_sources, Action::KeepSources);
    ui.horizontal_wrapped(|ui| {
        let hint = "Copy the equivalent command line to the clipboard (K)";
        form.add_button(ui, "Copy command", hint, Action::CopyCommand);
        if let Some(folder) = &state.saved_in {
            let open = ui.button(tr("Open folder")).on_hover_text(folder.display().to_string());
            if open.clicked() {
                form.push_action(Action::OpenFolder);
            }
        }
    });
    ui.label(tr("Camera for calls")).tooltip("Other programs see the picture as a camera's (O)");
    if state.virtual_cameras.is_empty() {
        add_remark(ui, NO_VIRTUAL_CAMERA);
        return;
    }
    let current = state.virtual_camera().map(|output| output.name.as_str());
    let off = (tr("Off").to_owned(), "", None);
    let cameras =
        state.virtual_cameras.iter().map(|camera| (camera.label.clone(), &camera.name[..], Some(&camera.name[..])));
    let all: Vec<_> = [off].into_iter().chain(cameras).collect();
    // The active camera may have left the list: then its name is shown.
    let shown = all
        .iter()
        .find(|camera| camera.2 == current)
        .map_or_else(|| current.unwrap_or_default().to_owned(), |camera| camera.0.clone());
    if let Some(camera) = add_dropdown(ui, "Camera for calls", &shown, all, &current) {
        form.push_action(Action::VirtualCamera(camera.map(str::to_owned)));
    }
}
