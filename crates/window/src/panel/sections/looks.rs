//! Presets: named looks.

use egui::{
    Align2, CornerRadius, FontFamily, FontId, Key, Label, Rect, Response, Role, Sense, TextEdit, Ui, Vec2, WidgetInfo,
    vec2,
};

use super::PanelForm;
use crate::panel::theme::{Colors, medium_font};
use crate::panel::widgets::{RadioGroup, Tooltip, add_button, add_remark, set_accessible_name};
use crate::state::Action;
use crate::texts::{tr, tr_with};
use bokehcam::look::Effect;
use bokehcam::look::presets::Preset;

/// The built-in presets as they are shown.
const READY_MADE: [&str; 5] = ["Portrait", "Cinematic", "Dreamy", "Product", "Miniature"];

/// State of the preset dialog.
#[derive(Debug, Default, PartialEq)]
enum Dialog {
    #[default]
    Nothing,
    /// Enter a name to save the look.
    Saving,
    /// List the user's presets, to rename or delete them.
    Listing,
    Renaming(String),
    Deleting(String),
}

/// The preset dialog, and the name that is being typed.
#[derive(Debug, Default)]
pub struct PresetEditor {
    dialog: Dialog,
    name: String,
    /// Whether the text field is new and must request the focus.
    needs_focus: bool,
}

impl PresetEditor {
    /// Whether a dialog is open that Esc cancels.
    pub fn has_open_dialog(&self) -> bool {
        self.dialog != Dialog::Nothing
    }

    fn open_dialog(&mut self, ui: &Ui, dialog: Dialog, name: &str) {
        *self = Self { dialog, name: name.to_owned(), needs_focus: true };
        // During this pass, the clicked button still has the focus.
        ui.ctx().request_repaint();
    }
}

/// Adds the presets, and the dialogs to save, rename and delete the user's own.
pub fn show(ui: &mut Ui, form: &mut PanelForm, editing: &mut PresetEditor) {
    let state = form.state;
    // Each dialog returns its next state; the buttons above it take effect in the next pass.
    let current = std::mem::take(&mut editing.dialog);
    let mut next = None;
    ui.scope(|ui| {
        ui.spacing_mut().item_spacing = vec2(6.0, 6.0);
        ui.horizontal_wrapped(|ui| {
            let (mut chips, in_use) = (RadioGroup::default(), state.preset_in_use());
            for (index, preset) in state.presets.iter().enumerate() {
                let needs_depth = preset.patch.effect.is_some_and(Effect::follows_depth);
                let possible = !needs_depth || form.has_depth();
                chips.add(draw_chip(ui, index, preset, in_use == Some(index), possible), preset);
            }
            if let Some(preset) = chips.selection(ui) {
                form.push_action(Action::Preset(preset.name.clone()));
            }
            if current != Dialog::Saving && add_button(ui, "Save as…", "Save this look under a name") {
                next = Some(Dialog::Saving);
            }
            let has_own = state.presets.iter().any(|preset| preset.is_user_defined);
            if has_own && add_button(ui, "Edit…", "Rename or delete looks of your own") {
                next = Some(if current == Dialog::Listing { Dialog::Nothing } else { Dialog::Listing });
            }
        });
    });
    editing.dialog = match current {
        Dialog::Nothing => Dialog::Nothing,
        Dialog::Saving => show_save_dialog(ui, form, editing),
        Dialog::Listing => show_list_dialog(ui, form, editing),
        Dialog::Renaming(name) => show_rename_dialog(ui, form, editing, name),
        Dialog::Deleting(name) => show_delete_dialog(ui, form, name),
    };
    if let Some(next) = next {
        editing.open_dialog(ui, next, "");
    }
}

/// Asks for the name of a new preset. An existing preset is replaced only by an explicit button press, not by Enter.
fn show_save_dialog(ui: &mut Ui, form: &mut PanelForm, editing: &mut PresetEditor) -> Dialog {
    let is_there = form.state.presets.iter().any(|preset| preset.is_user_defined && preset.name == editing.name.trim());
    let (verb, by_enter) = if is_there { ("Replace", false) } else { ("Save", true) };
    match add_name_field(ui, editing, verb, by_enter, form.is_cancelled(ui)) {
        Some(true) => form.push_action(Action::SavePreset(editing.name.trim().to_owned())),
        Some(false) => {}
        None => {
            if is_there {
                add_remark(ui, "There is already a look of this name.");
            }
            return Dialog::Saving;
        }
    }
    Dialog::Nothing
}

