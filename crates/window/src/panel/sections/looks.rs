//! Presets: looks by name.

use egui::{
    Align2, CornerRadius, FontFamily, FontId, Key, Label, Rect, Response, Role, Sense, TextEdit, Ui, Vec2, WidgetInfo,
    vec2,
};

use super::Sheet;
use crate::panel::parts::{Group, Hinted, button, called, remark};
use crate::panel::theme::{Colors, medium};
use crate::state::Action;
use crate::texts::{tr, tr_with};
use bokehcam::look::Effect;
use bokehcam::look::presets::Preset;

/// What is being done with presets.
#[derive(Debug, Default, PartialEq)]
enum Doing {
    #[default]
    Nothing,
    /// The look is being saved under a name.
    Saving,
    /// One's own are listed, to be renamed or deleted.
    Listing,
    Renaming(String),
    Deleting(String),
}

/// What is being done with presets, and the name that is being typed for it.
#[derive(Debug, Default)]
pub struct Editing {
    doing: Doing,
    name: String,
    /// Whether the text field is new and still needs the focus.
    ask_focus: bool,
}

impl Editing {
    /// Whether something is being done that Esc gives up.
    pub fn is_asking(&self) -> bool {
        self.doing != Doing::Nothing
    }

    fn begin(&mut self, ui: &Ui, doing: Doing, name: &str) {
        *self = Self { doing, name: name.to_owned(), ask_focus: true };
        // In the pass of the click, the button has the focus itself.
        ui.ctx().request_repaint();
    }
}

/// The presets, and ways to save, rename and delete one's own.
pub fn show(ui: &mut Ui, sheet: &mut Sheet, editing: &mut Editing) {
    let state = sheet.state;
    let was = std::mem::take(&mut editing.doing);
    let mut next = None;
    ui.scope(|ui| {
        ui.spacing_mut().item_spacing = vec2(6.0, 6.0);
        ui.horizontal_wrapped(|ui| {
            let (mut chips, lit) = (Group::default(), state.preset_in_use());
            for (index, preset) in state.presets.iter().enumerate() {
                let needs_depth = preset.patch.effect.is_some_and(Effect::follows_depth);
                let possible = !needs_depth || sheet.has_depth();
                chips.add(chip(ui, index, preset, lit == Some(index), possible), preset);
            }
            if let Some(preset) = chips.chosen(ui) {
                sheet.act(Action::Preset(preset.name.clone()));
            }
            if was != Doing::Saving && button(ui, "Save as…", "Save this look under a name") {
                next = Some(Doing::Saving);
            }
            let has_own = state.presets.iter().any(|preset| preset.own);
            if has_own && button(ui, "Edit…", "Rename or delete looks of your own") {
                next = Some(if was == Doing::Listing { Doing::Nothing } else { Doing::Listing });
            }
        });
    });
    editing.doing = match was {
        Doing::Nothing => Doing::Nothing,
        Doing::Saving => save(ui, sheet, editing),
        Doing::Listing => list(ui, sheet, editing),
        Doing::Renaming(name) => rename(ui, sheet, editing, name),
        Doing::Deleting(name) => delete(ui, sheet, name),
    };
    if let Some(next) = next {
        editing.begin(ui, next, "");
    }
}

/// Asks for the name of a new preset. One that is there is replaced only by the button that says so.
fn save(ui: &mut Ui, sheet: &mut Sheet, editing: &mut Editing) -> Doing {
    let is_there = sheet.state.presets.iter().any(|preset| preset.own && preset.name == editing.name.trim());
    let (verb, by_enter) = if is_there { ("Replace", false) } else { ("Save", true) };
    match named(ui, editing, verb, (by_enter, sheet.gives_up(ui))) {
        Some(true) => sheet.act(Action::SavePreset(editing.name.trim().to_owned())),
        Some(false) => {}
        None => {
            if is_there {
                remark(ui, "There is a look of this name already.");
            }
            return Doing::Saving;
        }
    }
    Doing::Nothing
}

/// Lists one's own presets, each with what can be done with it.
fn list(ui: &mut Ui, sheet: &Sheet, editing: &mut Editing) -> Doing {
    for preset in sheet.state.presets.iter().filter(|preset| preset.own) {
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
                editing.begin(ui, Doing::Nothing, &preset.name);
                return Doing::Renaming(preset.name.clone());
            }
            (_, true) => return Doing::Deleting(preset.name.clone()),
            _ => {}
        }
    }
    if sheet.gives_up(ui) { Doing::Nothing } else { Doing::Listing }
}

fn rename(ui: &mut Ui, sheet: &mut Sheet, editing: &mut Editing, old: String) -> Doing {
    let new = editing.name.trim().to_owned();
    match named(ui, editing, "Rename", (true, sheet.gives_up(ui))) {
        Some(true) if new != old => sheet.act(Action::RenamePreset(old, new)),
        Some(_) => {}
        None => return Doing::Renaming(old),
    }
    Doing::Listing
}

/// Asks before a preset is deleted, as nothing brings it back.
fn delete(ui: &mut Ui, sheet: &mut Sheet, name: String) -> Doing {
    ui.label(tr_with("Delete “{}” for good?", &[&name]));
    let (delete, keep) =
        ui.horizontal_wrapped(|ui| (ui.button(tr("Delete it")).clicked(), ui.button(tr("Keep it")).clicked())).inner;
    if delete {
        sheet.act(Action::DeletePreset(name));
    } else if !keep && !sheet.gives_up(ui) {
        return Doing::Deleting(name);
    }
    Doing::Listing
}

/// A field for a name and buttons. Whether the name holds or is given up, once one of them is so.
fn named(ui: &mut Ui, editing: &mut Editing, verb: &str, (by_enter, gives_up): (bool, bool)) -> Option<bool> {
    ui.horizontal_wrapped(|ui| {
        let width = ui.available_width().min(140.0);
        let edit = TextEdit::singleline(&mut editing.name).hint_text(tr("name")).desired_width(width).char_limit(40);
        let edit = ui.add(edit);
        called(&edit, "Name of the preset", Role::TextInput);
        if std::mem::take(&mut editing.ask_focus) {
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
        (ui.button(tr("Cancel")).clicked() || gives_up).then_some(false)
    })
    .inner
}

/// Draws a preset with the number of its key.
fn chip(ui: &mut Ui, index: usize, preset: &Preset, chosen: bool, possible: bool) -> Response {
    let colors = Colors::here(ui);
    // One's own are called as one called them.
    let shown = if preset.own { preset.name.clone() } else { capitalized(&preset.name) };
    let text = colors.on_fill(chosen, possible);
    let number_color = if possible && !chosen { colors.weak } else { text };
    let name = ui.painter().layout_no_wrap(shown, FontId::new(13.0, medium()), text);
    // The keys 1 to 9.
    let has_key = index < 9;
    let room = if has_key { 14.0 } else { 0.0 };
    let size = vec2((name.size().x + room + 20.0).min(ui.max_rect().width()), 28.0);
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
    painter.galley(rect.left_center() + vec2(10.0 + room, -name.size().y / 2.0), name, text);
    response.hint(match (possible, preset.own) {
        (false, _) => "needs depth, which this source has not",
        (true, true) => "your own look",
        (true, false) => "a ready-made look",
    })
}

fn capitalized(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
