//! The virtual background.

use std::path::Path;

use egui::{Role, Ui, WidgetInfo};

use super::PanelForm;
use crate::panel::widgets::{Tooltip, add_dropdown, add_path};
use crate::services::PathKind;
use crate::state::Action;
use crate::texts::{tr, tr_with};
use bokehcam::depth::backdrop::Background;

#[derive(Clone, Copy, PartialEq)]
enum BackgroundKind {
    Blurred,
    Color,
    /// A picture or a video.
    File,
}

const KINDS: [(&str, &str, BackgroundKind); 3] = [
    ("Blurred", "The room, blurred", BackgroundKind::Blurred),
    ("Colour", "One colour, or a green screen for programs that replace it", BackgroundKind::Color),
    ("Picture or video", "Your own file, as large as the frame", BackgroundKind::File),
];
/// Chroma-key green.
const GREEN: [u8; 3] = [0, 177, 64];

/// Adds the list of backgrounds.
pub fn add_background_choice(ui: &mut Ui, form: &mut PanelForm) {
    let kind = match form.look.background {
        // A window is never transparent.
        Background::Blur | Background::Transparent => BackgroundKind::Blurred,
        Background::Color(_) => BackgroundKind::Color,
        Background::Picture(_) | Background::Video(_) => BackgroundKind::File,
    };
    let named = match &form.state.first_look.background {
        file @ (Background::Picture(_) | Background::Video(_)) => Some(file.clone()),
        _ => None,
    };
    let shown = match (kind, &form.look.background) {
        (BackgroundKind::File, Background::Video(_)) => tr("Video"),
        (BackgroundKind::File, _) => tr("Picture"),
        (kind, _) => KINDS.iter().find(|(.., of)| *of == kind).map_or("", |(name, ..)| tr(name)),
    };
    let shown = tr_with("Background: {}", &[&shown]);
    let all = KINDS.map(|(name, hint, kind)| (tr(name).to_owned(), hint, kind));
    let enabled = form.follows_depth();
    let chosen = ui.add_enabled_ui(enabled, |ui| add_dropdown(ui, "Background", &shown, all, &kind)).inner;
    if let Some(chosen) = chosen {
        match (chosen, named) {
            (BackgroundKind::Blurred, _) => form.look.background = Background::Blur,
            (BackgroundKind::Color, _) => form.look.background = Background::Color(GREEN),
            (BackgroundKind::File, Some(named)) => form.look.background = named,
            (BackgroundKind::File, None) => form.push_action(Action::Browse(PathKind::Background)),
        }
        form.stroke = Some("behind");
    }
}

/// Adds the options of the selected background.
pub fn show(ui: &mut Ui, form: &mut PanelForm) {
    match form.look.background.clone() {
        Background::Blur | Background::Transparent => {}
        Background::Video(video) => add_file(ui, form, Some(video.file())),
        Background::Picture(picture) => add_file(ui, form, picture.file.as_deref()),
        Background::Color(mut color) => drop(ui.horizontal(|ui| {
            ui.label(tr("Colour"));
            let picker = ui.color_edit_button_srgb(&mut color);
            picker.widget_info(|| WidgetInfo::labeled(Role::ColorWell, true, tr("Colour")));
            if picker.tooltip("Another colour").changed() {
                form.look.background = Background::Color(color);
                form.stroke = Some("colour behind");
            }
        })),
    }
}

/// Adds the path of a picture or video, and a button to choose another.
fn add_file(ui: &mut Ui, form: &mut PanelForm, file: Option<&Path>) {
    file.into_iter().for_each(|file| add_path(ui, &file.display().to_string()));
    form.add_button(ui, "Choose file…", "Another picture or video of your own", Action::Browse(PathKind::Background));
}