/// Lists the user's presets with their actions.
fn show_list_dialog(ui: &mut Ui, form: &PanelForm, editing: &mut PresetEditor) -> Dialog {
    for preset in form.state.presets.iter().filter(|preset| preset.is_user_defined) {
        let row = ui.horizontal(|ui| {
            let [rename, delete] = ["Rename", "Delete"].map(|verb| {
                let button = ui.button(tr(verb));
                button.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("{} {}", tr(verb), preset.name)));
                button.clicked()
            });
            ui.add(Label::new(&preset.name).truncate());
            (rename, delete)
        });
        match row.inner {
            (true, _) => {
                editing.open_dialog(ui, Dialog::Nothing, &preset.name);
                return Dialog::Renaming(preset.name.clone());
            }
            (_, true) => return Dialog::Deleting(preset.name.clone()),
            _ => {}
        }
    }
    if form.is_cancelled(ui) { Dialog::Nothing } else { Dialog::Listing }
}

fn show_rename_dialog(ui: &mut Ui, form: &mut PanelForm, editing: &mut PresetEditor, old: String) -> Dialog {
    let new = editing.name.trim().to_owned();
    match add_name_field(ui, editing, "Rename", true, form.is_cancelled(ui)) {
        Some(true) if new != old => form.push_action(Action::RenamePreset(old, new)),
        Some(_) => {}
        None => return Dialog::Renaming(old),
    }
    Dialog::Listing
}

/// Asks before deleting a preset, because this cannot be undone.
fn show_delete_dialog(ui: &mut Ui, form: &mut PanelForm, name: String) -> Dialog {
    ui.label(tr_with("Delete “{}” for good?", &[&name]));
    let (delete, keep) =
        ui.horizontal_wrapped(|ui| (ui.button(tr("Delete it")).clicked(), ui.button(tr("Keep it")).clicked())).inner;
    if delete {
        form.push_action(Action::DeletePreset(name));
    } else if !keep && !form.is_cancelled(ui) {
        return Dialog::Deleting(name);
    }
    Dialog::Listing
}

/// Adds a name field with buttons. Returns true if confirmed, false if cancelled, `None` while open.
fn add_name_field(
    ui: &mut Ui,
    editing: &mut PresetEditor,
    verb: &str,
    by_enter: bool,
    is_cancelled: bool,
) -> Option<bool> {
    ui.horizontal_wrapped(|ui| {
        let width = ui.available_width().min(140.0);
        let edit = TextEdit::singleline(&mut editing.name).hint_text(tr("name")).desired_width(width).char_limit(40);
        let edit = ui.add(edit);
        set_accessible_name(&edit, "Name of the preset", Role::TextInput);
        if std::mem::take(&mut editing.needs_focus) {
            edit.request_focus();
        }
        let entered = edit.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
        if entered && !by_enter {
            edit.request_focus();
        }
        let holds = ui.button(tr(verb)).clicked() || entered && by_enter;
        if holds && !editing.name.trim().is_empty() {
            return Some(true);
        }
        (ui.button(tr("Cancel")).clicked() || is_cancelled).then_some(false)
    })
    .inner
}

/// Draws a preset with the number of its key.
fn draw_chip(ui: &mut Ui, index: usize, preset: &Preset, chosen: bool, possible: bool) -> Response {
    let colors = Colors::for_ui(ui);
    // Names of user presets are displayed verbatim.
    let built_in = READY_MADE.iter().find(|name| !preset.is_user_defined && name.eq_ignore_ascii_case(&preset.name));
    let shown = built_in.map_or(preset.name.as_str(), |name| tr(name)).to_owned();
    let text = colors.text_on_fill(chosen, possible);
    let number_color = if possible && !chosen { colors.weak } else { text };
    let name = ui.painter().layout_no_wrap(shown, FontId::new(13.0, medium_font()), text);
    // The keys 1 to 9 select presets.
    let has_key = index < 9;
    let key_width = if has_key { 14.0 } else { 0.0 };
    let size = vec2((name.size().x + key_width + 20.0).min(ui.max_rect().width()), 28.0);
    let sense = if possible { Sense::click() } else { Sense::hover() };
    let (rect, response) = ui.allocate_exact_size(size, sense);
    response.widget_info(|| WidgetInfo::selected(Role::RadioButton, possible, chosen, &preset.name));
    let painter = ui.painter();
    painter.rect_filled(rect, CornerRadius::same(14), colors.fill(chosen, possible && response.hovered()));
    if has_key {
        let at = Rect::from_min_size(rect.min, Vec2::new(24.0, rect.height())).center();
        let font = FontId::new(11.0, FontFamily::Proportional);
        painter.text(at, Align2::CENTER_CENTER, index + 1, font, number_color);
    }
    painter.galley(rect.left_center() + vec2(10.0 + key_width, -name.size().y / 2.0), name, text);
    response.tooltip(match (possible, preset.is_user_defined) {
        (false, _) => "needs depth, and this source has none",
        (true, true) => "your own look",
        (true, false) => "a ready-made look",
    })
}
