//! The help on keys and gestures.

use egui::{Align2, Area, Color32, Context, Grid, Id, Key, Label, Order, RichText, ScrollArea, Sense, Ui, vec2};

use super::icons::{self, Icon};
use super::keys::GROUPS;
use super::state::Action;
use super::theme::{Colors, GAP, PAD, card, medium};

const GESTURES: [(&str, &str); 6] = [
    ("Click", "focus there"),
    ("Double-click", "follow the subject"),
    ("Wheel", "less blur, more blur"),
    ("Drag the line", "move the split between before and after"),
    ("Drag the marks", "move, widen and turn the band of tilt-shift"),
    ("Tab", "from control to control; Space and the arrow keys change it"),
];

/// Draws the help over everything, in two columns where the window is wide. Enter or a click beside it closes it.
pub fn show(ctx: &Context, actions: &mut Vec<Action>) {
    let window = ctx.content_rect();
    let dim = ctx.layer_painter(egui::LayerId::new(Order::Middle, Id::unique("dim")));
    dim.rect_filled(window, egui::CornerRadius::ZERO, Color32::from_black_alpha(120));
    let area = Area::new(Id::unique("help")).anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0)).order(Order::Foreground);
    let columns = if window.width() > 720.0 { 2 } else { 1 };
    let width = if columns == 2 { 660.0 } else { (window.width() - 2.0 * (GAP + PAD)).clamp(60.0, 340.0) };
    let drawn = area.fade_in(false).sense(Sense::click()).show(ctx, |ui| {
        let colors = Colors::here(ui);
        ui.set_max_height((window.height() - 2.0 * GAP).max(1.0));
        card(&colors).show(ui, |ui| {
            ui.set_width(width);
            ui.horizontal(|ui| {
                ui.heading("Keys and gestures");
                ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                    if icons::button(ui, Icon::Close, "Close (Esc)", true) {
                        actions.push(Action::Help(false));
                    }
                });
            });
            let height = (window.height() - 2.0 * (GAP + PAD) - 40.0).max(20.0);
            ScrollArea::vertical().max_height(height).show(ui, |ui| {
                if columns == 2 {
                    ui.columns_const(|[left, right]| {
                        GROUPS[..3].iter().for_each(|group| {
                            table(left, group.name, group.bindings.iter().map(|key| (key.keys, key.does)))
                        });
                        GROUPS[3..].iter().for_each(|group| {
                            table(right, group.name, group.bindings.iter().map(|key| (key.keys, key.does)))
                        });
                        table(right, "On the picture", GESTURES.into_iter());
                    });
                } else {
                    for group in &GROUPS {
                        table(ui, group.name, group.bindings.iter().map(|key| (key.keys, key.does)));
                    }
                    table(ui, "On the picture", GESTURES.into_iter());
                }
            });
        });
    });
    let clicked_outside = ctx.input(|input| {
        let at = input.pointer.interact_pos().filter(|_| input.pointer.primary_clicked());
        at.is_some_and(|at| !drawn.response.rect.contains(at))
    });
    if clicked_outside || ctx.input(|input| input.key_pressed(Key::Enter)) {
        actions.push(Action::Help(false));
    }
}

/// A titled table of keys or gestures and what they do.
fn table<'a>(ui: &mut Ui, name: &str, rows: impl Iterator<Item = (&'a str, &'a str)>) {
    let colors = Colors::here(ui);
    ui.spacing_mut().interact_size.y = 17.0;
    ui.add_space(8.0);
    ui.label(RichText::new(name).family(medium()).color(colors.accent));
    Grid::new(name).num_columns(2).spacing(vec2(12.0, 4.0)).min_col_width(104.0).show(ui, |ui| {
        for (keys, does) in rows {
            ui.label(RichText::new(keys).family(medium()));
            ui.add(Label::new(RichText::new(does).color(colors.weak)).wrap());
            ui.end_row();
        }
    });
}
