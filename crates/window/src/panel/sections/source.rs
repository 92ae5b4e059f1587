//! The source, and the camera's controls.

use egui::Ui;

use super::PanelForm;
use crate::panel::widgets::{Number, add_choice, add_dropdown, add_number, add_remark, add_switch};
use crate::services::PathKind;
use crate::state::{Action, DepthMethod, Source};
use crate::texts::{tr, tr_with};
use bokehcam_live::camera_control::CameraControl;

/// The depth methods with their tooltips.
const DEPTH_METHODS: [(&str, &str, DepthMethod); 5] = [
    ("Measured", "From a depth camera, or from the recording", DepthMethod::Measured),
    ("Two cameras", "From two cameras side by side", DepthMethod::Stereo),
    ("Person", "A network finds the person in the picture", DepthMethod::Person),
    (
        "Person and distance",
        "Also, another network estimates the distance of everything else",
        DepthMethod::PersonAndMonoDepth,
    ),
    ("Empty room", "A picture of the room without you: step out for four seconds (T)", DepthMethod::Plate),
];

/// Adds the source's properties, its depth methods, and buttons to open another source.
pub fn show(ui: &mut Ui, form: &mut PanelForm) {
    let state = form.state;
    match &state.source {
        Source::Opening => add_remark(ui, "Opening…"),
        Source::Running(running) => {
            let (width, height) = running.size;
            let rate = 1e9 / running.period_ns.max(1) as f64;
            let depth = tr(match running.depth_method {
                _ if !running.has_depth => "without depth",
                Some(DepthMethod::Person) => "the person from a network",
                _ => "with depth",
            });
            add_remark(
                ui,
                &match state.is_photo() {
                    true => format!("{width} × {height}, {depth}"),
                    false => format!("{width} × {height}, {rate:.0} fps, {depth}"),
                },
            );
            let methods: Vec<_> =
                DEPTH_METHODS.into_iter().filter(|(.., method)| running.depth_methods.contains(method)).collect();
            // Offered only if there is a choice: several methods, or one that is off.
            if methods.len() > 1 || running.depth_method.is_none() && !methods.is_empty() {
                ui.label(tr("Depth from"));
                let chosen = add_choice(
                    ui,
                    "Depth from",
                    &methods.iter().map(|(name, hint, method)| (*name, *hint, Some(*method))).collect::<Vec<_>>(),
                    running.depth_method,
                    |_| true,
                );
                if let Some(method) = chosen.flatten().filter(|method| Some(*method) != running.depth_method) {
                    form.push_action(Action::SetDepthMethod(method));
                }
            }
        }
        Source::Lost(why) => add_remark(ui, &tr_with("Lost: {}", &[why])),
        Source::Ended => add_remark(ui, "It has ended."),
    }
    add_modes(ui, form);
    let hint = "You can also drop it on the window";
    ui.horizontal_wrapped(|ui| {
        form.add_button(ui, "Open folder…", hint, Action::Browse(PathKind::Folder));
        form.add_button(ui, "Open photo…", hint, Action::Browse(PathKind::Photo));
        if state.plate.is_some() {
            let hint = "A picture of the room without you; the camera must not move (T)";
            form.add_button(ui, "Take another plate", hint, Action::CapturePlate);
        }
    });
}

/// Adds a description of the executor that blurs.
pub fn add_executor(ui: &mut Ui, form: &PanelForm) {
    if let Source::Running(running) = &form.state.source {
        add_remark(ui, &running.executor);
    }
}

/// Adds lists of the camera's frame sizes and rates.
fn add_modes(ui: &mut Ui, form: &mut PanelForm) {
    let (state, Source::Running(running)) = (form.state, &form.state.source) else { return };
    let Some(mode) = state.camera.modes.iter().find(|mode| mode.size == running.size) else { return };
    let now_fps = 1e9 / running.period_ns.max(1) as f64;
    let off_by = |fps: &f64| (fps - now_fps).abs();
    let nearest = |all: &[f64]| all.iter().copied().min_by(|a, b| off_by(a).total_cmp(&off_by(b)));
    let size_text = |(width, height): (u32, u32)| format!("{width} × {height}");
    let fps_text = |fps: f64| format!("{} fps", (fps * 100.0).round() / 100.0);
    let sizes = state.camera.modes.iter().map(|mode| (size_text(mode.size), "", mode.size));
    let rates = mode.fps.iter().map(|&fps| (fps_text(fps), "", fps));
    let rate = nearest(&mode.fps).filter(|fps| off_by(fps) < 0.1).unwrap_or(now_fps);
    let [size, rate] = ui
        .horizontal(|ui| {
            ui.spacing_mut().combo_width = (ui.available_width() - 6.0) / 2.0;
            let size = add_dropdown(ui, "Size", &size_text(mode.size), sizes, &mode.size);
            let size = size.and_then(|size| state.camera.modes.iter().find(|mode| mode.size == size));
            let size = size.map(|mode| (mode.size, nearest(&mode.fps).unwrap_or(now_fps)));
            [size, add_dropdown(ui, "Frame rate", &fps_text(now_fps), rates, &rate).map(|fps| (mode.size, fps))]
        })
        .inner;
    if let Some((size, fps)) = size.or(rate) {
        form.push_action(Action::Mode(size, fps));
    }
}

/// Adds the camera's driver controls.
pub fn add_controls(ui: &mut Ui, form: &mut PanelForm) {
    let state = form.state;
    for control in &state.controls {
        let value = ui.add_enabled_ui(control.is_active, |ui| add_control(ui, control)).inner;
        if let Some(value) = value {
            form.push_action(Action::Control(control.name.clone(), value));
        }
    }
}

/// Adds a driver control as a switch, a menu or a number. Returns its new value if it changed.
fn add_control(ui: &mut Ui, control: &CameraControl) -> Option<i64> {
    let label = readable_name(&control.name);
    let hint = format!("--control {}={}", control.name, control.value);
    if control.is_boolean {
        return add_switch(ui, &label, &hint, control.value != 0).then_some(i64::from(control.value == 0));
    }
    if !control.menu.is_empty() {
        let chosen = control.menu.iter().find(|(value, _)| *value == control.value);
        let text = chosen.map_or("?", |(_, name)| name.as_str());
        ui.label(&label);
        let options = control.menu.iter().map(|(value, name)| (name.clone(), "", *value));
        return add_dropdown(ui, &label, text, options, &control.value);
    }
    let (min, max, step) = control.range;
    let mut value = control.value as f32;
    let range = min as f32..=(max.max(min)) as f32;
    if !add_number(ui, &Number::new(&label, &hint, range, 0), &mut value) {
        return None;
    }
    // Drivers accept only multiples of the step from the minimum.
    let steps = ((f64::from(value) - min as f64) / step.max(1) as f64).round() as i64;
    let value = min.saturating_add(steps.saturating_mul(step.max(1)));
    (value != control.value).then_some(value)
}

/// Returns a control's name in readable form: `exposure_auto_priority` becomes "Exposure auto priority".
fn readable_name(name: &str) -> String {
    let mut letters = name.chars().map(|c| if c == '_' { ' ' } else { c });
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
