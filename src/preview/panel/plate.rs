//! The plate: the offer to take one, and what to do while it is taken.

use egui::{Align2, Area, Context, Id, Label, Order, ProgressBar, RichText, Ui, vec2};

use super::state::{Action, State};
use super::theme::{Colors, GAP, card, medium};
use crate::depth::plate::Step;
use crate::preview::texts::tr;

const WIDTH: f32 = 420.0;

/// Draws the offer to take a plate, `bottom` points above the window's edge, where that is the way to a portrait. Its
/// height.
pub fn offer(ctx: &Context, state: &State, bottom: f32, actions: &mut Vec<Action>) -> f32 {
    if !state.takes_plates()[1] || state.declined_plate || state.plate.is_some() || state.bare {
        return 0.0;
    }
    let area = Area::new(Id::unique("plate offer")).anchor(Align2::CENTER_BOTTOM, vec2(0.0, -bottom));
    let drawn = area.order(Order::Middle).fade_in(false).show(ctx, |ui| {
        framed(ui, |ui, colors| {
            ui.label(RichText::new(tr("A portrait from this camera alone")).family(medium()).size(16.0));
            let text = "Step out of the picture for four seconds: what is behind you is then known, and blurred. The camera has \
                        to stand still.";
            ui.add(Label::new(RichText::new(tr(text)).color(colors.text)).wrap());
            ui.add_space(2.0);
            ui.horizontal(|ui| {
                if ui.button(tr("Take a plate")).on_hover_text("T").clicked() {
                    actions.push(Action::TakePlate);
                }
                if ui.button(tr("Not now")).clicked() {
                    actions.push(Action::DeclinePlate);
                }
            });
        });
    });
    drawn.response.rect.height() + 6.0
}

/// Draws, in the middle of the window, what the person has to do for the plate now.
pub fn show(ctx: &Context, state: &State, actions: &mut Vec<Action>) {
    let Some(step) = state.plate.filter(|step| *step != Step::Ready) else { return };
    let (title, why) = match step {
        Step::StepOut(_) => ("Step out of the picture", ""),
        Step::Taking(_) => ("Stay out", "What is behind you is being learned."),
        Step::Moves => ("Something moves", "Stay out of the picture, and let the camera stand still."),
        Step::Restless => {
            ("No plate so far", "Something keeps moving: let the camera stand on something firm, and step out.")
        }
        _ => (
            "Another picture",
            "The camera was moved, or the light has changed: nobody can be told from what is behind, so all is blurred.",
        ),
    };
    let area = Area::new(Id::unique("plate")).anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0)).order(Order::Foreground);
    area.fade_in(false).show(ctx, |ui| {
        framed(ui, |ui, colors| {
            ui.vertical_centered(|ui| {
                ui.label(RichText::new(tr(title)).family(medium()).size(22.0));
                match step {
                    Step::StepOut(seconds) => {
                        ui.label(RichText::new(seconds.to_string()).family(medium()).size(72.0));
                    }
                    Step::Taking(percent) => {
                        ui.add(ProgressBar::new(percent as f32 / 100.0).desired_width(WIDTH / 2.0));
                    }
                    _ => {}
                }
                if !why.is_empty() {
                    ui.add(Label::new(RichText::new(tr(why)).color(colors.text)).wrap());
                }
                if step == Step::Unlike && ui.button(tr("Take another plate")).on_hover_text("T").clicked() {
                    actions.push(Action::TakePlate);
                }
            });
        });
    });
}

/// A card no wider than the window.
pub fn framed(ui: &mut Ui, content: impl FnOnce(&mut Ui, &Colors)) {
    let colors = Colors::here(ui);
    ui.set_max_width((ui.ctx().content_rect().width() - 2.0 * GAP).clamp(60.0, WIDTH));
    card(&colors).inner_margin(egui::Margin::symmetric(18, 14)).show(ui, |ui| content(ui, &colors));
}
