//! The question whether the window shall close while something is recorded, or calls may have the picture.

use egui::{Checkbox, Context, Id, Modal};

use super::cards::{title, words};
use super::parts::{Hinted, button};
use super::state::{Action, State};
use super::theme::{Colors, GAP, PAD, card};
use crate::texts::tr;

/// What becomes of calls.
const CALLS: &str = "A call that uses this camera gets no more pictures.";

/// Draws it over everything, with the focus on what loses nothing. Esc and the keys that close are among the keys.
pub fn show(ctx: &Context, state: &State, actions: &mut Vec<Action>) {
    let ticked = Id::unique("closing never asks");
    if !state.closing {
        ctx.data_mut(|data| data.remove::<bool>(ticked));
        return;
    }
    let colors = Colors::of(ctx.theme());
    let asked = Modal::new(Id::unique("closing")).frame(card(&colors)).show(ctx, |ui| {
        ui.set_max_width((ctx.content_rect().width() - 2.0 * (GAP + PAD)).clamp(60.0, 340.0));
        let is_recording = state.recording().is_some();
        title(ui, if is_recording { "Stop recording and close?" } else { "Take the picture out of calls and close?" });
        words(ui, &colors, if is_recording { "The video so far is saved." } else { CALLS });
        if is_recording && state.virtual_camera().is_some() {
            words(ui, &colors, CALLS);
        }
        let mut never = ctx.data(|data| data.get_temp(ticked)).unwrap_or(false);
        ui.add_space(2.0);
        ui.horizontal_wrapped(|ui| {
            let keep = ui.button(tr(if is_recording { "Keep recording" } else { "Stay" })).hint("Esc");
            if ctx.memory(|memory| memory.focused().is_none()) {
                keep.request_focus();
            }
            if keep.clicked() {
                actions.push(Action::StayOpen);
            }
            if button(ui, if is_recording { "Stop and close" } else { "Close" }, "Q again") {
                // Only who closes has decided.
                actions.extend([Action::AskBeforeClosing(!never), Action::Close]);
            }
        });
        if ui.add(Checkbox::new(&mut never, tr("Do not ask again"))).changed() {
            ctx.data_mut(|data| data.insert_temp(ticked, never));
        }
    });
    if asked.backdrop_response.clicked() {
        actions.push(Action::StayOpen);
    }
}
