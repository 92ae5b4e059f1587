//! The dialog that confirms closing the window while a recording or the virtual camera is active.

use egui::{Checkbox, Context, Id, Modal};

use super::cards::{paragraph, title};
use super::parts::{Hinted, button};
use super::state::{Action, State};
use super::theme::{Colors, GAP, PAD, card};
use crate::texts::tr;

/// Warns that closing stops the virtual camera.
const CALLS: &str = "A call that uses this camera gets no more pictures.";

/// Draws the modal dialog, with the initial focus on the safe choice. The key bindings handle Esc and the closing keys.
pub fn show(ctx: &Context, state: &State, actions: &mut Vec<Action>) {
    let checkbox_id = Id::unique("closing never asks");
    if !state.closing {
        ctx.data_mut(|data| data.remove::<bool>(checkbox_id));
        return;
    }
    let colors = Colors::of(ctx.theme());
    let modal = Modal::new(Id::unique("closing")).frame(card(&colors)).show(ctx, |ui| {
        ui.set_max_width((ctx.content_rect().width() - 2.0 * (GAP + PAD)).clamp(60.0, 340.0));
        let is_recording = state.recording().is_some();
        title(ui, if is_recording { "Stop recording and close?" } else { "Take the picture out of calls and close?" });
        paragraph(ui, &colors, if is_recording { "The video so far is saved." } else { CALLS });
        if is_recording && state.virtual_camera().is_some() {
            paragraph(ui, &colors, CALLS);
        }
        let mut never_ask = ctx.data(|data| data.get_temp(checkbox_id)).unwrap_or(false);
        ui.add_space(2.0);
        ui.horizontal_wrapped(|ui| {
            let stay = ui.button(tr(if is_recording { "Keep recording" } else { "Stay" })).hint("Esc");
            if ctx.memory(|memory| memory.focused().is_none()) {
                stay.request_focus();
            }
            if stay.clicked() {
                actions.push(Action::StayOpen);
            }
            if button(ui, if is_recording { "Stop and close" } else { "Close" }, "Q again") {
                // "Do not ask again" takes effect only on closing, not on cancelling.
                actions.extend([Action::AskBeforeClosing(!never_ask), Action::Close]);
            }
        });
        if ui.add(Checkbox::new(&mut never_ask, tr("Do not ask again"))).changed() {
            ctx.data_mut(|data| data.insert_temp(checkbox_id, never_ask));
        }
    });
    if modal.backdrop_response.clicked() {
        actions.push(Action::StayOpen);
    }
}
