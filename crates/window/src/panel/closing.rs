//! The dialog that confirms closing the window while a recording or the virtual camera is active.

use egui::{Checkbox, Context, Id, Modal};

use super::cards::{add_paragraph, add_title};
use super::state::{Action, State};
use super::theme::{Colors, GAP, PAD, card_frame};
use super::widgets::{Tooltip, add_button};
use crate::texts::tr;

/// Warns that closing stops the virtual camera.
const CALL_WARNING: &str = "A call that uses this camera gets no more pictures.";

/// Draws the modal dialog, with the initial focus on the safe choice. The key bindings handle Esc.
pub fn show(ctx: &Context, state: &State, actions: &mut Vec<Action>) {
    let checkbox_id = Id::unique("closing never asks");
    if !state.closing {
        ctx.data_mut(|data| data.remove::<bool>(checkbox_id));
        return;
    }
    let colors = Colors::for_theme(ctx.theme());
    let modal = Modal::new(Id::unique("closing")).frame(card_frame(&colors)).show(ctx, |ui| {
        ui.set_max_width((ctx.content_rect().width() - 2.0 * (GAP + PAD)).clamp(60.0, 340.0));
        let is_recording = state.recording().is_some();
        add_title(
            ui,
            if is_recording { "Stop recording and close?" } else { "Take the picture out of calls and close?" },
        );
        add_paragraph(ui, &colors, if is_recording { "The video so far is saved." } else { CALL_WARNING });
        if is_recording && state.virtual_camera().is_some() {
            add_paragraph(ui, &colors, CALL_WARNING);
        }
        let mut never_ask = ctx.data(|data| data.get_temp(checkbox_id)).unwrap_or(false);
        ui.add_space(2.0);
        ui.horizontal_wrapped(|ui| {
            let stay = ui.button(tr(if is_recording { "Keep recording" } else { "Stay" })).tooltip("Esc");
            if ctx.memory(|memory| memory.focused().is_none()) {
                stay.request_focus();
            }
            if stay.clicked() {
                actions.push(Action::CancelClose);
            }
            if add_button(ui, if is_recording { "Stop and close" } else { "Close" }, "") {
                // "Do not ask again" takes effect only on closing, not on cancelling.
                actions.extend([Action::AskBeforeClosing(!never_ask), Action::Close]);
            }
        });
        if ui.add(Checkbox::new(&mut never_ask, tr("Do not ask again"))).changed() {
            ctx.data_mut(|data| data.insert_temp(checkbox_id, never_ask));
        }
    });
    if modal.backdrop_response.clicked() {
        actions.push(Action::CancelClose);
    }
}
