//! The virtual background, and auto-framing.

use egui::{Role, Ui, WidgetInfo};

use super::PanelForm;
use crate::panel::widgets::{Number, Tooltip, add_dropdown, add_path, add_remark, add_switch};
use crate::services::PathKind;
use crate::state::Action;
use crate::texts::{tr, tr_with};
use bokehcam::depth::backdrop::Background;
use bokehcam::look::FramingZoom;

#[derive(Clone, Copy, PartialEq)]
enum BackgroundKind {
    Blurred,
    Color,
    Picture,
    Video,
    Transparent,
}

const KINDS: [(&str, &str, BackgroundKind); 3] = [
    ("Blurred", "The room, blurred", BackgroundKind::Blurred),
    ("Colour", "One colour, or a green screen for programs that replace it", BackgroundKind::Color),
    ("Picture", "Your own picture, as large as the frame", BackgroundKind::Picture),
];
/// Chroma-key green.
const GREEN: [u8; 3] = [0, 177, 64];
/// Default zoom of auto-framing: room to move with little loss of detail.
const DEFAULT_ZOOM: f32 = 1.5;
/// Minimum zoom of auto-framing; below, the crop could hardly move.
const MIN_ZOOM: f32 = 1.1;

/// Adds the list of backgrounds.
pub fn add_background_choice(ui: &mut Ui, form: &mut PanelForm) {
    let kind = match form.look.background {
        Background::Blur => BackgroundKind::Blurred,
        Background::Color(_) => BackgroundKind::Color,
        Background::Picture(_) => BackgroundKind::Picture,
        Background::Video(_) => BackgroundKind::Video,
        Background::Transparent => BackgroundKind::Transparent,
    };
    let named = match &form.state.first_look.background {
        Background::Picture(picture) => Some(Background::Picture(picture.clone())),
        _ => None,
    };
    let shown = match kind {
        // The command line and presets alone choose these.
        BackgroundKind::Video => tr("Video"),
        BackgroundKind::Transparent => tr("Transparent"),
        kind => KINDS.iter().find(|(.., of)| *of == kind).map_or("", |(name, ..)| tr(name)),
    };
    let shown = tr_with("Background: {}", &[&shown]);
    let all = KINDS.map(|(name, hint, kind)| (tr(name).to_owned(), hint, kind));
    let enabled = form.follows_depth();
    let chosen = ui.add_enabled_ui(enabled, |ui| add_dropdown(ui, "Background", &shown, all, &kind)).inner;
    if let Some(chosen) = chosen {
        match (chosen, named) {
            (BackgroundKind::Blurred, _) => form.look.background = Background::Blur,
            (BackgroundKind::Color, _) => form.look.background = Background::Color(GREEN),
            (BackgroundKind::Picture, Some(named)) => form.look.background = named,
            (BackgroundKind::Picture, None) => form.push_action(Action::Browse(PathKind::Background)),
            (BackgroundKind::Video | BackgroundKind::Transparent, _) => {}
        }
        form.mark_changed(true, "behind");
    }
}

/// Adds the options of the selected background, and auto-framing.
pub fn show(ui: &mut Ui, form: &mut PanelForm) {
    match form.look.background.clone() {
        Background::Blur => {}
        Background::Video(video) => add_path(ui, &video.file.path.display().to_string()),
        Background::Transparent => {
            add_remark(ui, "Shown as black here. PNG, WebM and MOV keep the transparency.");
        }
        Background::Picture(picture) => {
            picture.file.iter().for_each(|file| add_path(ui, &file.display().to_string()));
            form.add_button(ui, "Choose picture…", "Another picture of your own", Action::Browse(PathKind::Background));
        }
        Background::Color(mut color) => drop(ui.horizontal(|ui| {
            ui.label(tr("Colour"));
            let picker = ui.color_edit_button_srgb(&mut color);
            picker.widget_info(|| WidgetInfo::labeled(Role::ColorWell, true, tr("Colour")));
            if picker.tooltip("Another colour").changed() {
                form.look.background = Background::Color(color);
                form.mark_changed(true, "colour behind");
            }
        })),
    }
    let zoom = form.look.follow.zoom();
    let hint = "Recordings and calls show a part of the picture, with the subject in the middle";
    if add_switch(ui, "Follow the subject", hint, zoom.is_some()) {
        form.look.follow = if zoom.is_some() { FramingZoom::OFF } else { FramingZoom::from_zoom(DEFAULT_ZOOM) };
        form.mark_changed(true, "follow");
    }
    // `zoom` is from before the click, so the slider appears in the next pass.
    if let Some(zoom) = zoom {
        let how =
            Number::new("Largest zoom", "Largest magnification of the subject", MIN_ZOOM..=FramingZoom::MAX_ZOOM, 1);
        form.add_number(ui, &how.with_affixes("", "×"), zoom, |look, zoom| look.follow = FramingZoom::from_zoom(zoom));
        add_remark(ui, "Recordings and calls show the part in the dashed line; this window shows the whole picture.");
    }
}
