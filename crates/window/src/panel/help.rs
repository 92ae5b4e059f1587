//! The help on keys and gestures.

use egui::{Context, Grid, Id, Key, Label, Modal, RichText, ScrollArea, Ui, vec2};

use super::icons::{self, Icon};
use super::keys::{GROUPS, Group};
use super::state::{Action, State};
use super::theme::{Colors, GAP, PAD, card_frame, medium_font};
use super::widgets::add_switch;
use crate::texts::tr;

const GESTURES: [(&str, &str); 8] = [
    ("Click", "focus there"),
    ("Double-click", "focus on the object there, and follow it"),
    ("Wheel", "less blur, more blur"),
    ("Ctrl+Wheel, pinch", "zoom in and out, in actual pixels"),
    ("Drag", "move the enlarged picture"),
    ("Drag the line", "move the split between before and after"),
    ("Drag the marks", "move, widen and turn the band of tilt-shift"),
    ("Tab", "go to the next control; Space and the arrow keys change it"),
];

/// Scroll distance of an arrow key, in points.
const LINE: f32 = 40.0;
/// Width of the keys, and of the gap beside them, in points.
const KEYS_WIDTH: f32 = 104.0;
const SPACING: f32 = 12.0;

/// Draws the help as a modal, in two columns if the window is wide. Enter or a click outside closes it; the arrow and
/// page keys scroll it.
pub fn show(ctx: &Context, state: &State, actions: &mut Vec<Action>) {
    let window = ctx.content_rect();
    let columns = if window.width() > 720.0 { 2 } else { 1 };
    let width = if columns == 2 { 660.0 } else { (window.width() - 2.0 * (GAP + PAD)).clamp(60.0, 340.0) };
    let frame = card_frame(&Colors::for_theme(ctx.theme()));
    let drawn = Modal::new(Id::unique("help")).frame(frame).show(ctx, |ui| {
        ui.set_width(width);
        ui.set_max_height((window.height() - 2.0 * (GAP + PAD)).max(20.0));
        ui.horizontal(|ui| {
            ui.heading(tr("Keys and gestures"));
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                if icons::add_button(ui, Icon::Close, "Close (Esc)", true) {
                    actions.push(Action::Help(false));
                }
            });
        });
        let hint = "If off, shortcuts without Ctrl do nothing: for speech input";
        if add_switch(ui, "Single keys", hint, state.preferences.single_keys) {
            actions.push(Action::SingleKeys(!state.preferences.single_keys));
        }
        let (asks, hint) = (
            state.preferences.ask_before_closing,
            "While something is recorded or used in calls, closing the window asks first",
        );
        if add_switch(ui, "Ask before closing", hint, asks) {
            actions.push(Action::AskBeforeClosing(!asks));
        }
        // 100 points for the heading and the two switches.
        let height = (window.height() - 2.0 * (GAP + PAD) - 100.0).max(20.0);
        ScrollArea::vertical().max_height(height).show(ui, |ui| {
            ui.scroll_with_delta(vec2(0.0, scroll_distance(ui, height)));
            let gestures = |ui: &mut Ui| add_table(ui, "On the picture", GESTURES.into_iter());
            if columns == 2 {
                ui.columns_const(|[left, right]| {
                    GROUPS[..3].iter().for_each(|group| add_keys(left, group));
                    GROUPS[3..].iter().for_each(|group| add_keys(right, group));
                    gestures(right);
                });
            } else {
                GROUPS.iter().for_each(|group| add_keys(ui, group));
                gestures(ui);
            }
        });
    });
    if drawn.backdrop_response.clicked() || ctx.input(|input| input.key_pressed(Key::Enter)) {
        actions.push(Action::Help(false));
    }
}

/// Returns the scroll distance of the pressed keys in points; a page is `height`.
fn scroll_distance(ui: &Ui, height: f32) -> f32 {
    let steps = [
        (Key::ArrowUp, LINE),
        (Key::ArrowDown, -LINE),
        (Key::PageUp, height),
        (Key::PageDown, -height),
        (Key::Home, f32::MAX),
        (Key::End, f32::MIN),
    ];
    ui.input(|input| steps.iter().filter(|(key, _)| input.key_pressed(*key)).map(|(_, by)| by).sum())
}

fn add_keys(ui: &mut Ui, group: &Group) {
    add_table(ui, group.name, group.bindings.iter().map(|binding| (binding.keys, binding.help)));
}

/// Adds a titled table of keys or gestures with their effects.
fn add_table<'a>(ui: &mut Ui, name: &str, rows: impl Iterator<Item = (&'a str, &'a str)>) {
    let colors = Colors::for_ui(ui);
    ui.spacing_mut().interact_size.y = 17.0;
    ui.add_space(8.0);
    ui.label(RichText::new(tr(name)).family(medium_font()).color(colors.accent));
    let width = (ui.available_width() - KEYS_WIDTH - 2.0 * SPACING).max(40.0);
    Grid::new(name).num_columns(2).spacing(vec2(SPACING, 4.0)).min_col_width(KEYS_WIDTH).show(ui, |ui| {
        for (keys, does) in rows {
            ui.label(RichText::new(tr(keys)).family(medium_font()));
            // A grid gives each cell as much width as it asks for, over its neighbour if need be.
            ui.scope(|ui| {
                ui.set_max_width(width);
                ui.add(Label::new(RichText::new(tr(does)).color(colors.weak)).wrap());
            });
            ui.end_row();
        }
    });
}
