//! The widgets from which the sections are built.

use std::ops::RangeInclusive;

use egui::{
    Align, Align2, ComboBox, Context, CornerRadius, DragValue, EventFilter, FontId, Id, Key, Label, Layout,
    PointerButton, Rect, Response, RichText, Role, Sense, Slider, SliderClamping, Stroke, StrokeKind, TextStyle, Ui,
    Vec2, WidgetInfo, pos2,
};

use super::theme::{Colors, ROW, medium_font};
use crate::texts::{format_number, tr, tr_with};

/// Width of a number beside its label, in points.
const NUMBER_WIDTH: f32 = 70.0;

/// A labelled number with a slider.
#[derive(Clone)]
pub struct Number<'a> {
    pub label: &'a str,
    /// Tooltip.
    hint: &'a str,
    range: RangeInclusive<f32>,
    /// Decimal places.
    digits: usize,
    logarithmic: bool,
    /// Prefix and suffix of the number.
    affixes: [&'a str; 2],
}

impl<'a> Number<'a> {
    /// Creates a number in `range` without a unit, on a linear slider.
    pub fn new(label: &'a str, hint: &'a str, range: RangeInclusive<f32>, digits: usize) -> Self {
        Self { label, hint, range, digits, logarithmic: false, affixes: ["", ""] }
    }

    /// Adds a prefix and a suffix, such as a unit.
    pub fn with_affixes(self, before: &'a str, after: &'a str) -> Self {
        Self { affixes: [before, after], ..self }
    }

    /// Makes the slider logarithmic.
    pub fn logarithmic(self) -> Self {
        Self { logarithmic: true, ..self }
    }
}

/// Widgets with a tooltip.
pub trait Tooltip {
    /// Adds a translated tooltip unless `text` is empty. Suppresses it where the widget is scrolled out of sight, which
    /// egui does not check.
    fn tooltip(self, text: &str) -> Self;
}

impl Tooltip for Response {
    fn tooltip(self, text: &str) -> Self {
        let is_out_of_sight = |at| self.rect.contains(at) && !self.interact_rect.contains(at);
        match text.is_empty() || self.ctx.pointer_latest_pos().is_some_and(is_out_of_sight) {
            true => self,
            false => self.on_hover_text(tr(text)),
        }
    }
}

/// Adds a label, a number to drag or type, and a slider below them. Returns whether the number changed.
pub fn add_number(ui: &mut Ui, spec: &Number, value: &mut f32) -> bool {
    let Number { label, hint, ref range, digits, logarithmic, .. } = *spec;
    let mut changed = false;
    ui.scope(|ui| {
        ui.spacing_mut().item_spacing.y = 0.0;
        let name = ui.horizontal(|ui| {
            // The number never wraps; a long label does.
            let max_width = (ui.available_width() - NUMBER_WIDTH).max(20.0);
            let name = ui.scope(|ui| {
                ui.set_max_width(max_width);
                ui.add(Label::new(tr(label)).wrap())
            });
            let name = name.inner.tooltip(hint);
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                changed = add_drag_value(ui, spec, value, name.id)
            });
            name
        });
        ui.spacing_mut().slider_width = ui.available_width().max(10.0);
        ui.spacing_mut().interact_size.y = 20.0;
        // A logarithmic slider from 0 needs a smallest positive value.
        let smallest = if logarithmic { f64::from(*range.start()).max(1e-3) } else { 0.0 };
        let mut slid = *value;
        let slider = Slider::new(&mut slid, range.clone()).clamping(SliderClamping::Edits).show_value(false);
        let slider = ui.add(slider.logarithmic(logarithmic).smallest_positive(smallest)).labelled_by(name.inner.id);
        if slider.tooltip(hint).changed() {
            // Rounds to one more digit than is displayed.
            let steps = 10f32.powi(digits as i32 + 1);
            (*value, changed) = ((slid * steps).round() / steps, true);
        }
    });
    changed
}

