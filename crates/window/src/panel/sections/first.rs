//! The first screen, with the essential controls: camera, portrait, blur strength, background, recording, and calls.

use egui::{Align, Button, Layout, Role, Sense, Slider, TextStyle, Ui, Vec2, WidgetInfo, WidgetText, vec2};

use super::{PanelForm, backdrop};
use crate::panel::dock::{CELL, CELL_GAP, CELLS};
use crate::panel::widgets::{Tooltip, add_dropdown, add_switch};
use crate::panel::{icons, theme::Colors};
use crate::state::{Action, tweak};
use crate::texts::{tr, tr_with};
use bokehcam::look::{Effect, MAX_COC_PER_HEIGHT};

/// Name of the section with all other settings.
const MORE: &str = "More";

/// Draws the controls in `columns` columns.
pub fn show(ui: &mut Ui, form: &mut PanelForm, columns: usize) {
    let width = ((ui.available_width() - CELL_GAP * (columns - 1) as f32) / columns as f32).max(20.0);
    let cells: [fn(&mut Ui, &mut PanelForm); CELLS] = [
        add_source_list,
        add_portrait_switch,
        add_blur_slider,
        backdrop::add_background_choice,
        add_save_buttons,
        add_virtual_camera_switch,
        add_more_button,
    ];
    ui.scope(|ui| {
        ui.spacing_mut().item_spacing = Vec2::splat(CELL_GAP);
        for row in cells.chunks(columns) {
            ui.horizontal(|ui| {
                for cell in row {
                    ui.allocate_ui_with_layout(vec2(width, CELL), Layout::left_to_right(Align::Center), |ui| {
                        ui.set_min_size(vec2(width, CELL));
                        ui.set_max_width(width);
                        ui.spacing_mut().combo_width = width;
                        ui.spacing_mut().interact_size.y = CELL;
                        cell(ui, form);
                    });
                }
            });
        }
    });
}

/// Adds the list of sources.
fn add_source_list(ui: &mut Ui, form: &mut PanelForm) {
    let state = form.state;
    let shown = match state.title() {
        "" => tr("the first camera"),
        title => title,
    };
    let sources = state.sources.iter().map(|choice| (choice.label.clone(), &choice.name[..], &choice.name[..]));
    let shown = tr_with("Camera: {}", &[&shown]);
    if let Some(name) = add_dropdown(ui, "Camera", &shown, sources, &&state.source_name[..]) {
        form.push_action(Action::Open(name.to_owned()));
    }
}

/// Adds the switch for blur by depth.
fn add_portrait_switch(ui: &mut Ui, form: &mut PanelForm) {
    let on = form.follows_depth() && form.has_depth();
    let hint = "More blur, the farther from the subject in focus";
    if add_switch(ui, "Portrait", hint, on) {
        form.push_action(Action::Portrait(!on));
    }
}

/// Adds the slider for the blur strength.
fn add_blur_slider(ui: &mut Ui, form: &mut PanelForm) {
    let focus_m = form.state.focus_distance_m();
    let fraction = tweak::blur_fraction(&form.look, focus_m, form.size);
    let enabled = form.look.effect != Effect::None;
    ui.add_enabled_ui(enabled, |ui| {
        let name = ui.label(tr("Blur"));
        ui.spacing_mut().slider_width = ui.available_width().max(10.0);
        ui.spacing_mut().interact_size.y = 20.0;
        let max_percent = MAX_COC_PER_HEIGHT * 100.0;
        let mut percent = (fraction * 100.0).min(max_percent);
        let slider = ui.add(Slider::new(&mut percent, 0.0..=max_percent).show_value(false)).labelled_by(name.id);
        if slider
            .tooltip("How much the background is blurred. The mouse wheel over the picture does the same")
            .changed()
        {
            tweak::set_blur_fraction(&mut form.look, percent / 100.0, focus_m, form.size);
            form.stroke = Some("Amount of blur");
        }
    });
}

/// Adds the buttons for recordings and snapshots.
fn add_save_buttons(ui: &mut Ui, form: &mut PanelForm) {
    let recording = form.state.recording().is_some();
    let snapshot = icons::ICON_SIZE + 18.0;
    let record = vec2((ui.available_width() - snapshot - CELL_GAP).max(10.0), CELL);
    if add_record_button(ui, recording, record) {
        form.push_action(Action::Record(!recording));
    }
    let (rect, response) = ui.allocate_exact_size(vec2(snapshot, CELL), Sense::click());
    response.widget_info(|| WidgetInfo::labeled(Role::Button, true, tr("Snapshot")));
    let colors = Colors::for_ui(ui);
    ui.painter().rect_filled(rect, 8, colors.fill(false, response.hovered()));
    icons::draw_camera(ui.painter(), rect.center(), colors.text);
    if response.tooltip("Snapshot: save this picture (S)").clicked() {
        form.push_action(Action::Snapshot);
    }
}

/// Adds the button that starts and stops a recording. Returns whether it was clicked.
fn add_record_button(ui: &mut Ui, on: bool, size: Vec2) -> bool {
    let colors = Colors::for_ui(ui);
    let (rect, response) = ui.allocate_exact_size(size, Sense::click());
    let text = tr(if on { "Stop recording" } else { "Record" });
    response.widget_info(|| WidgetInfo::selected(Role::Button, true, on, text));
    ui.painter().rect_filled(rect, 8, colors.fill(false, response.hovered()));
    if on {
        ui.painter().rect_stroke(rect, 8, egui::Stroke::new(1.5, colors.alarm), egui::StrokeKind::Inside);
    }
    let text = WidgetText::from(text).color(colors.text);
    let max_width = (rect.width() - 40.0).max(10.0);
    let name = text.into_galley(ui, Some(egui::TextWrapMode::Truncate), max_width, TextStyle::Button);
    let left = rect.center().x - (name.size().x + 22.0) / 2.0;
    icons::draw_record(ui.painter(), egui::pos2(left + 7.0, rect.center().y), on, colors.alarm);
    ui.painter().galley(egui::pos2(left + 22.0, rect.center().y - name.size().y / 2.0), name, colors.text);
    response.tooltip("A video beside the window, until you stop it (V)").clicked()
}

/// Adds the switch for the virtual camera.
fn add_virtual_camera_switch(ui: &mut Ui, form: &mut PanelForm) {
    let state = form.state;
    let current = state.virtual_camera();
    let hint = "Other programs see this picture as a camera's (O)";
    if add_switch(ui, "Use in calls", hint, current.is_some()) {
        let first = state.virtual_cameras.first().map(|camera| camera.name.clone());
        form.push_action(Action::VirtualCamera(if current.is_some() { None } else { first }));
    }
}

/// Adds the button that expands the panel.
fn add_more_button(ui: &mut Ui, form: &mut PanelForm) {
    let open = form.state.is_expanded();
    let text = tr_with(if open { "{} Less" } else { "{} More" }, &[&if open { "−" } else { "+" }]);
    let button = Button::new(text).truncate().min_size(vec2(ui.available_width(), CELL));
    let button = ui.add(button).tooltip("All other settings");
    button.widget_info(|| WidgetInfo::selected(Role::Button, true, open, tr(MORE)));
    if button.clicked() {
        form.push_action(Action::Section(MORE, !open));
    }
}
