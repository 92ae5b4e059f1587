//! The background plate: the offer to capture one, and instructions during the capture.

use egui::{ProgressBar, RichText};

use super::cards::{CardStack, add_paragraph};
use super::dock::picture_area;
use super::state::{Action, DepthMethod, State};
use super::theme::medium_font;
use super::widgets::add_button;
use crate::texts::tr;
use bokehcam::depth::plate::Step;

const WIDTH: f32 = 420.0;

/// Draws the offer of depth methods, if the source has no depth.
pub fn show_offer(stack: &mut CardStack, state: &State, actions: &mut Vec<Action>) {
    if !state.offers_depth_methods() || state.controls_hidden {
        return;
    }
    let by_network = Action::SetDepthMethod(DepthMethod::Person);
    let network = ("Find me with a small network", "It separates a person from the background", by_network);
    let plate =
        ("Show me the empty room", "Step out for four seconds; the camera must not move (T)", Action::CapturePlate);
    let plate = Some(plate).filter(|_| state.can_capture_plate());
    let buttons = [network].into_iter().chain(plate).chain([("Not now", "Esc", Action::DeclineDepthOffer)]);
    let why = match state.depth_methods().contains(&DepthMethod::Person) {
        // Omits the explanation if it would cover a small picture.
        _ if picture_area(stack.ctx).height() < 360.0 => "",
        true => "Nothing is known about depth here, so everything is blurred.",
        false => {
            "Nothing is known about depth here, so everything is blurred. The network is not installed yet: run `bokehcam \
             models get` in a terminal, then press the button."
        }
    };
    stack.add_buttons("plate offer", WIDTH, ["A portrait from this picture alone", why], buttons, actions);
}

/// Draws the instructions for the current step of the capture.
pub fn show(stack: &mut CardStack, state: &State, actions: &mut Vec<Action>) {
    let Some(step) = state.plate.filter(|step| *step != Step::Ready) else { return };
    let (title, why) = match step {
        Step::StepOut(_) => ("Step out of the picture", ""),
        Step::Capturing(_) => ("Stay out", "The room behind you is being recorded."),
        Step::Moving => ("Something moves", "Stay out of the picture, and do not move the camera."),
        Step::KeepsMoving => {
            ("No plate so far", "Something keeps moving: put the camera on something firm, and step out.")
        }
        Step::PersonThere => {
            ("Somebody seems to be there", "Step out of the picture. If nobody is there, take it anyway.")
        }
        // `Step::Mismatched`: the plate does not match the picture.
        _ => (
            "Another picture",
            "The camera was moved, or the light has changed: you cannot be separated from the background, so \
             everything is blurred.",
        ),
    };
    stack.add_card("plate", WIDTH, |ui, colors| {
        ui.label(RichText::new(tr(title)).family(medium_font()).size(22.0));
        match step {
            Step::StepOut(seconds) => {
                ui.label(RichText::new(seconds.to_string()).family(medium_font()).size(40.0));
            }
            Step::Capturing(percent) => {
                ui.add(ProgressBar::new(percent as f32 / 100.0).desired_width(ui.available_width().min(WIDTH / 2.0)));
            }
            _ => {}
        }
        add_paragraph(ui, colors, why);
        if step == Step::Mismatched && add_button(ui, "Take another plate", "T") {
            actions.push(Action::CapturePlate);
        }
        let hint = "What stands there becomes part of the room";
        if step == Step::PersonThere && add_button(ui, "Take it anyway", hint) {
            actions.push(Action::CapturePlateAnyway);
        }
        if let Some(depth_method) = state.method_without_plate().filter(|_| add_button(ui, "Find me without it", "Esc"))
        {
            actions.push(Action::SetDepthMethod(depth_method));
        }
    });
}