/// Adds a number to drag or type, labelled by `name`. Returns whether it changed.
fn add_drag_value(ui: &mut Ui, spec: &Number, value: &mut f32, name: Id) -> bool {
    let Number { hint, ref range, digits, affixes: [before, after], .. } = *spec;
    ui.spacing_mut().button_padding = Vec2::new(5.0, 1.0);
    ui.spacing_mut().interact_size = Vec2::new(24.0, 20.0);
    // Accepts a decimal comma, as in 1,5.
    let (ctx, shown) = (ui.ctx().clone(), f64::from(*value));
    let parse = |text: &str| {
        let number: f64 = text.trim().replace(',', ".").parse().ok()?;
        // Moving on with Tab re-enters the displayed value: that is no input.
        if (number - shown).abs() > 0.1f64.powi(digits as i32) {
            report_range(&ctx, spec, number);
        }
        Some(number)
    };
    // A value set elsewhere may lie outside the range; it stays until the user moves it.
    let mut typed = *value;
    let drag = DragValue::new(&mut typed)
        .range(range.clone())
        .clamp_existing_to_range(false)
        // Dragging over 300 points, the panel's width, covers the range.
        .speed((range.end() - range.start()) / 300.0)
        .update_while_editing(false)
        .max_decimals(digits)
        .min_decimals(digits)
        .custom_formatter(|number, _| format_number(number, digits))
        .custom_parser(parse)
        .prefix(before)
        .suffix(after);
    let is_other = ui.add(drag).labelled_by(name).tooltip(hint).changed();
    // Moving the keyboard focus re-enters the displayed, rounded value: that is no change.
    let has_changed = is_other && (typed - *value).abs() > 0.501 * 0.1f32.powi(digits as i32);
    *value = if has_changed { typed } else { *value };
    has_changed
}

/// Returns the key under which a message waits for the end of the pass.
fn message_id() -> Id {
    Id::unique("said by a control")
}

/// Queues a message if a typed number is out of range: it names the range and the value used.
fn report_range(ctx: &Context, spec: &Number, number: f64) {
    let Number { label, ref range, digits, affixes: [before, after], .. } = *spec;
    // Compares rounded values: half a displayed step beyond a limit still displays as the limit.
    let half = 0.5 * 0.1f64.powi(digits as i32);
    let (min, max) = (f64::from(*range.start()), f64::from(*range.end()));
    if number < min - half || number > max + half {
        let taken = if number < min { min } else { max };
        let [min, max, taken] =
            [min, max, taken].map(|number| format!("{before}{}{after}", format_number(number, digits)));
        let line = tr_with("{} is limited to {} to {}: {} was set.", &[&tr(label), &min, &max, &taken]);
        ctx.data_mut(|data| data.insert_temp(message_id(), line));
    }
}

/// Takes the message that a widget queued in this pass.
pub fn take_message(ctx: &Context) -> Option<String> {
    ctx.data_mut(|data| data.remove_temp(message_id()))
}

/// Adds a group of radio buttons in a grid, given as name, tooltip and value; `is_selectable` tells which values are
/// selectable. Returns the value that was clicked, or selected by the arrow keys.
pub fn add_choice<T: PartialEq + Copy>(
    ui: &mut Ui,
    what: &str,
    options: &[(&str, &str, T)],
    chosen: T,
    is_selectable: impl Fn(T) -> bool,
) -> Option<T> {
    let colors = Colors::for_ui(ui);
    let what = tr(what);
    let font = |chosen: bool| FontId::new(12.5, if chosen { medium_font() } else { egui::FontFamily::Proportional });
    let width_of = |name: &str| ui.painter().layout_no_wrap(tr(name).to_owned(), font(true), colors.text).size().x;
    let widest = options.iter().map(|(name, ..)| width_of(name)).fold(0.0, f32::max) + 12.0;
    // As many columns as fit the widest name in this language, with the rows evenly filled.
    let whole = (1..=options.len()).rev().find(|columns| ui.available_width() / *columns as f32 >= widest);
    let columns = options.len().div_ceil(options.len().div_ceil(whole.unwrap_or(1).max(1)).max(1)).max(1);
    let rows = options.len().div_ceil(columns);
    let (rect, _) = ui.allocate_exact_size(Vec2::new(ui.available_width(), ROW * rows as f32), Sense::hover());
    ui.painter().rect_filled(rect, CornerRadius::same(7), colors.field);
    let cell_width = rect.width() / columns as f32;
    let mut group = RadioGroup::default();
    for (index, &(name, hint, option)) in options.iter().enumerate() {
        let name = tr(name);
        let (row, column) = (index / columns, index % columns);
        let corner = pos2(rect.left() + cell_width * column as f32, rect.top() + ROW * row as f32);
        let cell = Rect::from_min_size(corner, Vec2::new(cell_width, ROW));
        let (is_chosen, is_possible) = (option == chosen, is_selectable(option));
        let sense = if is_possible { Sense::click() } else { Sense::hover() };
        let response = ui.interact(cell, ui.scope_id().with((what, index)), sense);
        response
            .widget_info(|| WidgetInfo::selected(Role::RadioButton, is_possible, is_chosen, format!("{what}: {name}")));
        let inner = cell.shrink(2.0);
        let is_hovered = is_possible && response.hovered();
        if is_chosen || is_hovered {
            ui.painter().rect_filled(inner, CornerRadius::same(6), colors.fill(is_chosen, is_hovered));
        }
        let text = colors.text_on_fill(is_chosen, is_possible);
        let name = ui.painter().layout(name.to_owned(), font(is_chosen), text, cell_width);
        let at = Align2::CENTER_CENTER.anchor_size(inner.center(), name.size()).min;
        ui.painter().with_clip_rect(cell).galley(at, name, text);
        group.add(response.tooltip(hint), option);
    }
    group.selection(ui)
}

