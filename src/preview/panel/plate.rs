//! The plate: the offer to take one, and what to do while it is taken.

use egui::{Context, ProgressBar, RichText};

use super::cards::{self, Stack, words};
use super::parts::button;
use super::state::{Action, State};
use super::theme::medium;
use crate::depth::plate::Step;
use crate::preview::texts::tr;

const WIDTH: f32 = 420.0;

/// Draws the offer to take a plate, where that is the way to a portrait.
pub fn offer(stack: &mut Stack, state: &State, actions: &mut Vec<Action>) {
    if !state.takes_plates()[1] || state.declined_plate || state.plate.is_some() || state.bare {
        return;
    }
    let text = "Step out of the picture for four seconds: what is behind you is then known, and blurred. The camera has to \
                stand still.";
    let buttons = [("Take a plate", "T", Action::TakePlate), ("Not now", "", Action::DeclinePlate)];
    stack.ask("plate offer", WIDTH, ["A portrait from this camera alone", text], buttons, actions);
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
    cards::in_middle(ctx, "plate", WIDTH, |ui, colors| {
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
            words(ui, colors, why);
            if step == Step::Unlike && button(ui, "Take another plate", "T") {
                actions.push(Action::TakePlate);
            }
        });
    });
}
