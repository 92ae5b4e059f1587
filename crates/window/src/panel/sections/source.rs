//! The source, and the camera's controls.

use egui::Ui;

use super::Sheet;
use crate::panel::parts::{Number, choose, dropdown, number, remark, switch};
use crate::services::Browse;
use crate::state::{Action, DepthMethod, Source};
use crate::texts::{tr, tr_with};
use bokehcam::camera_control::CameraControl;

/// The depth methods with their tooltips.
const WAYS: [(&str, &str, DepthMethod); 5] = [
    ("Measured", "From a depth camera, or from the recording", DepthMethod::Measured),
    ("Two cameras", "From two cameras side by side", DepthMethod::Stereo),
    ("Person", "A network finds the person in the picture", DepthMethod::Person),
    (
        "Person and distance",
        "Also, another network estimates the distance of everything \
                             else",
        DepthMethod::PersonAndDistance,
    ),
    ("Empty room", "A picture of the room without you: step out for four seconds (T)", DepthMethod::Plate),
];

/// Adds the source's properties, its depth methods, and buttons to open another source.
pub fn show(ui: &mut Ui, sheet: &mut Sheet) {
    let state = sheet.state;
    match &state.source {
        Source::Opening => remark(ui, "Opening…"),
        Source::Running(running) => {
            let (width, height) = running.size;
            let rate = 1e9 / running.period_ns.max(1) as f64;
            let depth = tr(match running.way {
                _ if !running.has_depth => "without depth",
                Some(DepthMethod::Person) => "the person from a network",
                _ => "with depth",
            });
            remark(
                ui,
                &match state.is_photo() {
                    true => format!("{width} × {height}, {depth}"),
                    false => format!("{width} × {height}, {rate:.0} fps, {depth}"),
                },
            );
            let ways: Vec<_> = WAYS.into_iter().filter(|(.., way)| running.ways.contains(way)).collect();
            // Offered only if there is a choice: several methods, or one that is off.
            if ways.len() > 1 || running.way.is_none() && !ways.is_empty() {
                ui.label(tr("Depth from"));
                let chosen = choose(
                    ui,
                    "Depth from",
                    &ways.iter().map(|way| (way.0, way.1, Some(way.2))).collect::<Vec<_>>(),
                    running.way,
                    |_| true,
                );
                if let Some(way) = chosen.flatten().filter(|way| Some(*way) != running.way) {
                    sheet.act(Action::DepthBy(way));
                }
            }
        }
        Source::Lost(why) => remark(ui, &tr_with("Lost: {}", &[why])),
        Source::Ended => remark(ui, "It has ended."),
    }
    modes(ui, sheet);
    let hint = "You can also drop it on the window";
    ui.horizontal_wrapped(|ui| {
        sheet.button(ui, "Open folder…", hint, Action::Browse(Browse::Folder));
        sheet.button(ui, "Open photo…", hint, Action::Browse(Browse::Photo));
        if state.plate.is_some() {
            let hint = "A picture of the room without you; the camera must not move (T)";
            sheet.button(ui, "Take another plate", hint, Action::TakePlate);
        }
    });
}

/// Adds a description of the executor that blurs.
pub fn executor(ui: &mut Ui, sheet: &Sheet) {
    if let Source::Running(running) = &sheet.state.source {
        remark(ui, &running.executor);
    }
}

/// Adds lists of the camera's frame sizes and rates.
fn modes(ui: &mut Ui, sheet: &mut Sheet) {
    let (state, Source::Running(running)) = (sheet.state, &sheet.state.source) else { return };
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
            let size = dropdown(ui, "Size", &size_text(mode.size), sizes, &mode.size);
            let size = size.and_then(|size| state.camera.modes.iter().find(|mode| mode.size == size));
            let size = size.map(|mode| (mode.size, nearest(&mode.fps).unwrap_or(now_fps)));
            [size, dropdown(ui, "Frame rate", &fps_text(now_fps), rates, &rate).map(|fps| (mode.size, fps))]
        })
        .inner;
    if let Some((size, fps)) = size.or(rate) {
        sheet.act(Action::Mode(size, fps));
    }
}

/// Adds the camera's driver controls.
pub fn controls(ui: &mut Ui, sheet: &mut Sheet) {
    let state = sheet.state;
    for control in &state.controls {
        let value = ui.add_enabled_ui(control.is_active, |ui| knob(ui, control)).inner;
        if let Some(value) = value {
            sheet.act(Action::Control(control.name.clone(), value));
        }
    }
}

/// Adds a driver control as a switch, a menu or a number. Returns its new value if it changed.
fn knob(ui: &mut Ui, control: &CameraControl) -> Option<i64> {
    let label = title(&control.name);
    let hint = format!("--control {}={}", control.name, control.value);
    if control.is_boolean {
        return switch(ui, &label, &hint, control.value != 0).then_some(i64::from(control.value == 0));
    }
    if !control.menu.is_empty() {
        let chosen = control.menu.iter().find(|(value, _)| *value == control.value);
        let text = chosen.map_or("?", |(_, name)| name.as_str());
        ui.label(&label);
        let options = control.menu.iter().map(|(value, name)| (name.clone(), "", *value));
        return dropdown(ui, &label, text, options, &control.value);
    }
    let (min, max, step) = control.range;
    let mut value = control.value as f32;
    let range = min as f32..=(max.max(min)) as f32;
    if !number(ui, &Number::new(&label, &hint, range, 0), &mut value) {
        return None;
    }
    // Drivers accept only multiples of the step from the minimum.
    let steps = ((f64::from(value) - min as f64) / step.max(1) as f64).round() as i64;
    let value = min.saturating_add(steps.saturating_mul(step.max(1)));
    (value != control.value).then_some(value)
}

/// Returns a control's name in readable form: `exposure_auto_priority` becomes "Exposure auto priority".
fn title(name: &str) -> String {
    let mut letters = name.chars().map(|c| if c == '_' { ' ' } else { c });
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