/// A radio group: the user selects by click, or by an arrow key from the neighbour that has the focus.
pub struct RadioGroup<T>(Vec<(Response, T)>);

impl<T> Default for RadioGroup<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> RadioGroup<T> {
    /// Adds the next widget; disabled ones (hover only) are never selected.
    pub fn add(&mut self, control: Response, option: T) {
        if control.sense.senses_click() {
            self.0.push((control, option));
        }
    }

    /// Returns the value selected in this pass.
    pub fn selection(mut self, ui: &Ui) -> Option<T> {
        let focused = self.0.iter().position(|(control, _)| control.has_focus());
        let by_arrow = focused.and_then(|at| {
            let arrows = EventFilter { horizontal_arrows: true, ..EventFilter::default() };
            ui.memory_mut(|memory| memory.set_focus_lock_filter(self.0[at].0.id, arrows));
            let pressed = |key| ui.input(|input| input.key_pressed(key));
            match (pressed(Key::ArrowLeft), pressed(Key::ArrowRight)) {
                (true, false) => at.checked_sub(1),
                (false, true) => Some(at + 1).filter(|next| *next < self.0.len()),
                _ => None,
            }
        });
        by_arrow.into_iter().for_each(|next| self.0[next].0.request_focus());
        let chosen = by_arrow.or_else(|| self.0.iter().position(|(control, _)| control.clicked()));
        chosen.map(|index| self.0.swap_remove(index).1)
    }
}

/// Adds a drop-down list, given as name, tooltip and value. Returns a newly selected value.
pub fn add_dropdown<'a, T: PartialEq>(
    ui: &mut Ui,
    what: &str,
    shown: &str,
    options: impl IntoIterator<Item = (String, &'a str, T)>,
    chosen: &T,
) -> Option<T> {
    let (mut picked, mut is_chosen_by_key) = (None, false);
    let menu = ComboBox::from_id_salt(what).selected_text(shown).truncate().show_ui(ui, |ui| {
        for (name, hint, option) in options {
            let is_chosen = option == *chosen;
            let item = ui.selectable_label(is_chosen, name).tooltip(hint);
            if item.clicked() {
                // egui closes the list by itself only after a click of the pointer.
                ui.close();
                is_chosen_by_key = !item.clicked_by(PointerButton::Primary);
                picked = Some(option).filter(|_| !is_chosen);
            }
        }
    });
    if is_chosen_by_key {
        // The item that had the focus is gone.
        menu.response.request_focus();
    }
    // Linux's screen readers get no value of a list, so its name has it.
    let what = tr(what);
    let name = if shown.starts_with(what) { shown.to_owned() } else { format!("{what}: {shown}") };
    menu.response.widget_info(|| {
        let mut info = WidgetInfo::labeled(Role::ComboBox, menu.response.enabled(), &name);
        info.current_text_value = Some(shown.to_owned());
        info
    });
    picked
}

/// Adds a labelled switch. Returns whether it was clicked.
pub fn add_switch(ui: &mut Ui, label: &str, hint: &str, on: bool) -> bool {
    let colors = Colors::for_ui(ui);
    let label = tr(label);
    let font = TextStyle::Body.resolve(ui.style());
    let text =
        ui.painter().layout(label.to_owned(), font, ui.visuals().text_color(), (ui.available_width() - 42.0).max(10.0));
    let size = Vec2::new(ui.available_width(), text.size().y.max(24.0));
    let (rect, response) = ui.allocate_exact_size(size, Sense::click());
    response.widget_info(|| WidgetInfo::selected(Role::Switch, ui.is_enabled(), on, label));
    let track = Rect::from_center_size(pos2(rect.right() - 17.0, rect.center().y), Vec2::new(32.0, 18.0));
    let painter = ui.painter();
    painter.rect_filled(track, CornerRadius::same(9), colors.fill(on, response.hovered()));
    painter.rect_stroke(track, CornerRadius::same(9), Stroke::new(1.0, colors.line), StrokeKind::Inside);
    let x = if on { track.right() - 9.0 } else { track.left() + 9.0 };
    painter.circle_filled(pos2(x, track.center().y), 6.5, if on { colors.on_accent } else { colors.weak });
    let at = Align2::LEFT_CENTER.anchor_size(rect.left_center(), text.size()).min;
    painter.galley(at, text, ui.visuals().text_color());
    response.tooltip(hint).clicked()
}

/// Adds a button. Returns whether it was clicked.
pub fn add_button(ui: &mut Ui, text: &str, hint: &str) -> bool {
    ui.button(tr(text)).tooltip(hint).clicked()
}

/// Sets the accessible name of a list or a field for screen readers.
pub fn set_accessible_name(control: &Response, name: &str, role: Role) {
    control.widget_info(|| WidgetInfo::labeled(role, control.enabled(), tr(name)));
}

/// Adds a line of small explanatory text.
pub fn add_remark(ui: &mut Ui, text: &str) {
    ui.label(RichText::new(tr(text)).text_style(TextStyle::Small).color(Colors::for_ui(ui).weak));
}

/// Adds a path, shortened at its beginning because the end identifies the file.
pub fn add_path(ui: &mut Ui, path: &str) {
    let shown = bokehcam_files::user_folders::format_output(path);
    ui.scope(|ui| add_remark(ui, &truncate_start(&shown, 38))).response.on_hover_text(path);
}

/// Returns the last `max_chars` characters of a text, the first of them replaced by an ellipsis if it is longer.
fn truncate_start(text: &str, max_chars: usize) -> String {
    match text.chars().count().checked_sub(max_chars) {
        None | Some(0) => text.to_owned(),
        Some(over) => ['…'].into_iter().chain(text.chars().skip(over + 1)).collect(),
    }
}

/// Returns the first `max_chars` characters of a text, the last of them replaced by an ellipsis if it is longer.
pub fn truncate_end(text: &str, max_chars: usize) -> String {
    match text.chars().count() > max_chars {
        true => text.chars().take(max_chars.saturating_sub(1)).chain(['…']).collect(),
        false => text.to_owned(),
    }
}

/// Adds a foldable section. Returns whether its title was clicked.
pub fn add_foldable_section(ui: &mut Ui, name: &str, open: bool, body: impl FnOnce(&mut Ui)) -> bool {
    let colors = Colors::for_ui(ui);
    ui.add_space(4.0);
    let title = RichText::new(tr(name)).family(medium_font()).size(13.5).color(colors.text);
    let header = egui::CollapsingHeader::new(title).id_salt(name).open(Some(open));
    let folded = header.show_unindented(ui, |ui| {
        ui.add_space(2.0);
        body(ui);
    });
    // Linux's screen readers are not told what is expanded, but what is pressed.
    ui.ctx().accesskit_node_builder(folded.header_response.id, |node| node.set_toggled(open.into()));
    folded.header_response.clicked()
}
